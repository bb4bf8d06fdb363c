"""Pure tensor geometry: no network, no file, no category. Every function names shapes, units and frame."""

from kpred.ops.cage import enclosing_cage, icosphere, pulled_in_cage
from kpred.ops.chamfer import chamfer_distance, squared_distances, unilateral_chamfer_distance
from kpred.ops.frames import Frame, unit_box_frame
from kpred.ops.interpolation import affine_influence, gaussian_influence
from kpred.ops.mean_value import mean_value_coordinates
from kpred.ops.nearest import nearest_neighbours
from kpred.ops.occlusion import depth_scan, slice_by_plane
from kpred.ops.regions import ball_query, density_confidence
from kpred.ops.sampling import farthest_point_sampling, sample_surface

__all__ = [
    "Frame",
    "affine_influence",
    "ball_query",
    "chamfer_distance",
    "density_confidence",
    "depth_scan",
    "enclosing_cage",
    "farthest_point_sampling",
    "gaussian_influence",
    "icosphere",
    "mean_value_coordinates",
    "nearest_neighbours",
    "pulled_in_cage",
    "sample_surface",
    "slice_by_plane",
    "squared_distances",
    "unilateral_chamfer_distance",
    "unit_box_frame",
]
