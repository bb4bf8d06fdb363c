"""Meshes, packs of meshes, scans, and the files that hold them.

Names are imported at first use, so ``import kpred.shapes`` needs nothing but numpy.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from kpred._lazy import lazy_names

if TYPE_CHECKING:
    from kpred.shapes.camera import Camera as Camera
    from kpred.shapes.depth import DepthScan as DepthScan
    from kpred.shapes.depth import MergedScan as MergedScan
    from kpred.shapes.depth import merge_views as merge_views
    from kpred.shapes.depth import read_depth as read_depth
    from kpred.shapes.depth import read_mask as read_mask
    from kpred.shapes.depth import scan_depth as scan_depth
    from kpred.shapes.depth import write_depth as write_depth
    from kpred.shapes.folder import FolderItem as FolderItem
    from kpred.shapes.folder import read_folder as read_folder
    from kpred.shapes.intrinsics_file import IntrinsicsFile as IntrinsicsFile
    from kpred.shapes.intrinsics_file import read_intrinsics as read_intrinsics
    from kpred.shapes.intrinsics_file import read_intrinsics_file as read_intrinsics_file
    from kpred.shapes.mesh import Mesh as Mesh
    from kpred.shapes.mesh import clean_mesh as clean_mesh
    from kpred.shapes.mesh_io import read_mesh as read_mesh
    from kpred.shapes.mesh_io import write_mesh as write_mesh
    from kpred.shapes.pack import MeshPack as MeshPack
    from kpred.shapes.pack import concatenate as concatenate
    from kpred.shapes.pose_file import read_pose as read_pose
    from kpred.shapes.render import render_depth as render_depth
    from kpred.shapes.scan import check_points as check_points
    from kpred.shapes.scan import read_scan as read_scan
    from kpred.shapes.source import Shape as Shape
    from kpred.shapes.source import open_shapes as open_shapes

_MODULES = {
    "Camera": "camera",
    "IntrinsicsFile": "intrinsics_file",
    "DepthScan": "depth",
    "FolderItem": "folder",
    "MergedScan": "depth",
    "Mesh": "mesh",
    "MeshPack": "pack",
    "Shape": "source",
    "check_points": "scan",
    "clean_mesh": "mesh",
    "concatenate": "pack",
    "merge_views": "depth",
    "open_shapes": "source",
    "read_depth": "depth",
    "read_folder": "folder",
    "read_intrinsics": "intrinsics_file",
    "read_intrinsics_file": "intrinsics_file",
    "read_mask": "depth",
    "read_mesh": "mesh_io",
    "read_pose": "pose_file",
    "read_scan": "scan",
    "render_depth": "render",
    "scan_depth": "depth",
    "write_depth": "depth",
    "write_mesh": "mesh_io",
}

__all__ = sorted(_MODULES)  # pyright: ignore[reportUnsupportedDunderAll]

__getattr__, __dir__ = lazy_names(__name__, _MODULES)
