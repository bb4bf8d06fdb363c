"""Packs that commands write: where they go, and what is printed of them."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING

from kpred.atomic import check_place
from kpred.errors import OutputError

if TYPE_CHECKING:
    from kpred.shapes import MeshPack


def check_pack_place(path: Path, kind: str) -> None:
    """Refuse a place for a mesh or room pack before any work is done for it.

    Raises:
        OutputError: the extension is not .npz, or the file cannot be written there.
    """
    if path.suffix.lower() != ".npz":
        raise OutputError(f"Cannot write {path}: {kind} packs are .npz files; give it that extension.")
    check_place(path)


def split_counts(pack: MeshPack) -> dict[str, int]:
    """Count the shapes of each split."""
    return dict(sorted(Counter(pack.split.tolist()).items()))
