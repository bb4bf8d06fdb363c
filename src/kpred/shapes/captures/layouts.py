"""Layouts of folders: ScanNet, TUM, Replica, Open3D, ARKitScenes, BOP and pictures with their poses beside them."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from kpred.errors import ConfigError, KpredError
from kpred.shapes.captures.capture import Capture, Frame
from kpred.shapes.captures.tables import matrix_poses, named_times, nearest_times, number_rows, quaternion_poses
from kpred.shapes.formats.keyed_content import read_keyed
from kpred.shapes.intrinsics_file import IntrinsicsFile, intrinsics_of, read_intrinsics_file
from kpred.shapes.pose_file import pose_of, read_pose

PICTURES = (".png", ".npy", ".npz", ".tif", ".tiff", ".pgm", ".pfm")

_TUM_REACH, _ARKIT_REACH = 0.03, 0.06
"""Seconds between a picture and the pose that it gets."""

_REPLICA_UNITS, _TUM_UNITS = 6553.5, 5000.0

Given = IntrinsicsFile | None
"""Intrinsics that the caller names; None takes those of the folder."""


def pictures(folder: Path, pattern: str = "*") -> list[Path]:
    """List the depth pictures of a folder, by the numbers in their names."""
    if not folder.is_dir():
        return []
    found = [file for file in folder.glob(pattern) if file.suffix.lower() in PICTURES and file.is_file()]
    return sorted(
        found, key=lambda file: [int(part) if part.isdigit() else part for part in re.split(r"(\d+)", file.name)]
    )


def number(file: Path) -> int | None:
    """Return the last number in the name of a file."""
    digits = re.findall(r"\d+", file.name.partition(".")[0])
    return int(digits[-1]) if digits else None


def first_of(folder: Path, *patterns: str) -> Path | None:
    """Return the first file that one of these patterns finds."""
    return next((file for pattern in patterns for file in sorted(folder.glob(pattern)) if file.is_file()), None)


def camera_of(folder: Path, given: Given, *patterns: str) -> IntrinsicsFile:
    """Read the intrinsics that the folder holds, unless they are given.

    Raises:
        ConfigError: there are none.
    """
    if given is not None:
        return given
    file = first_of(folder, *patterns)
    if file is None:
        raise ConfigError(f"{folder}: it holds no intrinsics of its camera ({', '.join(patterns)}); give --intrinsics.")
    return read_intrinsics_file(file)


def scannet(folder: Path, given: Given) -> Capture | None:
    """Read ScanNet as its exporter writes it: depth/0.png, pose/0.txt, intrinsic/intrinsic_depth.txt."""
    found = pictures(folder / "depth")
    poses = next((folder / name for name in ("pose", "poses") if (folder / name).is_dir()), None)
    if not found or poses is None:
        return None
    intrinsics = camera_of(folder, given, "intrinsic*/*depth*.txt", "intrinsic*/*.txt", "*intrinsic*.txt", "*.json")
    return _beside("ScanNet", found, lambda file: first_of(poses, f"{file.stem}.*"), intrinsics, "z")


def seven_scenes(folder: Path, given: Given) -> Capture | None:
    """Read 7-Scenes, 3RScan and BundleFusion: frame-000000.depth.png (.pgm) and frame-000000.pose.txt."""
    for place in (folder, folder / "sequence"):
        found = pictures(place, "*.depth.*") or [file for file in pictures(place, "frame-*") if ".depth." in file.name]
        if found:
            intrinsics = camera_of(place, given, "_info.txt", "info.txt", "*intrinsic*", "camera*")
            return _beside("7-Scenes", found, _pose_of_frame, intrinsics, "auto")
    return None


def _pose_of_frame(file: Path) -> Path | None:
    return first_of(file.parent, f"{file.name.partition('.')[0]}.pose.txt")


def tum(folder: Path, given: Given) -> Capture | None:
    """Read TUM: depth.txt lists pictures by time, groundtruth.txt poses."""
    listed = folder / "depth.txt"
    track = first_of(folder, "groundtruth.txt", "*trajectory*.txt", "CameraTrajectory*.txt", "poses.txt")
    if not listed.is_file() or track is None:
        return None
    intrinsics = camera_of(folder, given, "*intrinsic*", "camera*.*", "calibration*", "*.yaml", "*.yml")
    if intrinsics.units_per_metre is None:
        intrinsics = IntrinsicsFile(intrinsics.matrix, intrinsics.size, _TUM_UNITS)
    entries = named_times(listed)
    rows = np.array([row for row in number_rows(track) if len(row) == 8]).reshape(-1, 8)
    poses = quaternion_poses(rows[:, 1:4], rows[:, 4:8], track)
    matched = nearest_times(np.array([time for time, _ in entries]), rows[:, 0], _TUM_REACH)
    files = [inside(folder, name) for _, name in entries]
    frames = [Frame(file, poses[row], intrinsics) for file, row in zip(files, matched, strict=True) if row >= 0]
    return Capture("TUM", tuple(frames), "z", len(entries) - len(frames))


def inside(folder: Path, name: str) -> Path:
    """Return the path of a file that a list names, within its folder.

    Raises:
        ConfigError: it leads outside.
    """
    file = folder / name
    if (
        "\0" in name
        or ".." in Path(name).parts
        or Path(name).is_absolute()
        or not file.resolve().is_relative_to(folder.resolve())
    ):
        raise ConfigError(f"{folder}: it names {name[:60]!r}, outside of the folder; copy the pictures into it.")
    return file


def replica(folder: Path, given: Given) -> Capture | None:
    """Read Replica as NICE-SLAM renders it: results/depth000000.png, traj.txt, cam_params.json."""
    track = folder / "traj.txt"
    found = pictures(folder / "results", "depth*") or pictures(folder / "depth")
    if not track.is_file() or not found:
        return None
    own = first_of(folder, "cam_params.json", "*camera*.json", "*.yaml") or first_of(folder.parent, "cam_params.json")
    intrinsics = given or (read_intrinsics_file(own) if own is not None else camera_of(folder, None, "cam_params.json"))
    if intrinsics.units_per_metre is None:
        intrinsics = IntrinsicsFile(intrinsics.matrix, intrinsics.size, _REPLICA_UNITS)
    return _in_order("Replica", found, matrix_poses(track), intrinsics, "z")


def open3d(folder: Path, given: Given) -> Capture | None:
    """Read Open3D and Redwood: depth/ and a .log of camera-to-world matrices, in the order of the pictures."""
    found = pictures(folder / "depth")
    track = first_of(folder, "*.log", "*/*.log")
    if track is None or not found:
        return None
    intrinsics = camera_of(folder, given, "*intrinsic*.json", "camera*.json", "*.json", "*intrinsic*.txt")
    return _in_order("Open3D", found, matrix_poses(track), intrinsics, "auto")


def arkit_scenes(folder: Path, given: Given) -> Capture | None:
    """Read ARKitScenes: lowres_depth/ID_TIME.png, lowres_wide.traj (world-to-camera), lowres_wide_intrinsics/."""
    track = folder / "lowres_wide.traj"
    found = pictures(folder / "lowres_depth")
    if not track.is_file() or not found:
        return None
    rows = np.array([row for row in number_rows(track) if len(row) == 7]).reshape(-1, 7)
    inverse = np.tile(np.eye(4), (len(rows), 1, 1))
    inverse[:, :3, :3] = _from_rotation_vectors(rows[:, 1:4])
    inverse[:, :3, 3] = rows[:, 4:7]
    poses = np.linalg.inv(inverse)
    times = np.array([_time(file) for file in found])
    matched = nearest_times(times, rows[:, 0], _ARKIT_REACH)
    cameras = sorted((folder / "lowres_wide_intrinsics").glob("*.pincam"))
    near = nearest_times(times, np.array([_time(file) for file in cameras]), np.inf)
    confidence = folder / "confidence"
    frames = []
    for file, row, camera in zip(found, matched, near, strict=True):
        if row >= 0:
            intrinsics = given or (read_intrinsics_file(cameras[camera]) if camera >= 0 else None)
            if intrinsics is None:
                raise ConfigError(f"{folder}: it holds no lowres_wide_intrinsics; give --intrinsics.")
            sure = confidence / file.name
            frames.append(Frame(file, poses[row], intrinsics, sure if sure.is_file() else None))
    return Capture("ARKitScenes", tuple(frames), "z", len(found) - len(frames))


def _from_rotation_vectors(vectors: np.ndarray) -> np.ndarray:
    return Rotation.from_rotvec(vectors).as_matrix() if len(vectors) else np.zeros((0, 3, 3))


def _time(file: Path) -> float:
    """Return the time at the end of a name such as 41069021_305.372.png."""
    match = re.search(r"(\d+\.\d+)(?:\.\w+)?$", file.name) or re.search(r"(\d+)\.\w+$", file.name)
    return float(match[1]) if match else np.nan


def bop(folder: Path, given: Given) -> Capture | None:
    """Read a scene of BOP: depth/000000.png and scene_camera.json, in the frame of the first camera or the world."""
    cameras = folder / "scene_camera.json"
    found = pictures(folder / "depth")
    if not cameras.is_file() or not found:
        return None
    content = read_keyed(cameras, "cameras")
    frames = []
    for file in found:
        entry = content.get(str(number(file))) if isinstance(content, dict) else None
        if isinstance(entry, dict) and "cam_R_w2c" in entry and "cam_K" in entry:
            frames.append(Frame(file, pose_of(cameras, entry), given or intrinsics_of(cameras, entry)))
    return Capture("BOP", tuple(frames), "auto", len(found) - len(frames))


def _beside(
    kind: str, found: Sequence[Path], pose_of: Callable[[Path], Path | None], intrinsics: IntrinsicsFile, up: str
) -> Capture:
    """Build a capture of pictures each of which has a file with its pose; lost ones are counted."""
    frames = []
    for file in found:
        pose = pose_of(file)
        if pose is None:
            continue
        try:
            frames.append(Frame(file, read_pose(pose, file), intrinsics))
        except KpredError as error:
            # ScanNet marks frames whose tracking was lost by infinite poses.
            if "tracking was lost" not in str(error):
                raise
    return Capture(kind, tuple(frames), up, len(found) - len(frames))


def _in_order(kind: str, found: Sequence[Path], poses: np.ndarray, intrinsics: IntrinsicsFile, up: str) -> Capture:
    """Build a capture of pictures whose poses stand in their order, or at the places that their numbers name."""
    numbers = [number(file) for file in found]
    by_number = all(one is not None and one < len(poses) for one in numbers) and len(poses) != len(found)
    rows = [one or 0 for one in numbers] if by_number else list(range(min(len(found), len(poses))))
    frames = [
        Frame(file, poses[row], intrinsics)
        for file, row in zip(found, rows, strict=False)
        if np.isfinite(poses[row]).all()
    ]
    return Capture(kind, tuple(frames), up, len(found) - len(frames))
