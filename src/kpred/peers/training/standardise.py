"""Weights to start from: every layer scaled by what it says of real data, in place of batch normalisation.

The published networks of parts have batch normalisation. Without it, the maximum over a cloud's points is nearly the
same for every shape, so that the code of a target says little of it, and for a long time all sources are deformed to
one mean shape.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

import torch
from torch import Tensor, nn

MIN_SPREAD = 1e-4
"""A channel that varies less is not scaled up further."""


@torch.no_grad()
def standardise(layers: Iterable[nn.Linear], run: Callable[[], object]) -> None:
    """Give each layer's outputs mean 0 and deviation 1 over a batch, one after the other as `run` meets them.

    Layers without a bias keep their mean; a layer that is met several times counts the first.
    """
    met: set[nn.Module] = set()

    def scale(layer: nn.Module, _given: Any, said: Tensor) -> Tensor | None:
        if layer in met or not isinstance(layer, nn.Linear):
            return None
        met.add(layer)
        flat = said.detach().reshape(-1, said.shape[-1]).float()
        mean, spread = flat.mean(0), flat.std(0).clamp(min=MIN_SPREAD)
        layer.weight.div_(spread[:, None])
        if layer.bias is None:
            return said / spread
        layer.bias.sub_(mean).div_(spread)
        return (said - mean) / spread

    hooks = [layer.register_forward_hook(scale) for layer in layers]
    try:
        run()
    finally:
        for hook in hooks:
            hook.remove()


def hidden_layers(*parts: nn.Module) -> list[nn.Linear]:
    """List the linear layers of networks but for the last ones, which are called `output`."""
    named = (pair for part in parts for pair in part.named_modules())
    return [layer for name, layer in named if isinstance(layer, nn.Linear) and not name.endswith("output")]
