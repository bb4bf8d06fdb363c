"""`kpred evaluate table`: one command for each table of the paper."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar

from tyro.conf import arg

from kpred.cli.command import Group
from kpred.cli.evaluate_ablation import AblationCommand
from kpred.cli.evaluate_generalization import GeneralizationCommand
from kpred.cli.evaluate_scan2cad import Scan2CadCommand
from kpred.cli.table_options import MeasuredCommand


@dataclass(frozen=True, kw_only=True)
class FullCommand(MeasuredCommand):
    """Whole shapes: Chamfer distance, best of the top k (the paper's table of full shapes).

    Rows: what needs no model (two samples of one surface, the true nearest shape as it is, deformation without
    learning), then of each model the nearest retrieved shape as it is, feed-forward (the paper's protocol), with
    refined keypoints, and by structure (what a fit delivers by default), with the hint that nothing is hidden, and
    without. A second table says how far the deformed meshes are still flat, square, mirrored and joined.

    examples:
      kpred evaluate table full chair.npz table.npz cabinet.npz -o full.json
      kpred evaluate table full packs/ --model kp-red=runs/kp-red --model kp-red-plus=bundled --limit 100
      kpred evaluate table full packs/ --unknown-frame --oracle --limit 40
    """

    kind: ClassVar[str] = "full"

    top_k: Annotated[int, arg(metavar="K")] = 10
    """How many retrieved models are deformed and compared"""
    unknown_frame: Annotated[bool, arg(help_behavior_hint="")] = False
    """Fit every target too where its place, size and yaw must be found"""
    oracle: Annotated[bool, arg(help_behavior_hint="")] = False
    """Deform and compare all of the database as well (slow)"""


@dataclass(frozen=True, kw_only=True)
class PartialCommand(MeasuredCommand):
    """Shapes cut by a random plane: UCD at each fraction hidden (the paper's occlusion curves).

    UCD is measured from the points that are seen; `UCD, whole` from all of the true surface to the same result.

    examples:
      kpred evaluate table partial chair.npz table.npz cabinet.npz --limit 100 -o partial.json
      kpred evaluate table partial packs/ --occlusions 0 0.5 --unknown-frame --limit 20
    """

    kind: ClassVar[str] = "partial"

    top_k: Annotated[int, arg(metavar="K")] = 10
    """How many retrieved models are deformed and compared"""
    occlusions: Annotated[tuple[float, ...], arg(metavar="FRACTION [FRACTION ...]")] = (0.0, 0.25, 0.5, 0.75)
    """Fractions of the points that are hidden"""
    unknown_frame: Annotated[bool, arg(help_behavior_hint="")] = False
    """Fit every target too where its place, size and yaw must be found"""


@dataclass(frozen=True, kw_only=True)
class TopKCommand(MeasuredCommand):
    """Whole shapes: how the number of retrieved models that are deformed and compared counts.

    examples:
      kpred evaluate table topk chair.npz table.npz cabinet.npz --limit 100 -o topk.json
      kpred evaluate table topk packs/ --top-k 1 10 --oracle --limit 20
    """

    kind: ClassVar[str] = "topk"

    top_k: Annotated[tuple[int, ...], arg(metavar="K [K ...]")] = (1, 5, 10, 25)
    """Numbers of retrieved models that are deformed and compared"""
    oracle: Annotated[bool, arg(help_behavior_hint="")] = False
    """Deform and compare all of the database as well (slow)"""


@dataclass(frozen=True, kw_only=True)
class OracleCommand(MeasuredCommand):
    """How well retrieval ranks: all of the database is deformed and refined to every target.

    The true best is the model of the lowest error after that. Printed: for which fraction of the targets it is in the
    top k, Spearman's rank correlation with the refined error, and the best of the top k against the oracle; for the
    order by tokens, by feed-forward error and by undeformed distance. Slow: choose a --limit.

    examples:
      kpred evaluate table oracle chair.npz table.npz cabinet.npz --limit 40 -o oracle.json
      kpred evaluate table oracle chair.npz --limit 10 --occlusions 0.5
    """

    kind: ClassVar[str] = "oracle"

    limit: Annotated[int | None, arg(metavar="N")] = 40
    """At most so many targets a pack, drawn at random by the seed"""
    top_k: Annotated[tuple[int, ...], arg(metavar="K [K ...]")] = (1, 5, 10, 25)
    """Numbers of retrieved models"""
    occlusions: Annotated[tuple[float, ...], arg(metavar="FRACTION [FRACTION ...]")] = ()
    """Rank for shapes cut by a plane too, with these fractions hidden"""


TABLES = Group(
    {
        "full": FullCommand,
        "partial": PartialCommand,
        "scan2cad": Scan2CadCommand,
        "ablation": AblationCommand,
        "topk": TopKCommand,
        "oracle": OracleCommand,
        "generalization": GeneralizationCommand,
    },
    "Make a table of the paper: values, intervals, JSON and CSV.",
)
