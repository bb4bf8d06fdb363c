"""Layouts of folders that phones and their tools write: nerfstudio, Polycam, Stray Scanner, Record3D and others."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from kpred.errors import ConfigError
from kpred.shapes.captures.capture import GL_TO_CV, Capture, Frame
from kpred.shapes.captures.layouts import Given, first_of, inside, number, pictures
from kpred.shapes.captures.tables import number_rows, quaternion_poses
from kpred.shapes.formats.keyed_content import read_keyed
from kpred.shapes.intrinsics_file import IntrinsicsFile, Size, intrinsics_of, read_intrinsics_file
from kpred.shapes.pose_file import pose_of

_PHOTOGRAPHS: tuple[Size, ...] = ((1920, 1440), (1440, 1080), (1280, 960), (960, 720), (640, 480), (256, 192))
"""Sizes of pictures of iPhones and iPads."""

_KEYS = ("depth_file_path", "depth_path", "depth_file", "depth")


def nerfstudio(folder: Path, given: Given) -> Capture | None:
    """Read nerfstudio and instant-ngp: transforms.json with `depth_file_path` or a depth picture of the same name."""
    file = first_of(folder, "transforms.json", "transforms_train.json")
    content = None if file is None else read_keyed(file, "cameras")
    if file is None or not isinstance(content, dict) or not isinstance(content.get("frames"), list):
        return None
    entries = [entry for entry in content["frames"] if isinstance(entry, dict) and "transform_matrix" in entry]
    common = {key: value for key, value in content.items() if key != "frames"}
    frames = []
    for entry in entries:
        depth = _depth_of(folder, entry)
        if depth is not None:
            cameras = {key: value for key, value in {**common, **entry}.items() if key != "transform_matrix"}
            frames.append(Frame(depth, pose_of(file, entry), given or intrinsics_of(file, cameras)))
    if entries and not frames:
        raise ConfigError(f"{file}: its frames name no depth pictures (depth_file_path); record depth too.")
    return Capture("nerfstudio", tuple(frames), "z", len(entries) - len(frames))


def _depth_of(folder: Path, entry: dict[str, Any]) -> Path | None:
    named = next((entry[key] for key in _KEYS if isinstance(entry.get(key), str)), None)
    if named is not None:
        file = inside(folder, named)
        return file if file.is_file() else first_of(file.parent, f"{file.name}.*")
    stem = Path(str(entry.get("file_path", ""))).stem
    places = [folder / name for name in ("depth", "depths")]
    return next((found for place in places if stem and (found := first_of(place, f"{_plain(stem)}.*"))), None)


def _plain(name: str) -> str:
    """Escape the signs that patterns of file names give a meaning to."""
    return "".join(f"[{letter}]" if letter in "*?[" else letter for letter in name)


def polycam(folder: Path, given: Given) -> Capture | None:
    """Read Polycam's raw data: keyframes/depth/TIME.png and keyframes/corrected_cameras/TIME.json."""
    for root in (folder / "keyframes", folder):
        cameras = next((root / name for name in ("corrected_cameras", "cameras") if (root / name).is_dir()), None)
        found = pictures(root / "depth")
        if cameras is not None and found:
            return _each("Polycam", found, lambda file, here=cameras: here / f"{file.stem}.json", given, "confidence")
    return None


def scanner_app(folder: Path, given: Given) -> Capture | None:
    """Read 3D Scanner App: depth_00000.png and frame_00000.json with `cameraPoseARFrame`."""
    found = pictures(folder, "depth_*")
    if not found or first_of(folder, "frame_*.json") is None:
        return None
    return _each(
        "3D Scanner App", found, lambda file: file.with_name(f"frame_{file.stem.partition('_')[2]}.json"), given
    )


def _each(kind: str, found: list[Path], camera: Any, given: Given, confidence: str = "") -> Capture:
    """Build a capture of pictures each of which has a file with its pose and intrinsics."""
    frames = []
    for file in found:
        beside = camera(file)
        if not beside.is_file():
            continue
        content = read_keyed(beside, "cameras")
        if not isinstance(content, dict):
            raise ConfigError(f"{beside}: it is no camera of {kind}; export the capture again.")
        own = given or sized(intrinsics_of(beside, content))
        sure = file.parent.parent / confidence / file.name
        frames.append(Frame(file, pose_of(beside, content), own, sure if confidence and sure.is_file() else None))
    return Capture(kind, tuple(frames), "y", len(found) - len(frames))


def sized(intrinsics: IntrinsicsFile) -> IntrinsicsFile:
    """Add the size of the photographs of a phone, by the principal point, where the file does not say it."""
    if intrinsics.size is not None:
        return intrinsics
    middle = 2 * intrinsics.matrix[:2, 2] + 1
    sizes = [*_PHOTOGRAPHS, *((height, width) for width, height in _PHOTOGRAPHS)]
    size = min(sizes, key=lambda one: float(np.abs(np.log(np.maximum(middle, 1) / np.array(one))).max()))
    return IntrinsicsFile(intrinsics.matrix, size, intrinsics.units_per_metre)


def stray_scanner(folder: Path, given: Given) -> Capture | None:
    """Read Stray Scanner: depth/000000.png, odometry.csv (x right, y down, z forward), camera_matrix.csv."""
    track, found = folder / "odometry.csv", pictures(folder / "depth")
    if not track.is_file() or not found:
        return None
    rows = np.array([row[:9] for row in number_rows(track) if len(row) >= 9]).reshape(-1, 9)
    poses = quaternion_poses(rows[:, 2:5], rows[:, 5:9], track)
    places = {int(frame): row for row, frame in enumerate(rows[:, 1])}
    own = sized(given or read_intrinsics_file(folder / "camera_matrix.csv"))
    frames = []
    for file in found:
        row = places.get(number(file) or 0)
        sure = folder / "confidence" / f"{file.stem}.png"
        if row is not None:
            frames.append(Frame(file, poses[row], own, sure if sure.is_file() else None))
    return Capture("Stray Scanner", tuple(frames), "y", len(found) - len(frames))


def record3d(folder: Path, given: Given) -> Capture | None:
    """Read Record3D: metadata.json with `poses` (quaternion, place; y up, z backward) and numbered depth pictures."""
    file = first_of(folder, "metadata.json", "metadata")
    content = None
    if file is not None and file.suffix:
        content = read_keyed(file, "cameras")
    if file is None or not isinstance(content, dict) or not isinstance(content.get("poses"), list):
        return None
    found = next((found for name in ("depth", "depths", "rgbd", ".") if (found := _numbered(folder / name))), [])
    if not found:
        packed = first_of(folder, "rgbd/*.depth", "*.exr", "*/*.exr")
        kind = f"{packed.suffix} files, which are not read" if packed is not None else "no depth pictures"
        raise ConfigError(f"{folder}: it holds {kind}; save the depths as .npy or 16-bit .png in a folder depth.")
    rows = np.array([row for row in content["poses"] if isinstance(row, list) and len(row) == 7], float).reshape(-1, 7)
    poses = quaternion_poses(rows[:, 4:7], rows[:, :4], file) @ GL_TO_CV
    own = given or intrinsics_of(file, {key: value for key, value in content.items() if key in ("K", "w", "h")})
    numbers = [number(one) for one in found]
    frames = [
        Frame(one, poses[row], own)
        for one, row in zip(found, numbers, strict=True)
        if row is not None and row < len(poses)
    ]
    return Capture("Record3D", tuple(frames), "y", len(found) - len(frames))


def _numbered(folder: Path) -> list[Path]:
    return [file for file in pictures(folder) if file.stem.isdigit() or "depth" in file.stem.lower()]


def scannet_plus_plus(folder: Path, given: Given) -> Capture | None:
    """Read ScanNet++: iphone/depth/frame_000000.png and pose_intrinsic_imu.json."""
    for root in (folder / "iphone", folder):
        file, found = root / "pose_intrinsic_imu.json", pictures(root / "depth")
        if file.is_file() and found:
            content = read_keyed(file, "cameras")
            return Capture("ScanNet++", tuple(_imu_frames(file, content, found, given)), "z")
    return None


def _imu_frames(file: Path, content: Any, found: list[Path], given: Given) -> Iterator[Frame]:
    for picture in found:
        entry = content.get(picture.stem) if isinstance(content, dict) else None
        if isinstance(entry, dict):
            key = "aligned_pose" if "aligned_pose" in entry else "pose"
            own = given or sized(intrinsics_of(file, {"intrinsic": entry.get("intrinsic")}))
            yield Frame(picture, pose_of(file, {"pose": entry.get(key)}), own)
