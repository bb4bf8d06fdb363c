"""Motion of a source's parts by attention between parts, source and target (U-RED, Sec. 3)."""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.nn import functional

from kpred.ops.typing import Bool, Float

STEP = 0.1
"""What the decoder says is scaled by this (published)."""


class Messages(nn.Module):
    """One round: nodes ask others, and add what they make of the answer to themselves."""

    def __init__(self, width: int, heads: int) -> None:
        super().__init__()
        self.heads = heads
        self.ask, self.answer = nn.Linear(width, width), nn.Linear(width, 2 * width)
        self.merge = nn.Linear(width, width)
        self.widen, self.narrow = nn.Linear(2 * width, 2 * width), nn.Linear(2 * width, width)

    def forward(
        self,
        nodes: Float[Tensor, "batch nodes width"],
        others: Float[Tensor, "batch others width"],
        there: Bool[Tensor, "batch others"],
    ) -> Float[Tensor, "batch nodes width"]:
        """Update the nodes by one round of messages; nodes that are not `there` send none."""
        query = self.ask(nodes).unflatten(2, (self.heads, -1)).transpose(1, 2)
        key, value = (x.transpose(1, 2) for x in self.answer(others).unflatten(2, (2, self.heads, -1)).unbind(2))
        heard = functional.scaled_dot_product_attention(query, key, value, attn_mask=there[:, None, None])
        message = torch.cat([nodes, self.merge(heard.transpose(1, 2).flatten(2))], dim=2)
        changed: Tensor = nodes + self.narrow(functional.leaky_relu(self.widen(message), 0.1))
        return changed


class PartAttention(nn.Module):
    """Two nodes for whole source and target, one for each part; rounds among themselves and between the two kinds."""

    def __init__(self, code_size: int, width: int, rounds: int, heads: int) -> None:
        super().__init__()
        self.encode = nn.ModuleList([nn.Linear(code_size, width), nn.Linear(width, width)])
        self.source, self.target = nn.Linear(code_size, width), nn.Linear(code_size, width)
        self.among = nn.ModuleList([Messages(width, heads) for _ in range(rounds)])
        self.between = nn.ModuleList([Messages(width, heads) for _ in range(rounds)])
        self.hidden, self.output = nn.Linear(3 * width, 256), nn.Linear(256, 6)

    def describe(
        self, part_codes: Float[Tensor, "batch parts size"], there: Bool[Tensor, "batch parts"]
    ) -> Float[Tensor, "batch parts width"]:
        """Return the parts' nodes after their first round among themselves, which no target changes."""
        first, second = self.encode
        parts = second(functional.leaky_relu(first(part_codes), 0.1))
        described: Tensor = self.among[0](parts, parts, there)
        return described

    def forward(
        self,
        sources: Float[Tensor, "batch size"],
        targets: Float[Tensor, "batch size"],
        parts: Float[Tensor, "batch parts width"],
        there: Bool[Tensor, "batch parts"],
    ) -> Float[Tensor, "batch parts 6"]:
        """Predict how each part (`describe`) moves and grows, before contacts are kept; undefined for empty parts."""
        whole = torch.stack([self.source(sources), self.target(targets)], dim=1)
        both = there.new_ones(len(there), 2)
        for number, (among, between) in enumerate(zip(self.among, self.between, strict=True)):
            whole, parts = among(whole, whole, both), among(parts, parts, there) if number else parts
            whole, parts = between(whole, parts, there), between(parts, whole, both)
        features = torch.cat([whole.flatten(1)[:, None].expand(-1, parts.shape[1], -1), parts], dim=2)
        motion: Tensor = STEP * self.output(functional.leaky_relu(self.hidden(features), 0.1))
        return motion
