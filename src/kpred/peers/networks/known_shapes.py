"""Shapes that a network knows by learned codes alone: where the codes of given ids are."""

from __future__ import annotations

import torch
from torch import Tensor

from kpred.errors import ModelError
from kpred.ops.typing import Int

CODE_RATE = 10.0
"""Codes learn so much faster than the networks: each is met in few steps of a short training, and Adam's steps do not
depend on the scale of a parameter."""


def known_rows(known: tuple[str, ...], model_ids: tuple[str, ...]) -> Int[Tensor, " shapes"]:
    """Return rows of the codes of these shapes.

    Raises:
        ModelError: if one was not among the shapes of the training.
    """
    place = {name: row for row, name in enumerate(known)}
    missing = [name for name in model_ids if name not in place]
    if missing:
        raise ModelError(
            f"{len(missing)} of {len(model_ids)} sources were not in the training of this peer, which knows its "
            f"sources by codes alone (the first is {missing[0]}); train it on the packs it is measured on."
        )
    return torch.tensor([place[name] for name in model_ids])
