"""`kpred evaluate table ...`, `compare` and `plot`: what they print, write and refuse."""

import csv
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from PIL import Image

from kpred.cli.main import FAILED, OK, USAGE, main
from kpred.shapes.pack import MeshPack
from kpred.synthetic.generator import generate

Run = Callable[..., Any]


@pytest.fixture(scope="module")
def pack(tmp_path_factory: pytest.TempPathFactory) -> Path:
    file = tmp_path_factory.mktemp("packs") / "table.npz"
    tables = generate("table", 6, seed=4, splits=False)
    splits = ["source"] * 2 + ["train"] * 2 + ["val"] * 2
    MeshPack.from_meshes(list(tables), list(tables.model_id), splits, "table").save(file)
    return file


@pytest.fixture(scope="module")
def made(files: Path, pack: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A table of two models that are the same, and one of partial shapes."""
    folder = tmp_path_factory.mktemp("made")
    models = ["--model", f"one={files / 'model'}", "--model", f"two={files / 'model'}"]
    cache = ["--cache", str(folder / "cache"), "--top-k", "2"]
    assert main(["evaluate", "table", "full", str(pack), *models, *cache, "-o", str(folder / "full.json")]) == OK
    line = ["--occlusions", "0", "0.5", "--model", f"one={files / 'model'}", "-o", str(folder / "partial.json")]
    assert main(["evaluate", "table", "partial", str(pack), *cache, *line]) == OK
    return folder


def test_generalization_measures_packs_and_databases(
    files: Path, pack: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["evaluate", "table", "generalization", "--model", str(files / "model"), "--top-k", "1", "--split", "train"]
    four = tmp_path / "four.npz"
    tables = MeshPack.load(pack)
    splits = ["train", "source", "source", "source", "source", "source"]
    MeshPack.from_meshes(list(tables), list(tables.model_id), splits, "table").save(four)
    assert main([*words, str(four), "-o", str(tmp_path / "general.json")]) == OK
    printed = capsys.readouterr().out
    assert "retrieved" in printed and "random" in printed and "wrote" in printed
    assert main([*words, str(tmp_path / "no.kpred")]) == FAILED
    assert "no.kpred" in capsys.readouterr().err


def test_full_prints_what_it_writes(
    files: Path, pack: Path, made: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "again.json"
    words = ["evaluate", "table", "full", str(pack), "--model", f"one={files / 'model'}", "--top-k", "2"]
    assert main([*words, "--cache", str(made / "cache"), "-o", str(out), "--json"]) == OK
    printed = capsys.readouterr()
    report = json.loads(printed.out)
    assert report == json.loads(out.read_text())
    assert report["header"]["command"].startswith("kpred evaluate table full ")
    assert report["header"]["seconds"] >= 0
    row = next(row for row in report["rows"] if row["method"] == "structure")
    assert (row["model"], row["n"], row["category"]) == ("one", 2, "table")
    assert f"{row['value']:.5f} ({row['low']:.5f}–{row['high']:.5f})" in printed.err
    for name in ("again.json", "again.csv", "again.targets.csv"):
        assert f"wrote {tmp_path / name}" in printed.err
    with open(tmp_path / "again.csv", newline="") as stream:
        assert [float(line["value"]) for line in csv.DictReader(stream)] == [r["value"] for r in report["rows"]]
    # Of two models in one table the first has the same values as alone.
    both = json.loads((made / "full.json").read_text())
    alone = {(one["method"], one["metric"]): one["values"] for one in report["series"]}
    for one in both["series"]:
        assert one["values"] == pytest.approx(alone[one["method"], one["metric"]], rel=1e-6, abs=1e-9)


def test_shapes_prints_ratios_beside_a_table_of_any_protocol(
    files: Path, pack: Path, made: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    line = ["evaluate", str(pack), "--top-k", "1", "2", "--protocol", "all", "--limit", "1", "--json"]
    line += ["--occlusions", "0.5", "--model", str(files / "model"), "--cache", str(made / "cache")]
    assert main([*line, "-o", str(tmp_path / "rows.json")]) == OK
    printed = capsys.readouterr()
    report = json.loads(printed.out)
    assert report == json.loads((tmp_path / "rows.json").read_text())
    errors = {
        (row["method"], row["top_k"]): row["value"]
        for row in report["rows"]
        if (row["protocol"], row["metric"], row["surface"]) == ("full", "chamfer_distance", "seen")
    }
    shown = next(line for line in printed.err.splitlines() if "refined" in line and " CD " in line and " 2 " in line)
    for ratio in (
        errors["refined", 2] / errors["undeformed_nearest", None],
        errors["refined", 2] / errors["no_learning", 2],
    ):
        assert f"{ratio:.4g}" in shown
    assert {row["occlusion"] for row in report["rows"] if row["protocol"] == "partial"} == {0.5}
    assert "1 targets against 2 models" in printed.err


def test_cleanliness_stands_beside_the_errors(
    files: Path, pack: Path, made: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    using = ["--model", f"one={files / 'model'}", "--cache", str(made / "cache"), "--top-k", "2"]
    assert main(["evaluate", "table", "full", str(pack), *using, "--json"]) == OK
    printed = capsys.readouterr()
    report = json.loads(printed.out)
    rows = {(row["method"], row["metric"]): row for row in report["rows"]}
    bent = rows["refined", "squareness"]
    assert (bent["unit"], bent["n"]) == ("degrees", 2)
    assert bent["percentile_95"] >= bent["value"] > 0
    assert rows["undeformed_retrieved", "squareness"]["value"] == pytest.approx(0, abs=1e-6)
    assert "cleanliness, mean over the targets" in printed.err
    assert "cleanliness, 95th percentile over the targets" in printed.err
    assert f"{bent['value']:.4g}" in printed.err
    hint = rows["structure_without_hint", "chamfer_distance"]["value"] / rows["structure", "chamfer_distance"]["value"]
    line = next(line for line in printed.err.split("with it")[1].splitlines() if line.strip().startswith("one"))
    assert f"{hint:.2f}" in line


def test_topk_and_oracle_have_a_column_for_each_number(
    files: Path, pack: Path, made: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    using = ["--model", f"one={files / 'model'}", "--cache", str(made / "cache"), "--top-k", "1", "2"]
    assert main(["evaluate", "table", "topk", str(pack), *using]) == OK
    assert "top 1" in (printed := capsys.readouterr().out)
    assert "top 2" in printed
    assert main(["evaluate", "table", "oracle", str(pack), *using, "--limit", "1"]) == OK
    printed = capsys.readouterr().out
    assert "spearman" in printed
    assert "undeformed distance" in printed
    assert "true best" in printed


def test_compare_pairs_the_targets(made: Path, run_json: Run, capsys: pytest.CaptureFixture[str]) -> None:
    full = made / "full.json"
    report = run_json("evaluate", "compare", full, full, "--a", "one", "--b", "two")
    errors = [row for row in report["rows"] if row["unit"] == "unit box squared"]
    assert {(row["ratio"], row["p_value"], row["n"]) for row in errors} == {(1.0, 1.0, 2)}
    # Cleanliness is compared as well; nothing over nothing has no ratio.
    clean = [row for row in report["rows"] if row["unit"] != "unit box squared"]
    assert {row["ratio"] for row in clean} == {1.0, None}
    assert all(row["first"] == row["second"] for row in clean)
    assert main(["evaluate", "compare", str(full), str(made / "partial.json"), "--a", "one"]) == FAILED
    assert "different kinds of tables (full and partial)" in capsys.readouterr().err


def test_ablation_trains_keeps_and_prints(pack: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    line = ["evaluate", "table", "ablation", str(pack), "--runs", str(tmp_path / "runs"), "--steps", "1"]
    line += ["--preset", "kp-red-plus", "--top-k", "2", "--device", "cpu"]
    assert main([*line, "--rows", "f"]) == OK
    assert "LGF" in capsys.readouterr().out
    assert main([*line, "--finished", "--json"]) == OK
    again = capsys.readouterr()
    report = json.loads(again.out)
    assert {one["model"] for one in report["series"]} == {"f"}
    assert report["header"]["training"]["deformation"]["steps"] == 1
    assert "row a: it is not trained to the end" in again.err
    assert main([*line[:6], "--runs", str(tmp_path / "runs"), "--steps", "2", "--preset", "kp-red-plus"]) == FAILED
    assert "was trained by other settings or data" in capsys.readouterr().err
    taken = [*line[:6], "--preset", "kp-red-plus", "--top-k", "2", "--device", "cpu", "--as-trained"]
    assert main([*taken, "--finished"]) == FAILED
    assert "rows a and f were trained differently" in capsys.readouterr().err
    assert main([*taken, "--finished", "--rows", "f", "--json"]) == OK
    assert json.loads(capsys.readouterr().out)["header"]["training"] == report["header"]["training"]
    assert main([*taken, "--steps", "1"]) == USAGE
    assert "leave out --steps" in capsys.readouterr().err


def test_plots_are_written(made: Path, files: Path, pack: Path, tmp_path: Path) -> None:
    using = ["--database", str(files / "tables.kpred"), "--category", "table"]
    lines = {
        "occlusion.png": ["occlusion", str(made / "partial.json")],
        "tokens.png": ["tokens", *using, "--pictures", "2"],
        "keypoints.pdf": ["keypoints", *using, "--count", "2"],
        "influence.png": ["influence", *using, "--model", str(files / "model"), "--keypoints", "1", "--count", "1"],
        "grid.png": ["grid", str(pack), "--count", "1", "--top-k", "2", "--model", str(files / "model")],
    }
    for name, words in lines.items():
        assert main(["plot", *words, "-o", str(tmp_path / name)]) == OK
        if name.endswith(".png"):
            assert Image.open(tmp_path / name).size[0] > 200
    assert {file.name for file in tmp_path.iterdir()} == set(lines)


@pytest.mark.parametrize(
    ("words", "code", "sentence"),
    [
        ("evaluate table", USAGE, "topk"),
        ("evaluate table fulll {pack}", USAGE, "did you mean `kpred evaluate table full`?"),
        ("evaluate table full", USAGE, "no pack was named"),
        ("evaluate shapes", USAGE, "no pack was named"),
        ("evaluate a.npz --top-k many", USAGE, "--top-k"),
        ("evaluate {pack} --top-k 0", FAILED, "top_k must be at least 1"),
        ("evaluate {new}/missing.npz", FAILED, "missing.npz"),
        ("evaluate table full {pack} -o {new}/rows.txt", FAILED, "tables are .json"),
        ("evaluate table full {pack} -o {new}/none/rows.json", FAILED, "does not exist; make it first"),
        ("evaluate table full {pack} --model a=x --model a=y", USAGE, "names a twice"),
        ("evaluate table full {pack} --model =x", USAGE, "must be NAME=PATH"),
        ("evaluate table full {pack} --model a={new}/none", FAILED, "no model folder"),
        ("evaluate table full {pack} --database b=x", USAGE, "names the model b"),
        ("evaluate table full {new}/none.npz", FAILED, "there is no such file"),
        ("evaluate table full {pack} --split nope", FAILED, "no shape is in the split 'nope'"),
        ("evaluate table full {pack} --targets {new}/none.csv", FAILED, "cannot be read"),
        ("evaluate table full {pack} --peer a", USAGE, "--peer must be NAME=PATH"),
        ("evaluate table partial {pack} --occlusions 1.0", FAILED, "Occlusions must be fractions"),
        ("evaluate table topk {pack} --top-k 0", FAILED, "top_k must be at least 1"),
        ("evaluate table scan2cad {new}", FAILED, "full_annotations.json"),
        ("evaluate table ablation {pack} --rows a z", FAILED, "no row z"),
        ("evaluate table ablation {pack} --finished --runs {new}/none", FAILED, "no finished row"),
        ("evaluate compare {new}/a.json {new}/b.json", FAILED, "a.json: it cannot be read"),
        ("plot", USAGE, "occlusion"),
        ("plot occlusion -o {new}/a.png", USAGE, "no table was named"),
        ("plot tokens -o {new}/a.gif", FAILED, ".png or .pdf"),
        ("plot grid {pack} --occlusion 1 -o {new}/a.png", USAGE, "--occlusion must be a fraction"),
        ("plot influence --keypoints 12 -o {new}/a.png", FAILED, "numbered 0 to 11"),
    ],
)
def test_refusals(
    words: str, code: int, sentence: str, pack: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main([word.format(pack=pack, new=tmp_path) for word in words.split()]) == code
    printed = capsys.readouterr()
    assert sentence in printed.err
    assert "Traceback" not in printed.err
    assert printed.out == ""
    assert not list(tmp_path.iterdir())
