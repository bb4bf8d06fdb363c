"""From an upright room to proposals: voxels, floor and walls, pieces, and the sets of pieces that may be objects."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch

from kpred.detection.adjacency import Pieces, describe_pieces, pair_features, touching
from kpred.detection.crops import RoomVoxels
from kpred.detection.links import Links
from kpred.detection.networks import PairNetwork
from kpred.detection.proposals import merge_trees
from kpred.detection.segments import neighbour_edges, segment_voxels
from kpred.detection.structure import Structure, find_structure
from kpred.detection.voxels import STRAY_REACH, VoxelGrid, voxel_grid, without_strays
from kpred.ops.typing import Float, Int

MIN_REST = 60
"""Voxels that must be left without floor and walls for there to be any object."""


@dataclass(frozen=True, eq=False)
class PreparedRoom:
    """A room before proposals.

    Attributes:
        grid: its voxels; structure: floor, walls and ceiling; voxels: both, upright, with the piece of each voxel.
        pieces: None without any.
        pairs: (E, 2) pieces that touch; contact: (E, 5) how; features: (E, PAIR_FEATURES).
    """

    grid: VoxelGrid
    structure: Structure
    voxels: RoomVoxels
    pieces: Pieces | None
    pairs: Int[np.ndarray, "pairs 2"]
    contact: Float[np.ndarray, "pairs 5"]
    features: Float[np.ndarray, "pairs features"]


def prepare_room(points: Float[np.ndarray, "points 3"]) -> PreparedRoom:
    """Cut a room (N, 3) in metres, z up, into pieces of objects, floor, walls and ceiling apart."""
    cells = voxel_grid(points)
    grid = without_strays(cells, max(STRAY_REACH, 6.0 * cells.cell))
    structure = find_structure(grid.points)
    places = np.column_stack([grid.points[:, :2], structure.height])
    rest = np.flatnonzero(~structure.mask)
    segment = np.full(len(grid), -1, dtype=np.int64)
    if len(rest) < MIN_REST:
        voxels = RoomVoxels(places, structure.normals, structure.mask, segment, grid.cell)
        nothing = np.zeros((0, 2), np.int64), np.zeros((0, 5)), np.zeros((0, 0))
        return PreparedRoom(grid, structure, voxels, None, *nothing)
    edges, _ = neighbour_edges(places[rest])
    segment[rest] = segment_voxels(places[rest], structure.normals[rest], edges)
    pieces = describe_pieces(places[rest], structure.normals[rest], segment[rest], places[structure.mask], grid.cell)
    pairs, contact = touching(places[rest], pieces)
    voxels = RoomVoxels(places, structure.normals, structure.mask, segment, grid.cell)
    return PreparedRoom(grid, structure, voxels, pieces, pairs, contact, pair_features(pieces, pairs, contact))


def pair_odds(room: PreparedRoom, network: PairNetwork) -> Float[np.ndarray, " pairs"]:
    """Predict log-odds that the pieces of each pair are of one object."""
    with torch.inference_mode():
        return np.asarray(network(torch.from_numpy(room.features).float()).double().numpy())


def propose_objects(room: PreparedRoom, odds: Float[np.ndarray, " pairs"]) -> list[frozenset[int]]:
    """List sets of pieces that may be one object; `odds` as of `pair_odds`."""
    return [] if room.pieces is None else merge_trees(room.pieces, room.pairs, odds, room.contact)


def room_links(room: PreparedRoom, odds: Float[np.ndarray, " pairs"]) -> Links:
    """Return how the pieces of a room hang together; `odds` as of `pair_odds`."""
    return Links(0 if room.pieces is None else len(room.pieces.sizes), room.pairs, odds, room.contact)
