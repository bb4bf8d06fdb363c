"""Scans of rooms: by hand with a depth camera, from tripods, in one view, by LiDAR."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from kpred.synthetic.rooms.cameras import drifted, path_poses, single_pose, tripod_poses
from kpred.synthetic.rooms.fusion import back_project, fused
from kpred.synthetic.rooms.occupancy import Occupancy, surface_points
from kpred.synthetic.rooms.raster import count_views, render_frame
from kpred.synthetic.rooms.room import OTHER, STRUCTURE, Room
from kpred.synthetic.rooms.sensor import Sensor, measured_depth

SCANNERS = ("mesh", "dense", "view", "lidar")
"""A fused mesh's vertices (ScanNet), dense clouds from tripods (S3DIS), one depth image, LiDAR."""

CARVED = 0.05
"""Images that see this much farther (metres) than a fused point speak against it."""


NEIGHBOURS = 12
"""Points about a fused point over which its place is blurred."""

BUMPS, BENDS = (0.06, 0.4, 16), (2.0, 8.0, 3)
"""Shortest and longest wave, metres, and number of waves: of a fused surface's bumps, and of a scan that bends."""

OPEN_VIEW, VIEW_TRIES = 0.5, 12
"""Fraction of a single view's pixels that show something beyond 1.2 m and within range, and how many poses are tried
for it."""


@dataclass(frozen=True, eq=False)
class Views:
    """What the cameras of a scan could have seen.

    Attributes:
        poses: (K, 4, 4) true poses, camera to world; focal: in pixels.
        depths: (K, height, width) float32 true depths, metres, 0 where nothing is.
        near, far: range, metres.
    """

    poses: np.ndarray
    focal: float
    depths: np.ndarray
    near: float
    far: float

    def sees(self, places: np.ndarray, tolerance: np.ndarray) -> np.ndarray:
        """Test (N,) whether surface at places (N, 3; world, metres) would be visible, up to tolerances (N,)."""
        seen, _ = count_views(
            places.astype(np.float64),
            self.poses,
            self.focal,
            self.depths,
            tolerance.astype(np.float64),
            self.near,
            self.far,
            True,
        )
        return np.asarray(seen > 0)


@dataclass(frozen=True, eq=False)
class RoomScan:
    """A scan of a room.

    Attributes:
        points: (N, 3) float32, the room's frame, metres.
        instance: (N,) int32 number of the room's object that a point was measured on, -1 for none.
        scanner: one of `SCANNERS`; views: its cameras.
        deviation: metres that a labelled point may lie off its object's surface (four standard deviations of the noise
            at the far end, drift, cells).
    """

    points: np.ndarray
    instance: np.ndarray
    scanner: str
    views: Views
    deviation: float


@dataclass(frozen=True)
class _Setting:
    sensor: Sensor
    width: int
    height: int
    focal: float
    cell: float
    slab: float
    least: int
    points: int
    shift: float
    turn: float
    carving: float = 0.0
    warp: float = 0.0
    rough: float = 0.0
    bumps: float = 0.0
    blur: float = 0.0


def _setting(scanner: str, rng: np.random.Generator) -> _Setting:
    shift, turn = float(rng.uniform(0.0, 0.025)), float(np.radians(rng.uniform(0.0, 0.7)))
    if scanner == "mesh":
        sensor = Sensor(far=float(rng.uniform(3.6, 4.5)), noise=float(rng.uniform(0.001, 0.002)))
        cell = float(rng.uniform(0.017, 0.026))
        warp, rough = float(rng.uniform(0.0, 0.025)), float(rng.uniform(0.0003, 0.003))
        bumps, blur = float(rng.uniform(0.001, 0.006)), float(rng.uniform(0.2, 1.0))
        most, carving = int(rng.uniform(35_000, 70_000)), float(rng.uniform(0.25, 0.9))
        return _Setting(sensor, 160, 120, 144.0, cell, 0.08, 2, most, shift, turn, carving, warp, rough, bumps, blur)
    if scanner == "dense":
        sensor = Sensor(0.5, 7.0, 0.002, 0.0008, lost_edges=0.5, flying=0.06, grazing=0.1)
        shape = {"warp": 0.008, "rough": 0.001, "bumps": 0.002, "blur": float(rng.uniform(0.0, 0.5))}
        return _Setting(sensor, 288, 288, 144.0, 0.014, 0.05, 1, 220_000, shift / 2, turn / 2, 0.9, **shape)
    if scanner == "view":
        sensor = Sensor(far=float(rng.uniform(4.0, 6.0)), flying=0.2, lost_edges=0.45)
        return _Setting(sensor, 320, 240, 288.0, 0.0, 0.0, 1, 70_000, 0.0, 0.0)
    sensor = Sensor(0.3, 30.0, 0.003, 0.0, lost_edges=0.1, flying=0.35, grazing=0.06, dropout=0.01)
    return _Setting(sensor, 256, 256, 128.0, 0.0, 0.0, 1, 90_000, shift / 3, turn / 3)


def scan_room(room: Room, scanner: str, rng: np.random.Generator) -> RoomScan:
    """Scan a room with one of `SCANNERS`."""
    setting = _setting(scanner, rng)
    vertices, faces, owner = room.surfaces()
    poses = _poses(room, scanner, rng)
    if scanner == "view":
        poses = _open_view(room, (vertices, faces), poses, setting, rng)
    estimated = drifted(poses, setting.shift, setting.turn, rng)
    normals = _normals(vertices, faces)
    loss = np.array([item.loss for item in room.objects])[owner]
    true, noisy, clouds = [], [], []
    for pose, guess in zip(poses, estimated, strict=True):
        depth, face = render_frame(vertices, faces, pose, setting.focal, setting.width, setting.height)
        found, flying = measured_depth(depth, face, normals, loss, pose, setting.focal, setting.sensor, rng)
        true.append(depth)
        noisy.append(found)
        clouds.append(back_project(found, flying, face, owner, normals, guess, setting.focal))
    points, labels, codes = (np.concatenate(column) for column in zip(*clouds, strict=True))
    if setting.cell > 0:
        points, labels = fused(points, labels, codes, setting.cell, setting.slab, setting.least)
        kept = _kept(points, estimated, np.stack(noisy), setting)
        points, labels = _uneven(points[kept].astype(np.float64), setting, rng), labels[kept]
    chosen = np.sort(rng.permutation(len(points))[: setting.points])
    far = setting.sensor.far
    views = Views(poses, setting.focal, np.stack(true), setting.sensor.near, far)
    reach = min(far, float(np.linalg.norm(room.size)))
    deviation = 4 * float(setting.sensor.spread(np.array(reach))) + setting.shift + setting.turn * reach
    # A cell averages across an edge of its object.
    deviation += 6 * setting.cell + setting.slab / 2 + 2 * setting.warp + 5 * setting.rough + 4 * setting.bumps
    return RoomScan(points[chosen], labels[chosen], scanner, views, deviation)


def _open_view(
    room: Room, surfaces: tuple[np.ndarray, np.ndarray], pose: np.ndarray, setting: _Setting, rng: np.random.Generator
) -> np.ndarray:
    """Return a pose (1, 4, 4) that sees enough: the given one, or another where it is blocked."""
    best, most, tried = pose, -1.0, pose
    for _ in range(VIEW_TRIES):
        depth, _ = render_frame(*surfaces, tried[0], setting.focal / 4, setting.width // 4, setting.height // 4)
        share = float(((depth > 1.2) & (depth < setting.sensor.far)).mean())
        if share > most:
            best, most = tried, share
        if share > OPEN_VIEW:
            break
        tried = single_pose(room, rng)
    return best


def _poses(room: Room, scanner: str, rng: np.random.Generator) -> np.ndarray:
    if scanner == "view":
        return single_pose(room, rng)
    free = _free_floor(room)
    if scanner == "mesh":
        return path_poses(room, free, int(rng.integers(40, 90)), rng)
    return tripod_poses(room, free, int(rng.integers(2, 4) if scanner == "dense" else rng.integers(1, 3)), rng)


def _uneven(points: np.ndarray, setting: _Setting, rng: np.random.Generator) -> np.ndarray:
    """Disturb fused points (N, 3) as in a TSDF: off their grid, edges rounded, things that touch joined, bumps."""
    limit = 2 * setting.cell
    noise = rng.standard_normal(points.shape) * setting.rough
    noise += waves(points, setting.bumps, *BUMPS, rng) + waves(points, setting.warp, *BENDS, rng)
    if len(points) > NEIGHBOURS:
        _, index = cKDTree(points, balanced_tree=False).query(points, k=NEIGHBOURS)
        near = points[index]
        middle = near.mean(axis=1)
        offset = near - middle[:, None]
        normal = np.linalg.eigh(offset.transpose(0, 2, 1) @ offset)[1][:, :, 0]
        along = (rng.random(points.shape) - 0.5) * setting.cell
        noise += along - (along * normal).sum(axis=1, keepdims=True) * normal
        noise += np.clip(setting.blur * (middle - points), -limit, limit)
    return np.asarray(points + noise, dtype=np.float32)


def waves(
    points: np.ndarray, amplitude: float, shortest: float, longest: float, count: int, rng: np.random.Generator
) -> np.ndarray:
    """Draw smooth offsets (N, 3) of about an amplitude at points (N, 3), by `count` waves of lengths in metres."""
    total = np.zeros(points.shape)
    for _ in range(count):
        direction, bend = rng.normal(0.0, 1.0, (2, 3))
        length = shortest * (longest / shortest) ** rng.random()
        wave = direction * (2 * np.pi / length / np.linalg.norm(direction))
        bend *= amplitude * np.sqrt(2.0 / count) / np.linalg.norm(bend)
        total += np.sin(points @ wave + rng.uniform(0, 2 * np.pi))[:, None] * bend
    return total


def _free_floor(room: Room) -> np.ndarray:
    taken = Occupancy(room.size)
    for item in room.objects:
        if item.category != STRUCTURE and (item.category != OTHER or np.ptp(item.box, axis=0).max() > 0.5):
            taken.add(surface_points(item.mesh, 0.06) @ item.pose[:3, :3].T + item.pose[:3, 3])
    return taken.free_floor(0.3, 1.8)


def _normals(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    corners = vertices[faces]
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return np.asarray(cross / np.maximum(np.linalg.norm(cross, axis=1, keepdims=True), 1e-12), dtype=np.float32)


def _kept(points: np.ndarray, poses: np.ndarray, depths: np.ndarray, setting: _Setting) -> np.ndarray:
    """Return a mask (N,) of fused points hit more often than seen through; thin things suffer."""
    tolerance = np.full(len(points), CARVED)
    sensor = setting.sensor
    before, through = count_views(
        points.astype(np.float64), poses, setting.focal, depths, tolerance, sensor.near, sensor.far, False
    )
    return np.asarray(through <= setting.carving * (before - through))
