"""Cameras as RealSense, ROS, ScanNet, ARKit, nerfstudio, Azure Kinect, ... write them."""

import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from scipy.spatial.transform import Rotation

from kpred.errors import ConfigError
from kpred.shapes.depth import read_depth
from kpred.shapes.depth_camera import depth_camera
from kpred.shapes.furniture_size import size_warning
from kpred.shapes.intrinsics_file import read_intrinsics_file
from kpred.shapes.pose_file import read_pose

K = [[290.0, 0, 159.5], [0, 291.0, 119.5], [0, 0, 1]]
FLAT = [290.0, 0.0, 159.5, 0.0, 291.0, 119.5, 0.0, 0.0, 1.0]
PLAIN = {"width": 320, "height": 240}
SIZE = (320, 240)

SCANNET = """colorHeight = 968
colorWidth = 1296
colorToDepthExtrinsics = 1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1
depthHeight = 240
depthWidth = 320
fx_color = 1170.18
fx_depth = 290.0
fy_color = 1170.18
fy_depth = 291.0
mx_color = 647.7
mx_depth = 159.5
my_color = 483.7
my_depth = 119.5
"""
INFO = """m_versionNumber = 4
m_depthWidth = 320
m_depthHeight = 240
m_depthShift = 1000
m_calibrationDepthIntrinsic = 290 0 159.5 0 0 291 119.5 0 0 0 1 0 0 0 0 1
"""
ROS = """image_width: 320
image_height: 240
camera_matrix:
  rows: 3
  cols: 3
  data: [290.0, 0.0, 159.5, 0.0, 291.0, 119.5, 0.0, 0.0, 1.0]
distortion_model: plumb_bob
"""
OPENCV = """%YAML:1.0
---
image_width: 320
image_height: 240
camera_matrix: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 290., 0., 159.5, 0., 291., 119.5, 0., 0., 1. ]
"""
OST = """# oST version 5.0 parameters

[image]

width
320

height
240

[narrow_stereo]

camera matrix
290.0 0.0 159.5
0.0 291.0 119.5
0.0 0.0 1.0

distortion
0.1 -0.2 0.0 0.0 0.0

projection
290.0 0.0 159.5 0.0
0.0 291.0 119.5 0.0
0.0 0.0 1.0 0.0
"""
ORBBEC = """[ColorIntrinsic]
fx = 9
fy = 9
cx = 1
cy = 1
[DepthIntrinsic]
fx = 290
fy = 291
cx = 159.5
cy = 119.5
width = 320
height = 240
"""
OPENCV_XML = """<?xml version="1.0"?>
<!DOCTYPE x [<!ENTITY a "aaaa">]>
<opencv_storage>
<image_width>320</image_width>
<image_height>240</image_height>
<camera_matrix type_id="opencv-matrix">
  <rows>3</rows>
  <cols>3</cols>
  <dt>d</dt>
  <data>
    290. 0. 159.5 0. 291. 119.5 0. 0. 1.</data></camera_matrix>
</opencv_storage>
"""
FOCAL = {"fx": 290.0, "fy": 291.0, "cx": 159.5, "cy": 119.5}
LISTS = {"FocalLength": [290.0, 291.0], "PrincipalPoint": [159.5, 119.5]}
ORB = """%YAML:1.0
Camera.fx: 290.0
Camera.fy: 291.0
Camera.cx: 159.5
Camera.cy: 119.5
Camera.width: 320
Camera.height: 240
DepthMapFactor: 5000.0
"""
KALIBR = "cam0:\n  camera_model: pinhole\n  intrinsics: [290.0, 291.0, 159.5, 119.5]\n  resolution: [320, 240]\n"
COLMAP = "# Camera list\n# CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]\n1 PINHOLE 320 240 290 291 159.5 119.5\n"


def keyed(*names: str, **more: object) -> str:
    return json.dumps(dict(zip(names, (290.0, 291.0, 159.5, 119.5), strict=True)) | more)


REALSENSE = PLAIN | {"depth_scale": 0.0002500000118743628, "model": "Inverse Brown Conrady", "coeffs": [0] * 5}
AZURE = {
    "CalibrationInformation": {
        "Cameras": [
            {
                "Purpose": "CALIBRATION_CameraPurposePhotoVideo",
                "Intrinsics": {"ModelParameters": [0.5, 0.6, 0.47, 0.63, 0, 0]},
                "SensorWidth": 4096,
                "SensorHeight": 3072,
            },
            {
                "Purpose": "CALIBRATION_CameraPurposeDepth",
                "Intrinsics": {"ModelParameters": [0.5, 0.5, 0.49, 0.492, 0, 0]},
                "SensorWidth": 1024,
                "SensorHeight": 1024,
            },
        ]
    }
}


@pytest.mark.parametrize(
    ("name", "text", "size", "units"),
    [
        ("RealSense.json", keyed("fx", "fy", "ppx", "ppy", **REALSENSE), SIZE, 4000),
        ("RealSense.txt", "Width: 320\nHeight: 240\nPPX: 159.5\nPPY: 119.5\nFx: 290\nFy: 291\n", SIZE, None),
        ("ros1.json", json.dumps(PLAIN | {"K": FLAT, "D": [0] * 5}), SIZE, None),
        ("ros2.json", json.dumps(PLAIN | {"k": FLAT, "d": [0] * 5, "p": [9.0] * 12}), SIZE, None),
        ("ros.yaml", ROS, SIZE, None),
        ("opencv.yml", OPENCV, SIZE, None),
        ("orb.yaml", ORB, SIZE, 5000),
        ("kalibr.yaml", KALIBR, SIZE, None),
        ("scene0000_00.txt", SCANNET, SIZE, None),
        ("_info.txt", INFO, SIZE, 1000),
        ("frame.pincam", "320 240 290 291 159.5 119.5\n", SIZE, None),
        ("pincam.txt", "320 240 290 291 159.5 119.5\n", SIZE, None),
        ("transforms.json", keyed("fl_x", "fl_y", "cx", "cy", w=320, h=240, frames=[]), SIZE, None),
        ("cameras.txt", COLMAP, SIZE, None),
        ("bop.json", json.dumps({"cam_K": FLAT, "depth_scale": 0.1}), None, 10_000),
        ("open3d.json", json.dumps(PLAIN | {"intrinsic_matrix": np.ravel(K, "F").tolist()}), SIZE, None),
        ("record3d.json", json.dumps({"K": np.ravel(K, "F").tolist(), "w": 320, "h": 240}), SIZE, None),
        ("matrix.json", json.dumps({"depth": {"intrinsics": K, **PLAIN}}), SIZE, None),
        ("nested.json", json.dumps({"color": {"K": [9.0, 0, 1, 0, 9, 1, 0, 0, 1]}, "depth": {"K": FLAT}}), None, None),
        ("words.json", json.dumps({"fx": "290", "fy": "291.0", "cx": "159.5", "cy": "1.195e2"}), None, None),
        ("info.yaml", json.dumps(PLAIN | {"K": FLAT, "roi": {"height": 0, "width": 0, "x_offset": 0}}), SIZE, None),
        ("camera_matrix.csv", "290.0,0,159.5\n0,291.0,119.5\n0,0,1\n", None, None),
        ("matlab.txt", "K = [290 0 159.5; 0 291 119.5; 0 0 1];\n", None, None),
        ("numpy.txt", f"array({K})\n".replace("], [", "],\n       ["), None, None),
        ("librealsense.txt", "[ 320x240  p[159.5 119.5]  f[290 291]  Brown Conrady [0 0 0 0 0] ]\n", SIZE, None),
        ("one line.txt", "width: 320, height: 240, ppx: 159.5, ppy: 119.5, fx: 290.0, fy: 291.0\n", SIZE, None),
        ("ost.txt", OST, SIZE, None),
        ("ost.ini", OST, SIZE, None),
        ("ZED.conf", "[LEFT]\nfx=290\nfy=291\ncx=159.5\ncy=119.5\n[RIGHT]\nfx=9\nfy=9\ncx=1\ncy=1\n", None, None),
        ("sections.txt", ORBBEC, SIZE, None),
        ("opencv.xml", OPENCV_XML, SIZE, None),
        ("arkit.json", json.dumps({"intrinsics": np.ravel(K, "F").tolist(), "imageResolution": SIZE}), SIZE, None),
        ("arkit columns.json", json.dumps({"cameraIntrinsics": np.transpose(K).tolist()}), None, None),
        ("replica.json", json.dumps({"camera": {**FOCAL, "w": 320, "h": 240, "scale": 6553.5}}), SIZE, 6553.5),
        ("scene.json", json.dumps({**FOCAL, "w": 320, "h": 240, "scale": 0.33}), SIZE, None),
        ("matlab.json", json.dumps({**LISTS, "ImageSize": [240, 320]}), SIZE, None),
        ("lists.json", json.dumps({"focal_length": [290.0, 291.0], "principal_point": [159.5, 119.5]}), None, None),
    ],
)
def test_intrinsics_of_many_programs(tmp_path: Path, name: str, text: str, size: object, units: float | None) -> None:
    for encoding in ("utf-8", "utf-8-sig"):
        (tmp_path / name).write_text(text, encoding=encoding)
        found = read_intrinsics_file(tmp_path / name, SIZE)
        np.testing.assert_allclose(found.matrix, K)
        assert found.size == size
        assert found.units_per_metre == (None if units is None else pytest.approx(units))


def test_intrinsics_in_archives(tmp_path: Path) -> None:
    for name in ("K", "mtx", "camera_matrix"):
        np.savez(tmp_path / "a.npz", **{name: np.array(K)}, dist=np.zeros(5), pictures=np.zeros((2, 3, 4)))
        np.testing.assert_allclose(read_intrinsics_file(tmp_path / "a.npz").matrix, K)


@pytest.mark.parametrize(("key", "angle"), [("camera_angle_x", 2 * np.arctan(0.5)), ("hfov", 53.13010235)])
def test_intrinsics_from_the_field_of_view(tmp_path: Path, key: str, angle: float) -> None:
    (tmp_path / "a.json").write_text(json.dumps({key: angle, "w": 320, "h": 240}))
    found = read_intrinsics_file(tmp_path / "a.json")
    np.testing.assert_allclose(found.matrix, [[320, 0, 160], [0, 320, 120], [0, 0, 1]], atol=1e-5)
    assert found.size == SIZE


def test_azure_kinect_counts_from_the_whole_sensor(tmp_path: Path) -> None:
    (tmp_path / "a.json").write_text(json.dumps(AZURE))
    for picture, side, left, top in (((640, 576), 1024, 192, 180), ((320, 288), 512, 96, 90), ((512, 512), 512, 0, 0)):
        found = read_intrinsics_file(tmp_path / "a.json", picture)
        assert found.size == picture
        np.testing.assert_allclose(found.matrix[0], [0.49 * side, 0, 0.5 * side - left - 0.5])
        np.testing.assert_allclose(found.matrix[1], [0, 0.492 * side, 0.5 * side - top - 0.5])


def test_of_several_cameras_the_one_of_the_picture_is_taken(tmp_path: Path) -> None:
    (tmp_path / "a.txt").write_text(SCANNET)
    assert read_intrinsics_file(tmp_path / "a.txt", (1296, 968)).matrix[0, 0] == 1170.18
    assert read_intrinsics_file(tmp_path / "a.txt", (64, 48)).matrix[0, 0] == 290


def test_intrinsics_of_a_larger_picture_are_scaled(tmp_path: Path) -> None:
    (tmp_path / "a.json").write_text(json.dumps(dict(fx=1160, fy=1164, cx=639.5, cy=479.5, width=1280, height=960)))
    camera = depth_camera(np.zeros((240, 320)), read_intrinsics_file(tmp_path / "a.json"), np.eye(4), "d", "a.json")
    np.testing.assert_allclose(camera.intrinsics, K)


def test_intrinsics_without_a_size_that_are_of_a_larger_picture(tmp_path: Path) -> None:
    """Those of the photograph are scaled where it is given, and refused where it is not."""
    (tmp_path / "k.txt").write_text("580 582 319.5 239.5")
    found, depth = read_intrinsics_file(tmp_path / "k.txt"), np.zeros((240, 320))
    camera = depth_camera(depth, found, np.eye(4), "d.png", "k.txt", photograph=(640, 480))
    np.testing.assert_allclose(camera.intrinsics, K)
    with pytest.raises(ConfigError, match=r"k\.txt: the principal point \(320, 240\) is not that of a depth picture"):
        depth_camera(depth, found, np.eye(4), "d.png", "k.txt")
    (tmp_path / "k.txt").write_text("290 291 159.5 119.5")
    own = depth_camera(depth, read_intrinsics_file(tmp_path / "k.txt"), np.eye(4), "d.png", "k.txt", (640, 480))
    np.testing.assert_allclose(own.intrinsics, K)


def test_the_unit_of_the_camera_file_is_for_whole_numbers_only(tmp_path: Path) -> None:
    Image.fromarray(np.full((4, 5), 8000, np.uint16)).save(tmp_path / "d.png")
    np.save(tmp_path / "d.npy", np.full((4, 5), 2.0, np.float32))
    for name in ("d.png", "d.npy"):
        np.testing.assert_allclose(read_depth(tmp_path / name, None, 4000.0), 2.0)
    np.testing.assert_allclose(read_depth(tmp_path / "d.png", 1000.0, 4000.0), 8.0)


def test_sizes_that_no_furniture_has_are_reported() -> None:
    assert size_warning(np.array([0.5, 0.9, 0.5]), "chair", "x") is None
    for size, word in ((3.6, "large"), (0.1, "small")):
        assert f"too {word} for a chair" in str(
            size_warning(np.array([0.05, size, 0.05]), "chair", "give --depth-scale")
        )


@pytest.mark.parametrize(
    "text",
    [
        "a: &a [1]\nb: &b [*a, *a]\nc: [*b, *b]\n",  # would grow without end
        "{" * 50,
        '{"fx": 1e400, "fy": 1, "cx": 1, "cy": 1}',
        '{"K": [' + "9" * 5000 + "]}",
        "[" * 100_000,
        '{"fx": ' + "1" * 4000 + ', "fy": 1, "cx": 1, "cy": 1}',
    ],
)
@pytest.mark.parametrize("name", ["a.yaml", "a.json"])
def test_hostile_camera_files_are_refused(tmp_path: Path, text: str, name: str) -> None:
    (tmp_path / name).write_text(text)
    for reader in (read_intrinsics_file, read_pose):
        with pytest.raises(ConfigError, match=name):
            reader(tmp_path / name)


def test_aliases_of_yaml_are_not_followed(tmp_path: Path) -> None:
    (tmp_path / "a.yaml").write_text("k: &k [290, 0, 159.5, 0, 291, 119.5, 0, 0, 1]\nother: *k\n")
    with pytest.raises(ConfigError, match="aliases are not read"):
        read_intrinsics_file(tmp_path / "a.yaml")


# ---- poses


@pytest.fixture
def pose(rng: np.random.Generator) -> np.ndarray:
    matrix = np.eye(4)
    matrix[:3, :3] = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    matrix[:3, 0] *= np.sign(np.linalg.det(matrix[:3, :3]))
    matrix[:3, 3] = rng.normal(size=3)
    return matrix


def axes(values: np.ndarray) -> dict[str, float]:
    return dict(zip("xyzw", values.tolist(), strict=False))


def test_every_key_has_its_convention(tmp_path: Path, pose: np.ndarray) -> None:
    from scipy.spatial.transform import Rotation

    opengl = pose * [1, -1, -1, 1]
    inverse = np.linalg.inv(pose)
    polycam = {f"t_{row}{column}": opengl[row, column] for row in range(3) for column in range(4)}
    quaternion = Rotation.from_matrix(pose[:3, :3]).as_quat()
    frames = [{"file_path": "images/a.png", "transform_matrix": np.eye(4).tolist()}]
    frames += [{"file_path": "images/b.png", "transform_matrix": opengl.tolist()}]
    contents = {
        "cv.json": {"camera_to_world": pose.tolist()},
        "three.json": {"c2w": pose[:3].tolist()},
        "gl.json": {"transform_matrix": opengl.tolist()},
        "arkit.json": {"cameraPoseARFrame": opengl.ravel().tolist()},
        "polycam.json": polycam,
        "inverse.json": {"world_to_camera": inverse.tolist()},
        "open3d.json": {"extrinsic": inverse.ravel("F").tolist(), "intrinsic": {}},
        "frames.json": {"frames": frames},
        "ros.json": {"header": {}, "pose": {"position": axes(pose[:3, 3]), "orientation": axes(quaternion)}},
        "tf.json": {"transform": {"translation": axes(pose[:3, 3]), "rotation": axes(quaternion)}},
        "bop.json": {"cam_R_w2c": inverse[:3, :3].ravel().tolist(), "cam_t_w2c": (1000 * inverse[:3, 3]).tolist()},
        "scannetpp.json": {"a": {"pose": np.eye(4).tolist()}, "b": {"pose": pose.tolist(), "aligned_pose": "none"}},
    }
    for name, content in contents.items():
        (tmp_path / name).write_text(json.dumps(content))
        np.testing.assert_allclose(read_pose(tmp_path / name, "depth/b.png"), pose, atol=1e-9, err_msg=name)
    for before in ("", "1305031102.175304 "):
        numbers = [*pose[:3, 3], *quaternion]
        (tmp_path / "tum.txt").write_text(before + " ".join(map(repr, map(float, numbers))))
        np.testing.assert_allclose(read_pose(tmp_path / "tum.txt"), pose, atol=1e-9)


def test_a_pose_among_several_frames_must_be_that_of_the_picture(tmp_path: Path) -> None:
    frames = [{"file_path": name, "transform_matrix": np.eye(4).tolist()} for name in ("a.png", "b.png")]
    (tmp_path / "t.json").write_text(json.dumps({"frames": frames}))
    with pytest.raises(ConfigError, match=r"t\.json: it holds the poses of 2 frames"):
        read_pose(tmp_path / "t.json", "c.png")
    poses = {"a": {"pose": np.eye(4).tolist()}, "b": {"pose": np.diag([1.0, -1, -1, 1]).tolist()}}
    (tmp_path / "t.json").write_text(json.dumps(poses))
    with pytest.raises(ConfigError, match=r"t\.json: it holds 2 poses"):
        read_pose(tmp_path / "t.json", "c.png")


def test_further_keys_of_poses(tmp_path: Path, pose: np.ndarray) -> None:
    inverse = np.linalg.inv(pose)
    quaternion = Rotation.from_matrix(pose[:3, :3]).as_quat().tolist()
    texts = {
        "a.json": json.dumps({"T_world_camera": pose.tolist()}),
        "b.json": json.dumps({"world_from_camera": pose.tolist()}),
        "c.json": json.dumps({"cam_from_world": inverse.tolist()}),
        "d.json": json.dumps({"T_camera_world": inverse.tolist()}),
        "e.json": json.dumps({"extrinsics": inverse.tolist()}),
        "f.json": json.dumps(dict(zip(("tx", "ty", "tz", "qx", "qy", "qz", "qw"), [*pose[:3, 3], *quaternion]))),
        "g.log": "0 0 1\n" + "\n".join(" ".join(map(str, row)) for row in pose.tolist()),
    }
    for name, text in texts.items():
        (tmp_path / name).write_text(text)
        np.testing.assert_allclose(read_pose(tmp_path / name), pose, atol=1e-7, err_msg=name)
