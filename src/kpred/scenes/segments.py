"""The segments of a scanned scene, of which annotated objects are made: ScanNet, ScanNet++ and 3RScan."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from kpred.errors import ScanError
from kpred.scenes.scan2cad import read_json
from kpred.scenes.scene import Scene

_NAMES = ("segments.json",)
"""ScanNet++ calls them so; the others lie beside the scene as `<scene>*.segs.json` or `*.segs.v2.json`."""

_MAX_NAME = 255


def segment_numbers(scene: Scene, file: Path, named: str) -> np.ndarray:
    """Read the segment of every point of a scene, (N,) int64, from the file that an annotation belongs to.

    Args:
        file: the annotation; its segments lie beside it or beside the scene.
        named: the name of the segments' file as the annotation gives it; folders in it are left out.

    Raises:
        ScanError: they are not there, or belong to another scene.
    """
    bare = Path(named.replace("\\", "/")).name if len(named) <= _MAX_NAME and "\0" not in named else ""
    folders = [file.parent] + ([scene.path.parent] if scene.path is not None else [])
    names = [name for name in (bare, bare.removeprefix("scannet."), *_NAMES) if name]
    candidates = [folder / name for folder in folders for name in names]
    candidates += [found for folder in folders for found in _beside(folder, scene.name)]
    source = next((candidate for candidate in candidates if candidate.is_file()), None)
    if source is None:
        raise ScanError(f"{file}: its segments ({bare or '*.segs.json'}) are not beside it; put them there.")
    content = read_json(source)
    try:
        numbers = np.asarray(content["segIndices"], dtype=np.int64)
    except (TypeError, LookupError, ValueError, OverflowError):
        raise ScanError(f"{source}: it has no segIndices; give ScanNet's .segs.json.") from None
    if numbers.shape != (len(scene.points),):
        raise ScanError(
            f"{source}: it has segments of {numbers.size} points, but the scene has {len(scene.points)}; "
            "give those of that scene."
        )
    return numbers


def _beside(folder: Path, scene: str) -> list[Path]:
    files = sorted(item for item in folder.iterdir() if ".segs." in item.name and item.suffix == ".json")
    return [item for item in files if item.name.startswith(scene)] or (files if len(files) == 1 else [])
