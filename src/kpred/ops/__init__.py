"""Pure tensor geometry: no network, no file, no category. Every function names shapes, units and frame.

Names are imported at first use, so that annotations (`kpred.ops.typing`) need no torch.
"""

from typing import TYPE_CHECKING

from kpred._lazy import lazy_names

if TYPE_CHECKING:
    from kpred.ops.cage import enclosing_cage as enclosing_cage
    from kpred.ops.cage import icosphere as icosphere
    from kpred.ops.cage import pulled_in_cage as pulled_in_cage
    from kpred.ops.chamfer import chamfer_distance as chamfer_distance
    from kpred.ops.chamfer import squared_distances as squared_distances
    from kpred.ops.chamfer import unilateral_chamfer_distance as unilateral_chamfer_distance
    from kpred.ops.frames import Frame as Frame
    from kpred.ops.frames import unit_box_frame as unit_box_frame
    from kpred.ops.interpolation import affine_influence as affine_influence
    from kpred.ops.interpolation import gaussian_influence as gaussian_influence
    from kpred.ops.mean_value import mean_value_coordinates as mean_value_coordinates
    from kpred.ops.nearest import nearest_neighbours as nearest_neighbours
    from kpred.ops.occlusion import depth_scan as depth_scan
    from kpred.ops.occlusion import slice_by_plane as slice_by_plane
    from kpred.ops.regions import ball_query as ball_query
    from kpred.ops.regions import density_confidence as density_confidence
    from kpred.ops.sampling import farthest_point_sampling as farthest_point_sampling
    from kpred.ops.sampling import sample_surface as sample_surface

_MODULES = {
    "Frame": "kpred.ops.frames",
    "affine_influence": "kpred.ops.interpolation",
    "ball_query": "kpred.ops.regions",
    "chamfer_distance": "kpred.ops.chamfer",
    "density_confidence": "kpred.ops.regions",
    "depth_scan": "kpred.ops.occlusion",
    "enclosing_cage": "kpred.ops.cage",
    "farthest_point_sampling": "kpred.ops.sampling",
    "gaussian_influence": "kpred.ops.interpolation",
    "icosphere": "kpred.ops.cage",
    "mean_value_coordinates": "kpred.ops.mean_value",
    "nearest_neighbours": "kpred.ops.nearest",
    "pulled_in_cage": "kpred.ops.cage",
    "sample_surface": "kpred.ops.sampling",
    "slice_by_plane": "kpred.ops.occlusion",
    "squared_distances": "kpred.ops.chamfer",
    "unilateral_chamfer_distance": "kpred.ops.chamfer",
    "unit_box_frame": "kpred.ops.frames",
}

__all__ = sorted(_MODULES)  # pyright: ignore[reportUnsupportedDunderAll]

__getattr__, __dir__ = lazy_names(__name__, _MODULES)
