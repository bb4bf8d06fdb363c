"""Poses: given rotations are read as documented, yaw hypotheses hold the true one, up is found."""

import json
from importlib.metadata import EntryPoint, EntryPoints
from pathlib import Path

import numpy as np
import pytest
import torch

from kpred.errors import ConfigError
from kpred.fitting.hypotheses import thickened
from kpred.ops.occlusion import depth_scan
from kpred.ops.rotations import UP_AXES, upright_rotation, yaw_rotation
from kpred.pose import estimators as pose
from kpred.pose.estimators import IdentityPose, PoseEstimator, UprightPose, given_pose, pose_estimator
from kpred.pose.proposals import generate_poses
from kpred.pose.up_axis import find_up
from kpred.pose.yaw import rectangle_yaw, yaw_hypotheses
from kpred.shapes.mesh import Mesh
from kpred.synthetic.generator import generate

# A round seat or top says nothing about its yaw.
ROUND = ("round", "pedestal", "tripod", "stool", "tulip", "barrel", "drum")


def seen(mesh: Mesh, seed: int, count: int = 2500) -> np.ndarray:
    """Depth scan from anywhere around, above."""
    rng = np.random.default_rng(seed)
    size = float(np.linalg.norm(np.ptp(mesh.vertices, axis=0)))
    yaw, rise = rng.uniform(-np.pi, np.pi), rng.uniform(0.15, 0.8)
    camera = 2.2 * size * np.array([np.sin(yaw) * np.cos(rise), np.sin(rise), np.cos(yaw) * np.cos(rise)])
    vertices, faces = torch.tensor(mesh.vertices), torch.tensor(mesh.faces).long()
    generator = torch.Generator().manual_seed(seed)
    scan = depth_scan(vertices, faces, torch.tensor(camera).float(), count, 100, 0.006, generator=generator)
    return scan.double().numpy()


def quarter_error(yaw: float, truth: float) -> float:
    """Degrees, modulo quarter turns."""
    return abs(np.degrees((yaw - truth + np.pi / 4) % (np.pi / 2) - np.pi / 4))


@pytest.fixture(scope="module")
def scans() -> list[tuple[str, np.ndarray]]:
    found = []
    for category in ("chair", "table", "cabinet"):
        pack = generate(category, 16, 7)
        found += [(pack[row].name, seen(pack[row], row)) for row in range(len(pack))]
    return [(name, scan) for name, scan in found if not any(word in name for word in ROUND)]


def test_yaw_is_among_the_hypotheses(scans: list[tuple[str, np.ndarray]]) -> None:
    rng = np.random.default_rng(0)
    missed, rectangle_missed = [], []
    for name, scan in scans:
        yaw = rng.uniform(-np.pi, np.pi)
        turned = scan @ yaw_rotation(yaw).T
        if min(quarter_error(found, -yaw) for found in yaw_hypotheses(turned)) > 5:
            missed.append(name)
        if quarter_error(rectangle_yaw(turned[:, [0, 2]]), -yaw) > 5:
            rectangle_missed.append(name)
    assert len(missed) <= 0.05 * len(scans), missed
    assert len(missed) <= len(rectangle_missed)


def test_the_first_direction_is_mostly_right(scans: list[tuple[str, np.ndarray]]) -> None:
    right = [quarter_error(yaw_hypotheses(scan)[0], 0.0) < 5 for _, scan in scans]
    assert np.mean(right) >= 0.92


def test_hypotheses_are_few_and_distinct(scans: list[tuple[str, np.ndarray]]) -> None:
    for _, scan in scans[::5]:
        yaws = yaw_hypotheses(scan @ yaw_rotation(0.7).T)
        assert 4 <= len(yaws) <= 8
        apart = [abs((a - b + np.pi) % (2 * np.pi) - np.pi) for i, a in enumerate(yaws) for b in yaws[:i]]
        assert min(apart) > np.radians(2.9)
        quarters = sorted(yaw % (2 * np.pi) for yaw in yaws[:4])
        assert np.allclose(np.diff(quarters), np.pi / 2)


def test_hypotheses_turn_with_the_scan(scans: list[tuple[str, np.ndarray]]) -> None:
    scan = scans[0][1]
    still = yaw_hypotheses(scan)[0]
    turned = yaw_hypotheses(scan @ yaw_rotation(1.1).T)[0]
    assert quarter_error(turned, still - 1.1) < 2


@pytest.mark.parametrize("up", list(UP_AXES))
def test_upright_takes_the_axis_to_y(up: str) -> None:
    rotation = upright_rotation(up)
    assert np.allclose(rotation @ np.array(UP_AXES[up], float), [0, 1, 0])
    assert np.allclose(rotation @ rotation.T, np.eye(3))
    assert np.linalg.det(rotation) == pytest.approx(1.0)


def test_up_is_mostly_among_the_found(scans: list[tuple[str, np.ndarray]]) -> None:
    found = {"y": [], "z": []}
    for _, scan in scans:
        for up, results in found.items():
            results.append(up in find_up(scan @ upright_rotation(up)))
    assert np.mean(found["y"]) >= 0.9
    assert np.mean(found["z"]) >= 0.9


def test_a_floor_tells_up() -> None:
    rng = np.random.default_rng(0)
    pack = generate("cabinet", 6, 3)
    for row in range(len(pack)):
        scan = seen(pack[row], row)
        low, high = scan.min(axis=0), scan.max(axis=0)
        floor = low + (rng.random((2500, 3)) * 1.6 - 0.3) * (high - low)
        floor[:, 1] = low[1] + rng.normal(size=len(floor)) * 0.003
        both = np.concatenate([scan, floor])
        assert "y" in find_up(both), pack[row].name
        assert "z" in find_up(both @ upright_rotation("z")), pack[row].name


def test_estimators_give_rotations(scans: list[tuple[str, np.ndarray]]) -> None:
    scan = scans[0][1]
    for name in ("identity", "upright"):
        estimator = pose_estimator(name)
        assert isinstance(estimator, PoseEstimator)
        for up in ("y", "z", "auto"):
            rotations = estimator(scan, up)
            assert 1 <= len(rotations) <= 8
            for rotation in rotations:
                assert np.allclose(rotation @ rotation.T, np.eye(3), atol=1e-9)
                assert np.linalg.det(rotation) == pytest.approx(1.0)


def test_shapes_without_a_direction_give_hypotheses(rng: np.random.Generator) -> None:
    sphere = rng.normal(size=(500, 3))
    sphere /= np.linalg.norm(sphere, axis=1, keepdims=True)
    line = np.outer(rng.random(100), [1.0, 2.0, 0.5])
    for points in (sphere, line, rng.random((64, 3)), np.zeros((64, 3)), sphere * 1e-6, sphere * 1e6):
        for up in ("y", "auto"):
            rotations = UprightPose()(points, up)
            assert rotations
            assert all(np.isfinite(rotation).all() for rotation in rotations)


def test_identity_only_turns_up() -> None:
    assert np.allclose(IdentityPose()(np.zeros((3, 3)), "y")[0], np.eye(3))
    assert np.allclose(IdentityPose()(np.zeros((3, 3)), "z")[0] @ [0, 0, 1], [0, 1, 0])


@pytest.mark.parametrize("kind", ["txt", "npy", "json", "pose.json"])
def test_given_pose_undoes_the_objects_rotation(tmp_path: Path, kind: str) -> None:
    rotation = yaw_rotation(0.8) @ upright_rotation("z")
    matrix = np.eye(4)
    matrix[:3, :3] = rotation * [0.7, 0.5, 2.0]
    matrix[:3, 3] = [4, 5, 6]
    path = tmp_path / f"pose.{kind}"
    if kind == "txt":
        np.savetxt(path, matrix)
    elif kind == "npy":
        np.save(path, matrix)
    else:
        path.write_text(json.dumps({"pose": matrix.tolist()} if kind == "pose.json" else matrix.tolist()))
    estimator = pose_estimator(f"given:{path}")
    assert np.allclose(estimator(np.zeros((3, 3)), "x")[0] @ rotation, np.eye(3), atol=1e-6)


@pytest.mark.parametrize(
    ("matrix", "message"),
    [
        (np.diag([1.0, 1.0, -1.0, 1.0]), "mirrors"),
        (np.diag([1.0, 0.0, 1.0, 1.0]), "squashes"),
        (np.eye(4) + np.eye(4, k=1) * [1, 0.3, 1, 1] * [[1], [1], [0], [0]], "sheared"),
        (np.eye(4)[:2], "shape"),
        (np.full((4, 4), np.nan), "finite"),
        (np.block([[np.eye(3), np.zeros((3, 1))], [np.array([[1.0, 2.0, 3.0, 1.0]])]]), "transposed"),
    ],
)
def test_what_is_no_pose_is_refused(tmp_path: Path, matrix: np.ndarray, message: str) -> None:
    np.save(tmp_path / "pose.npy", matrix)
    with pytest.raises(ConfigError, match=message):
        given_pose(str(tmp_path / "pose.npy"))


def test_unreadable_files_are_refused(tmp_path: Path) -> None:
    (tmp_path / "broken.json").write_text("{")
    (tmp_path / "words.txt").write_text("not a matrix")
    (tmp_path / "empty.json").write_text("{}")
    for name in ("broken.json", "words.txt", "empty.json", "missing.npy", "pose.yaml"):
        with pytest.raises(ConfigError):
            given_pose(str(tmp_path / name))


def test_scan2cad_annotation_and_derived_pairs_agree(shared_data: Path) -> None:
    folder = shared_data / "real" / "scan2cad_scene0470_00"
    pairs = json.loads((folder / "pairs" / "index.json").read_text())
    for number, entry in enumerate(pairs if isinstance(pairs, list) else pairs["pairs"]):
        given = given_pose(f"{folder / 'full_annotations.json'}#scene0470_00/{number}").rotation
        model_to_scan = np.array(entry["cad_to_scan"])[:3, :3]
        model_to_scan = model_to_scan / np.linalg.norm(model_to_scan, axis=0)
        # ShapeNet's front is -z; the canonical front is +z.
        assert np.allclose(given @ model_to_scan, np.diag([-1.0, 1.0, -1.0]), atol=1e-3)
    with pytest.raises(ConfigError, match="no such model"):
        given_pose(f"{folder / 'full_annotations.json'}#99")


def test_unknown_estimators_list_the_known() -> None:
    with pytest.raises(ConfigError, match="identity, upright, given:FILE"):
        pose_estimator("magic")
    with pytest.raises(ConfigError, match="given:FILE"):
        pose_estimator("given:")


class Sideways:
    """An estimator as another package would bring it."""

    def __call__(self, points: np.ndarray, up: str) -> list[np.ndarray]:
        return [yaw_rotation(np.pi / 2)]


def test_installed_packages_bring_estimators(monkeypatch: pytest.MonkeyPatch) -> None:
    good = EntryPoint("sideways", f"{__name__}:Sideways", pose.ENTRY_POINTS)
    bad = EntryPoint("broken", "no_such_module:Nothing", pose.ENTRY_POINTS)
    monkeypatch.setattr(pose, "entry_points", lambda group: EntryPoints([good, bad]))
    monkeypatch.setattr(
        EntryPoint, "load", lambda self: Sideways if self.name == "sideways" else __import__("nothing_")
    )
    assert np.allclose(pose_estimator("sideways")(np.zeros((3, 3)), "y")[0], yaw_rotation(np.pi / 2))
    with pytest.raises(ConfigError, match="broken.*cannot be loaded"):
        pose_estimator("broken")
    with pytest.raises(ConfigError, match="sideways"):
        pose_estimator("magic")


def test_without_a_recognizer_a_scan_is_first_taken_as_it_stands(scans: list[tuple[str, np.ndarray]]) -> None:
    found = generate_poses(scans[0][1] @ yaw_rotation(0.5).T, "y", None, None, ["chair", "table"])
    assert np.allclose(found[0].rotation, np.eye(3)) and found[0].log_odds == found[1].log_odds == 0
    assert {hypothesis.category for hypothesis in found} == {"chair", "table"} and len(found) == 10
    assert all(hypothesis.log_odds < 0 for hypothesis in found[2:])


def test_a_box_as_thin_as_a_plate_is_thickened_behind_its_front() -> None:
    low, high = np.array([-1.0, -1.0, 0.95]), np.array([1.0, 1.0, 1.0])
    thick_low, thick_high = thickened(low, high)
    assert np.array_equal(thick_high, high) and np.array_equal(thick_low[:2], low[:2])
    assert thick_high[2] - thick_low[2] == pytest.approx(0.7)
    for kept_low, kept_high in ((low, np.array([1.0, 1.0, 1.4])), (low * 0.5, np.array([0.5, 1.0, 1.0]))):
        assert all(np.array_equal(a, b) for a, b in zip(thickened(kept_low, kept_high), (kept_low, kept_high)))
