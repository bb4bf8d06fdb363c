"""What a table measures, beside its models and packs."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from typing import Any

from kpred.errors import ConfigError
from kpred.evaluation.tables.scorer import FULL, PARTIAL, Condition
from kpred.refinement.config import RefineConfig
from kpred.refinement.structure_config import StructureConfig

OCCLUSIONS = (0.0, 0.25, 0.5, 0.75)
MAX_OCCLUSION = 0.95
"""Below some fifty points there is nothing to fit a shape to."""

KINDS = ("full", "partial", "all", "topk", "oracle", "scan2cad", "ablation")
_NOT_HIDDEN = ("full", "topk", "scan2cad")
"""Kinds that use no occlusions."""


@dataclass(frozen=True)
class TableConfig:
    """What a table measures.

    Attributes:
        kind: `full`: whole shapes, CD. `partial`: shapes cut by a plane, UCD at each of `occlusions`. `all`: both.
            `topk`: whole shapes, the best of each of `top_k`. `oracle`: how well retrieval ranks
            (`kpred.evaluation.tables.ranking`), of whole shapes, and of cut ones if there are `occlusions`. `scan2cad`:
            see `kpred.evaluation.tables.scan2cad_table`. `ablation`: see `kpred.evaluation.tables.ablation_table`.
        split, limit, seed: which targets; `limit` of each pack, drawn by seed, None for all.
        top_k: numbers of retrieved models to deform and compare.
        occlusions: fractions hidden, for `partial`.
        oracle: compare all of the database too.
        unknown_frame: fit every target too where its frame must be found.
        refinement: for the models and for the baseline alike; structure: of the structure-keeping deformation.
        only: ids of the targets, where they are named (`kpred.evaluation.tables.target_lists`).

    Raises:
        ConfigError: a setting has an impossible value.
    """

    kind: str = "full"
    split: str = "val"
    limit: int | None = None
    seed: int = 0
    top_k: tuple[int, ...] = (10,)
    occlusions: tuple[float, ...] = OCCLUSIONS
    oracle: bool = False
    unknown_frame: bool = False
    refinement: RefineConfig = field(default_factory=RefineConfig)
    structure: StructureConfig = field(default_factory=StructureConfig)
    only: frozenset[str] | None = None

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            raise ConfigError(f"The kind of table must be one of {', '.join(KINDS)}, but is '{self.kind}'.")
        if not self.top_k or min(self.top_k) < 1:
            raise ConfigError(f"top_k must be at least 1, but is {', '.join(map(str, self.top_k)) or 'empty'}.")
        wrong = not all(0 <= occlusion <= MAX_OCCLUSION for occlusion in self.occlusions)
        if self.kind not in _NOT_HIDDEN and (wrong or (self.kind != "oracle" and not self.occlusions)):
            raise ConfigError(
                f"Occlusions must be fractions from 0 to {MAX_OCCLUSION}, but are {list(self.occlusions)}."
            )

    @property
    def conditions(self) -> tuple[Condition, ...]:
        """How each target is seen, measurement by measurement."""
        partial = tuple(Condition(PARTIAL, float(occlusion)) for occlusion in self.occlusions)
        if self.kind == "scan2cad":
            return (Condition(PARTIAL),)
        if self.kind == "partial":
            return partial
        return (Condition(FULL), *(partial if self.kind in ("all", "oracle") else ()))

    @property
    def numbers(self) -> tuple[int, ...]:
        """Top k, each once, in ascending order."""
        return tuple(sorted(set(self.top_k)))

    def to_json(self) -> dict[str, Any]:
        """Return all settings that a value depends on, beside model and data, as plain values."""
        values = asdict(self)
        values["top_k"], values["occlusions"] = list(self.top_k), list(self.occlusions)
        values["only"] = None if self.only is None else sorted(self.only)
        if self.kind in _NOT_HIDDEN:
            values.pop("occlusions")
        return values
