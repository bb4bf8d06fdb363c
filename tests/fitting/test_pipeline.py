"""A fit end to end, on the bundled weights and database: what goes in comes out in its own place, size and units."""

import json
from pathlib import Path

import numpy as np
import pytest
import torch

import kpred
from kpred.database import build_database
from kpred.errors import ConfigError, DatabaseError, ModelError, ScanError
from kpred.fitting import Fit, bundled_database_path
from kpred.fitting.deform import WHOLE
from kpred.fitting.joint_gaps import WORSE
from kpred.fitting.stages import Context
from kpred.nn.config import SHARED
from kpred.ops import chamfer_distance, sample_surface, unit_box_frame
from kpred.ops.closest_point import closest_points
from kpred.ops.nearest import nearest_reference
from kpred.synthetic.generator import generate

CATEGORIES = ("chair", "table", "cabinet")


@pytest.fixture(scope="module")
def database() -> kpred.Database:
    return kpred.Database.open(bundled_database_path(), read_only=True)


@pytest.fixture(scope="module")
def chair() -> np.ndarray:
    """A full scan of a chair that no database holds, in metres, canonical axes."""
    mesh = generate("chair", 1, seed=77)[0]
    return _sample(mesh.vertices, mesh.faces)


def _sample(vertices: np.ndarray, faces: np.ndarray, count: int = 2048, seed: int = 0) -> np.ndarray:
    generator = torch.Generator().manual_seed(seed)
    points, _ = sample_surface(
        torch.as_tensor(np.array(vertices)).double(), torch.as_tensor(np.array(faces)).long(), count, generator
    )
    return points.numpy()


def _distance(fit: Fit, other: Fit) -> float:
    """CD between two result meshes, relative to the first one's half extent squared."""
    a, b = (_sample(f.mesh.vertices, f.mesh.faces, 4096) for f in (fit, other))
    frame = unit_box_frame(a)
    return float(chamfer_distance(*(torch.from_numpy(frame.to_unit(p))[None].float() for p in (a, b))))


def test_the_bundle_is_whole(database: kpred.Database) -> None:
    model = kpred.load_model()
    assert set(model.categories) == set(CATEGORIES)
    assert model.recognizer is not None and set(model.recognizer.config.categories) == set(CATEGORIES)
    assert "trained on" in (bundled_database_path().parent / "model" / SHARED / "README.md").read_text()
    for category in CATEGORIES:
        assert len(database.model_ids(category)) >= 100
        folder = bundled_database_path().parent / "model" / category
        assert (folder / "model.safetensors").stat().st_size < 6e6
        assert "trained on" in (folder / "README.md").read_text()


@pytest.mark.parametrize("category", CATEGORIES)
def test_a_model_of_the_database_returns_itself_undeformed(database: kpred.Database, category: str) -> None:
    itself, names = 0, database.model_ids(category)[5::25][:6]
    for model_id in names:
        entry = database.entry(model_id)
        fit = kpred.fit(_sample(entry.mesh.vertices, entry.mesh.faces), category=category)
        assert model_id in [candidate.model_id for candidate in fit.candidates]
        if fit.source.model_id != model_id or fit.source.step != "none":
            continue
        # Its own size and place, up to its symmetry.
        assert fit.placement.own_size
        off, _ = closest_points(fit.mesh.vertices, entry.mesh.vertices.astype(np.float64), entry.mesh.faces)
        itself += off.max() < 0.01 * np.ptp(entry.mesh.vertices, axis=0).max()
    # Of a plain wardrobe the back looks like the front, and one shelf like another.
    assert itself >= len(names) - (3 if category == "cabinet" else 2)


def test_a_moved_and_scaled_scan_gives_the_same_mesh_moved_and_scaled(chair: np.ndarray) -> None:
    fit = kpred.fit(chair, category="chair")
    shift, factor = np.array([120.0, -3.0, 45.0]), 1000.0
    moved = kpred.fit(chair * factor + shift, category="chair")
    assert moved.source.model_id == fit.source.model_id
    assert np.allclose((moved.mesh.vertices - shift) / factor, fit.mesh.vertices, atol=1e-3 * fit.frame.scale)
    assert np.allclose((moved.keypoints - shift) / factor, fit.keypoints, atol=1e-3 * fit.frame.scale)


@pytest.mark.parametrize("degrees", [90.0, 180.0, -37.0])
def test_a_turned_scan_gives_the_same_mesh_turned(chair: np.ndarray, degrees: float) -> None:
    fit = kpred.fit(chair, category="chair")
    angle = np.radians(degrees)
    turn = np.array([[np.cos(angle), 0, np.sin(angle)], [0, 1, 0], [-np.sin(angle), 0, np.cos(angle)]])
    turned = kpred.fit(chair @ turn.T, category="chair")
    turned.mesh.vertices = turned.mesh.vertices @ turn
    # Two samples of one surface are about 0.003 apart.
    assert _distance(fit, turned) < 0.008


def test_z_up_scans(chair: np.ndarray) -> None:
    fit = kpred.fit(chair, category="chair")
    z_up = chair @ np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]]).astype(float)
    assert np.allclose(z_up[:, 2], chair[:, 1])
    turned = kpred.fit(z_up, category="chair", up="z")
    assert turned.source.model_id == fit.source.model_id
    back = turned.mesh.vertices @ np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]]).astype(float)
    assert np.allclose(back, fit.mesh.vertices, atol=2e-3 * fit.frame.scale)


@pytest.mark.parametrize("category", CATEGORIES)
def test_the_category_is_found_and_the_simplest_good_candidate_is_first(category: str) -> None:
    right = 0
    for mesh in generate(category, 6, seed=78):
        fit = kpred.fit(_sample(mesh.vertices, mesh.faces))
        right += fit.category == category
        final = [found for found in fit.candidates if found.final]
        assert fit.source is fit.candidates[0] and fit.source.final
        assert [found.final for found in fit.candidates] == [True] * len(final) + [False] * (10 - len(final))
        scores = [found.score for found in final]
        if fit.seen > WHOLE:
            # A better one whose parts came apart gives way to the result.
            assert scores[1:] == sorted(scores[1:])
            assert scores[0] < min(scores) + WORSE
        assert fit.source.score < min(scores) + 1.0
    assert right >= 5


def test_deforming_lowers_the_error(chair: np.ndarray) -> None:
    placed, deformed = (kpred.fit(chair, category="chair", deform=deform) for deform in ("none", "structure"))
    assert {found.step for found in placed.candidates} == {"none"}
    assert deformed.source.error < placed.source.error


def test_the_papers_protocol_takes_the_keypoints_as_the_network_puts_them(chair: np.ndarray) -> None:
    known = unit_box_frame(chair).to_unit(chair)
    fit = kpred.fit(known, category="chair", frame="known", deform="paper", top_k=5)
    assert len(fit.candidates) == 5
    assert all(candidate.step == "paper" and candidate.final for candidate in fit.candidates)
    assert fit.frame.scale == 1
    assert [metric.frame for metric in fit.metrics][0] == "known unit box"
    refined = kpred.fit(known, category="chair", frame="known", deform="free", top_k=5)
    assert refined.source.error < fit.source.error


def test_a_partial_scan_in_the_known_frame_gives_the_whole_chair(chair: np.ndarray) -> None:
    whole = unit_box_frame(chair).to_unit(chair)
    seen = whole[whole[:, 0] < 0.05]
    fit = kpred.fit(seen, category="chair", frame="known", partial=True)
    assert fit.partial
    reach = fit.mesh.vertices.max(axis=0) - whole.max(axis=0)
    assert abs(reach[0]) < 0.35, "the unseen side must be there"
    assert fit.keypoint_confidence.min() < 0.5 < fit.keypoint_confidence.max()


def test_the_same_scan_gives_the_same_fit(chair: np.ndarray) -> None:
    first, second = kpred.fit(chair), kpred.fit(chair)
    assert np.array_equal(first.mesh.vertices, second.mesh.vertices)
    assert first.source.model_id == second.source.model_id


def test_the_record_is_plain_json(chair: np.ndarray) -> None:
    fit = kpred.fit(chair, category="chair")
    record = json.loads(json.dumps(fit.to_json(), allow_nan=False))
    assert record["model_id"] == fit.source.model_id
    assert {metric["unit"] for metric in record["metrics"]} == {"unit box squared", "scan units"}
    matrix = np.array(record["unit_box_to_scan"])
    corner = matrix[:3, :3] @ np.array([0.3, -0.2, 0.9]) + matrix[:3, 3]
    assert np.allclose(corner, fit.frame.from_unit(np.array([0.3, -0.2, 0.9])))


def test_result_lies_near_the_scan_in_its_own_units(chair: np.ndarray) -> None:
    fit = kpred.fit(chair, category="chair")
    count = 60_000
    surface = torch.from_numpy(_sample(fit.mesh.vertices, fit.mesh.faces, count))[None]
    squared, _ = nearest_reference(torch.from_numpy(chair[::4])[None], surface)
    stated = next(metric for metric in fit.metrics if metric.name == "mean_scan_to_result")
    assert stated.unit == "scan units"
    # Of other points of the scan, and to the surface itself: samples of it are farther, by less than their spacing.
    sampled, apart = float(squared.sqrt().mean()), float(np.sqrt(fit.mesh.area / count))
    assert 0.9 * stated.value < sampled < 1.1 * stated.value + apart


@pytest.mark.slow
def test_all_real_crops(shared_data: Path) -> None:
    """A mesh in metres whose box lies over the scan's."""
    files = sorted((shared_data / "real" / "s3dis").glob("*.ply"))
    assert files
    beside = []
    for file in files:
        scan = kpred.read_scan(file)
        fit = kpred.fit(file, category=file.stem.split("_")[0])
        low, high = np.quantile(scan, 0.01, axis=0), np.quantile(scan, 0.99, axis=0)
        lowest, highest = fit.mesh.bounds
        common = np.clip(np.minimum(high, highest) - np.maximum(low, lowest), 0, None).prod()
        if common < 0.5 * (high - low).prod() or ((highest - lowest) > 2.0 * (high - low) + 0.3).any():
            beside.append(file.name)
            assert fit.confidence < 0.5, f"{file.name}: a result beside its scan must not be trusted"
    # Of these two long cabinets what lies on top and one end that reaches the floor stay outside of the result.
    assert set(beside) <= {"cabinet_07.ply", "cabinet_09.ply"}


@pytest.mark.parametrize(
    ("points", "words"),
    [
        (np.zeros((0, 3)), "point"),
        (np.random.default_rng(0).random((63, 3)), "64"),
        (np.full((500, 3), 2.0), "point"),
        (np.linspace(0, 1, 500)[:, None] * np.ones(3), "line"),
        (np.full((500, 3), np.nan), "NaN|finite"),
        (np.zeros((500, 2)), "3"),
    ],
    ids=["empty", "few", "one point", "line", "NaN", "two columns"],
)
def test_hopeless_scans(points: np.ndarray, words: str) -> None:
    with pytest.raises(ScanError, match=words):
        kpred.fit(points)


def test_a_few_broken_points_do_no_harm(chair: np.ndarray) -> None:
    broken = chair.copy()
    broken[::50] = np.nan
    assert kpred.fit(broken, category="chair").source.error < 0.05


def test_impossible_arguments(chair: np.ndarray, tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="top_k"):
        kpred.fit(chair, top_k=0)
    with pytest.raises(ConfigError, match="up axis"):
        kpred.fit(chair, up="w")
    with pytest.raises(ConfigError, match="known"):
        kpred.fit(chair * 1000, frame="known")
    with pytest.raises((ModelError, DatabaseError), match="sofa"):
        kpred.fit(chair, category="sofa")
    with pytest.raises(ModelError, match="no model folder"):
        kpred.fit(chair, model=tmp_path / "nothing")
    with pytest.raises(DatabaseError):
        kpred.fit(chair, database=tmp_path / "nothing.kpred")
    with pytest.raises(ScanError, match=r"nothing\.ply"):
        kpred.fit(tmp_path / "nothing.ply")


def test_other_categories_are_searched_by_the_shared_network_without_the_recognizer(tmp_path: Path) -> None:
    lamps = generate("lamp", 3, seed=77)
    model = kpred.load_model()
    shapes = [(str(lamps.model_id[i]), "lamp", "source", lamps[i]) for i in range(len(lamps))]
    build_database(tmp_path / "lamps.kpred", shapes, model)
    scan = _sample(lamps[0].vertices, lamps[0].faces) * 100 + [5, 7, -3]
    fit = kpred.fit(scan, database=tmp_path / "lamps.kpred", up="y")
    assert (fit.category, fit.source.model_id) == ("lamp", str(lamps.model_id[0]))


def test_the_recognizer_is_used_for_categories_that_it_knows(database: kpred.Database) -> None:
    model = kpred.load_model()
    assert Context(model, database, ("chair", "table")).recognizer is model.recognizer is not None
    assert Context(model, database, ("chair", "spaceship")).recognizer is None
