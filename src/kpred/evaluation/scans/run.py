"""The run over virtual scans: every shape of every group is scanned, fitted and measured."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

from kpred.errors import ConfigError, MeshError, PackError
from kpred.evaluation.database_source import Progress
from kpred.evaluation.metrics.summary import ALL, Scope, Summary
from kpred.evaluation.scans.outcome import FitOutcome, FitSettings
from kpred.evaluation.scans.targets import ScanTarget, make_scan_target
from kpred.rendering.contact_sheet import Tile
from kpred.shapes.mesh import Mesh
from kpred.shapes.pack import MeshPack

Outcome = TypeVar("Outcome", bound=FitOutcome)

Measure = Callable[[ScanTarget, str, FitSettings, bool], Outcome]
"""Fits a target of a category and measures the result; the last argument keeps its mesh."""

MAX_VIEWS = 20


@dataclass(frozen=True)
class ScanConfig:
    """How shapes are scanned and fitted.

    Attributes:
        views: depth views of each shape; 0 scans its whole surface.
        limit: at most so many shapes of each category of a data set, drawn by seed; None for all.
        seed: of shapes, scans, databases that are built, fits and intervals.
        top_k: candidates of each fit.
        tiles: pictures of the worst results, if they are wanted.

    Raises:
        ConfigError: a number is impossible.
    """

    views: int = 1
    limit: int | None = 40
    seed: int = 0
    top_k: int = 10
    tiles: int = 0

    def __post_init__(self) -> None:
        if not 0 <= self.views <= MAX_VIEWS:
            raise ConfigError(f"The number of views must be from 0 to {MAX_VIEWS}, but is {self.views}.")
        if self.top_k < 1:
            raise ConfigError(f"top_k must be at least 1, but is {self.top_k}.")


@dataclass(frozen=True, eq=False)
class ScannedShapes:
    """Shapes of one category that are scanned and fitted.

    Attributes:
        dataset: their data set; model_ids: their ids; mesh: reads one by its id.
        settings: of the fits; own_size: whether scans keep the size of the mesh.
    """

    dataset: str
    category: str
    model_ids: tuple[str, ...]
    mesh: Callable[[str], Mesh]
    settings: FitSettings
    own_size: bool = False


@dataclass(frozen=True, eq=False)
class Scanned(Generic[Outcome]):
    """One scan and its outcome; the target is kept for pictures alone."""

    dataset: str
    outcome: Outcome
    target: ScanTarget | None


@dataclass(frozen=True, eq=False)
class ScanReport(Generic[Outcome]):
    """All that was measured.

    Attributes:
        header: what it was made by; summaries: of every category, and of all.
        outcomes: (data set, outcome) of every target, failures too; tiles: pictures.
    """

    header: dict[str, Any]
    summaries: tuple[Summary, ...]
    outcomes: tuple[tuple[str, Outcome], ...]
    tiles: tuple[Tile, ...] = ()

    def to_json(self) -> dict[str, Any]:
        """Return plain values: header, rows, targets."""
        return {
            "header": self.header,
            "rows": [summary.to_json() for summary in self.summaries],
            "targets": [{"dataset": dataset, **outcome.to_json()} for dataset, outcome in self.outcomes],
        }


def mesh_reader(pack: MeshPack, rows: Mapping[str, int]) -> Callable[[str], Mesh]:
    """Read meshes of a pack by their ids."""
    return lambda name: pack[rows[name]]


def run_scans(
    groups: Iterable[ScannedShapes],
    measure: Measure[Outcome],
    config: ScanConfig,
    progress: Progress | None,
    report: Callable[[str], None],
) -> list[Scanned[Outcome]]:
    """Scan, fit and measure all shapes; those without a surface go to `report`.

    Raises:
        PackError: no shape of a group has a surface.
    """
    found: list[Scanned[Outcome]] = []
    for group in groups:
        name, before = f"{group.dataset}/{group.category}", len(found)
        for done, target in enumerate(_targets(group, config, report), start=1):
            outcome = measure(target, group.category, group.settings, config.tiles > 0)
            found.append(Scanned(group.dataset, outcome, target if config.tiles > 0 else None))
            if progress is not None:
                progress(f"{name}: scans", done, len(group.model_ids))
        if len(found) == before:
            raise PackError(f"{name}: no shape to be scanned has a surface; choose another split, pack or database.")
    return found


def summaries_of(
    scanned: Sequence[Scanned[Outcome]],
    summarise: Callable[[Sequence[Outcome], Scope], list[Summary]],
    split: str,
    seed: int,
) -> Iterator[Summary]:
    """Summarize every category of every data set, every data set with several, and all together."""
    groups = list(dict.fromkeys((one.dataset, one.outcome.category) for one in scanned))
    datasets = list(dict.fromkeys(dataset for dataset, _ in groups))
    for dataset, category in groups:
        mine = [one.outcome for one in scanned if (one.dataset, one.outcome.category) == (dataset, category)]
        yield from summarise(mine, Scope(dataset, split, category, seed))
    for dataset in datasets if len(datasets) > 1 else ():
        if sum(name == dataset for name, _ in groups) > 1:
            mine = [one.outcome for one in scanned if one.dataset == dataset]
            yield from summarise(mine, Scope(dataset, split, ALL, seed))
    if len(groups) > 1:
        yield from summarise([one.outcome for one in scanned], Scope(ALL, split, ALL, seed))


def shown(scanned: Iterable[Scanned[Outcome]]) -> list[tuple[ScanTarget, Outcome]]:
    """List targets and outcomes that were kept for pictures."""
    return [(one.target, one.outcome) for one in scanned if one.target is not None]


def _targets(group: ScannedShapes, config: ScanConfig, report: Callable[[str], None]) -> Iterator[ScanTarget]:
    for name in group.model_ids:
        try:
            target = make_scan_target(group.mesh(name), name, config.seed, config.views, group.own_size)
        except MeshError as error:
            report(f"left out: {error}")
            continue
        yield target
