"""What knowing the frame is worth: the same target fitted in its whole shape's frame, and where it must be found.

Both are whole fits (`kpred.fit`) of clean points with the category given, and are measured alike: points sampled on the
result's mesh, in the true unit box. In the unknown frame the target stands anywhere, in any size and at any yaw, and
only its up axis is given.
"""

from __future__ import annotations

import zlib
from collections.abc import Callable

import numpy as np
import torch
import trimesh

from kpred.evaluation.scans.outcomes import Fitting, moved, tried
from kpred.evaluation.scans.targets import random_frame
from kpred.evaluation.tables.rows import CD, UCD, UCD_WHOLE, WHOLE, Score
from kpred.evaluation.tables.targets import Target
from kpred.fitting import RefineConfig
from kpred.ops import chamfer_distance, sample_surface, squared_distances
from kpred.ops.typing import Float
from kpred.refinement.structure_config import StructureConfig

KNOWN_FRAME, UNKNOWN_FRAME = "fit_known_frame", "fit_unknown_frame"


def measure_fits(
    target: Target,
    category: str,
    how: Fitting,
    settings: tuple[RefineConfig, StructureConfig],
    protocol: str,
    occlusion: float,
    report: Callable[[str], None],
) -> list[Score]:
    """Scores of both fits, unit box squared; one that fails is told to `report` and has none.

    Args:
        settings: of the keypoints' refinement and of the structure-keeping deformation.
    """
    partial = protocol == "partial"
    cloud = target.visible(occlusion) if partial else target.points
    checksum = zlib.crc32(f"frame {how.seed} {target.model_id}".encode())
    frame = random_frame(torch.Generator().manual_seed(checksum))
    known = cloud.numpy().astype(np.float64)
    options = {"category": category, "partial": partial, "clean": False}
    options |= {"refinement": settings[0], "structure": settings[1]}
    fits = {
        KNOWN_FRAME: tried(known, how, frame="known", **options),
        UNKNOWN_FRAME: tried(frame.from_unit(known), how, up="y", **options),
    }
    scores = []
    for method, fit in fits.items():
        if isinstance(fit, str):
            report(f"no result: {target.model_id}, {method}: {fit}")
            continue
        mesh = moved(fit.mesh, frame) if method == UNKNOWN_FRAME else fit.mesh
        result = sampled(mesh, len(target.points), checksum)
        top_k = how.top_k
        if partial:
            seen, whole = (float(squared_distances(c[None], result[None]).mean()) for c in (cloud, target.points))
            scores.append(Score(protocol, occlusion, method, UCD, top_k, seen))
            scores.append(Score(protocol, occlusion, method + WHOLE, UCD_WHOLE, top_k, whole))
        else:
            error = float(chamfer_distance(target.points[None], result[None]))
            scores.append(Score(protocol, occlusion, method, CD, top_k, error))
    return scores


def sampled(mesh: trimesh.Trimesh, count: int, seed: int) -> Float[torch.Tensor, "count 3"]:
    """Points of a mesh's surface, in its frame; raises MeshError where no face has an area."""
    vertices = torch.from_numpy(np.asarray(mesh.vertices, dtype=np.float32))
    faces = torch.from_numpy(np.asarray(mesh.faces, dtype=np.int64))
    return sample_surface(vertices, faces, count, torch.Generator().manual_seed(seed))[0]
