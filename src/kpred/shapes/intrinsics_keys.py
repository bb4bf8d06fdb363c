"""Under which names programs write intrinsics, sizes of pictures and units of depth; all in lower case."""

from __future__ import annotations

NUMBER_KEYS: tuple[tuple[tuple[str, str, str, str], str], ...] = (
    (("fx_depth", "fy_depth", "mx_depth", "my_depth"), "depth"),  # ScanNet
    (("fx_color", "fy_color", "mx_color", "my_color"), "color"),
    (("fx", "fy", "cx", "cy"), ""),
    (("fx", "fy", "ppx", "ppy"), ""),  # RealSense
    (("fl_x", "fl_y", "cx", "cy"), ""),  # nerfstudio, instant-ngp
    (("camera.fx", "camera.fy", "camera.cx", "camera.cy"), ""),  # ORB-SLAM
    (("camera1.fx", "camera1.fy", "camera1.cx", "camera1.cy"), ""),
    (("f_x", "f_y", "c_x", "c_y"), ""),
    (("fx", "fy", "px", "py"), ""),
    (("fx", "fy", "ox", "oy"), ""),
    (("focal_x", "focal_y", "center_x", "center_y"), ""),
    (("focal_length_x", "focal_length_y", "principal_point_x", "principal_point_y"), ""),
    (("focallengthx", "focallengthy", "principalpointx", "principalpointy"), ""),
    (("f", "f", "cx", "cy"), ""),
)
"""Names of fx, fy, cx and cy, and what the camera is for."""

FOCAL_AND_POINT = (
    ("focal_length", "principal_point"),
    ("focallength", "principalpoint"),
    ("focal", "principal_point"),
    ("f", "c"),
)
"""Names of two lists: focal lengths, principal point."""

ANGLE_KEYS = ("camera_angle_x", "hfov")
"""Names of the horizontal field of view: radians (NeRF), degrees (Habitat)."""

MATRIX_KEYS = (
    ("m_calibrationdepthintrinsic", "depth"),  # ScanNet's _info.txt
    ("intrinsic_matrix", ""),  # Open3D
    ("camera_matrix", ""),  # ROS, OpenCV
    ("cameramatrix", ""),
    ("intrinsicmatrix", ""),
    ("depth_intrinsics", ""),
    ("depth_intrinsic", ""),
    ("intrinsics", ""),
    ("intrinsic", ""),
    ("camera_intrinsics", ""),
    ("camera_intrinsic", ""),
    ("cameraintrinsics", ""),
    ("intrinsics_matrix", ""),  # Matterport3D
    ("cam_k", ""),  # BOP
    ("mtx", ""),  # OpenCV's examples
    ("k", ""),  # ROS 1 and 2, Record3D
    ("data", ""),
)

SIZE_KEYS = (
    (("depthwidth", "depthheight"), "depth"),
    (("m_depthwidth", "m_depthheight"), "depth"),
    (("depth_width", "depth_height"), "depth"),
    (("colorwidth", "colorheight"), "color"),
    (("m_colorwidth", "m_colorheight"), "color"),
    (("width", "height"), ""),
    (("w", "h"), ""),
    (("image_width", "image_height"), ""),
    (("imagewidth", "imageheight"), ""),
    (("camera.width", "camera.height"), ""),
    (("resolution",), ""),  # Kalibr
    (("image_size",), ""),
    (("imageresolution",), ""),  # ARKit
    (("imagesize",), ""),
)

SCALE_KEYS = (
    "depth_scale",
    "depthscale",
    "png_depth_scale",
    "integer_depth_scale",
    "depth_unit_scale_factor",
    "depthmapfactor",
    "rgbd.depthmapfactor",
    "depth_factor",
    "depthfactor",
    "m_depthshift",
    "depth_shift",
    "depth_units",
    "depth_unit",
)

COLMAP_MODELS = {
    "PINHOLE": False,
    "OPENCV": False,
    "FULL_OPENCV": False,
    "SIMPLE_PINHOLE": True,
    "SIMPLE_RADIAL": True,
    "RADIAL": True,
}
"""Names of COLMAP's models of cameras, and whether they have one focal length."""

AZURE_SENSOR = 1024
AZURE_CROPS = {
    (640, 576): (1024, 192, 180),
    (320, 288): (512, 96, 90),
    (512, 512): (512, 0, 0),
    (1024, 1024): (1024, 0, 0),
}
"""Size of a depth picture of Azure Kinect -> side of the whole sensor at that binning, and where the picture begins."""
