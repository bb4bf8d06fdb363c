"""`kpred evaluate peers`: several methods, this package's and others, on one bench."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from tyro.conf import Positional, UseAppendAction, arg

from kpred.cli.command import Command
from kpred.cli.output import Output
from kpred.cli.usage import UsageError

if TYPE_CHECKING:
    from kpred.evaluation.methods import Method

OWN = ("bundled",)
"""Names in place of a folder."""


@dataclass(frozen=True, kw_only=True)
class PeersCommand(Command):
    """Measure several methods on the same targets against the same sources: best of the top k, mean over the shapes.

    A method is a folder of weights: of a peer (`kpred train peer`) or of this package's networks (`bundled`, or a
    folder; measured as it deforms, and refined). The nearest undeformed shape and the baseline without learning
    are measured with them. Rows are those of `kpred evaluate shapes`, the method's name as their metric.

    examples:
      kpred evaluate peers chair.npz --method kp-red-plus=bundled --method uy2021=runs/uy2021/chair
      kpred evaluate peers packs/ --method keypoint-deformer=runs/keypoint-deformer --limit 50 -o rows.json
    """

    packs: Annotated[Positional[tuple[Path, ...]], arg(metavar="PACK [PACK ...]", help_behavior_hint="")]
    """Mesh packs (.npz), or folders of them; the split source of each is searched"""
    method: UseAppendAction[Annotated[tuple[str, ...], arg(metavar="NAME=FOLDER")]] = ()
    """A method, once for each: its name in the rows, and the folder of its weights (or of folders a category)"""
    output: Annotated[Path | None, arg(aliases=["-o"], metavar="FILE")] = None
    """Write rows, single values and what they were made by to this JSON file too"""
    refined_peers: Annotated[bool, arg(help_behavior_hint="")] = False
    """Measure KeypointDeformer with this package's keypoint refinement too, which its publication does not have"""
    split: Annotated[str, arg(metavar="NAME")] = "val"
    """Whose shapes are the targets"""
    top_k: Annotated[tuple[int, ...], arg(metavar="K [K ...]")] = (10,)
    """How many retrieved sources are deformed and compared"""
    protocol: Literal["full", "partial"] = "full"
    """Whole clouds, or clouds cut by a random plane (for which no peer was trained); frame of the whole shape"""
    occlusions: Annotated[tuple[float, ...], arg(metavar="FRACTION [FRACTION ...]")] = (0.0, 0.25, 0.5, 0.75)
    """Shares hidden in the partial protocol"""
    limit: Annotated[int | None, arg(metavar="N")] = None
    """At most so many targets a pack, drawn at random by the seed"""
    seed: Annotated[int, arg(metavar="SEED")] = 0
    """Of targets, planes and points"""

    def run(self, output: Output) -> None:
        """Measure with a progress bar, print and write the rows."""
        from kpred.atomic import check_place
        from kpred.cli.progress import ProgressBar
        from kpred.evaluation.header import versions
        from kpred.evaluation.methods import NoLearningMethod, UndeformedMethod, evaluate_methods
        from kpred.evaluation.metrics.summary import finite, write_report
        from kpred.evaluation.tables.rows import FRAME, UNIT

        if not self.packs:
            raise UsageError("no pack was named; try `kpred evaluate peers PACK.npz --method NAME=FOLDER`")
        if self.output is not None:
            check_place(self.output)
        methods: list[Method] = [UndeformedMethod(), NoLearningMethod()]
        made: dict[str, Any] = {}
        for word in self.method:
            name, separator, place = word.partition("=")
            if not (name and separator and place):
                raise UsageError(f"--method {word} names no method; write it as NAME=FOLDER")
            found, made[name] = _methods(name, place, self.refined_peers)
            methods += found
        left_out: list[str] = []
        with ProgressBar() as bar:
            rows, instances = evaluate_methods(
                self.packs,
                methods,
                split=self.split,
                top_k=self.top_k,
                occlusions=None if self.protocol == "full" else self.occlusions,
                limit=self.limit,
                seed=self.seed,
                progress=bar.update,
                report=left_out.append,
            )
        header = {
            "methods": made,
            "split": self.split,
            "protocol": self.protocol,
            "occlusions": [] if self.protocol == "full" else list(self.occlusions),
            "top_k": list(self.top_k),
            "limit": self.limit,
            "seed": self.seed,
            "unit": UNIT,
            "frame": FRAME,
            "remarks": left_out,
            "note": "mean over instances; the numbers of published tables are most likely 10^2 times these",
            "versions": versions(),
        }
        report = finite(
            {
                "header": header,
                "rows": [row.to_json() for row in rows],
                "instances": [asdict(instance) for instance in instances],
            }
        )
        if self.output is not None:
            write_report(self.output, report)
        output.result({"header": report["header"], "rows": report["rows"]})
        for dataset, category in dict.fromkeys((row.dataset, row.category) for row in rows):
            shown = [row for row in rows if (row.dataset, row.category) == (dataset, category)]
            first = shown[0]
            output.table(
                f"{dataset} / {category}: {first.n} shapes of {first.split} against {first.database_models} sources; "
                f"{first.unit}, {first.frame}",
                ["protocol", "method", "distance", "top k", "value", "/ undeformed", "/ unlearned"],
                [
                    (
                        row.protocol if row.protocol == "full" else f"{row.protocol} {row.occlusion:g}",
                        row.metric,
                        "CD" if row.protocol == "full" else "UCD, whole" if row.metric.endswith("_whole") else "UCD",
                        "all" if row.top_k is None else str(row.top_k),
                        row.value,
                        row.ratio_to_undeformed,
                        row.ratio_to_no_learning,
                    )
                    for row in shown
                ],
            )
        output.note("note: means over the shapes; the numbers of published tables are most likely 10^2 times these")
        for sentence in left_out[:10]:
            output.note(f"note: {sentence}")
        if self.output is not None:
            output.note(f"wrote {self.output}")


def _methods(name: str, place: str, refined_peers: bool) -> tuple[list[Method], dict[str, Any]]:
    """Return the methods that a folder of weights stands for, and what they were made by, as plain values."""
    from kpred.evaluation.header import made_by
    from kpred.evaluation.methods import KpRedMethod
    from kpred.nn.loading import load_model
    from kpred.peers.methods.peers import peer_method, refined
    from kpred.peers.networks.loading import holds_peers

    if place in OWN or not holds_peers(place):
        model = load_model(place)
        own: list[Method] = [
            KpRedMethod(name, model),
            KpRedMethod(f"{name}_refined", model, "free"),
            KpRedMethod(f"{name}_structure", model, "auto"),
        ]
        return own, made_by(model)
    method, record = peer_method(name, place)
    return [method, *(refined(method) if refined_peers else [])], record
