"""The bench: every method explains every target against the same sources, and is charged by the same distances."""

from __future__ import annotations

import os
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import torch
from torch import Tensor

from kpred.errors import ConfigError, PackError
from kpred.evaluation.methods.method import Method, Searcher
from kpred.evaluation.methods.sources import Sources
from kpred.evaluation.searched import Progress
from kpred.evaluation.tables.baselines import undeformed_errors
from kpred.evaluation.tables.protocols import FULL, PARTIAL
from kpred.evaluation.tables.rows import CD, UCD, UCD_WHOLE, WHOLE, Row, Score, aggregate
from kpred.evaluation.tables.run import ALL, pack_files
from kpred.evaluation.tables.targets import Target, read_targets
from kpred.ops import squared_distances
from kpred.shapes.pack import MeshPack


@dataclass(frozen=True)
class Instance:
    """What one method scored on one target; the rows are means of these.

    Attributes:
        dataset, category, target: which target; model_id: of the source that became the result.
        score: the number, and how it was measured.
    """

    dataset: str
    category: str
    target: str
    model_id: str
    score: Score


def _warn(message: str) -> None:
    warnings.warn(message, stacklevel=3)


def evaluate_methods(
    packs: Sequence[str | os.PathLike[str]],
    methods: Sequence[Method],
    *,
    split: str = "val",
    top_k: Sequence[int] = (10,),
    occlusions: Sequence[float] | None = None,
    limit: int | None = None,
    seed: int = 0,
    progress: Progress | None = None,
    report: Callable[[str], None] = _warn,
) -> tuple[list[Row], list[Instance]]:
    """Measure methods on the targets of one split against the split `source` of the same pack, in the known frame.

    The targets, their points and the sources' points are those of `kpred.evaluation.evaluate` with the same seed.

    Args:
        packs: files of mesh packs, or folders of them.
        top_k: best of the first so many retrieved sources; every number has rows of its own.
        occlusions: None measures whole targets (CD). Otherwise shares that a random plane hides (UCD from what is
            seen, and from the whole surface).
        limit: at most so many targets a pack, drawn by seed.
        report: called with one sentence for each shape left out.

    Returns:
        Rows as `kpred.evaluation.evaluate` gives them, the method's name as their metric; and the single numbers.

    Raises:
        PackError: a pack is missing, damaged, or has no shapes of a needed split.
        ModelError: a method does not know a category or a source.
        ConfigError: top k or occlusions cannot be, or two methods have one name.
    """
    if not top_k or min(top_k) < 1:
        raise ConfigError(f"top_k must be at least 1, but is {list(top_k)}.")
    if occlusions is not None and not (occlusions and all(0 <= share <= 0.95 for share in occlusions)):
        raise ConfigError(f"Occlusions must be shares from 0 to 0.95, but are {list(occlusions)}.")
    names = [method.name for method in methods]
    if len(set(names)) < len(names):
        raise ConfigError(f"Two methods have one name ({', '.join(names)}); name them apart.")
    steps = [(FULL, 0.0)] if occlusions is None else [(PARTIAL, float(share)) for share in occlusions]
    files = pack_files(packs)
    loaded = [(file, MeshPack.load(file)) for file in files]
    for file, pack in loaded:  # What is wrong with the last pack must not come out after hours.
        if not len(pack.indices(split)):
            raise PackError(f"{file}: no shape is in the split '{split}'; choose another split.")
    rows: list[Row] = []
    instances: list[Instance] = []
    sizes: list[int] = []
    for file, pack in loaded:
        dataset = file.resolve().parent.name
        targets = read_targets(pack, str(file), split, limit, seed, report)
        with Sources.of_pack(pack, str(file), seed, report) as sources, torch.inference_mode():
            found = _measure(dataset, targets, sources, methods, steps, sorted(set(top_k)), progress)
            scores = [instance.score for instance in found]
            rows += aggregate(
                scores, dataset=dataset, split=split, category=pack.category, database_models=len(sources)
            )
            instances += found
            sizes += [len(sources)] * len(targets)
    if len(files) > 1:
        scores, size = [instance.score for instance in instances], round(sum(sizes) / len(sizes))
        rows += aggregate(scores, dataset=ALL, split=split, category=ALL, database_models=size)
    return rows, instances


def _measure(
    dataset: str,
    targets: Sequence[Target],
    sources: Sources,
    methods: Sequence[Method],
    steps: Sequence[tuple[str, float]],
    top_k: Sequence[int],
    progress: Progress | None,
) -> list[Instance]:
    name = f"{dataset}/{sources.category}"
    searchers: list[tuple[Method, Searcher]] = []
    for method in methods:
        if progress is not None:
            progress(f"{name}: preparing {method.name}", 0, 1)
        searchers.append((method, method.over(sources)))
        if progress is not None:
            progress(f"{name}: preparing {method.name}", 1, 1)
    found: list[Instance] = []
    for done, target in enumerate(targets, start=1):
        for protocol, occlusion in steps:
            # One cloud for all methods: what they share of it is worked out once.
            cloud = target.visible(occlusion) if protocol == PARTIAL else target.points
            for method, searcher in searchers:
                found += _charged(
                    dataset, sources.category, target, cloud, method, searcher, (protocol, occlusion), top_k
                )
        if progress is not None:
            progress(f"{name}: targets", done, len(targets))
    return found


def _charged(
    dataset: str,
    category: str,
    target: Target,
    cloud: Tensor,
    method: Method,
    searcher: Searcher,
    step: tuple[str, float],
    top_k: Sequence[int],
) -> list[Instance]:
    """All scores of one method on one target under one protocol and occlusion."""
    protocol, occlusion = step
    partial = protocol == PARTIAL
    explanation = searcher.explain(cloud, max(top_k), partial)
    errors = undeformed_errors(cloud, explanation.points, partial)
    found = []
    for k in top_k if method.ranked else (None,):
        first = errors if k is None else errors[:k]
        row = explanation.best(first)
        values = [(method.name, UCD if partial else CD, float(errors[row]))]
        if partial:
            # Chosen by what was seen; charged for what was not seen too.
            whole = squared_distances(target.points[None], explanation.points[row][None]).mean()
            values.append((method.name + WHOLE, UCD_WHOLE, float(whole)))
        for metric, distance, value in values:
            score = Score(protocol, occlusion, metric, distance, k, value)
            found.append(Instance(dataset, category, target.model_id, explanation.model_ids[row], score))
    return found
