"""Measure what rooms look like to the detector, so that virtual ones can be compared with real ones.

    python scripts/measure_room_look.py ROOMS_FOLDER_OR_PACK [...]

Prints, in the mean over the rooms of each argument: roughness of the floor (millimetres off the local plane within
12 cm), planarity of what is neither floor nor wall (lower quartile), small pieces (fraction of the voxels in pieces of
fewer than 40), fraction of the voxels that is neither floor nor wall, furniture that stands close (fraction of its
voxels with another thing within 5 cm), and the height (metres) that 99 % of the voxels are below.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

from kpred.detection.networks import CATEGORIES
from kpred.detection.propose import PreparedRoom, prepare_room
from kpred.evaluation.rooms.labelled import LabelledRoom, labelled_rooms, true_objects

NAMES = ("floor rough mm", "planarity", "small pieces", "no floor, wall", "close by", "height m")
REACH, BESIDE = 0.12, 0.05


def look(labelled: LabelledRoom) -> list[float] | None:
    """Measure one room that stands upright along z; None where nothing but floor and walls is seen."""
    points = labelled.scene.points
    room = prepare_room(points - np.nanmedian(points, axis=0))
    if room.pieces is None:
        return None
    rest, height = ~room.structure.mask, room.structure.height
    sizes = room.pieces.sizes
    return [
        1000 * roughness(room.voxels.points[np.abs(height) < 0.04]),
        float(np.quantile(room.structure.planarity[rest], 0.25)),
        float(sizes[sizes < 40].sum() / sizes.sum()),
        float(rest.mean()),
        closeness(room, labelled),
        float(np.quantile(height, 0.99)),
    ]


def roughness(floor: np.ndarray) -> float:
    """Measure the median distance of points (N, 3) from the plane of those around them, metres."""
    tree, found = cKDTree(floor), []
    for rows in tree.query_ball_point(floor[:: max(1, len(floor) // 1500)], REACH):
        if len(rows) > 10:
            offset = floor[rows] - floor[rows].mean(axis=0)
            found.append(np.sqrt(max(float(np.linalg.eigvalsh(offset.T @ offset / len(rows))[0]), 0.0)))
    return float(np.median(found)) if found else float("nan")


def closeness(room: PreparedRoom, labelled: LabelledRoom) -> float:
    """Measure the fraction of furniture's voxels near other things, in the mean over the pieces of furniture."""
    owner = np.full(len(room.grid), -1)
    used = room.grid.owner >= 0
    owner[room.grid.owner[used]] = labelled.instance[used]
    rest, found = ~room.structure.mask, []
    for row, name in true_objects(labelled).items():
        mine, others = owner == row, (owner != row) & rest
        if name in CATEGORIES and mine.sum() >= 60 and others.any():
            found.append(
                float((cKDTree(room.voxels.points[others]).query(room.voxels.points[mine])[0] < BESIDE).mean())
            )
    return float(np.mean(found)) if found else float("nan")


def main() -> None:
    """Parse the command line, measure, print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("rooms", type=Path, nargs="+")
    for path in parser.parse_args().rooms:
        rows = [row for room in labelled_rooms(path) if (row := look(room)) is not None]
        means = np.nanmean(np.array(rows), axis=0)
        print(f"{path.name}: {len(rows)} rooms; " + ", ".join(f"{name} {mean:.2f}" for name, mean in zip(NAMES, means)))


if __name__ == "__main__":
    main()
