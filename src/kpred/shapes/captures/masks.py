"""The masks of a capture: one picture for each depth picture, of the same name."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from kpred.errors import ScanError
from kpred.ops.typing import Bool
from kpred.shapes.captures.capture import Frame
from kpred.shapes.depth import MASK_EXTENSIONS, read_mask


def mask_finder(folder: Path, mask_id: int | None) -> Callable[[Frame], Bool[np.ndarray, "height width"]]:
    """Return what finds the object's pixels (height, width) of a frame, by the stem of its depth picture.

    A frame whose mask is missing or empty shows nothing of the object.

    Raises:
        ScanError: `folder` is none, or holds no masks.
    """
    if not folder.is_dir():
        raise ScanError(f"{folder}: masks of a capture are a folder of pictures named as the depth pictures are.")
    known = {_stem(file): file for file in sorted(folder.iterdir()) if file.suffix.lower() in MASK_EXTENSIONS}
    if not known:
        raise ScanError(f"{folder}: it holds no masks; put pictures named as the depth pictures there.")

    def mask_of(frame: Frame) -> np.ndarray:
        file = known.get(_stem(frame.depth))
        if file is None:
            raise ScanError(f"{folder}: it holds no mask for {frame.depth.name}; name masks as the depth pictures are.")
        return read_mask(file, mask_id)

    return mask_of


def _stem(file: Path) -> str:
    """Return the name without extensions, and without the words that name a kind of picture."""
    return file.name.partition(".")[0].removeprefix("depth_").removeprefix("mask_")
