"""Points of LAZ files: LAS, compressed; read block by block by laspy and lazrs (the extra `las`)."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from kpred.errors import ScanError
from kpred.shapes.formats.records import BLOCK_ROWS
from kpred.shapes.formats.scan_las import NOISE


def laz_points(path: Path, rows: int = BLOCK_ROWS) -> Iterator[np.ndarray]:
    """Yield (n, 3) float64 blocks, n <= `rows`, of the points of a LAZ file, without noise and withheld points.

    Raises:
        ScanError: laspy or lazrs is not installed, or the file is damaged or cut short.
    """
    try:
        import laspy
        import lazrs  # noqa: F401  laspy finds it by itself
    except ImportError as error:
        raise ScanError(f"{path}: LAZ needs laspy and lazrs: pip install 'kpred[las]', or save it as .las.") from error
    read = 0
    try:
        # One thread: the other decoder holds many blocks at once.
        with laspy.open(path, laz_backend=laspy.LazBackend.Lazrs) as reader:
            count = int(reader.header.point_count)
            for block in reader.chunk_iterator(rows):
                read += len(block)
                valid = ~np.isin(np.asarray(block.classification), NOISE) & (np.asarray(block.withheld) == 0)
                yield np.stack([np.asarray(axis, dtype=np.float64) for axis in (block.x, block.y, block.z)], axis=1)[
                    valid
                ]
    except GeneratorExit:
        raise
    except BaseException as error:
        # A fault within lazrs is an exception of its own kind, which is no Exception.
        if isinstance(error, Exception) or type(error).__name__ == "PanicException":
            raise ScanError(
                f"{path}: it is not a readable LAZ file (damaged or cut short); export it again."
            ) from error
        raise
    if read < count:
        raise ScanError(f"{path}: it is cut short ({read} of {count} points); copy or export it again.")
