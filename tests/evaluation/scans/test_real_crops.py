"""Real scans: crops by name or index, both distances, and objects of a Scan2CAD layout against their annotation."""

import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from kpred.errors import ConfigError, ScanError
from kpred.evaluation.database_source import database_source
from kpred.evaluation.metrics.surfaces import Surface
from kpred.evaluation.metrics.symmetry import yaw_between
from kpred.evaluation.scans import real_crops as real
from kpred.evaluation.scans.outcome import FitSettings
from kpred.evaluation.scans.real_crops import Crop, CropOutcome, evaluate_crops, read_crops, summarise_crops
from kpred.evaluation.scans.scenes import (
    SceneOutcome,
    annotated_centre,
    annotated_mesh,
    annotated_rotation,
    evaluate_scenes,
    scan_of,
    summarise_scenes,
)
from kpred.fitting.pipeline import fit
from kpred.nn import Model
from kpred.ops.rotations import upright_rotation
from kpred.preprocessing.clean import clean_scan
from kpred.scenes.scan2cad import read_annotations
from kpred.shapes import read_scan
from kpred.synthetic.generator import generate

# Of the Scan2CAD layout in conftest.py.
TO_Z_UP = Rotation.from_euler("x", 90, degrees=True)
SCENE = "scene0001_00"
TURN = 40.0
PLACE = np.array([2.0, -1.0, 0.5])


@pytest.fixture(scope="module")
def settings(packs: dict[str, Path], model: Model) -> Iterator[FitSettings]:
    with database_source([packs["chair"], packs["table"]], model, None, 0, None, pytest.fail) as database:
        yield FitSettings(model, database, top_k=2, seed=0)


def surface(category: str, count: int = 900) -> np.ndarray:
    mesh = generate(category, 4, seed=8)[3]
    return trimesh.sample.sample_surface(trimesh.Trimesh(mesh.vertices, mesh.faces, process=False), count, seed=0)[0]


def write(points: np.ndarray, file: Path) -> None:
    trimesh.PointCloud(points).export(file)


@pytest.fixture(scope="module")
def crops(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A chair with strays, y up; a table, z up; a fragment; something unknown."""
    folder = tmp_path_factory.mktemp("crops")
    write(np.concatenate([surface("chair"), [[9.0, 9.0, 9.0], [9.1, 9.0, 9.0]]]), folder / "chair_00.ply")
    write(TO_Z_UP.apply(surface("table")), folder / "7_04379243_ab.ply")
    write(surface("chair", 20), folder / "chair_01.ply")
    write(surface("chair"), folder / "lamp_00.ply")
    index = [{"file": "7_04379243_ab.ply", "category": "table", "up": "z"}, {"file": "gone.ply", "category": "chair"}]
    (folder / "index.json").write_text(json.dumps(index))
    return folder


@pytest.fixture(scope="module")
def outcomes(crops: Path, settings: FitSettings) -> list[CropOutcome]:
    return evaluate_crops(read_crops(crops), settings)


def test_the_index_or_the_name_says_what_a_crop_is(crops: Path) -> None:
    found = [(crop.file.name, crop.category, crop.up) for crop in read_crops(crops)]
    assert found == [
        ("7_04379243_ab.ply", "table", "z"),
        ("chair_00.ply", "chair", "y"),
        ("chair_01.ply", "chair", "y"),
        ("lamp_00.ply", "lamp", "y"),
    ]
    assert {crop.up for crop in read_crops(crops, up="-x")} == {"-x"}


def test_folders_that_hold_no_crops(crops: Path, tmp_path: Path) -> None:
    with pytest.raises(ScanError, match=r"no such folder with \.ply files"):
        read_crops(tmp_path / "none")
    write(surface("chair"), tmp_path / "chair_00.ply")
    (tmp_path / "index.json").write_text('{"up": "z"}')
    with pytest.raises(ScanError, match=r"index\.json: it is no list"):
        read_crops(tmp_path)
    with pytest.raises(ConfigError, match="'up'"):
        read_crops(crops, up="up")


def test_distances_are_those_of_the_fit_alone(crops: Path, settings: FitSettings, outcomes: list[CropOutcome]) -> None:
    outcome = outcomes[1]
    points = read_scan(crops / "chair_00.ply")
    result = fit(points, settings.model, settings.database, top_k=2, up="y")
    distances = Surface(result.mesh).distances(points)
    kept = clean_scan(points).object_points
    assert (outcome.file, outcome.points, outcome.kept) == ("chair_00.ply", 902, int(kept.sum()))
    assert outcome.kept <= 900
    assert outcome.distance_all == pytest.approx(distances.mean(), rel=0.02)
    assert outcome.distance_kept == pytest.approx(distances[kept].mean(), rel=0.02)
    assert outcome.found == result.category
    assert outcome.model == result.source.model_id
    assert outcome.distance_all is not None
    assert outcome.distance_kept is not None
    # The strays are nine metres away.
    assert outcome.distance_all > outcome.distance_kept + 0.01


def test_what_fails_is_in_the_list_and_what_is_unknown_is_told(crops: Path, settings: FitSettings) -> None:
    told: list[str] = []
    seen: list[tuple[str, int, int]] = []
    found = evaluate_crops(read_crops(crops), settings, progress=lambda *step: seen.append(step), report=told.append)
    assert [(o.file, o.failure is None) for o in found] == [
        ("7_04379243_ab.ply", True),
        ("chair_00.ply", True),
        ("chair_01.ply", False),
    ]
    assert "20" in str(found[2].failure)
    assert found[2].tile.verdict == "wrong"
    assert len(told) == 1
    assert "lamp_00.ply: lamp is not among the categories" in told[0]
    assert seen == [("crops", k, 4) for k in range(1, 5)]
    rows = {(row.category, row.metric): row for row in summarise_crops(found, "crops", 0)}
    assert rows["chair", "failed"].value == 0.5
    assert rows["chair", "distance_all"].n == 1
    assert rows["all", "category_right"].n == 3
    assert rows["all", "distance_kept"].unit == "m"
    with pytest.raises(ScanError, match="No crop is of a known category"):
        evaluate_crops([Crop(crops / "lamp_00.ply", "lamp", "y")], settings)


def test_a_broken_file_costs_only_itself(settings: FitSettings, tmp_path: Path) -> None:
    (tmp_path / "chair_00.ply").write_text("ply\nnonsense")
    (found,) = evaluate_crops(read_crops(tmp_path), settings)
    assert "chair_00.ply" in str(found.failure)
    assert not found.near


def test_near_is_4_cm_of_what_was_kept(outcomes: list[CropOutcome]) -> None:
    near = replace(outcomes[1], distance_kept=0.039, distance_all=0.041, found="chair")
    assert (near.near, near.all_near, near.category_right) == (True, False, True)
    rows = {row.metric: row.value for row in summarise_crops([near, outcomes[2]], "crops", 0)}
    assert rows["kept_points_under_4_cm"] == rows["category_right"] == 0.5
    assert rows["all_points_under_4_cm"] == 0
    assert real.NEAR_METRES == 0.04


@pytest.fixture(scope="module")
def objects(layout: Path, settings: FitSettings) -> list[SceneOutcome]:
    return evaluate_scenes(layout, settings)


def test_the_annotated_model_stands_where_the_scan_is(layout: Path) -> None:
    (annotation,) = read_annotations(layout / "full_annotations.json")
    model = annotation.models[0]
    placed = annotated_mesh(model, layout)
    scan = read_scan(scan_of(layout, SCENE))
    assert Surface(placed).distances(scan[:1500]).mean() < 0.005
    np.testing.assert_allclose(annotated_centre(model, placed), PLACE, atol=1e-6)
    np.testing.assert_allclose(annotated_centre(replace(model, center=None), placed), PLACE, atol=1e-3)


def test_the_annotated_rotation_leads_to_canonical_axes(layout: Path) -> None:
    (annotation,) = read_annotations(layout / "full_annotations.json")
    found = annotated_rotation(annotation.models[0])
    # The chair was turned by TURN about z from ShapeNet's pose, whose front is -z: half a turn from the canonical one.
    true = upright_rotation("z") @ Rotation.from_euler("z", -TURN - 180, degrees=True).as_matrix()
    np.testing.assert_allclose(found, true, atol=1e-6)
    np.testing.assert_allclose(found @ [0, 0, 1], [0, 1, 0], atol=1e-6)


def test_objects_are_measured_against_their_annotation(
    layout: Path, settings: FitSettings, objects: list[SceneOutcome]
) -> None:
    told: list[str] = []
    seen: list[int] = []
    again = evaluate_scenes(layout, settings, progress=lambda name, done, total: seen.append(done), report=told.append)
    assert [item.to_json() | {"milliseconds": 0} for item in again] == [
        item.to_json() | {"milliseconds": 0} for item in objects
    ]
    assert seen == sorted(seen)
    assert "trash_bin" in told[0]
    good, gone = objects
    assert (good.name, good.category, good.symmetry) == ("chair_0", "chair", "half turn")
    assert good.failure is None
    assert good.annotated_distance is not None
    assert good.annotated_distance < 0.005
    assert good.distance is not None
    assert good.ratio == pytest.approx(good.distance / good.annotated_distance)
    assert good.yaw is not None
    assert 0 <= good.yaw <= 90
    assert good.found in ("chair", "table")
    assert gone.failure is not None
    assert "03001627/gone" in gone.failure
    assert not gone.passes
    assert good.tile is not None
    assert gone.tile is not None


def test_the_truth_passes(layout: Path, settings: FitSettings, monkeypatch: pytest.MonkeyPatch) -> None:
    from kpred.fitting import fit_scene as scene_module
    from kpred.ops import unit_box_frame

    (annotation,) = read_annotations(layout / "full_annotations.json")
    model = annotation.models[0]
    placed = annotated_mesh(model, layout)
    really = scene_module.fit

    def true_fit(points: np.ndarray, *arguments: Any, **options: Any) -> Any:
        frame = unit_box_frame(np.asarray(placed.vertices), annotated_rotation(model))
        return replace(really(points, *arguments, **options), mesh=placed, frame=frame)

    monkeypatch.setattr(scene_module, "fit", true_fit)
    good = evaluate_scenes(layout, settings)[0]
    assert good.ratio == pytest.approx(1)
    assert good.centre_cm == pytest.approx(0, abs=0.1)
    assert good.yaw == pytest.approx(0, abs=1e-6)
    assert good.passes
    assert yaw_between(annotated_rotation(model), annotated_rotation(model)) == pytest.approx(0)


def test_passing_needs_nearness_and_place() -> None:
    item = SceneOutcome(
        scene="s",
        name="chair_1",
        category="chair",
        points=10,
        found="chair",
        distance=0.0239,
        annotated_distance=0.02,
        centre_cm=9.9,
    )
    assert item.passes
    assert not replace(item, distance=0.0241).passes
    assert not replace(item, centre_cm=10.1).passes
    lost = SceneOutcome(scene="s", name="table_2", category="table", points=10, failure="no")
    rows = {(row.category, row.metric): row.value for row in summarise_scenes([item, lost], "s", 0)}
    assert rows["all", "passes"] == rows["all", "category_right_not_given"] == 0.5
    assert rows["all", "distance_ratio"] == pytest.approx(1.195)
    assert ("table", "distance") not in rows


def test_scenes_that_are_not_there(layout: Path, settings: FitSettings, tmp_path: Path) -> None:
    with pytest.raises(ScanError, match=r"full_annotations\.json"):
        evaluate_scenes(tmp_path, settings)
    with pytest.raises(ScanError, match=f"{SCENE}_vh_clean_2.ply"):
        evaluate_scenes(tmp_path, settings, layout / "full_annotations.json")
    content = json.loads((layout / "full_annotations.json").read_text())
    content[0]["aligned_models"] = content[0]["aligned_models"][1:2]
    (tmp_path / "bins.json").write_text(json.dumps(content))
    with pytest.raises(ScanError, match="no object of a known category"):
        evaluate_scenes(layout, settings, tmp_path / "bins.json")


def test_the_shared_crops_say_what_they_are(shared_data: Path) -> None:
    found = read_crops(shared_data / "real" / "s3dis")
    assert len(found) == 27
    assert {crop.up for crop in found} == {"y"}
    pairs = read_crops(shared_data / "real" / "scan2cad_scene0470_00" / "pairs")
    assert {(crop.category, crop.up) for crop in pairs} == {("chair", "z"), ("table", "z"), ("trash_bin", "z")}
