"""The result over the photograph: the CAD model drawn half transparent, with outlines, by the camera that took it.

This is how the paper shows its results on Scan2CAD. The drawing is plain numpy and needs no graphics library.
"""

from __future__ import annotations

import os
import warnings
from pathlib import Path

import numpy as np
from PIL import Image, UnidentifiedImageError

from kpred.atomic import atomic_path
from kpred.errors import ScanError
from kpred.rendering.draw import PictureWarning, check_png
from kpred.shapes.camera import Camera
from kpred.shapes.reading import check_file
from kpred.shapes.render import render_faces

COLOR = (0.33, 0.62, 0.95)
OPACITY = 0.6
OUTLINE = (0.04, 0.13, 0.30)

MAX_PIXELS = 1 << 26
"""Of a photograph: 67 million, more than cameras in telephones take."""

_SAMPLES = 2
"""Samples a pixel in each direction, against jagged edges."""

_LIGHT = np.array([-0.45, -0.75, -0.5])
"""Toward the key light in camera axes (x right, y down, z forward): from the upper left behind the camera."""

_EDGE_LINE, _CREASE_LINE = 0.95, 0.6
"""Opacities of the lines around silhouettes and along creases."""

_CREASE = 0.35
"""Cosine below which two neighbouring faces have an edge drawn between them, as where the seat meets a leg."""


def draw_overlay(
    picture: np.ndarray, vertices: np.ndarray, faces: np.ndarray, camera: Camera, opacity: float = OPACITY
) -> np.ndarray:
    """Draw a mesh over a photograph.

    Args:
        picture: (height, width, 3) uint8, what `camera` saw; the camera is resized to it.
        vertices: (V, 3) in the camera's world; faces: (F, 3).
        opacity: of the faces, 0 to 1; outlines are nearly opaque.

    Returns:
        (height, width, 3) uint8.

    Raises:
        ConfigError: the picture has other proportions than the camera's.
    """
    height, width = picture.shape[:2]
    fine = camera.resized(width * _SAMPLES, height * _SAMPLES)
    depth, face = render_faces(vertices, faces, fine)
    result = picture[..., :3].copy()
    rows, columns = (np.flatnonzero((face >= 0).any(axis=axis)) // _SAMPLES for axis in (1, 0))
    if not len(rows):
        return result
    # Only the part of the picture that holds the mesh and its outline is worked on.
    part = tuple(slice(max(side[0] - 2, 0), side[-1] + 3) for side in (rows, columns))
    several = tuple(slice(side.start * _SAMPLES, side.stop * _SAMPLES) for side in part)
    depth, face = depth[several], face[several]
    inside = face >= 0
    normals = _normals(fine.to_camera(vertices)[faces])[face]
    color = _shade(normals) * np.array(COLOR)
    line = _outline(depth, normals, inside, 1e-6 + 12 / float(fine.intrinsics[0, 0]))
    alpha = np.maximum(np.where(inside, opacity, 0.0), line)[..., None]
    color = np.where(line[..., None] > 0, np.array(OUTLINE), color)
    paint, cover = (_averaged(values) for values in (color * alpha, alpha))
    result[part] = (paint * 255 + result[part] * (1 - cover)).round().clip(0, 255).astype(np.uint8)
    return result


def save_overlay(
    vertices: np.ndarray,
    faces: np.ndarray,
    camera: Camera,
    photograph: str | os.PathLike[str],
    path: str | os.PathLike[str],
    opacity: float = OPACITY,
) -> None:
    """Draw a mesh over the photograph file and write the PNG `path`, whole or not at all.

    Warns with a `PictureWarning` when the mesh lies outside of the picture; it is written nevertheless.

    Raises:
        ScanError: the photograph is missing or unreadable.
        ConfigError: it has other proportions than the camera's picture.
        OutputError: `path` is not a .png, or cannot be written.
    """
    target = check_png(path)
    picture = read_photograph(photograph)
    drawn = draw_overlay(picture, vertices, faces, camera, opacity)
    if np.array_equal(drawn, picture):
        message = f"The result lies outside of the picture {photograph}; check pose and intrinsics."
        warnings.warn(message, PictureWarning, stacklevel=2)
    with atomic_path(target) as temporary:
        Image.fromarray(drawn).save(temporary, format="PNG")


def read_photograph(path: str | os.PathLike[str]) -> np.ndarray:
    """(height, width, 3) uint8 of a picture file (.png, .jpg, ...), its pixels as they were taken.

    Raises:
        ScanError: missing, unreadable, no picture, or too large.
    """
    file = Path(path)
    check_file(file, ScanError, "photograph")
    try:
        with Image.open(file) as picture:
            if picture.width * picture.height > MAX_PIXELS:
                raise ScanError(f"{file}: {picture.width} x {picture.height} pixels are too many; give a smaller copy.")
            return np.asarray(picture.convert("RGB"))
    except UnidentifiedImageError as error:
        raise ScanError(f"{file}: it is not a picture; give a .png or .jpg photograph.") from error
    except (OSError, ValueError, SyntaxError, Image.DecompressionBombError) as error:
        raise ScanError(f"{file}: it cannot be read (damaged or cut short: {error}); copy it again.") from error


def _averaged(values: np.ndarray) -> np.ndarray:
    """Average samples (height * 2, width * 2, C) to pixels (height, width, C)."""
    height, width, channels = values.shape
    blocks = values.reshape(height // _SAMPLES, _SAMPLES, width // _SAMPLES, _SAMPLES, channels)
    return np.asarray(blocks.mean(axis=(1, 3)))


def _normals(corners: np.ndarray) -> np.ndarray:
    """Compute unit normals (F, 3) toward the camera, in camera axes; corners (F, 3, 3)."""
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    away = (normal * corners[:, 0]).sum(axis=1) > 0
    normal[away] *= -1
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    return np.asarray(normal / np.maximum(length, 1e-30))


def _shade(normals: np.ndarray) -> np.ndarray:
    """Brightness (..., 1): ambient, key light and head light."""
    key = (normals @ (_LIGHT / np.linalg.norm(_LIGHT))).clip(0)
    head = (-normals[..., 2]).clip(0)
    return np.asarray(0.35 + 0.55 * key + 0.25 * head)[..., None].clip(0, 1.05)


def _outline(depth: np.ndarray, normals: np.ndarray, inside: np.ndarray, step: float) -> np.ndarray:
    """Opacity (height, width) of lines: around the silhouette, at jumps of depth, and weaker at creases."""
    line = np.zeros(depth.shape)
    near = np.where(inside, depth, np.inf)
    for axis in (0, 1):
        one = (slice(None, -1), slice(None)) if axis == 0 else (slice(None), slice(None, -1))
        other = (slice(1, None), slice(None)) if axis == 0 else (slice(None), slice(1, None))
        both = inside[one] & inside[other]
        front = np.minimum(near[one], near[other])
        with np.errstate(invalid="ignore"):
            jump = both & (np.abs(near[one] - near[other]) > step * front)
        crease = both & ((normals[one] * normals[other]).sum(axis=-1) < _CREASE)
        strength = np.where((inside[one] != inside[other]) | jump, _EDGE_LINE, np.where(crease, _CREASE_LINE, 0.0))
        line[one] = np.maximum(line[one], strength)
        line[other] = np.maximum(line[other], strength)
    # Two fine samples are too thin a line around the silhouette: one more on each side.
    wide = np.pad(np.where(line > _CREASE_LINE, line, 0.0), 1)
    around = [wide[:-2, 1:-1], wide[2:, 1:-1], wide[1:-1, :-2], wide[1:-1, 2:]]
    return np.asarray(np.maximum.reduce([line, *around]))
