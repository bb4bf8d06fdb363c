"""The table of real scans: objects of Scan2CAD scenes, by the paper's protocol and as a user fits them.

Known frame: an object's scan points are put into the unit box of its annotated CAD model, in the model's canonical
axes (the paper). Unknown frame: the object is fitted as `kpred scene` fits it, category given. All distances are UCD
in that same unit box, from the scan's points and, as `whole`, from the surface of the annotated CAD model. That model
itself is measured too: it is the nearest that people found, not the same product.
"""

from __future__ import annotations

import os
import zlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import torch

from kpred.database import Database
from kpred.errors import ConfigError, KpredError, ScanError
from kpred.evaluation.database_source import Progress, content_hash, counter, database_source
from kpred.evaluation.header import models_of, processor, versions
from kpred.evaluation.methods.method import Method
from kpred.evaluation.methods.no_learning import NoLearningMethod
from kpred.evaluation.methods.sources import Sources
from kpred.evaluation.methods.whole_fit import UNKNOWN_FRAME, sample_mesh
from kpred.evaluation.metrics.metric import FRAME, UCD, UNIT, WHOLE, Metric
from kpred.evaluation.remarks import Remarks
from kpred.evaluation.scans.outcome import moved
from kpred.evaluation.scans.scenes import ANNOTATIONS, annotated_mesh, annotated_rotation, scan_of
from kpred.evaluation.tables.config import TableConfig
from kpred.evaluation.tables.make_table import NOTE, add_seconds, loaded_models, methods_of
from kpred.evaluation.tables.packs import Store, check_same_shapes, pack_files
from kpred.evaluation.tables.scorer import FLOOR, PARTIAL, Condition, Scorer, check_names, prepare
from kpred.evaluation.tables.table import Subject, Table
from kpred.evaluation.tables.targets import Target
from kpred.fitting.defaults import resolve_database
from kpred.fitting.fit_scene import fit_scene
from kpred.fitting.stages import SCAN_POINTS
from kpred.nn import Model
from kpred.ops import Frame, unit_box_frame
from kpred.scenes.objects import SceneObject, objects_of
from kpred.scenes.scan2cad import SceneAnnotation, read_annotations
from kpred.scenes.scene import Scene, read_scene
from kpred.shapes.pack import MeshPack

ANNOTATED = "annotated_cad"
MIN_POINTS = 64
SEEN_SCAN = Condition(PARTIAL)


def make_scan2cad_table(
    folders: Sequence[str | os.PathLike[str]],
    models: Mapping[str, Model | str | os.PathLike[str] | None],
    config: TableConfig,
    databases: Mapping[str, Store] | None = None,
    source: Sequence[str | os.PathLike[str]] = (),
    *,
    methods: Sequence[Method] = (),
    cache: Path | None = None,
    progress: Progress | None = None,
    report: Callable[[str], None] = lambda sentence: None,
) -> Table:
    """Measure models and other methods on the annotated objects of scenes in folders laid out as Scan2CAD's repository.

    Args:
        models: by the name that they have in the table; databases: of models that have one.
        source: packs whose split `source` the other models search; without them, the bundled database.
        methods: others than this package's; they search the packs' split `source`, in the known frame.
        report: called with one sentence for each object or scene left out; the header keeps them as well.

    Raises:
        ScanError: annotations are missing or broken, or no object of a known category is left.
        ModelError, DatabaseError, PackError: what is searched is missing, or does not fit a model.
        ConfigError: the databases of the models hold different shapes, or other methods have no packs to search.
    """
    check_names([*models, *(method.name for method in methods)])
    if methods and not source:
        raise ConfigError("Other methods search mesh packs, but none was given; give packs of the categories.")
    loaded, stores = loaded_models(models), dict(databases or {})
    remarks = Remarks(report)
    roots = [Path(folder) for folder in folders]
    for root in roots:
        read_annotations(root / ANNOTATIONS)
    files = pack_files(source) if source else []
    table = Table(_header(loaded, roots, config, methods) | {"remarks": remarks.sentences})
    with ExitStack() as stack:
        opened: dict[str, Database] = {}
        for name, model in loaded.items():
            building = counter(progress, f"database of {name}", 0)
            given = stores.get(name) if name in stores or files else resolve_database(None)
            searching = database_source(files, model, given, config.seed, building, remarks, cache=cache)
            opened[name] = stack.enter_context(searching)
        table.header["databases"] = {name: str(store.path) for name, store in opened.items()}
        packs = {pack.category: pack for pack in map(MeshPack.load, files)} if methods else {}
        scorers = _Scorers(loaded, opened, config, remarks, methods, packs)
        for root in roots:
            for annotation in _annotations(root, remarks):
                _add_scene(table, root, annotation, scorers, progress, remarks)
        add_seconds(table, scorers.made())
    if not table.values:
        raise ScanError(
            f"{roots[0]}: no annotated object of a known category could be measured; {' '.join(remarks.sentences)}"
        )
    return table


def _header(
    models: Mapping[str, Model], roots: Sequence[Path], config: TableConfig, methods: Sequence[Method]
) -> dict[str, Any]:
    return {
        "table": config.kind,
        "seed": config.seed,
        "unit": UNIT,
        "frame": FRAME,
        "models": models_of(models, methods),
        "protocol": config.to_json(),
        "data": [{"dataset": root.resolve().name, "sha256": content_hash(root / ANNOTATIONS)} for root in roots],
        "note": NOTE,
        "versions": versions(),
        "machine": processor(),
    }


@dataclass(frozen=True, eq=False)
class _Annotated:
    """A scanned object: the annotated CAD model as target, its scan points, both in its unit box; and that box."""

    item: SceneObject
    target: Target
    cloud: torch.Tensor
    frame: Frame

    def subject(self, root: Path) -> Subject:
        """Name it in a table."""
        return Subject(root.resolve().name, str(self.item.category), self.target.model_id)


class _Scorers:
    """The scorer of each category, made at first use."""

    def __init__(
        self,
        models: Mapping[str, Model],
        stores: Mapping[str, Database],
        config: TableConfig,
        report: Callable[[str], None],
        methods: Sequence[Method],
        packs: Mapping[str, MeshPack],
    ) -> None:
        self.models, self.stores, self.config, self.report = models, stores, config, report
        self.methods, self.packs = list(methods), packs
        self._of: dict[str, Scorer] = {}

    def knows(self, category: str | None) -> bool:
        """Decide whether all models, databases and packs know a category."""
        return (
            category is not None
            and (not self.methods or category in self.packs)
            and all(
                category in model.categories and category in self.stores[name].categories()
                for name, model in self.models.items()
            )
        )

    def made(self) -> list[Scorer]:
        """List the scorers that were used."""
        return list(self._of.values())

    def of(self, category: str) -> Scorer:
        """Return the scorer of a category; raises ConfigError where the databases differ."""
        if category not in self._of:
            check_same_shapes(self.stores, category)
            sources = Sources.of_databases(category, self.models, self.stores)
            first: list[Method] = [NoLearningMethod(self.config.refinement)]
            methods = methods_of(self.models, replace(self.config, unknown_frame=False), self.report)
            searchers = prepare([*first, *methods], sources)
            if self.methods:  # parts are cut from meshes, which a database's sources lack
                own = Sources.of_pack(self.packs[category], category, self.config.seed, lambda sentence: None)
                searchers += prepare(self.methods, own)
            self._of[category] = Scorer(tuple(searchers), sources, self.config.numbers)
        return self._of[category]


def _annotations(root: Path, report: Callable[[str], None]) -> Iterator[SceneAnnotation]:
    """Yield the scenes of a folder whose scans are there; others are counted."""
    missing = 0
    for annotation in read_annotations(root / ANNOTATIONS):
        try:
            scan_of(root, annotation.id_scan)
        except ScanError as error:
            missing += 1
            if missing <= 3:
                report(f"left out: {annotation.id_scan}: {error}")
            continue
        for broken in annotation.broken:
            report(f"left out: {annotation.id_scan} {broken.reason}")
        yield annotation
    if missing:
        report(f"left out: {missing} annotated scenes of {root} whose scan is not there.")


def _add_scene(
    table: Table,
    root: Path,
    annotation: SceneAnnotation,
    scorers: _Scorers,
    progress: Progress | None,
    report: Callable[[str], None],
) -> None:
    scene = read_scene(scan_of(root, annotation.id_scan))
    usable: list[_Annotated] = []
    for item in objects_of(scene, root / ANNOTATIONS):
        name = f"{annotation.id_scan} {item.name}"
        if not scorers.knows(item.category):
            report(f"left out: {name}: {item.category} is not among the categories of the models.")
        elif item.problem is not None:
            report(f"left out: {annotation.id_scan} {item.problem}")
        elif len(item.points) < MIN_POINTS:
            report(f"left out: {name}: it has only {len(item.points)} scan points.")
        else:
            try:
                usable.append(_annotated(item, root, name, scorers.config.seed))
            except (KpredError, ValueError) as error:
                report(f"left out: {name}: {error}")
    total = len(usable) * (1 + len(scorers.models) * scorers.config.unknown_frame)
    for done, one in enumerate(usable, start=1):
        for series, value in scorers.of(str(one.item.category)).score(one.target, SEEN_SCAN, one.cloud):
            # Distance of the scan to a sample of the annotated model.
            method = ANNOTATED if series.method == FLOOR else series.method
            table.add(replace(series, method=method), one.subject(root), value)
        if progress is not None:
            progress(f"{annotation.id_scan}: objects", done, total)
    if scorers.config.unknown_frame:
        _add_unknown(table, root, scene, usable, scorers, report)


def _add_unknown(
    table: Table,
    root: Path,
    scene: Scene,
    usable: Sequence[_Annotated],
    scorers: _Scorers,
    report: Callable[[str], None],
) -> None:
    """Fits of the whole scene, as `kpred scene` makes them."""
    top_k, seed = max(scorers.config.top_k), scorers.config.seed
    for name, model in scorers.models.items():
        objects = [one.item for one in usable]
        fitted = fit_scene(scene, objects, model, scorers.stores[name], top_k=top_k, seed=seed)
        for one, found in zip(usable, fitted.fits, strict=True):
            if found.fit is None:
                report(f"no result: {one.target.model_id}, {UNKNOWN_FRAME}: {found.error}")
                continue
            result = sample_mesh(moved(found.fit.mesh, one.frame), SCAN_POINTS, seed)
            for metric, points in (
                (Metric(UCD, top_k=top_k), one.cloud),
                (Metric(UCD, WHOLE, top_k=top_k), one.target.points),
            ):
                error = float(torch.cdist(points, result).min(1).values.square().mean())
                table.add(SEEN_SCAN.series(name, UNKNOWN_FRAME, metric), one.subject(root), error)


def _annotated(item: SceneObject, root: Path, name: str, seed: int) -> _Annotated:
    """Make a target of an object's annotated CAD model.

    Raises:
        MeshError: the model's file is missing or broken.
        ValueError: its annotated pose mirrors it.
    """
    if item.annotation is None:
        raise ScanError("it has no annotated CAD model.")
    placed = annotated_mesh(item.annotation, root)
    used = np.asarray(placed.vertices)[np.unique(np.asarray(placed.faces))]
    frame = unit_box_frame(used, annotated_rotation(item.annotation))
    mesh = moved(placed, frame)
    checksum = zlib.crc32(f"{seed} {name}".encode())
    points, again = sample_mesh(mesh, SCAN_POINTS, checksum), sample_mesh(mesh, SCAN_POINTS, checksum + 1)
    order = np.random.default_rng(checksum).permutation(len(item.points))[:SCAN_POINTS]
    cloud = torch.from_numpy(frame.to_unit(item.points[order]).astype(np.float32))
    return _Annotated(item, Target(name, points, again, torch.tensor([1.0, 0.0, 0.0])), cloud, frame)
