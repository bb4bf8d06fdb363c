"""Results of small batches lie as their scans do; large ones, and those begun by earlier versions, in hashes."""

import json
from pathlib import Path

import pytest

from kpred.batch.journal import Journal
from kpred.batch.layout import lay_out, name_places
from kpred.batch.task import Task, other_files, read_tasks
from kpred.errors import ManifestError


def tasks(*names: str) -> list[Task]:
    return [Task(name, f"/scans/{name}") for name in names]


def test_places_are_readable_and_all_different() -> None:
    places = name_places(
        ["a.ply", "deep/a.ply", "b.ply", "B.xyz", "job.ply", "../x.ply", "/abs/y.ply", "ü?.ply", "c 1.2.ply"]
    )
    assert places["a.ply"] == "a" and places["deep/a.ply"] == "deep/a" and places["c 1.2.ply"] == "c 1.2"
    assert places["b.ply"].startswith("b-") and places["B.xyz"].startswith("B-")
    assert places["job.ply"].startswith("job-")
    assert len({place.lower() for place in places.values()}) == len(places)
    assert all(not place.startswith(("/", ".")) and ".." not in place.split("/") for place in places.values())


def test_a_small_batch_lies_as_its_scans_do_and_a_large_one_in_hashes(tmp_path: Path) -> None:
    found, placed = lay_out(iter(tasks("a.ply", "b.ply")), tmp_path / "out", tmp_path)
    assert [task.stem for task in placed] == ["a", "b"] and found.job == {"layout": "names"}
    found, placed = lay_out(iter(tasks("a.ply", "b.ply")), tmp_path / "out", tmp_path, small=1)
    assert found.places is None and found.job == {}
    assert [task.stem[2] for task in placed] == ["/", "/"]


@pytest.mark.parametrize("begun", [{}, {"layout": "names"}])
def test_a_batch_goes_on_in_the_layout_in_which_it_began(tmp_path: Path, begun: dict[str, str]) -> None:
    (tmp_path / "job.json").write_text(json.dumps(begun))
    small = 1 if begun else 1000
    found, placed = lay_out(iter(tasks("a.ply", "b.ply")), tmp_path, tmp_path / "scans", small)
    assert found.job == begun
    assert (next(placed).stem == "a") == bool(begun)


def test_results_do_not_lie_among_the_scans(tmp_path: Path) -> None:
    with pytest.raises(ManifestError, match=r"would lie among the scans; give another folder, as .*fitted"):
        lay_out(iter(tasks("a.ply")), tmp_path, tmp_path)


def test_results_of_batches_and_of_fits_are_no_scans(tmp_path: Path) -> None:
    (tmp_path / "chair.ply").write_text("scan")
    with Journal(tmp_path / "out", {}, {"chair.ply": "chair"}):
        (tmp_path / "out" / "chair.ply").write_text("mesh")
    (tmp_path / "chair_fitted.obj").write_text("mesh")
    (tmp_path / "chair_fitted.png").write_text("picture")
    (tmp_path / "chair_fitted.json").write_text(json.dumps({"kpred": "1", "mesh": "here/chair_fitted.obj"}))
    (tmp_path / "table.obj").write_text("scan")
    (tmp_path / "table.json").write_text("{}")
    assert [task.name for task in read_tasks(tmp_path)] == ["chair.ply", "table.obj"]
    assert other_files(tmp_path) == {".json": 1}


def test_what_lies_beside_a_damaged_record_is_a_scan(tmp_path: Path) -> None:
    (tmp_path / "a.ply").write_text("scan")
    (tmp_path / "a.json").write_text("[" * 100_000)
    assert [task.name for task in read_tasks(tmp_path)] == ["a.ply"]
