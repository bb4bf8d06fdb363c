"""Where the cameras of a scan are: along a path through free space, on tripods, or at one place."""

from __future__ import annotations

import numpy as np

from kpred.synthetic.rooms.room import Room

CUBE = ((0.0, 0.0), (90.0, 0.0), (180.0, 0.0), (270.0, 0.0), (0.0, -89.9), (0.0, 89.9))
"""Yaw and pitch, degrees, of the six images of a tripod's place."""


def looking(eye: np.ndarray, yaw: float, pitch: float, roll: float = 0.0) -> np.ndarray:
    """Make the (4, 4) pose of a camera at `eye` (3,), angles in radians.

    Camera to world; the camera looks along its +z, x is right, y is down; yaw 0 looks along the world's +z.
    """
    ahead = np.array([np.cos(pitch) * np.sin(yaw), np.sin(pitch), np.cos(pitch) * np.cos(yaw)])
    right = np.cross(ahead, [0.0, 1.0, 0.0])
    right = right / np.linalg.norm(right)
    down = np.cross(ahead, right)
    c, s = np.cos(roll), np.sin(roll)
    pose = np.eye(4)
    pose[:3, :3] = np.stack([c * right + s * down, c * down - s * right, ahead], axis=1)
    pose[:3, 3] = eye
    return pose


def path_poses(room: Room, free: np.ndarray, frames: int, rng: np.random.Generator) -> np.ndarray:
    """Draw poses (frames, 4, 4) of a hand-held camera through a room, looking around and mostly down.

    `free`: (N, 2) free places (x, z) on the floor.
    """
    stops = _apart(free, int(rng.integers(3, 7)), room, rng)
    loop = np.concatenate([stops, stops[:1]])
    along = np.linspace(0.0, len(stops) - 1e-6, frames)
    part = along - np.floor(along)
    smooth = (part * part * (3 - 2 * part))[:, None]
    place = loop[along.astype(int)] * (1 - smooth) + loop[along.astype(int) + 1] * smooth
    turns = rng.uniform(1.2, 3.0) * rng.choice([-1.0, 1.0])
    time = np.linspace(0.0, 1.0, frames)
    yaw = rng.uniform(0, 2 * np.pi) + 2 * np.pi * turns * time + _wave(time, 0.5, rng)
    # Some look at what stands on the floor alone, some up the walls too.
    swing = rng.uniform(0.1, 0.6)
    pitch = np.radians(rng.uniform(-36.0, 2.0)) + _wave(time, swing, rng) + _wave(time, 0.1, rng)
    height = rng.uniform(1.25, 1.7) + _wave(time, 0.12, rng)
    roll = _wave(time, 0.06, rng)
    eyes = np.column_stack([place[:, 0], height, place[:, 1]])
    return np.stack([looking(*values) for values in zip(eyes, yaw, pitch, roll, strict=True)])


def tripod_poses(room: Room, free: np.ndarray, stations: int, rng: np.random.Generator) -> np.ndarray:
    """Draw poses (6 stations, 4, 4) of square images of 90 degrees all around separate places."""
    poses = []
    for x, z in _apart(free, stations, room, rng):
        eye, start = np.array([x, rng.uniform(1.3, 1.7), z]), float(rng.uniform(0, 2 * np.pi))
        poses += [looking(eye, start + np.radians(yaw), np.radians(pitch)) for yaw, pitch in CUBE]
    return np.stack(poses)


def single_pose(room: Room, rng: np.random.Generator) -> np.ndarray:
    """Draw the pose (1, 4, 4) of one camera near a wall that looks into the room."""
    half = room.size[[0, 2]] / 2
    angle = float(rng.uniform(0, 2 * np.pi))
    place = np.array([np.sin(angle), np.cos(angle)])
    place = place / np.max(np.abs(place) / (half - 0.25)) * rng.uniform(0.7, 1.0)
    target = rng.uniform(-0.4, 0.4, 2) * half
    yaw = float(np.arctan2(*(target - place)))
    eye = np.array([place[0], rng.uniform(1.0, 1.8), place[1]])
    return looking(eye, yaw, float(np.radians(rng.uniform(-35.0, -5.0))))[None]


def drifted(poses: np.ndarray, shift: float, turn: float, rng: np.random.Generator) -> np.ndarray:
    """Disturb poses (K, 4, 4) as tracking does, by slow waves up to `shift` metres and `turn` radians."""
    time = np.linspace(0.0, 1.0, len(poses))
    moved = poses.copy()
    moved[:, :3, 3] += np.stack([_wave(time, shift / np.sqrt(3), rng) for _ in range(3)], axis=1)
    yaw = _wave(time, turn, rng)
    c, s = np.cos(yaw), np.sin(yaw)
    zero, one = np.zeros_like(c), np.ones_like(c)
    about = np.stack([c, zero, s, zero, one, zero, -s, zero, c], axis=1).reshape(-1, 3, 3)
    moved[:, :3, :3] = about @ poses[:, :3, :3]
    return moved


def _wave(time: np.ndarray, amplitude: float, rng: np.random.Generator) -> np.ndarray:
    """Draw a slow smooth function of the time, no larger than the amplitude."""
    found = np.zeros_like(time)
    for cycles in (1.0, 2.3, 4.1):
        found += np.sin(2 * np.pi * (cycles * time + rng.random())) * rng.random() / 3
    return np.asarray(found * amplitude)


def _apart(free: np.ndarray, count: int, room: Room, rng: np.random.Generator) -> np.ndarray:
    """Draw free places (count, 2), each the farthest of a few random ones from those before."""
    if not len(free):
        free = rng.uniform(-0.3, 0.3, (8, 2)) * room.size[[0, 2]]
    found = [free[int(rng.integers(len(free)))]]
    while len(found) < count:
        tries = free[rng.integers(len(free), size=6)]
        away = np.min(np.linalg.norm(tries[:, None] - np.array(found)[None], axis=2), axis=1)
        found.append(tries[int(np.argmax(away))])
    return np.array(found)
