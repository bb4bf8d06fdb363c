"""Results named by the models of Scan2CAD's annotations: its benchmark counts all others as wrong.

The pool of a scan is the set of models that its annotation uses. Their ids and boxes are read, their poses are not.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from kpred.errors import ScanError
from kpred.scenes.scan2cad import AlignedModel, Alignment, compose, read_annotations


def read_pool(path: str | os.PathLike[str], id_scan: str) -> tuple[AlignedModel, ...]:
    """Read the models of a scan from full_annotations.json, each once; those without a box are left out.

    Raises:
        ScanError: the file is broken, or it has no model of that scan.
    """
    every = read_annotations(path, id_scan)
    models = {(model.catid_cad, model.id_cad): model for one in every for model in one.models}
    found = tuple(model for model in models.values() if model.half_size is not None and model.center is not None)
    if not found:
        raise ScanError(f"{path}: it has no model of {id_scan} with bbox and center; give the annotation of that scan.")
    return found


def with_pool_models(alignments: Sequence[Alignment], pool: Sequence[AlignedModel]) -> list[Alignment]:
    """Return alignments of the pool's models that fill the results' boxes; those of other categories are left out.

    Of a category's models the one whose proportions are nearest is taken.
    """
    found = []
    for one in alignments:
        mine = [model for model in pool if model.catid_cad == one.catid_cad]
        if mine:
            found.append(min((_in_box(one, model) for model in mine), key=lambda pair: pair[0])[1])
    return found


def _in_box(one: Alignment, model: AlignedModel) -> tuple[float, Alignment]:
    """Return how far a model's proportions are from a result's, and the alignment that puts it into that box."""
    assert model.half_size is not None and model.center is not None
    scale = one.half_size * one.scale / np.maximum(model.half_size, 1e-6)
    to_scan = compose(one.translation, one.rotation, scale)
    unlike = float(np.std(np.log(np.maximum(scale, 1e-9))))
    changed = replace(
        one,
        catid_cad=model.catid_cad,
        id_cad=model.id_cad,
        scale=scale,
        translation=one.translation - to_scan[:3, :3] @ model.center,
        half_size=model.half_size,
    )
    return unlike, changed
