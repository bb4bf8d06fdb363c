"""Laws of the pinhole camera, and the files its numbers are read from."""

import json
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from kpred.errors import ConfigError, KpredError, ScanError
from kpred.shapes.camera import Camera
from kpred.shapes.intrinsics_file import read_intrinsics
from kpred.shapes.pose_file import read_pose

K = np.array([[577.9, 0.0, 319.5], [0.0, 578.7, 239.5], [0.0, 0.0, 1.0]])
DIGITS = "577.9 0 319.5\n0 578.7 239.5\n0 0 1\n"


def random_camera(rng: np.random.Generator) -> Camera:
    pose = np.eye(4)
    pose[:3, :3] = Rotation.random(random_state=int(rng.integers(1 << 30))).as_matrix()
    pose[:3, 3] = rng.normal(size=3) * 3
    fx, fy, skew = rng.uniform(100, 900), rng.uniform(100, 900), rng.normal() * 2
    return Camera(np.array([[fx, skew, 310.0], [0, fy, 250.0], [0, 0, 1]]), 640, 480, pose)


@pytest.mark.parametrize("shape", [(), (7,), (3, 5)])
def test_unproject_is_the_inverse_of_project(shape: tuple[int, ...], rng: np.random.Generator) -> None:
    for _ in range(20):
        camera = random_camera(rng)
        pixels = rng.uniform(0, 480, size=(*shape, 2))
        depth = rng.uniform(0.1, 9, size=shape)
        points = camera.unproject(pixels, depth)
        assert points.shape == (*shape, 3)
        again, deep = camera.project(points)
        np.testing.assert_allclose(again, pixels, atol=1e-8)
        np.testing.assert_allclose(deep, depth, atol=1e-10)


def test_projection_is_that_of_homogeneous_matrices(rng: np.random.Generator) -> None:
    camera = random_camera(rng)
    points = camera.unproject(rng.uniform(0, 480, size=(50, 2)), rng.uniform(1, 5, size=50))
    homogeneous = np.linalg.inv(camera.camera_to_world) @ np.c_[points, np.ones(50)].T
    image = camera.intrinsics @ homogeneous[:3]
    np.testing.assert_allclose(camera.project(points)[0], (image[:2] / image[2]).T, atol=1e-8)


def test_axes_are_right_down_forward() -> None:
    camera = Camera(K, 640, 480)
    pixels, depth = camera.project(np.array([[0, 0, 2.0], [0.5, 0, 2], [0, 0.5, 2], [0, 0, -1]]))
    np.testing.assert_allclose(pixels[0], [319.5, 239.5])
    assert pixels[1, 0] > pixels[0, 0] and pixels[1, 1] == pixels[0, 1]
    assert pixels[2, 1] > pixels[0, 1] and pixels[2, 0] == pixels[0, 0]
    np.testing.assert_allclose(depth, [2, 2, 2, -1])


def test_the_origin_is_seen_nowhere_and_every_ray_leaves_it(rng: np.random.Generator) -> None:
    camera = random_camera(rng)
    points = camera.unproject(np.full((4, 2), [100.0, 50.0]), np.array([0.0, 1, 2, 3]))
    np.testing.assert_allclose(points[0], camera.origin)
    np.testing.assert_allclose(np.diff(points, axis=0), np.broadcast_to(points[1] - points[0], (3, 3)), atol=1e-9)


def test_a_resized_camera_sees_the_same_through_the_same_part_of_the_picture(rng: np.random.Generator) -> None:
    camera = random_camera(rng)
    large = camera.resized(1280, 960)
    borders = np.array([[-0.5, -0.5], [639.5, 479.5]]), np.array([[-0.5, -0.5], [1279.5, 959.5]])
    depth = np.array([2.0, 2.0])
    np.testing.assert_allclose(camera.unproject(borders[0], depth), large.unproject(borders[1], depth), atol=1e-9)
    np.testing.assert_allclose(large.resized(640, 480).intrinsics, camera.intrinsics, atol=1e-9)
    with pytest.raises(ConfigError, match="proportions"):
        camera.resized(640, 640)


@pytest.mark.parametrize(
    ("name", "text", "size"),
    [
        ("k.txt", DIGITS, None),
        ("k.txt", "577.9 0 319.5 0\n0 578.7 239.5 0\n0 0 1 0\n0 0 0 1\n", None),
        ("k.txt", "577.9 578.7 319.5 239.5", None),
        ("k.txt", "# fx, fy, cx, cy\n577.9, 578.7, 319.5, 239.5\n", None),
        ("k.json", json.dumps(K.tolist()), None),
        ("k.json", json.dumps({"K": K.tolist()}), None),
        ("k.json", json.dumps({"fx": 577.9, "fy": 578.7, "cx": 319.5, "cy": 239.5}), None),
        ("k.json", json.dumps({"width": 640, "height": 480, "intrinsic_matrix": K.T.ravel().tolist()}), (640, 480)),
        ("k.json", json.dumps({"width": 640, "height": 480, "camera_matrix": K.ravel().tolist()}), (640, 480)),
        (
            "k.json",
            json.dumps({"intrinsic": {"width": 640, "height": 480, "intrinsic_matrix": K.T.ravel().tolist()}}),
            (640, 480),
        ),
    ],
)
def test_every_way_to_write_intrinsics(name: str, text: str, size: tuple[int, int] | None, tmp_path: Path) -> None:
    (tmp_path / name).write_text(text)
    matrix, found = read_intrinsics(tmp_path / name)
    np.testing.assert_array_equal(matrix, K)
    assert found == size


def test_every_way_to_write_a_pose(tmp_path: Path, rng: np.random.Generator) -> None:
    pose = random_camera(rng).camera_to_world
    np.savetxt(tmp_path / "four.txt", pose)
    np.savetxt(tmp_path / "three.txt", pose[:3])
    np.savetxt(tmp_path / "row.txt", pose.reshape(1, 16))
    (tmp_path / "bare.json").write_text(json.dumps(pose.tolist()))
    (tmp_path / "named.json").write_text(json.dumps({"camera_to_world": pose.tolist()}))
    np.save(tmp_path / "pose.npy", pose)
    for file in tmp_path.iterdir():
        np.testing.assert_allclose(read_pose(file), pose, atol=1e-12, err_msg=file.name)


def test_a_pose_of_few_digits_becomes_a_rotation(tmp_path: Path, rng: np.random.Generator) -> None:
    pose = random_camera(rng).camera_to_world
    np.savetxt(tmp_path / "pose.txt", pose, fmt="%.3f")
    rotation = read_pose(tmp_path / "pose.txt")[:3, :3]
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-12)
    np.testing.assert_allclose(rotation, pose[:3, :3], atol=2e-3)


@pytest.mark.parametrize(
    ("name", "text", "word"),
    [
        ("k.txt", "577 0 320\n0 0 240\n0 0 1", "positive"),
        ("k.txt", "577 0 320\n0 577 240\n0 0 2", "rows must be"),
        ("k.txt", "577 0 320\n0 577 240", "2 x 3"),
        ("k.txt", "577 0 nan\n0 577 240\n0 0 1", "NaN"),
        ("k.txt", "577 0 320\n0 577\n0 0 1", "not numbers"),
        ("k.txt", "fx fy cx cy", "not numbers"),
        ("k.txt", "# nothing\n", "matrix"),
        ("k.json", "{", "readable"),
        ("k.json", json.dumps({"focal": 5}), "fx, fy"),
        ("k.json", json.dumps({"fx": 5, "fy": 5, "cx": 1, "cy": 1, "width": 0, "height": 4}), "whole numbers"),
        ("k.json", "null", "number"),
        ("k.yml7", DIGITS, "extension"),
        ("k.npy", "no array", "readable"),
    ],
)
def test_bad_intrinsics_are_refused_by_name(name: str, text: str, word: str, tmp_path: Path) -> None:
    (tmp_path / name).write_text(text)
    with pytest.raises(ConfigError, match=word) as caught:
        read_intrinsics(tmp_path / name)
    assert name in str(caught.value)


@pytest.mark.parametrize(
    ("matrix", "kind", "word"),
    [
        (np.full((4, 4), -np.inf), ScanError, "tracking was lost"),
        (np.diag([2.0, 2, 2, 1]), ConfigError, "not a rotation"),
        (np.diag([1.0, 1, -1, 1]), ConfigError, "not a rotation"),
        (np.eye(4) + np.eye(4, k=-3), ConfigError, "last row"),
        (np.eye(5), ConfigError, "5 x 5"),
    ],
)
def test_bad_poses_are_refused_by_name(matrix: np.ndarray, kind: type[KpredError], word: str, tmp_path: Path) -> None:
    np.savetxt(tmp_path / "frame-7.pose.txt", matrix)
    with pytest.raises(kind, match=word) as caught:
        read_pose(tmp_path / "frame-7.pose.txt")
    assert "frame-7" in str(caught.value)


def test_missing_files_and_cameras_without_pixels(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="no such file"):
        read_pose(tmp_path / "none.txt")
    with pytest.raises(ConfigError, match="no such file"):
        read_intrinsics(tmp_path / "none.npy")
    with pytest.raises(ConfigError, match="at least one pixel"):
        Camera(K, 0, 480)
