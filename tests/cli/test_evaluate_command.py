"""`kpred evaluate`: what it prints, writes and refuses."""

import json
from pathlib import Path

import pytest

from kpred.cli.main import FAILED, OK, USAGE, main


def test_json_file_and_tables_say_the_same(
    packs: dict[str, Path], model_folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "rows.json"
    line = ["evaluate", str(packs["chair"]), "--top-k", "1", "3", "--protocol", "all", "--limit", "1"]
    assert main([*line, "--model", str(model_folder), "-o", str(file), "--json"]) == OK
    printed = capsys.readouterr()
    value = json.loads(printed.out)
    assert value == json.loads(file.read_text())
    assert value["header"]["top_k"] == [1, 3]
    assert value["header"]["versions"]["kpred"]
    rows = value["rows"]
    assert {(row["dataset"], row["category"], row["split"]) for row in rows} == {("generated", "chair", "val")}
    assert {row["unit"] for row in rows if "chamfer" in row["distance"]} == {"unit box squared"}
    assert {row["unit"] for row in rows if row["distance"] == "squareness"} == {"degrees"}
    assert {row["frame"] for row in rows} == {"known unit box"}
    assert {row["occlusion"] for row in rows if row["protocol"] == "partial"} == {0.0, 0.25, 0.5, 0.75}
    refined = next(r for r in rows if (r["protocol"], r["metric"], r["top_k"]) == ("full", "refined", 3))
    assert f"{refined['value']:.4g}" in printed.err
    assert f"{refined['ratio_to_undeformed']:.4g}" in printed.err
    assert "10^2" in printed.err


@pytest.mark.parametrize(
    ("words", "code", "sentence"),
    [
        ([], USAGE, "no pack was named"),
        (["a.npz", "--top-k", "many"], USAGE, "--top-k"),
        (["a.npz", "--top-k", "0"], FAILED, "top_k must be at least 1"),
        (["missing.npz"], FAILED, "missing.npz"),
        (["a.npz", "-o", "no/such/folder/rows.json"], FAILED, "does not exist; make it first"),
    ],
)
def test_wrong_use_is_one_sentence(
    words: list[str], code: int, sentence: str, model_folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["evaluate", *words, "--model", str(model_folder)]) == code
    printed = capsys.readouterr()
    assert sentence in printed.err
    assert "Traceback" not in printed.err
    assert printed.out == ""
