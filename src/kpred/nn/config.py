"""The typed configuration of one category's networks; every ablation row of the paper is a setting of it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

from kpred.errors import ConfigError
from kpred.nn.plain_config import PlainConfig

SHARED = "any"
"""Category of networks that serve every category without networks of its own."""

MAX_SUBDIVISIONS = 5
"""Of the cage's icosahedron: 10,242 vertices."""


@dataclass(frozen=True)
class ModelConfig(PlainConfig):
    """Architecture of one category's networks.

    Attributes:
        category: name of the category the weights are for.
        keypoints: number of semantic keypoints N_K (paper: 12).
        token_size: numbers per keypoint of the retrieval token (128, 1536 in all).
        radius: support ball around a keypoint, unit-box units (paper: 0.3).
        region_points: points kept per support region.
        width: channels of the region encoder's points and tokens.
        stages: rounds of region pooling and self-attention in the region encoder.
        heads: attention heads.
        keypoint_head: `regression` from the global feature (the paper's), or `voting`: every point votes for every
            keypoint's place and the votes are averaged by learned weights.
        partial_blocks: context blocks of the keypoint predictor for partial scans, if it votes.
        box_blocks: context blocks of the box predictor.
        self_attention: GSA; without it influence and tokens come from one global PointNet feature.
        deformation_aware: DAR; without it the retrieval tokens are trained on reconstruction alone (Psi_1).
        local_global: LGF; without it one global feature is the retrieval token.
        confidence: CB; without it every keypoint of a partial scan has the same weight.
        influence: `local`, the network's output inside the support region alone (the paper's), or `affine`: the same as
            a correction to the smooth interpolation that reproduces affine maps.
        influence_neighbours: cage vertices, those nearest to a keypoint, that the network may let it move.
        cage: `enclosing` by construction, or `pulled` in as in the published code (may cut the shape).
        cage_subdivisions: 1 for 42 cage vertices, 2 for 162.
        density: alpha of D_i, points (of 2048) per unit-box volume at which a region counts as fully seen.
    """

    category: str = "chair"
    keypoints: int = 12
    token_size: int = 128
    radius: float = 0.3
    region_points: int = 64
    width: int = 128
    stages: int = 2
    heads: int = 2
    keypoint_head: Literal["regression", "voting"] = "voting"
    partial_blocks: int = 0
    box_blocks: int = 0
    self_attention: bool = True
    deformation_aware: bool = True
    local_global: bool = True
    confidence: bool = True
    influence: Literal["local", "affine"] = "affine"
    influence_neighbours: int = 16
    cage: Literal["enclosing", "pulled"] = "enclosing"
    cage_subdivisions: int = 1
    density: float = 300.0

    def __post_init__(self) -> None:
        for name in ("keypoints", "token_size", "region_points", "width", "stages", "heads", "influence_neighbours"):
            if getattr(self, name) < 1:
                raise ConfigError(f"Model setting {name} must be at least 1, but is {getattr(self, name)}.")
        for name in ("partial_blocks", "box_blocks"):
            if getattr(self, name) < 0:
                raise ConfigError(f"Model setting {name} must not be negative, but is {getattr(self, name)}.")
        if not 0 <= self.cage_subdivisions <= MAX_SUBDIVISIONS:
            raise ConfigError(
                f"Model setting cage_subdivisions must lie in 0 to {MAX_SUBDIVISIONS}, but is {self.cage_subdivisions}."
            )
        if self.width % self.heads:
            raise ConfigError(f"Model setting width ({self.width}) must be a multiple of heads ({self.heads}).")
        if not 0 < self.radius <= 2:
            raise ConfigError(f"Model setting radius must lie in (0, 2] unit-box units, but is {self.radius}.")

    @property
    def cage_vertices(self) -> int:
        """Vertices of the cage: 42 after one subdivision of the icosahedron."""
        return 10 * 4**self.cage_subdivisions + 2

    @classmethod
    def from_dict(cls, values: dict[str, Any]) -> ModelConfig:
        """Return the config written by `to_dict`, by this or an older version; errors are those of the base."""
        if "box_blocks" not in values and values.get("partial_blocks"):  # written before there was the setting
            return super().from_dict({**values, "box_blocks": 1})
        return super().from_dict(values)


PRESETS: dict[str, dict[str, Any]] = {
    "kp-red": {
        "keypoint_head": "regression",
        "influence": "local",
        "influence_neighbours": 5,
        "cage": "pulled",
        "region_points": 192,
        "stages": 3,
    },
    "kp-red-plus": {"partial_blocks": 2, "box_blocks": 2},
}
"""Named architectures: the paper's, and this project's default."""


def preset(name: str, category: str, **changes: Any) -> ModelConfig:
    """Return the named architecture for one category, with some settings changed.

    Raises:
        ConfigError: if there is no preset of this name.
    """
    if name not in PRESETS:
        raise ConfigError(f"There is no preset '{name}'; choose one of {', '.join(PRESETS)}.")
    return ModelConfig(category=category, **{**PRESETS[name], **changes})
