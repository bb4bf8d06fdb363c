"""What a database keeps of its models beside their shapes, and what it does when a mesh has changed."""

import numpy as np
import pytest
import torch

from kpred.database import Database, build_database
from kpred.nn import KPRed, ModelConfig
from kpred.shapes import Mesh, Shape

DETAILS = {"title": "Oak chair", "author": "Ann Lee", "licence": "CC-BY-3.0", "width": "0.4"}


def box(height: float = 1.0) -> Mesh:
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, height) for z in (0, 1)], np.float32)
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    return Mesh(corners, np.array([t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))]))


def build(path, networks, *shapes, update=False):
    return build_database(path, shapes, networks, update=update, count=128)


@pytest.fixture
def networks():
    torch.manual_seed(0)
    return {"chair": KPRed(ModelConfig("chair", token_size=8, width=16, stages=1, region_points=8)).eval()}


@pytest.fixture
def file(tmp_path, networks):
    path = tmp_path / "a.kpred"
    build(path, networks, Shape("chair/a", "chair", "source", box(), DETAILS), ("chair/b", "chair", "source", box(2)))
    return path


def test_details_are_kept_and_listed(file):
    with Database.open(file) as database:
        assert database.metadata("chair/a").items() >= {**DETAILS, "split": "source"}.items()
        listed = database.all_metadata()
        assert list(listed) == ["chair/a", "chair/b"]
        assert listed["chair/a"].items() >= {**DETAILS, "category": "chair", "faces": 12, "vertices": 8}.items()
        assert database.all_metadata("table") == {}
        assert database.info()["licences"] == {"": 1, "CC-BY-3.0": 1}


def test_the_same_mesh_again_is_present(file, networks):
    report = build(file, networks, ("chair/b", "chair", "source", box(2)))
    assert (report.skipped_present, report.changed, report.added) == (1, [], 0)


def test_another_mesh_of_the_same_name_is_kept_out_and_named(file, networks):
    report = build(file, networks, ("chair/b", "chair", "source", box(3)))
    assert (report.skipped_present, report.changed, report.replaced) == (0, ["chair/b"], 0)
    with Database.open(file) as database:
        np.testing.assert_array_equal(database.entry("chair/b").mesh.vertices, box(2).vertices)


def test_update_replaces_what_has_changed_and_nothing_else(file, networks):
    with Database.open(file) as database:
        (before,) = database.records(["chair/a"])
    shapes = [Shape("chair/a", "chair", "source", box(), DETAILS), ("chair/b", "chair", "source", box(3))]
    report = build(file, networks, *shapes, ("chair/c", "chair", "source", box(4)), update=True)
    assert (report.skipped_present, report.replaced, report.added, report.changed) == (1, 1, 1, [])
    with Database.open(file) as database:
        assert database.model_ids() == ("chair/a", "chair/b", "chair/c")
        np.testing.assert_array_equal(database.entry("chair/b").mesh.vertices, box(3).vertices)
        assert database.records(["chair/a"])[0].digest() == before.digest()


def test_update_takes_over_new_details_of_the_same_mesh(file, networks):
    report = build(file, networks, Shape("chair/b", "chair", "source", box(2), {"author": "Bo"}), update=True)
    assert report.replaced == 1
    with Database.open(file) as database:
        assert database.metadata("chair/b")["author"] == "Bo"


def test_a_database_without_hashes_compares_the_meshes_themselves(file, networks):
    with Database.open(file) as database:
        entry = database.entry("chair/b")
        entry.metadata.pop("content")
        database.add([entry], replace=True)
        assert "content" not in database.metadata("chair/b")
    assert build(file, networks, ("chair/b", "chair", "source", box(2))).skipped_present == 1
    assert build(file, networks, ("chair/b", "chair", "source", box(3))).changed == ["chair/b"]
