"""The table of real scans: objects of Scan2CAD scenes, by the paper's protocol and as a user fits them.

Known frame: an object's scan points are put into the unit box of its annotated CAD model, in the model's canonical
axes (the paper). Unknown frame: the object is fitted as `kpred scene` fits it, category told. All distances are UCD
in that same unit box, from the scan's points and, as `whole`, from the surface of the annotated CAD model. That model
itself is measured too: it is the nearest that people found, not the same product.
"""

from __future__ import annotations

import os
import zlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

import numpy as np
import torch

from kpred.database import Database
from kpred.errors import KpredError, ScanError
from kpred.evaluation.header import made_by, versions
from kpred.evaluation.scans.outcomes import moved
from kpred.evaluation.scans.scenes import ANNOTATIONS, annotated_mesh, annotated_rotation, scan_of
from kpred.evaluation.searched import Progress, content_hash, counter, searched
from kpred.evaluation.tables.baselines import NoLearning
from kpred.evaluation.tables.frame_protocol import UNKNOWN_FRAME, sampled
from kpred.evaluation.tables.make_table import TableConfig, loaded_models, protocol_of
from kpred.evaluation.tables.measuring import Plan, Store, check_same_shapes, pack_files
from kpred.evaluation.tables.protocols import PARTIAL, Bench, measure_cloud
from kpred.evaluation.tables.rows import FRAME, UCD, UCD_WHOLE, UNIT, WHOLE
from kpred.evaluation.tables.table import NO_MODEL, Series, Subject, Table
from kpred.evaluation.tables.targets import Target
from kpred.fitting.defaults import resolve_database
from kpred.fitting.fit_scene import fit_scene
from kpred.fitting.stages import SCAN_POINTS
from kpred.nn import Model
from kpred.ops import Frame, unit_box_frame
from kpred.scenes.objects import SceneObject, objects_of
from kpred.scenes.scan2cad import SceneAnnotation, read_annotations
from kpred.scenes.scene import Scene, read_scene

ANNOTATED = "annotated_cad"
FEWEST_POINTS = 64


def make_scan2cad_table(
    folders: Sequence[str | os.PathLike[str]],
    models: Mapping[str, Model | str | os.PathLike[str] | None],
    config: TableConfig,
    databases: Mapping[str, Store] | None = None,
    source: Sequence[str | os.PathLike[str]] = (),
    *,
    cache: Path | None = None,
    progress: Progress | None = None,
    report: Callable[[str], None] = lambda sentence: None,
) -> Table:
    """Measure models on the annotated objects of all scenes of folders laid out as Scan2CAD's repository.

    Args:
        models: by the name that they have in the table; databases: of models that have one.
        source: packs whose split `source` the other models search; without them, the bundled database.
        report: called with one sentence for each object or scene left out; the header keeps them as well.

    Raises:
        ScanError: annotations are missing or broken, or no object of a known category is left.
        ModelError, DatabaseError, PackError: what is searched is missing, or does not fit a model.
        ConfigError: the databases of the models hold different shapes.
    """
    loaded, stores = loaded_models(models), dict(databases or {})
    plan = config.plan(cache)
    remarks: list[str] = []

    def tell(sentence: str) -> None:
        remarks.append(sentence)
        report(sentence)

    roots = [Path(folder) for folder in folders]
    for root in roots:
        read_annotations(root / ANNOTATIONS)
    files = pack_files(source) if source else []
    header = {
        "table": config.kind,
        "seed": config.seed,
        "unit": UNIT,
        "frame": FRAME,
        "models": {name: made_by(model) for name, model in loaded.items()},
        "protocol": protocol_of(config),
        "data": [{"dataset": root.resolve().name, "sha256": content_hash(root / ANNOTATIONS)} for root in roots],
        "note": "the numbers of the paper's tables are most likely 10^2 times these",
        "versions": versions(),
        "remarks": remarks,
    }
    table = Table(header)
    with ExitStack() as stack:
        opened: dict[str, Database] = {}
        for name, model in loaded.items():
            building = counter(progress, f"database of {name}", 0)
            given = stores.get(name) if name in stores or files else resolve_database(None)
            searching = searched(files, model, given, config.seed, building, tell, cache=cache)
            opened[name] = stack.enter_context(searching)
        header["databases"] = {name: str(store.path) for name, store in opened.items()}
        bench = _Benches(loaded, opened, plan)
        for root in roots:
            for annotation in _annotations(root, tell):
                _add_scene(table, root, annotation, bench, progress, tell)
    if not table.values:
        raise ScanError(f"{roots[0]}: no annotated object of a known category could be measured; {' '.join(remarks)}")
    return table


class _Benches:
    """Of each category: the baselines and every model, made when they are asked for."""

    def __init__(self, models: Mapping[str, Model], stores: Mapping[str, Database], plan: Plan) -> None:
        self.models, self.stores, self.plan = models, stores, plan
        self._of: dict[str, list[tuple[str, Bench]]] = {}

    def knows(self, category: str | None) -> bool:
        """Whether all models and databases do."""
        return category is not None and all(
            category in model.categories and category in self.stores[name].categories()
            for name, model in self.models.items()
        )

    def of(self, category: str) -> list[tuple[str, Bench]]:
        """Baselines under no name, then models; raises ConfigError where their databases differ."""
        if category not in self._of:
            check_same_shapes(self.stores, category)
            arrays = next(iter(self.stores.values())).candidates(category)
            baseline = NoLearning.build(arrays.model_ids, category, torch.from_numpy(arrays.points))
            plan = self.plan
            benches = [
                (
                    name,
                    Bench(
                        model,
                        self.stores[name],
                        baseline,
                        plan.top_k,
                        plan.refinement,
                        plan.structure,
                        baselines=False,
                    ),
                )
                for name, model in self.models.items()
            ]
            alone = replace(benches[0][1], baselines=True, learned=False)
            self._of[category] = [(NO_MODEL, alone), *benches]
        return self._of[category]


def _annotations(root: Path, report: Callable[[str], None]) -> Iterator[SceneAnnotation]:
    """The scenes of a folder that are there; a partly downloaded data set has annotations without scans."""
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
    benches: _Benches,
    progress: Progress | None,
    report: Callable[[str], None],
) -> None:
    scene = read_scene(scan_of(root, annotation.id_scan))
    objects = objects_of(scene, root / ANNOTATIONS)
    usable: list[tuple[SceneObject, Target, torch.Tensor, Frame]] = []
    for item in objects:
        name = f"{annotation.id_scan} {item.name}"
        if not benches.knows(item.category):
            report(f"left out: {name}: {item.category} is not among the categories of the models.")
        elif item.problem is not None:
            report(f"left out: {annotation.id_scan} {item.problem}")
        elif len(item.points) < FEWEST_POINTS:
            report(f"left out: {name}: it has only {len(item.points)} scan points.")
        else:
            try:
                usable.append((item, *_target(item, root, name, benches.plan.seed)))
            except (KpredError, ValueError) as error:
                report(f"left out: {name}: {error}")
    total = len(usable) * (1 + len(benches.models) * benches.plan.unknown_frame)
    for done, (item, target, cloud, _) in enumerate(usable, start=1):
        subject = Subject(root.resolve().name, str(item.category), target.model_id)
        with torch.inference_mode():
            for name, bench in benches.of(str(item.category)):
                for score in measure_cloud(cloud, target, bench, PARTIAL, 0.0):
                    # Distance of the scan to a sample of the annotated model.
                    method = ANNOTATED if score.metric == "sampling_floor" else score.metric
                    series = replace(_series(name, method, score.distance, score.top_k), unit=score.unit)
                    table.add(series, subject, score.value)
        if progress is not None:
            progress(f"{annotation.id_scan}: objects", done, total)
    if benches.plan.unknown_frame:
        _add_unknown(table, root, scene, usable, benches, report)


def _add_unknown(
    table: Table,
    root: Path,
    scene: Scene,
    usable: Sequence[tuple[SceneObject, Target, torch.Tensor, Frame]],
    benches: _Benches,
    report: Callable[[str], None],
) -> None:
    """Fits of the whole scene, as `kpred scene` makes them."""
    top_k = max(benches.plan.top_k)
    for name, model in benches.models.items():
        objects = [item for item, *_ in usable]
        fitted = fit_scene(scene, objects, model, benches.stores[name], top_k=top_k, seed=benches.plan.seed)
        for (item, target, cloud, frame), one in zip(usable, fitted.fits, strict=True):
            if one.fit is None:
                report(f"no result: {target.model_id}, {UNKNOWN_FRAME}: {one.error}")
                continue
            subject = Subject(root.resolve().name, str(item.category), target.model_id)
            result = sampled(moved(one.fit.mesh, frame), SCAN_POINTS, benches.plan.seed)
            for method, distance, points in (
                (UNKNOWN_FRAME, UCD, cloud),
                (UNKNOWN_FRAME + WHOLE, UCD_WHOLE, target.points),
            ):
                error = float(torch.cdist(points, result).min(1).values.square().mean())
                table.add(_series(name, method, distance, top_k), subject, error)


def _series(model: str, method: str, distance: str, top_k: int | None) -> Series:
    return Series(model, method, PARTIAL, 0.0, distance, top_k)


def _target(item: SceneObject, root: Path, name: str, seed: int) -> tuple[Target, torch.Tensor, Frame]:
    """The annotated CAD model as a target, the object's scan points, both in its unit box; and that box.

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
    points, again = sampled(mesh, SCAN_POINTS, checksum), sampled(mesh, SCAN_POINTS, checksum + 1)
    order = np.random.default_rng(checksum).permutation(len(item.points))[:SCAN_POINTS]
    cloud = torch.from_numpy(frame.to_unit(item.points[order]).astype(np.float32))
    return Target(name, points, again, torch.tensor([1.0, 0.0, 0.0])), cloud, frame
