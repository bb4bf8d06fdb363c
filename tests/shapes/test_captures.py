"""Folders of depth pictures as phones, cameras and data sets record them: all give the same chair in the same world."""

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from kpred.errors import ConfigError, KpredError, ScanError
from kpred.scenes.scene import read_scene
from kpred.shapes.camera import Camera
from kpred.shapes.captures.capture import GL_TO_CV
from kpred.shapes.captures.masks import mask_finder
from kpred.shapes.captures.read import capture_scan, read_capture
from kpred.shapes.depth import scan_depth
from kpred.shapes.render import render_depth
from kpred.synthetic.generator import generate

WIDTH, HEIGHT = 64, 48
K = np.array([[60.0, 0, 31.5], [0, 60.0, 23.5], [0, 0, 1]])
LARGE = np.array([[450.0, 0, 239.75], [0, 450.0, 179.75], [0, 0, 1]])
"""The same view in a photograph of 480 x 360 pixels."""

PHOTOGRAPH = np.array([[1800.0, 0, 959.5], [0, 1800.0, 719.5], [0, 0, 1]])
"""The same view in one of 1920 x 1440."""

VIEWS = 4


def looking(place: np.ndarray, target: np.ndarray) -> np.ndarray:
    """Camera-to-world of a camera that looks at a target: x right, y down, z forward."""
    forward = (target - place) / np.linalg.norm(target - place)
    right = np.cross(forward, [0.0, 1.0, 0.0])
    right /= np.linalg.norm(right)
    pose = np.eye(4)
    pose[:3, :3] = np.stack([right, np.cross(forward, right), forward], axis=1)
    pose[:3, 3] = place
    return pose


MESH = generate("chair", 1, seed=5)[0]
CENTER = MESH.bounds.mean(axis=0).astype(float)
POSES = [
    looking(CENTER + np.array([2.2 * np.sin(a), 0.7, 2.2 * np.cos(a)]), CENTER)
    for a in np.arange(VIEWS) * 2 * np.pi / VIEWS + 0.3
]
DEPTHS = [render_depth(MESH.vertices, MESH.faces, Camera(K, WIDTH, HEIGHT, pose)) for pose in POSES]
POINTS = np.concatenate(
    [scan_depth(depth, Camera(K, WIDTH, HEIGHT, pose)).points for depth, pose in zip(DEPTHS, POSES, strict=True)]
)
QUATERNIONS = [Rotation.from_matrix(pose[:3, :3]).as_quat() for pose in POSES]


def save_depth(file: Path, view: int, units: float = 1000.0) -> None:
    file.parent.mkdir(parents=True, exist_ok=True)
    Image.fromarray((DEPTHS[view] * units).round().astype(np.uint16)).save(file)


def text(matrix: np.ndarray) -> str:
    return "\n".join(" ".join(f"{value:.9f}" for value in row) for row in np.atleast_2d(matrix)) + "\n"


def write(file: Path, content: object) -> None:
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(content if isinstance(content, str) else json.dumps(content))


def scannet(folder: Path) -> None:
    for view, pose in enumerate(POSES):
        save_depth(folder / f"depth/{view * 10}.png", view)
        write(folder / f"pose/{view * 10}.txt", text(pose))
    save_depth(folder / "depth/999.png", 0)
    write(folder / "pose/999.txt", text(np.full((4, 4), -np.inf)))
    matrix = np.eye(4)
    matrix[:3, :3] = K
    write(folder / "intrinsic/intrinsic_depth.txt", text(matrix))
    write(folder / "intrinsic/intrinsic_color.txt", text(2 * matrix))


def three_r_scan(folder: Path) -> None:
    for view, pose in enumerate(POSES):
        Image.fromarray((DEPTHS[view] * 1000).round().astype(np.uint16)).save(folder / f"{view}.pgm")
        (folder / "sequence").mkdir(exist_ok=True)
        (folder / f"{view}.pgm").rename(folder / f"sequence/frame-{view:06d}.depth.pgm")
        write(folder / f"sequence/frame-{view:06d}.pose.txt", text(pose))
    values = " ".join(map(str, K.ravel()))
    matrix = f"{K[0, 0]} 0 {K[0, 2]} 0 0 {K[1, 1]} {K[1, 2]} 0 0 0 1 0 0 0 0 1"
    write(
        folder / "sequence/_info.txt",
        f"m_depthWidth = {WIDTH}\nm_depthHeight = {HEIGHT}\nm_depthShift = 1000\n"
        f"m_calibrationDepthIntrinsic = {matrix}\nm_unused = {values}\n",
    )


def tum(folder: Path) -> None:
    listed, track = "# depth maps\n", "# timestamp tx ty tz qx qy qz qw\n"
    for view, (pose, turn) in enumerate(zip(POSES, QUATERNIONS, strict=True)):
        time = 1305031102.16 + view
        save_depth(folder / f"depth/{time:.6f}.png", view, 5000.0)
        listed += f"{time:.6f} depth/{time:.6f}.png\n"
        track += " ".join(map(str, [f"{time + 0.01:.4f}", *pose[:3, 3], *turn])) + "\n"
    listed += "1305031999.0 depth/1305031102.160000.png\n"
    write(folder / "depth.txt", listed)
    write(folder / "groundtruth.txt", track)
    write(folder / "camera.txt", f"{K[0, 0]} {K[1, 1]} {K[0, 2]} {K[1, 2]}")


def replica(folder: Path) -> None:
    for view in range(VIEWS):
        save_depth(folder / f"results/depth{view:06d}.png", view, 6553.5)
    write(folder / "traj.txt", "\n".join(" ".join(map(str, pose.ravel())) for pose in POSES))
    camera = {"w": WIDTH, "h": HEIGHT, "fx": K[0, 0], "fy": K[1, 1], "cx": K[0, 2], "cy": K[1, 2], "scale": 6553.5}
    write(folder / "cam_params.json", {"camera": camera})


def open3d(folder: Path) -> None:
    for view in range(VIEWS):
        save_depth(folder / f"depth/{view:05d}.png", view)
        write(folder / f"image/{view:05d}.jpg", "")
    write(folder / "trajectory.log", "".join(f"{v} {v} {v + 1}\n{text(pose)}" for v, pose in enumerate(POSES)))
    write(
        folder / "camera_intrinsic.json",
        {"width": WIDTH, "height": HEIGHT, "intrinsic_matrix": K.T.ravel().tolist()},
    )


def arkit_scenes(folder: Path) -> None:
    track = ""
    for view, pose in enumerate(POSES):
        inverse, time = np.linalg.inv(pose), 305.372 + view * 0.1
        vector = Rotation.from_matrix(inverse[:3, :3]).as_rotvec()
        track += " ".join(map(str, [f"{time + 0.002:.6f}", *vector, *inverse[:3, 3]])) + "\n"
        save_depth(folder / f"lowres_depth/41069021_{time:.3f}.png", view)
        write(
            folder / f"lowres_wide_intrinsics/41069021_{time + 0.01:.3f}.pincam",
            f"{WIDTH} {HEIGHT} {K[0, 0]} {K[1, 1]} {K[0, 2]} {K[1, 2]}",
        )
    write(folder / "lowres_wide.traj", track)


def bop(folder: Path) -> None:
    cameras = {}
    for view, pose in enumerate(POSES):
        inverse = np.linalg.inv(pose)
        save_depth(folder / f"depth/{view:06d}.png", view, 10000.0)
        cameras[str(view)] = {
            "cam_K": K.ravel().tolist(),
            "depth_scale": 0.1,
            "cam_R_w2c": inverse[:3, :3].ravel().tolist(),
            "cam_t_w2c": (inverse[:3, 3] * 1000).tolist(),
        }
    write(folder / "scene_camera.json", cameras)


def nerfstudio(folder: Path) -> None:
    frames = []
    for view, pose in enumerate(POSES):
        save_depth(folder / f"depths/{view:05d}.png", view)
        frames.append(
            {
                "file_path": f"images/{view:05d}.png",
                "depth_file_path": f"depths/{view:05d}.png",
                "transform_matrix": (pose @ GL_TO_CV).tolist(),
            }
        )
    camera = {"fl_x": 450.0, "fl_y": 450.0, "cx": 239.75, "cy": 179.75, "w": 480, "h": 360}
    write(folder / "transforms.json", camera | {"camera_model": "OPENCV", "frames": frames})


def instant_ngp(folder: Path) -> None:
    nerfstudio(folder)
    content = json.loads((folder / "transforms.json").read_text())
    camera = {key: content.pop(key) for key in ("fl_x", "fl_y", "cx", "cy", "w", "h")}
    for frame in content["frames"]:
        frame |= camera
        del frame["depth_file_path"]
    write(folder / "transforms.json", content)


def polycam(folder: Path) -> None:
    for view, pose in enumerate(POSES):
        save_depth(folder / f"keyframes/depth/{view + 83371}.png", view)
        matrix = pose @ GL_TO_CV
        entries = {f"t_{row}{column}": matrix[row, column] for row in range(3) for column in range(4)}
        camera = {"fx": 450.0, "fy": 450.0, "cx": 239.75, "cy": 179.75, "width": 480, "height": 360}
        write(folder / f"keyframes/corrected_cameras/{view + 83371}.json", {**camera, **entries, "blur_score": 9})
        (folder / "keyframes/confidence").mkdir(exist_ok=True)
        sure = np.full((HEIGHT, WIDTH), 255, np.uint8)
        Image.fromarray(sure).save(folder / f"keyframes/confidence/{view + 83371}.png")


def stray_scanner(folder: Path) -> None:
    lines = "timestamp, frame, x, y, z, qx, qy, qz, qw\n"
    for view, (pose, turn) in enumerate(zip(POSES, QUATERNIONS, strict=True)):
        save_depth(folder / f"depth/{view:06d}.png", view)
        lines += ", ".join(map(str, [view / 60, f"{view:06d}", *pose[:3, 3], *turn])) + "\n"
        (folder / "confidence").mkdir(exist_ok=True)
        Image.fromarray(np.full((HEIGHT, WIDTH), 2, np.uint8)).save(folder / f"confidence/{view:06d}.png")
    write(folder / "odometry.csv", lines)
    write(folder / "camera_matrix.csv", "\n".join(",".join(map(str, row)) for row in PHOTOGRAPH))


def record3d(folder: Path) -> None:
    poses = []
    for view, pose in enumerate(POSES):
        (folder / "depth").mkdir(exist_ok=True)
        np.save(folder / f"depth/{view}.npy", DEPTHS[view].astype(np.float32))
        matrix = pose @ GL_TO_CV
        poses.append([*Rotation.from_matrix(matrix[:3, :3]).as_quat(), *matrix[:3, 3]])
    write(
        folder / "metadata.json", {"w": 480, "h": 360, "K": LARGE.T.ravel().tolist(), "poses": np.array(poses).tolist()}
    )


def scanner_app(folder: Path) -> None:
    for view, pose in enumerate(POSES):
        save_depth(folder / f"depth_{view:05d}.png", view)
        camera = {"cameraPoseARFrame": (pose @ GL_TO_CV).ravel().tolist(), "intrinsics": PHOTOGRAPH.ravel().tolist()}
        write(folder / f"frame_{view:05d}.json", camera)


def scannet_plus_plus(folder: Path) -> None:
    content = {}
    for view, pose in enumerate(POSES):
        save_depth(folder / f"iphone/depth/frame_{view:06d}.png", view)
        content[f"frame_{view:06d}"] = {
            "pose": np.eye(4).tolist(),
            "aligned_pose": pose.tolist(),
            "intrinsic": PHOTOGRAPH.tolist(),
        }
    write(folder / "iphone/pose_intrinsic_imu.json", content)


LAYOUTS: dict[str, tuple[Callable[[Path], None], str]] = {
    "ScanNet": (scannet, "z"),
    "7-Scenes": (three_r_scan, "auto"),
    "TUM": (tum, "z"),
    "Replica": (replica, "z"),
    "Open3D": (open3d, "auto"),
    "ARKitScenes": (arkit_scenes, "z"),
    "BOP": (bop, "auto"),
    "nerfstudio": (nerfstudio, "z"),
    "nerfstudio ": (instant_ngp, "z"),
    "Polycam": (polycam, "y"),
    "Stray Scanner": (stray_scanner, "y"),
    "Record3D": (record3d, "y"),
    "3D Scanner App": (scanner_app, "y"),
    "ScanNet++": (scannet_plus_plus, "z"),
}


def distances(points: np.ndarray) -> np.ndarray:
    """From points to those that the cameras saw, and back."""
    return np.concatenate([cKDTree(POINTS).query(points)[0], cKDTree(points).query(POINTS)[0]])


@pytest.mark.parametrize("name", LAYOUTS)
def test_every_layout_gives_the_same_points(tmp_path, name):
    layout, up = LAYOUTS[name]
    layout(tmp_path)
    capture = read_capture(tmp_path)
    assert (capture.kind, capture.up, len(capture.frames)) == (name.strip(), up, VIEWS)
    assert capture.lost == (1 if name in ("ScanNet", "TUM") else 0)
    points = capture_scan(capture, voxel=0.0).points
    # Intrinsics of a phone's photograph lie half a pixel of that photograph apart, by the program.
    assert len(points) == pytest.approx(len(POINTS), rel=0.03)
    assert distances(points).mean() < 0.002
    assert np.quantile(distances(points), 0.98) < 0.02


def test_a_capture_is_a_scene(tmp_path):
    polycam(tmp_path)
    scene = read_scene(tmp_path)
    assert scene.up == "y" and scene.name == tmp_path.name
    assert distances(scene.points).mean() < 0.01


def test_views_are_spread_and_the_voxel_thins(tmp_path):
    scannet(tmp_path)
    capture = read_capture(tmp_path)
    assert capture.spread(2) == (capture.frames[0], capture.frames[-1]) and capture.spread(9) == capture.frames
    assert len(capture_scan(capture, views=2, voxel=0.0).scans) == 2
    assert len(capture_scan(capture, voxel=0.05).points) < len(POINTS) / 2


def test_masks_of_a_capture(tmp_path):
    scannet(tmp_path / "scan")
    (tmp_path / "masks").mkdir()
    for view in range(2):
        mask = np.zeros((HEIGHT, WIDTH), np.uint8)
        mask[:, : WIDTH // 2] = 7
        Image.fromarray(mask).save(tmp_path / f"masks/{view * 10}.png")
    found = capture_scan(read_capture(tmp_path / "scan"), mask_of=mask_finder(tmp_path / "masks", 7), voxel=0.0)
    assert len(found.scans) == 2
    assert all((scan.pixels[:, 0] < WIDTH // 2).all() for scan in found.scans)
    with pytest.raises(ScanError, match="folder of pictures named as the depth pictures"):
        mask_finder(tmp_path / "masks/0.png", None)


def test_pixels_of_low_confidence_are_left_out(tmp_path):
    stray_scanner(tmp_path)
    for view in range(VIEWS):
        sure = np.zeros((HEIGHT, WIDTH), np.uint8)
        sure[: HEIGHT // 2] = 1
        Image.fromarray(sure).save(tmp_path / f"confidence/{view:06d}.png")
    found = capture_scan(read_capture(tmp_path), voxel=0.0)
    assert all((scan.pixels[:, 1] < HEIGHT // 2).all() for scan in found.scans)


def without_intrinsics(folder: Path) -> None:
    tum(folder)
    (folder / "camera.txt").unlink()


def packed(folder: Path) -> None:
    record3d(folder)
    for file in (folder / "depth").iterdir():
        file.unlink()
    write(folder / "rgbd/0.depth", "bvx2")


def leads_out(folder: Path) -> None:
    nerfstudio(folder)
    content = (folder / "transforms.json").read_text()
    write(folder / "transforms.json", content.replace("depths/00000.png", "../secret.png"))


def no_depth(folder: Path) -> None:
    nerfstudio(folder)
    content = json.loads((folder / "transforms.json").read_text())
    for frame in content["frames"]:
        frame["file_path"] = "images/other.png"
        del frame["depth_file_path"]
    write(folder / "transforms.json", content)


def no_quaternion(folder: Path) -> None:
    stray_scanner(folder)
    write(folder / "odometry.csv", "0, 0, 1, 1, 1, 2, 2, 2, 2\n")


def other_folder(folder: Path) -> None:
    write(folder / "notes.txt", "nothing")


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (without_intrinsics, "holds no intrinsics of its camera.*give --intrinsics"),
        (packed, r"\.depth files, which are not read; save the depths as \.npy"),
        (leads_out, "outside of the folder"),
        (no_depth, "name no depth pictures"),
        (no_quaternion, "no unit quaternions"),
        (other_folder, "no folder of depth pictures with poses, of ScanNet"),
    ],
)
def test_captures_that_cannot_be_read_say_why(tmp_path, make, words):
    make(tmp_path)
    with pytest.raises((ScanError, ConfigError), match=words) as caught:
        read_capture(tmp_path)
    assert isinstance(caught.value, KpredError) and "\n" not in str(caught.value)
