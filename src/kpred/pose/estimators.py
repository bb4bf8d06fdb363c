"""Pose estimators: rotations from a scan's own frame to the canonical frame (y up, front +z)."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from importlib.metadata import entry_points
from pathlib import Path
from typing import Any, Protocol, runtime_checkable

import numpy as np

from kpred.errors import ConfigError
from kpred.ops.rotations import upright_rotation, yaw_rotation
from kpred.ops.typing import Float
from kpred.pose.up_axis import find_up
from kpred.pose.yaw import yaw_hypotheses

ENTRY_POINTS = "kpred.pose_estimators"
"""Installed packages register estimators under this group: a name, and a class or function without arguments."""


@runtime_checkable
class PoseEstimator(Protocol):
    """Interface of a pose estimator: rotations from the scan's frame to the canonical frame.

    Called with the scan's points (N, 3), in its own frame and unit, and its up axis (x, y, z, -x, -y, -z, or "auto"
    where it is unknown), it gives rotations R (3, 3), the most plausible first, such that R @ x is canonical up to
    position and size.
    """

    def __call__(self, points: Float[np.ndarray, "points 3"], up: str) -> list[np.ndarray]:
        """Return rotations (3, 3), the most plausible first."""
        ...


@dataclass(frozen=True)
class IdentityPose:
    """Estimator for objects that face +z already; rotates another up axis to y."""

    def __call__(self, points: Float[np.ndarray, "points 3"], up: str) -> list[np.ndarray]:
        """Return the rotation of the up axis to y; "auto" counts as y."""
        return [upright_rotation("y" if up == "auto" else up)]


@dataclass(frozen=True)
class GivenPose:
    """Estimator that returns a given rotation.

    Attributes:
        rotation: (3, 3) from the scan's frame to the canonical frame.
    """

    rotation: Float[np.ndarray, "3 3"]

    def __call__(self, points: Float[np.ndarray, "points 3"], up: str) -> list[np.ndarray]:
        """Return the given rotation; `up` is contained in it."""
        return [self.rotation]


@dataclass(frozen=True)
class UprightPose:
    """Estimator for upright objects of unknown yaw.

    Attributes:
        max_yaws: maximum number of hypotheses.
    """

    max_yaws: int = 8

    def __call__(self, points: Float[np.ndarray, "points 3"], up: str) -> list[np.ndarray]:
        """Return rotations about the up axis, or alternately about the one or two likeliest axes."""
        if up != "auto":
            return self._about(points, up, self.max_yaws)
        axes = find_up(points)
        each = [self._about(points, axis, self.max_yaws // len(axes)) for axis in axes]
        return [rotation for group in zip(*each) for rotation in group]

    @staticmethod
    def _about(points: np.ndarray, up: str, max_yaws: int) -> list[np.ndarray]:
        upright = upright_rotation(up)
        return [yaw_rotation(yaw) @ upright for yaw in yaw_hypotheses(points @ upright.T, max_yaws)]


def pose_estimator(name: str) -> PoseEstimator:
    """Return the estimator of this name: built in, or registered by an installed package.

    "identity"; "upright"; "given:FILE", see `given_pose`.

    Raises:
        ConfigError: unknown name, an estimator that cannot be loaded, or a file without a pose.
    """
    kind, _, argument = name.partition(":")
    if kind == "given":
        if not argument:
            raise ConfigError("The pose estimator 'given' needs a file: given:FILE.")
        return given_pose(argument)
    built_in: dict[str, Callable[[], PoseEstimator]] = {"identity": IdentityPose, "upright": UprightPose}
    if name in built_in:
        return built_in[name]()
    registered = {entry.name: entry for entry in entry_points(group=ENTRY_POINTS)}
    if name not in registered:
        known = ", ".join([*built_in, "given:FILE", *sorted(registered)])
        raise ConfigError(f"There is no pose estimator '{name}'; the known ones are {known}.")
    try:
        estimator = registered[name].load()()
    except Exception as error:  # whatever a foreign package does wrong
        raise ConfigError(
            f"The pose estimator '{name}' ({registered[name].value}) cannot be loaded: {error}"
        ) from error
    if not isinstance(estimator, PoseEstimator):
        raise ConfigError(f"The pose estimator '{name}' ({registered[name].value}) cannot be called.")
    return estimator


def given_pose(source: str) -> GivenPose:
    """Read a pose: a 4x4 (or 3x3) matrix in .txt, .npy or .json, or a model of a Scan2CAD annotation.

    The matrix takes the canonical object (y up, front +z) to the scan, as pose estimators and Scan2CAD give it, in
    column vectors; only its rotation is used, because position and size are found in the fit. JSON holds the rows, or
    an object with them under "pose", "transform", "matrix", "rotation" or "cad_to_scan"; the last is Scan2CAD's, whose
    ShapeNet models face -z. Of Scan2CAD's annotation one model is named after a #, by scene (where there are several)
    and number: `full_annotations.json#3`, `full_annotations.json#scene0470_00/3`.

    Raises:
        ConfigError: if the file is missing or unreadable, or holds no rotation.
    """
    name, _, selected = source.partition("#")
    path = Path(name)
    try:
        if path.suffix == ".npy":
            return GivenPose(_inverse_rotation(np.load(path, allow_pickle=False), source))
        if path.suffix == ".txt":
            return GivenPose(_inverse_rotation(np.loadtxt(path, ndmin=2), source))
        if path.suffix != ".json":
            raise ConfigError(f"{path}: a pose is a .txt, .npy or .json file, not '{path.suffix}'.")
        content = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise ConfigError(f"{path}: the pose cannot be read ({error.strerror or error}); check the file.") from error
    except (ValueError, UnicodeDecodeError) as error:
        raise ConfigError(f"{path}: this is no pose ({error}); give a 4x4 matrix.") from error
    if selected:
        return GivenPose(_scan2cad_rotation(content, selected, source))
    if isinstance(content, dict):
        if "cad_to_scan" in content:
            return GivenPose(yaw_rotation(np.pi) @ _inverse_rotation(content["cad_to_scan"], source))
        for key in ("pose", "transform", "matrix", "rotation"):
            if key in content:
                return GivenPose(_inverse_rotation(content[key], source))
    if isinstance(content, list) and content and isinstance(content[0], dict):
        raise ConfigError(f"{path}: several annotations; name one model by its number, as in {path.name}#0.")
    return GivenPose(_inverse_rotation(content, source))


def _scan2cad_rotation(content: Any, selected: str, source: str) -> np.ndarray:
    """Compute scan to canonical from model to world and scan to world; models face -z."""
    scene_name, _, number = selected.rpartition("/")
    scenes = content if isinstance(content, list) else [content]
    try:
        scenes = [scene for scene in scenes if not scene_name or scene["id_scan"] == scene_name]
        if len(scenes) != 1:
            raise ConfigError(f"{source}: {len(scenes)} scenes fit; name one, as in FILE#scene0470_00/3.")
        model = scenes[0]["aligned_models"][int(number)]["trs"]["rotation"]
        world = scenes[0]["trs"]["rotation"]
    except (KeyError, IndexError, TypeError, ValueError) as error:
        raise ConfigError(
            f"{source}: Scan2CAD's annotation has no such model ({error!r}); check the number."
        ) from error
    return yaw_rotation(np.pi) @ _quaternion_matrix(model, source).T @ _quaternion_matrix(world, source)


def _quaternion_matrix(wxyz: Any, source: str) -> np.ndarray:
    try:
        w, x, y, z = np.asarray(wxyz, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise ConfigError(f"{source}: a rotation is four numbers w, x, y, z, but is {wxyz!r}.") from error
    length = w * w + x * x + y * y + z * z
    if not 1e-12 < length < np.inf:
        raise ConfigError(f"{source}: the rotation {wxyz!r} has no direction.")
    s = 2.0 / length
    return np.array(
        [
            [1 - s * (y * y + z * z), s * (x * y - w * z), s * (x * z + w * y)],
            [s * (x * y + w * z), 1 - s * (x * x + z * z), s * (y * z - w * x)],
            [s * (x * z - w * y), s * (y * z + w * x), 1 - s * (x * x + y * y)],
        ]
    )


def _inverse_rotation(matrix: Any, source: str) -> np.ndarray:
    """Invert the rotation in a matrix that may also hold a scale for each axis of the object."""
    try:
        pose = np.asarray(matrix, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise ConfigError(f"{source}: this is no matrix of numbers; give a 4x4 matrix.") from error
    if pose.shape not in ((4, 4), (3, 4), (3, 3)) or not np.isfinite(pose).all():
        raise ConfigError(f"{source}: a pose is a 4x4 matrix of finite numbers, but this one has shape {pose.shape}.")
    if pose.shape == (4, 4) and not np.allclose(pose[3], [0, 0, 0, 1], atol=1e-6):
        raise ConfigError(f"{source}: the last row of a pose is 0 0 0 1; is the matrix transposed?")
    axes = pose[:3, :3]
    length = np.linalg.norm(axes, axis=0)
    if not (length > 0).all():
        raise ConfigError(f"{source}: the pose squashes an axis to nothing.")
    turned = axes / length
    if np.abs(turned.T @ turned - np.eye(3)).max() > 0.02:
        raise ConfigError(f"{source}: the pose is sheared; give a rotation with a scale at most for each object axis.")
    if np.linalg.det(turned) < 0:
        raise ConfigError(f"{source}: the pose mirrors the object; give a proper rotation.")
    left, _, right = np.linalg.svd(turned)
    rotation: np.ndarray = (left @ right).T
    return rotation


__all__ = [
    "ENTRY_POINTS",
    "GivenPose",
    "IdentityPose",
    "PoseEstimator",
    "UprightPose",
    "given_pose",
    "pose_estimator",
]
