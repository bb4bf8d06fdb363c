"""`kpred refit`: the same mesh to the bit; what has changed is named, and nothing is written."""

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from kpred.cli.main import OK, main
from kpred.database import Database
from kpred.errors import RecordError
from kpred.fitting.refit import read_record


@pytest.fixture
def fitted(files: Path, tmp_path: Path) -> Path:
    """A folder of its own with scan, database, networks, and a fit of them: a.obj and a.json."""
    shutil.copytree(files, tmp_path, dirs_exist_ok=True)
    using = ["--model", tmp_path / "model", "--database", tmp_path / "tables.kpred", "--top-k", 2, "--no-picture"]
    more = ["--structure.contact", 0.5, "--sensor", 1300, 150, -300, "--unit", "cm"]
    line = ["fit", tmp_path / "scan.ply", "-o", tmp_path / "a.obj", *using, *more]
    assert main([str(word) for word in line]) == OK
    return tmp_path


def test_the_mesh_is_the_same_to_the_bit(fitted: Path) -> None:
    assert main(["refit", str(fitted / "a.json"), "--no-picture"]) == OK
    assert (fitted / "a_refit.obj").read_bytes() == (fitted / "a.obj").read_bytes()
    first, again = (json.loads((fitted / name).read_text()) for name in ("a.json", "a_refit.json"))
    assert again["mesh_sha256"] == first["mesh_sha256"]
    assert again["options"] == first["options"] and first["options"]["structure"]["contact"] == 0.5


def test_a_record_of_a_record_and_a_moved_folder_work(fitted: Path, tmp_path_factory: pytest.TempPathFactory) -> None:
    place = tmp_path_factory.mktemp("moved") / "here"
    shutil.move(fitted, place)
    line = ["refit", place / "a.json", "--model", place / "model", "--database", place / "tables.kpred"]
    assert main([str(word) for word in [*line, "-o", place / "b.obj", "--no-picture"]]) == OK
    assert main(["refit", str(place / "b.json"), "-o", str(place / "c.obj"), "--no-picture"]) == OK
    assert (place / "c.obj").read_bytes() == (place / "a.obj").read_bytes()


@pytest.mark.parametrize("what", ["scan", "weights", "database"])
def test_what_has_changed_is_named(fitted: Path, refusal: Callable[..., str], what: str) -> None:
    if what == "scan":
        with open(fitted / "scan.ply", "ab") as stream:
            stream.write(b"\n")
    elif what == "weights":
        calibration = {"features": ["error"], "weights": [1.0], "weights_without_odds": [], "made_from": {}}
        (fitted / "model" / "calibration.json").write_text(json.dumps(calibration))
    else:
        with Database.open(fitted / "tables.kpred") as database:
            database.remove(database.model_ids()[:1])
    before = sorted(file.name for file in fitted.iterdir())
    said = refusal("refit", fitted / "a.json")
    assert f"the {what} " in said and "changed since" in said
    assert sorted(file.name for file in fitted.iterdir()) == before


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("{", "no readable JSON"),
        ("[1]", "no record that can be repeated"),
        ('{"kpred": "0.1.0", "studio": 1}', "a session of kpred studio"),
        ('{"kpred": "0.0.1"}', "fit the scan again with this version"),
        ('{"kpred": "9.0", "record_version": 99}', "written by kpred 9.0"),
        ('{"record_version": 1}', "the scan is missing"),
        ('{"record_version": 1, "input": {"path": null}}', "came from no file"),
    ],
)
def test_other_files_are_refused_in_one_sentence(tmp_path: Path, content: str, said: str) -> None:
    (tmp_path / "a.json").write_text(content)
    with pytest.raises(RecordError, match=said):
        read_record(tmp_path / "a.json")


@pytest.mark.parametrize("damage", [{"options": {}}, {"options": None}, {"weights": 3}, {"mesh_sha256": "0" * 64}])
def test_a_damaged_record_is_refused(fitted: Path, refusal: Callable[..., str], damage: dict[str, Any]) -> None:
    content = json.loads((fitted / "a.json").read_text())
    (fitted / "a.json").write_text(json.dumps(content | damage))
    said = refusal("refit", fitted / "a.json")
    assert "damaged" in said or "differs from the record's" in said
    assert not (fitted / "a_refit.obj").exists()
