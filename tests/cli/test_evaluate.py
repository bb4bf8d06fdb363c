"""`kpred evaluate scans` and `real`: what they print, write and refuse; and the old spelling of `shapes`."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from PIL import Image

from kpred.cli.main import FAILED, OK, USAGE, main
from kpred.shapes.pack import MeshPack
from kpred.synthetic.generator import generate

Run = Callable[..., Any]


@pytest.fixture(scope="module")
def pack(tmp_path_factory: pytest.TempPathFactory) -> Path:
    file = tmp_path_factory.mktemp("packs") / "table.npz"
    tables = generate("table", 6, seed=4, splits=False)
    MeshPack.from_meshes(list(tables), list(tables.model_id), ["source"] * 4 + ["val"] * 2, "table").save(file)
    return file


@pytest.fixture(scope="module")
def crops(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("crops")
    mesh = generate("table", 9, seed=2)[8]
    solid = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
    trimesh.PointCloud(trimesh.sample.sample_surface(solid, 700, seed=0)[0]).export(folder / "table_00.ply")
    trimesh.PointCloud(np.eye(3)).export(folder / "table_01.ply")
    return folder


def test_scans_prints_what_it_writes(
    files: Path, pack: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = ["-o", str(tmp_path / "rows.json"), "--picture", str(tmp_path / "sheet.png"), "--worst", "1"]
    line = ["evaluate", "scans", str(pack), "--model", str(files / "model"), "--top-k", "2", *out]
    assert main([*line, "--json"]) == OK
    printed = capsys.readouterr()
    report = json.loads(printed.out)
    assert report == json.loads((tmp_path / "rows.json").read_text())
    assert {row["n"] for row in report["rows"] if row["metric"] == "right"} == {2}
    assert len(report["targets"]) == 2
    assert report["confusion"] == {"table": {"table": 2}}
    ratio = next(row for row in report["rows"] if row["metric"] == "ucd_whole_ratio")
    assert f"{ratio['value']:.2f} {ratio['low']:.2f}–{ratio['high']:.2f}" in printed.err
    assert "confidence of 2 results" in printed.err
    assert f"wrote {tmp_path / 'sheet.png'}" in printed.err
    assert Image.open(tmp_path / "sheet.png").size[0] > 500


def test_real_prints_what_it_writes(
    files: Path, crops: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = ["-o", str(tmp_path / "rows.json"), "--picture", str(tmp_path / "sheet.png")]
    using = ["--model", str(files / "model"), "--database", str(files / "tables.kpred"), "--top-k", "2"]
    assert main(["evaluate", "real", "--crops", str(crops), *using, *out, "--json"]) == OK
    printed = capsys.readouterr()
    report = json.loads(printed.out)
    assert report == json.loads((tmp_path / "rows.json").read_text())
    assert [crop["file"] for crop in report["crops"]] == ["table_00.ply", "table_01.ply"]
    near = sum(crop["distance_kept"] is not None and crop["distance_kept"] < 0.04 for crop in report["crops"])
    assert f"{near} of 2 under 4 cm" in printed.err
    assert "1 of 2 of the right category" in printed.err
    assert "failed: table_01.ply" in printed.err
    crop, broken = report["crops"]
    assert f"facets tilt by {crop['cleanliness']['axis_tilt']:.2g} degrees" in printed.err
    assert (crop["up_right"], broken["cleanliness"]) == (None, None)
    tilt = {row["statistic"]: row["value"] for row in report["rows"] if row["metric"] == "axis_tilt"}
    assert tilt == {"mean": crop["cleanliness"]["axis_tilt"], "95th percentile": crop["cleanliness"]["axis_tilt"]}
    assert Image.open(tmp_path / "sheet.png").size[0] > 1000


def test_real_can_be_left_to_find_the_up_axis(files: Path, crops: Path, run_json: Run) -> None:
    using = ["--model", files / "model", "--database", files / "tables.kpred", "--top-k", 2]
    report = run_json("evaluate", "real", "--crops", crops, "--up", "auto", *using)
    assert report["header"]["up"] == "found by the fit"
    assert report["crops"][0]["up_right"] is True
    assert next(row["value"] for row in report["rows"] if row["metric"] == "up_axis_right") == 1.0
    # Told the wrong axis, a fit stands the table on its side.
    wrong = run_json("evaluate", "real", "--crops", crops, "--up", "x", *using)
    assert wrong["header"]["up"] == "given"
    assert wrong["crops"][0]["distance_kept"] != report["crops"][0]["distance_kept"]


def test_catalogue_prints_what_it_writes(
    files: Path, pack: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = ["-o", str(tmp_path / "rows.json"), "--picture", str(tmp_path / "sheet.png"), "--tiles", "2"]
    line = ["evaluate", "catalogue", str(pack), "--model", str(files / "model"), "--top-k", "2", "--limit", "2", *out]
    assert main([*line, "--views", "0", "--json"]) == OK
    printed = capsys.readouterr()
    report = json.loads(printed.out)
    assert report == json.loads((tmp_path / "rows.json").read_text())
    assert len(report["targets"]) == 2
    assert report["header"]["views"] == 0
    first = next(row for row in report["rows"] if row["metric"] == "right_model_first")
    assert f"{first['value']:.2f} {first['low']:.2f}–{first['high']:.2f}" in printed.err
    assert "scanned (whole surfaces)" in printed.err
    assert Image.open(tmp_path / "sheet.png").size[0] > 500


def test_the_old_spelling_means_shapes(files: Path, pack: Path, tmp_path: Path, run_json: Run) -> None:
    line = [pack, "--model", files / "model", "--top-k", 2, "--limit", 1, "--cache", tmp_path]
    short, full = (run_json("evaluate", *words, *line) for words in ((), ("shapes",)))
    for report in (short, full):
        assert report["header"].pop("seconds") >= 0
        assert report["header"].pop("processor_seconds")
        assert report["header"].pop("command").startswith("kpred evaluate ")
    assert short == full


@pytest.mark.parametrize(
    ("words", "code", "sentence"),
    [
        (["shaps", "{pack}"], USAGE, "did you mean `kpred evaluate shapes`?"),
        (["scans"], USAGE, "no pack was named"),
        (["scans", "{pack}", "--worst", "0"], USAGE, "--worst must be at least 1"),
        (["scans", "{pack}", "--limit", "-1"], FAILED, "limit of targets must be at least 1"),
        (["scans", "{pack}", "--picture", "sheet.jpg"], FAILED, "pictures are .png files"),
        (["scans", "{pack}", "--split", "nope"], FAILED, "no shape is in the split 'nope'"),
        (["scans", "none.npz"], FAILED, "none.npz: there is no such file"),
        (["catalogue", "{pack}", "--views", "-1"], FAILED, "number of views must be"),
        (["catalogue", "{pack}", "--tiles", "0"], USAGE, "--tiles must be at least 1"),
        (["catalogue", "{pack}", "--picture", "sheet.jpg"], FAILED, "pictures are .png files"),
        (["catalogue", "--database", "{new}/none.kpred"], FAILED, "none.kpred"),
        (["real"], USAGE, "no scans were named"),
        (["real", "--annotations", "a.json"], USAGE, "give --scene FOLDER too"),
        (["real", "--crops", "{new}"], FAILED, "no such folder with .ply files"),
        (["real", "--scene", "{new}"], FAILED, "full_annotations.json"),
        (["real", "--crops", "{crops}", "-o", "{new}/none/rows.json"], FAILED, "does not exist; make it first"),
    ],
)
def test_refusals(
    words: list[str],
    code: int,
    sentence: str,
    files: Path,
    pack: Path,
    crops: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    model = [] if words[0] == "shaps" else ["--model", str(files / "model")]
    if words[0] == "real":
        model += ["--database", str(files / "tables.kpred")]
    assert main(["evaluate", *(word.format(pack=pack, new=tmp_path, crops=crops) for word in words), *model]) == code
    printed = capsys.readouterr()
    assert sentence in printed.err
    assert "Traceback" not in printed.err
    assert printed.out == ""
    assert not list(tmp_path.iterdir())
