"""Scenes fitted object by object: results lie where the scans lie, and no object costs another its result."""

import json
import warnings
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from kpred.database import Database, build_database
from kpred.errors import ConfigError, DatabaseError, OutputError, ScanError
from kpred.fitting import fit_scene as scene_module
from kpred.fitting.fit_scene import SceneFit, fit_scene
from kpred.nn import Model, ModelConfig
from kpred.rendering.draw import PictureWarning
from kpred.rendering.scene_picture import PICTURE_SIZE, save_scene_picture, scene_view
from kpred.scenes.floor import SceneFloor
from kpred.scenes.objects import SceneObject, objects_of
from kpred.scenes.scan2cad import compose, read_annotations
from kpred.scenes.scene import Scene, read_scene
from kpred.shapes.source import open_shapes
from kpred.synthetic.generator import generate
from kpred.training.run import new_network

PLACES = {"chair_1": (0.0, 0.0), "chair_2": (2.0, 0.5), "table_3": (0.5, 3.0)}
TO_Z_UP = Rotation.from_euler("x", 90, degrees=True)


@pytest.fixture(scope="session")
def model(untrained: Model) -> Model:
    return untrained


@pytest.fixture(scope="session")
def database(model: Model, tmp_path_factory: pytest.TempPathFactory) -> Database:
    folder = tmp_path_factory.mktemp("scenes")
    for category in ("chair", "table"):
        pack = folder / f"{category}.npz"
        generate(category, 5, seed=3, splits=False).save(pack)
        build_database(folder / "furniture.kpred", open_shapes(pack), model)
    return Database.open(folder / "furniture.kpred", read_only=True)


@pytest.fixture(scope="session")
def scene() -> Scene:
    """Two chairs and a table, z up, turned, on a floor."""
    rng = np.random.default_rng(0)
    parts, instances = [np.column_stack([rng.uniform(-1, 4, (500, 2)), np.zeros(500)])], [np.zeros(500, np.int64)]
    for number, (name, (x, y)) in enumerate(PLACES.items()):
        mesh = generate(name.partition("_")[0], 5, seed=3)[number]
        surface = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
        points = TO_Z_UP.apply(trimesh.sample.sample_surface(surface, 600, seed=number)[0])
        turn = Rotation.from_euler("z", 30 * number, degrees=True)
        parts.append(turn.apply(points) + [x, y, 0.0])
        instances.append(np.full(600, number + 1))
    numbers = np.concatenate(instances)
    labels = np.array([2, 5, 5, 7])[numbers]
    return Scene(np.concatenate(parts), labels, name="room", instances=numbers)


@pytest.fixture(scope="session")
def fitted(scene: Scene, model: Model, database: Database) -> SceneFit:
    return fit_scene(scene, objects_of(scene), model, database, top_k=3)


def test_every_object_is_fitted_in_its_own_category(fitted: SceneFit) -> None:
    assert [item.object.name for item in fitted.fits] == list(PLACES)
    assert [item.fit.category if item.fit else None for item in fitted.fits] == ["chair", "chair", "table"]
    assert fitted.fitted == fitted.fits


def test_nodes_of_the_glb_lie_where_the_scans_lie(fitted: SceneFit, tmp_path: Path) -> None:
    file = tmp_path / "scene.glb"
    fitted.to_glb(file)
    loaded = trimesh.load_scene(file, process=False)
    assert sorted(loaded.graph.nodes_geometry) == sorted(item.node for item in fitted.fits)
    turn = fitted.scan_to_glb()[:3, :3]
    for item in fitted.fits:
        assert item.fit is not None
        assert item.node == f"{item.object.name} {item.fit.source.model_id}"
        transform, geometry = loaded.graph[item.node]
        placed = trimesh.transform_points(loaded.geometry[geometry].vertices, transform)
        wanted = np.asarray(item.fit.mesh.vertices) @ turn.T
        # glTF may join or split vertices: as sets of points they are the same.
        assert cKDTree(placed).query(wanted)[0].max() < 1e-5
        assert cKDTree(wanted).query(placed)[0].max() < 1e-5
        scan = item.object.points @ turn.T
        # Untrained networks: the place is right, the size need not be.
        apart = (placed.min(axis=0) + placed.max(axis=0) - scan.min(axis=0) - scan.max(axis=0)) / 2
        assert np.linalg.norm(apart) < 0.5 * np.linalg.norm(np.ptp(scan, axis=0)), item.node


def test_meshes_are_in_shapenets_frame(fitted: SceneFit) -> None:
    for item in fitted.fits:
        assert item.fit is not None
        mesh, matrix = item.cad_mesh(), item.cad_to_scan()
        low, high = np.asarray(mesh.vertices).min(axis=0), np.asarray(mesh.vertices).max(axis=0)
        np.testing.assert_allclose(low + high, 0, atol=1e-9)
        assert np.linalg.norm(high - low) == pytest.approx(1)
        placed = np.asarray(mesh.vertices) @ matrix[:3, :3].T + matrix[:3, 3]
        np.testing.assert_allclose(placed, item.fit.mesh.vertices, atol=1e-9)
        # Up is the scan's up; the front, +z in the unit box, is -z.
        up, front = matrix[:3, 1] / np.linalg.norm(matrix[:3, 1]), -matrix[:3, 2] / np.linalg.norm(matrix[:3, 2])
        np.testing.assert_allclose(up, [0, 0, 1], atol=1e-9)
        np.testing.assert_allclose(front, item.fit.frame.rotation[2], atol=1e-9)


def test_json_and_csv_hold_the_same_alignments(fitted: SceneFit, tmp_path: Path) -> None:
    record = json.loads(json.dumps(fitted.to_json("scene.glb")))
    (tmp_path / "annotation.json").write_text(json.dumps(record["scan2cad"]))
    (annotation,) = read_annotations(tmp_path / "annotation.json", "room")
    fitted.to_csv(tmp_path / "room.csv")
    lines = (tmp_path / "room.csv").read_text().splitlines()
    assert len(lines) == len(annotation.models) == 3
    for item, model, line, entry in zip(fitted.fits, annotation.models, lines, record["objects"], strict=True):
        assert item.fit is not None
        np.testing.assert_allclose(model.cad_to_scan, item.cad_to_scan(), atol=1e-9)
        cells = line.split(",")
        numbers = np.array(cells[2:], dtype=np.float64)
        np.testing.assert_allclose(compose(numbers[:3], numbers[3:7], numbers[7:]), item.cad_to_scan(), atol=1e-9)
        assert cells[:2] == [{"chair": "03001627", "table": "04379243"}[item.fit.category], item.fit.source.model_id]
        assert entry["status"] == "fitted"
        assert entry["fit"]["model_id"] == item.fit.source.model_id
    assert [entry["node"] for entry in record["scan2cad"][0]["aligned_models"]] == [item.node for item in fitted.fits]


def _object(scene: Scene, name: str, category: str | None, rows: Any, **more: Any) -> SceneObject:
    indices = np.atleast_1d(np.asarray(rows, dtype=np.int64))
    return SceneObject(name, category, scene.points[indices], indices, scene.up, **more)


def test_no_object_stops_the_others(
    scene: Scene, model: Model, database: Database, monkeypatch: pytest.MonkeyPatch
) -> None:
    chair, _, table = objects_of(scene)
    really_fit = scene_module.fit

    def sometimes(points: np.ndarray, *arguments: Any, **options: Any) -> Any:
        if len(points) == 100:
            raise RuntimeError("the network fell over")
        return really_fit(points, *arguments, **options)

    monkeypatch.setattr(scene_module, "fit", sometimes)
    objects = [
        _object(scene, "trash_bin_0", "trash_bin", chair.indices),
        _object(scene, "fragment", "chair", chair.indices[:10]),
        _object(scene, "broken", "chair", [], problem="broken: its scale has a zero."),
        _object(scene, "unlucky", "chair", chair.indices[:100]),
        _object(scene, "line", "chair", np.full(200, chair.indices[0])),
        _object(scene, "nameless", None, table.indices),
        table,
    ]
    seen: list[tuple[int, int, str]] = []
    result = fit_scene(scene, objects, model, database, lambda *step: seen.append(step), top_k=2)
    assert [item.fit is not None for item in result.fits] == [False] * 5 + [True] * 2
    assert [item.skipped for item in result.fits] == [True] + [False] * 6
    errors = [str(item.error) for item in result.fits[:5]]
    assert "trash_bin is not among the categories of model and database (chair, table)" in errors[0]
    assert "10 distinct points" in errors[1]
    assert errors[2] == "broken: its scale has a zero."
    assert errors[3] == "unlucky: unexpected RuntimeError: the network fell over"
    for item, error in zip(result.fits, errors, strict=False):
        assert error.startswith(f"{item.object.name}: ")
    assert seen == [(k, 7, item.name) for k, item in enumerate(objects)] + [(7, 7, "")]
    statuses = [entry["status"] for entry in result.to_json()["objects"]]
    assert statuses == ["skipped"] + ["failed"] * 4 + ["fitted"] * 2


def _floors_given(monkeypatch: pytest.MonkeyPatch) -> dict[int, float | None]:
    """Number of an object's points -> the floor that its fit was told."""
    told: dict[int, float | None] = {}
    really_fit = scene_module.fit

    def spy(points: np.ndarray, *arguments: Any, floor: float | None, **options: Any) -> Any:
        told[len(points)] = floor
        return really_fit(points, *arguments, floor=floor, **options)

    monkeypatch.setattr(scene_module, "fit", spy)
    return told


def test_objects_stand_on_the_floor_unless_they_hang(
    scene: Scene, model: Model, database: Database, monkeypatch: pytest.MonkeyPatch
) -> None:
    chair, _, table = objects_of(scene)
    top = table.indices[table.points[:, 2] > 0.6 * table.points[:, 2].max()]
    hanging = SceneObject("shelf", "table", table.points[:500] + [0, 0, 2.0], np.full(500, -1))
    told = _floors_given(monkeypatch)
    found = fit_scene(scene, [_object(scene, "top", "table", top), hanging, chair], model, database, top_k=2)
    assert found.floor is not None and found.floor.source == "labels"
    assert told[500] is None
    assert told[len(top)] == pytest.approx(0.0, abs=0.02)
    assert told[len(chair.points)] == pytest.approx(0.0, abs=0.02)
    record = json.loads(json.dumps(found.to_json()))
    assert [entry["floor"] for entry in record["objects"]] == [told[len(top)], None, told[len(chair.points)]]
    assert record["floor"]["level"] == pytest.approx(0.0, abs=0.02)


def test_a_table_of_which_only_the_top_was_scanned_reaches_the_floor(scene: Scene) -> None:
    table = objects_of(scene)[2]
    top = _object(scene, "top", "table", table.indices[table.points[:, 2] > 0.8 * table.points[:, 2].max()])
    for floor, reaches in ((True, True), (False, False)):
        (found,) = fit_scene(scene, [top], floor=floor).fits
        assert found.fit is not None
        assert (abs(found.fit.mesh.bounds[0, 2]) < 0.08) == reaches


def test_the_floor_may_be_left_out_or_given(
    scene: Scene, model: Model, database: Database, monkeypatch: pytest.MonkeyPatch
) -> None:
    told = _floors_given(monkeypatch)
    chair = objects_of(scene)[0]
    without = fit_scene(scene, [chair], model, database, floor=False, top_k=2)
    assert without.floor is None
    assert without.to_json()["floor"] is None
    assert told.pop(len(chair.points)) is None
    given = SceneFloor("z", -0.25, np.zeros(2), "points")
    assert fit_scene(scene, [chair], model, database, floor=given, top_k=2).floor is given
    assert told.pop(len(chair.points)) == -0.25
    without_floor = replace(scene, points=scene.points[500:], labels=None)
    moved = replace(chair, indices=chair.indices - 500)
    assert fit_scene(without_floor, [moved], model, database, top_k=2).floor is None
    assert told.pop(len(chair.points)) is None


def test_doubts_are_told_of_each_object(fitted: SceneFit) -> None:
    record = json.loads(json.dumps(fitted.to_json()))
    for item, entry in zip(fitted.fits, record["objects"], strict=True):
        assert item.fit is not None
        assert entry["confidence"] == item.fit.confidence
        assert 0 <= entry["confidence"] <= 1
        assert entry["warnings"] == list(item.fit.warnings)


def test_a_scene_without_objects(scene: Scene, model: Model, database: Database, tmp_path: Path) -> None:
    with pytest.raises(ScanError, match="room: the scene has no objects"):
        fit_scene(scene, [], model, database)
    nothing = fit_scene(scene, [_object(scene, "plant_0", "plant", [1, 2])], model, database)
    with pytest.raises(OutputError, match="no object of the scene was fitted"):
        nothing.to_glb(tmp_path / "scene.glb")
    assert not list(tmp_path.iterdir())
    assert nothing.to_json()["scan2cad"][0]["aligned_models"] == []


def test_what_is_wrong_with_everything_is_said_at_once(scene: Scene, model: Model, database: Database) -> None:
    objects = objects_of(scene)
    with pytest.raises(ConfigError, match="up is given by"):
        fit_scene(scene, objects, model, database, up="y")
    config = ModelConfig(category="chair", width=16, token_size=8, region_points=16, stages=1)
    other = Model("other", {"chair": new_network(config, seed=9).eval()})
    with pytest.raises(DatabaseError):
        fit_scene(scene, objects, other, database)


def test_only_glb(fitted: SceneFit, tmp_path: Path) -> None:
    with pytest.raises(OutputError, match=r"\.glb"):
        fitted.to_glb(tmp_path / "scene.obj")
    with pytest.raises(OutputError, match=r"\.png"):
        save_scene_picture(fitted, tmp_path / "scene.jpg")


def test_the_view_is_that_of_the_glb(fitted: SceneFit) -> None:
    view = scene_view(fitted)
    bounds = fitted.glb_scene().bounds
    (scan,), (_, models) = (panel.layers for panel in view.panels)
    np.testing.assert_allclose(models.vertices.min(axis=0), bounds[0], atol=1e-5)
    np.testing.assert_allclose(models.vertices.max(axis=0), bounds[1], atol=1e-5)
    assert view.panels[1].labels == tuple(PLACES)
    assert len(models.faces) == len(models.colors)
    np.testing.assert_allclose(scan.vertices[:, 1], fitted.scene.points[:, 2], atol=1e-6)


@pytest.mark.parametrize("graphics", [True, False])
def test_the_picture_shows_scan_and_models(
    fitted: SceneFit, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, graphics: bool
) -> None:
    from matplotlib.image import imread

    from kpred.rendering import draw

    if not graphics:
        monkeypatch.setattr(draw, "_draw_apart", lambda *arguments: "there are no graphics here")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", PictureWarning)
        assert save_scene_picture(fitted, tmp_path / "scene.png")
    image = imread(tmp_path / "scene.png")[..., :3]
    assert image.shape[:2] == (PICTURE_SIZE[1], PICTURE_SIZE[0])
    left, right = np.split(image, 2, axis=1)
    assert (left < 0.9).any(axis=2).mean() > 0.002
    colourful = right.max(axis=2) - right.min(axis=2) > 0.15
    assert colourful.mean() > 0.01
    assert (left.max(axis=2) - left.min(axis=2) > 0.15).mean() < 0.2 * colourful.mean()


def test_the_shared_scene(shared_data: Path, model: Model, database: Database, tmp_path: Path) -> None:
    real = shared_data / "real" / "scan2cad_scene0470_00"
    scene = read_scene(real / "Assets/scannet-sample/scene0470_00/scene0470_00_vh_clean_2.ply")
    objects = objects_of(scene, real / "full_annotations.json")
    result = fit_scene(scene, objects, model, database, top_k=2)
    assert [item.object.name for item in result.fitted] == [f"chair_{k}" for k in range(1, 5)] + ["table_5", "chair_6"]
    assert result.fits[0].skipped
    assert scene_view(result).panels[0].layers[0].style.one_sided
    result.to_glb(tmp_path / "scene.glb")
    loaded = trimesh.load_scene(tmp_path / "scene.glb", process=False)
    scan_to_glb = result.scan_to_glb()[:3, :3]
    for item in result.fitted:
        annotation = item.object.annotation
        assert annotation is not None
        assert annotation.center is not None
        wanted = annotation.cad_to_scan[:3, :3] @ annotation.center + annotation.cad_to_scan[:3, 3]
        transform, _ = loaded.graph[item.node]
        # Untrained networks: the place is right, the size need not be.
        assert np.linalg.norm((transform[:3, 3] - scan_to_glb @ wanted)[[0, 2]]) < 0.6, item.object.name
