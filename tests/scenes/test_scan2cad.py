"""Scan2CAD's files: transforms agree with the shared scene, broken entries cost only themselves, results read back."""

import csv
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from kpred.errors import MeshError, OutputError, ScanError
from kpred.scenes.scan2cad import (
    Alignment,
    compose,
    decompose,
    model_path,
    read_annotations,
    results,
    write_csv,
)
from kpred.shapes.categories import category_of, nyu40_numbers, synset_of
from kpred.shapes.mesh_io import read_mesh

IDENTITY = {"translation": [0, 0, 0], "rotation": [1, 0, 0, 0], "scale": [1, 1, 1]}


def entry(**changes: Any) -> dict[str, Any]:
    trs = {"translation": [1, 2, 3], "rotation": [1, 0, 0, 0], "scale": [1, 1, 1]}
    return {"catid_cad": "03001627", "id_cad": "abc", "trs": trs, "sym": "__SYM_NONE"} | changes


def write(folder: Path, *models: Any, **changes: Any) -> Path:
    file = folder / "full_annotations.json"
    scene = {"id_scan": "scene0001_00", "trs": IDENTITY, "aligned_models": list(models)} | changes
    file.write_text(json.dumps([scene]))
    return file


@pytest.fixture
def real(shared_data: Path) -> Path:
    return shared_data / "real" / "scan2cad_scene0470_00"


def test_the_shared_scene_stands_as_its_pairs_say(real: Path) -> None:
    (scene,) = read_annotations(real / "full_annotations.json")
    pairs = json.loads((real / "pairs" / "index.json").read_text())
    assert scene.id_scan == "scene0470_00"
    assert not scene.broken
    assert [model.category for model in scene.models] == [pair["category"] for pair in pairs]
    for model, pair in zip(scene.models, pairs, strict=True):
        np.testing.assert_allclose(model.cad_to_scan, pair["cad_to_scan"], atol=1e-5)
        assert (model.catid_cad, model.id_cad, model.sym) == (pair["catid_cad"], pair["id_cad"], pair["sym"])


def test_bbox_and_center_are_those_of_the_models(real: Path) -> None:
    (scene,) = read_annotations(real / "full_annotations.json", "scene0470_00")
    for model in scene.models:
        low, high = read_mesh(model_path(model, real)).bounds
        assert model.half_size is not None
        assert model.center is not None
        np.testing.assert_allclose((high - low) / 2, model.half_size, atol=2e-4)
        np.testing.assert_allclose((high + low) / 2, model.center, atol=2e-4)


def test_a_model_that_is_not_there_is_named(real: Path, tmp_path: Path) -> None:
    (scene,) = read_annotations(real / "full_annotations.json")
    with pytest.raises(MeshError, match=r"chair_1.*03001627/b4371c352f96c4d5a6fee8e2140acec9"):
        model_path(scene.models[1], tmp_path)


@pytest.mark.parametrize(
    ("trs", "trouble"),
    [
        ({**IDENTITY, "scale": [1, 0, 1]}, "zero"),
        ({**IDENTITY, "scale": [1, float("nan"), 1]}, "scale is not 3 finite"),
        ({**IDENTITY, "translation": [0, float("inf"), 0]}, "translation"),
        ({**IDENTITY, "translation": [0, 0]}, "translation"),
        ({**IDENTITY, "rotation": [0, 0, 0, 0]}, "zero quaternion"),
        ({**IDENTITY, "rotation": "upside down"}, "rotation"),
        ({"scale": [1, 1, 1]}, "translation"),
        (None, "no trs"),
    ],
)
def test_a_broken_transform_costs_its_object_only(tmp_path: Path, trs: Any, trouble: str) -> None:
    file = write(tmp_path, entry(), entry(trs=trs, catid_cad="04379243", id_cad="xyz"), entry())
    (scene,) = read_annotations(file)
    assert [model.name for model in scene.models] == ["chair_0", "chair_2"]
    (broken,) = scene.broken
    assert broken.name == "table_1"
    assert all(word in broken.reason for word in (str(file), "table_1", "04379243/xyz", trouble))


@pytest.mark.parametrize("item", [{}, None, entry(id_cad=""), 7])
def test_an_entry_without_a_model_is_broken(tmp_path: Path, item: Any) -> None:
    (scene,) = read_annotations(write(tmp_path, item))
    assert not scene.models
    assert "names no CAD model" in scene.broken[0].reason


def test_files_that_are_no_annotation(tmp_path: Path) -> None:
    other = tmp_path / "other.json"
    for content in ("[1, 2]", '{"a": 1}', "null"):
        other.write_text(content)
        with pytest.raises(ScanError, match="no Scan2CAD annotation"):
            read_annotations(other)
    other.write_text('[{"id_scan": ')
    with pytest.raises(ScanError, match="not valid JSON"):
        read_annotations(other)
    with pytest.raises(ScanError, match="no such file|cannot be read"):
        read_annotations(tmp_path / "none.json")
    with pytest.raises(ScanError, match="no annotation of scene0002_00"):
        read_annotations(write(tmp_path, entry()), "scene0002_00")
    with pytest.raises(ScanError, match="scene0001_00 is broken"):
        read_annotations(write(tmp_path, entry(), trs={**IDENTITY, "scale": [0, 0, 0]}))


def test_compose_and_decompose_are_inverse(rng: np.random.Generator) -> None:
    for turn in Rotation.random(20, random_state=0):
        translation, scale = rng.normal(size=3), rng.uniform(0.1, 3, size=3)
        quaternion = turn.as_quat(canonical=True)[[3, 0, 1, 2]]
        matrix = compose(translation, quaternion, scale)
        point = rng.normal(size=3)
        np.testing.assert_allclose(matrix[:3, :3] @ point, turn.apply(scale * point))
        for found, wanted in zip(decompose(matrix), (translation, quaternion, scale), strict=True):
            np.testing.assert_allclose(found, wanted, atol=1e-12)


def make_alignment(rng: np.random.Generator) -> Alignment:
    quaternion = rng.normal(size=4)
    quaternion *= np.sign(quaternion[0]) / np.linalg.norm(quaternion)
    scale = np.full(3, rng.uniform(0.5, 2))
    half = rng.uniform(0.1, 0.4, 3)
    return Alignment(
        "03001627", "m 1", rng.normal(size=3), quaternion, scale, half, "scene.glb", "chair_1 m 1", "chair_1"
    )


def test_results_read_back_as_annotations(tmp_path: Path, rng: np.random.Generator) -> None:
    alignments = [make_alignment(rng) for _ in range(3)]
    world = compose(rng.normal(size=3), Rotation.from_euler("x", -90, degrees=True).as_quat()[[3, 0, 1, 2]], np.ones(3))
    file = tmp_path / "results.json"
    content = results("scene0001_00", alignments, world)
    file.write_text(json.dumps([content]))
    (scene,) = read_annotations(file, "scene0001_00")
    np.testing.assert_allclose(scene.scan_to_world, world, atol=1e-12)
    assert content["n_aligned_models"] == 3
    assert content["aligned_models"][0]["mesh"] == "scene.glb"
    assert content["aligned_models"][0]["node"] == "chair_1 m 1"
    for model, alignment in zip(scene.models, alignments, strict=True):
        np.testing.assert_allclose(model.cad_to_scan, alignment.matrix(), atol=1e-9)
        np.testing.assert_allclose(model.half_size, alignment.half_size)


def test_csv_lines_are_what_the_benchmark_reads(tmp_path: Path, rng: np.random.Generator) -> None:
    alignments = [make_alignment(rng) for _ in range(2)]
    write_csv(tmp_path / "scene0001_00.csv", alignments)
    with open(tmp_path / "scene0001_00.csv", newline="") as stream:
        rows = list(csv.reader(stream))
    assert [len(row) for row in rows] == [12, 12]
    for row, alignment in zip(rows, alignments, strict=True):
        assert row[:2] == ["03001627", "m 1"]
        numbers = np.array(row[2:], dtype=np.float64)
        np.testing.assert_array_equal(compose(numbers[:3], numbers[3:7], numbers[7:]), alignment.matrix())
    with pytest.raises(OutputError):
        write_csv(tmp_path / "none" / "a.csv", alignments)


@pytest.mark.parametrize(
    ("name", "category"),
    [
        ("03001627", "chair"),
        ("04379243", "table"),
        ("02871439", "cabinet"),
        ("02933112", "cabinet"),
        ("02747177", "trash_bin"),
        ("office chair", "chair"),
        ("Chairs", "chair"),
        ("kitchen cabinets", "cabinet"),
        ("bookshelf", "cabinet"),
        ("coffee table", "table"),
        ("desk", "table"),
        ("trash can", "trash_bin"),
        ("table lamp", "lamp"),
        ("Fire Extinguisher", "fire_extinguisher"),
        ("09999999", "09999999"),
    ],
)
def test_names_mean_categories(name: str, category: str) -> None:
    assert category_of(name) == category


def test_classes_and_synsets_of_categories() -> None:
    assert nyu40_numbers("chair") == (5,)
    assert set(nyu40_numbers("table")) == {7, 14}
    assert 10 in nyu40_numbers("cabinet")
    assert nyu40_numbers("piano") == ()
    assert [category_of(synset_of(name)) for name in ("chair", "table", "cabinet", "sofa")] == [
        *("chair", "table", "cabinet", "sofa")
    ]
    assert synset_of("gizmo") == "gizmo"
