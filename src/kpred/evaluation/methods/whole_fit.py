"""Whole fits as a method: the same target in its whole shape's frame, and where the frame must be found.

Both are `kpred.fit` of clean points with the category given, measured alike: points sampled on the result's mesh, in
the true unit box. In the unknown frame the target stands anywhere, in any size and at any yaw, and only its up axis is
given.
"""

from __future__ import annotations

import zlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
import trimesh

from kpred.evaluation.header import provenance
from kpred.evaluation.methods.method import Prediction, Query, Searcher
from kpred.evaluation.methods.sources import Sources
from kpred.evaluation.scans.outcome import FailedFit, FitSettings, moved, try_fit
from kpred.evaluation.scans.targets import random_frame
from kpred.fitting.stages import SCAN_POINTS
from kpred.nn import Model
from kpred.ops import sample_surface
from kpred.ops.typing import Float
from kpred.refinement.config import RefineConfig
from kpred.refinement.structure_config import StructureConfig

KNOWN_FRAME, UNKNOWN_FRAME = "fit_known_frame", "fit_unknown_frame"


@dataclass(frozen=True, eq=False)
class WholeFitMethod:
    """Fits of the largest top k.

    Attributes:
        name: of the model in tables; model: its networks; seed: of frames and samples.
        refinement: of the keypoints; structure: of the structure-keeping deformation.
        report: called with one sentence for each fit without a result.
    """

    name: str
    model: Model
    seed: int
    refinement: RefineConfig
    structure: StructureConfig
    report: Callable[[str], None]

    @property
    def provenance(self) -> dict[str, Any]:
        """See `Method`."""
        return provenance(self.model)

    def over(self, sources: Sources) -> Searcher:
        """See `Method`."""
        return _Searcher(self, sources)


@dataclass(frozen=True, eq=False)
class _Searcher:
    method: WholeFitMethod
    sources: Sources

    def predict(self, query: Query) -> Iterator[Prediction]:
        own, top_k = self.method, max(query.top_k)
        settings = FitSettings(own.model, self.sources.database(own.model), top_k, own.seed)
        checksum = zlib.crc32(f"frame {own.seed} {query.target}".encode())
        frame = random_frame(torch.Generator().manual_seed(checksum))
        known = query.cloud.numpy().astype(np.float64)
        options = {"category": self.sources.category, "partial": query.partial, "clean": False}
        options |= {"refinement": own.refinement, "structure": own.structure}
        fits = {
            KNOWN_FRAME: try_fit(known, settings, frame="known", **options),
            UNKNOWN_FRAME: try_fit(frame.from_unit(known), settings, up="y", **options),
        }
        for method, fit in fits.items():
            if isinstance(fit, FailedFit):
                own.report(f"no result: {query.target}, {method}: {fit.reason}")
                continue
            mesh = moved(fit.mesh, frame) if method == UNKNOWN_FRAME else fit.mesh
            yield Prediction(method, top_k, fit.source.model_id, sample_mesh(mesh, SCAN_POINTS, checksum))


def sample_mesh(mesh: trimesh.Trimesh, count: int, seed: int) -> Float[torch.Tensor, "count 3"]:
    """Sample points of a mesh's surface, in its frame.

    Raises:
        MeshError: no face has an area.
    """
    vertices = torch.from_numpy(np.asarray(mesh.vertices, dtype=np.float32))
    faces = torch.from_numpy(np.asarray(mesh.faces, dtype=np.int64))
    return sample_surface(vertices, faces, count, torch.Generator().manual_seed(seed))[0]
