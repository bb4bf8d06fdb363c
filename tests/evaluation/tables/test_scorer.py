"""Whole evaluations on small packs with untrained networks: the numbers are those of the fit and of slow references."""

import math
from pathlib import Path

import numpy as np
import pytest
import torch
from scipy.spatial import cKDTree

from kpred.database import Database, build_database
from kpred.errors import ConfigError, DatabaseError, KpredError, ModelError, PackError
from kpred.evaluation.metrics.cleanliness_measures import MEASURES
from kpred.evaluation.metrics.metric import CD, MESH, SEEN, UCD, WHOLE, Metric
from kpred.evaluation.tables.config import TableConfig
from kpred.evaluation.tables.make_table import make_table
from kpred.evaluation.tables.packs import pack_files
from kpred.evaluation.tables.scorer import PARTIAL, Condition
from kpred.evaluation.tables.table import Cell, Table
from kpred.evaluation.tables.targets import Target, read_targets
from kpred.fitting import fit
from kpred.fitting.deform import Deform
from kpred.fitting.encoding import encode_scan
from kpred.fitting.explanation import ModelPoints
from kpred.nn import Model, ModelConfig
from kpred.shapes import MeshPack, open_shapes
from kpred.training.run import new_network


@pytest.fixture(scope="module")
def database(packs: dict[str, Path], model: Model, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("database") / "both.kpred"
    for file in packs.values():
        build_database(path, open_shapes(file, split="source"), model, seed=0)
    return path


ALL_PROTOCOLS = TableConfig("all", top_k=(1, 4), occlusions=(0.0, 0.5), oracle=True)


@pytest.fixture(scope="module")
def table(packs: dict[str, Path], model: Model) -> Table:
    return make_table(list(packs.values()), {"m": model}, ALL_PROTOCOLS)


def _targets(packs: dict[str, Path], category: str) -> list[Target]:
    return read_targets(MeshPack.load(packs[category]), "p", "val", None, 0, pytest.fail)


def _cell(table: Table, method: str, category: str, metric: Metric, occlusion: float | None = None) -> Cell:
    condition = Condition() if occlusion is None else Condition(PARTIAL, occlusion)
    names = [one.model for one in table.values if one.method == method]
    found = table.cell(condition.series(names[0], method, metric), "generated", category)
    assert found is not None
    return found


def _value(
    table: Table,
    method: str,
    category: str,
    top_k: int | None = None,
    occlusion: float | None = None,
    surface: str = SEEN,
) -> float:
    metric = Metric(CD if occlusion is None else UCD, surface, top_k=top_k)
    return _cell(table, method, category, metric, occlusion).value


def _cleanliness(table: Table, method: str, category: str, measure: str) -> float:
    return _cell(table, method, category, Metric(measure, MESH, MEASURES[measure], 4)).value


def test_undeformed_nearest_is_the_least_chamfer_distance_to_any_source(
    table: Table, packs: dict[str, Path], database: Path
) -> None:
    with Database.open(database) as store:
        shapes = store.candidates("chair").points
    trees = [cKDTree(shape) for shape in shapes]
    nearest = []
    for target in _targets(packs, "chair"):
        tree = cKDTree(target.points.numpy())
        both = [
            (tree.query(shape)[0] ** 2).mean() + (one.query(target.points.numpy())[0] ** 2).mean()
            for shape, one in zip(shapes, trees, strict=True)
        ]
        nearest.append(min(both))
    assert _value(table, "undeformed_nearest", "chair") == pytest.approx(sum(nearest) / len(nearest), rel=1e-4)


def _as_fit_sees_them(points: torch.Tensor) -> np.ndarray:
    """Points that a fit, which shuffles them by seed 0, sees in the order of `points`."""
    given = np.empty(points.shape)
    given[np.random.default_rng(0).permutation(len(points))] = points.numpy()
    return given


def _chamfer(one: np.ndarray, other: np.ndarray) -> float:
    return float((cKDTree(other).query(one)[0] ** 2).mean() + (cKDTree(one).query(other)[0] ** 2).mean())


@pytest.mark.parametrize(
    ("metric", "deform", "partial"),
    [("refined", "free", False), ("structure", "auto", False), ("structure_without_hint", "auto", None)],
)
def test_full_numbers_are_those_of_what_a_fit_delivers(
    table: Table,
    packs: dict[str, Path],
    model: Model,
    database: Path,
    metric: str,
    deform: Deform,
    partial: bool | None,
) -> None:
    errors, clean = [], []
    with Database.open(database) as store:
        for target in _targets(packs, "chair"):
            points = _as_fit_sees_them(target.points)
            found = fit(points, model, store, "chair", 4, "known", deform, partial=partial)
            placed = found.placed.explanation.deformation
            entry = store.entry(found.source.model_id)
            result = placed(ModelPoints(entry.points.astype(float), entry.point_parts, entry.point_basis.astype(float)))
            errors.append(_chamfer(target.points.numpy(), result))
            clean.append(found.cleanliness)
    measured = _value(table, metric, "chair", 4)
    assert measured == pytest.approx(sum(errors) / len(errors), rel=1e-4)
    for name in ("flatness", "squareness", "contact_gap"):
        wanted = sum(getattr(one, name) for one in clean) / len(clean)
        assert _cleanliness(table, metric, "chair", name) == pytest.approx(wanted, rel=1e-3, abs=1e-6)


def test_feed_forward_is_the_lowest_error_of_the_networks_own_keypoints(
    table: Table, packs: dict[str, Path], model: Model, database: Path
) -> None:
    errors = []
    with Database.open(database) as store:
        for target in _targets(packs, "chair"):
            cloud = _as_fit_sees_them(target.points)
            names = fit(cloud, model, store, "chair", 4, "known", "paper", partial=False).candidates
            keypoints = encode_scan(target.points[None], model["chair"], partial=False).keypoints[0].numpy()
            entries = [store.entry(candidate.model_id) for candidate in names]
            results = [one.points + one.point_basis @ (keypoints - one.keypoints) for one in entries]
            errors.append(min(_chamfer(target.points.numpy(), result) for result in results))
    assert _value(table, "feed_forward", "chair", 4) == pytest.approx(sum(errors) / len(errors), rel=1e-4)


def test_partial_numbers_are_those_of_what_a_fit_delivers(
    table: Table, packs: dict[str, Path], model: Model, database: Path
) -> None:
    errors, whole = [], []
    with Database.open(database) as store:
        for target in _targets(packs, "table"):
            cloud = target.visible(0.5)
            found = fit(_as_fit_sees_them(cloud), model, store, "table", 4, "known", partial=True)
            tree = cKDTree(found.placed.explanation.points)
            errors.append((tree.query(cloud.numpy())[0] ** 2).mean())
            whole.append((tree.query(target.points.numpy())[0] ** 2).mean())
    assert _value(table, "structure", "table", 4, 0.5) == pytest.approx(sum(errors) / len(errors), rel=1e-4)
    assert _value(table, "structure", "table", 4, 0.5, WHOLE) == pytest.approx(sum(whole) / len(whole), rel=1e-4)


def test_undeformed_models_have_lost_nothing_and_bent_ones_have(table: Table) -> None:
    measures = [one for one in table.values if not one.is_error]
    assert {one.metric.name for one in measures} == set(MEASURES)
    assert {(one.metric.top_k, one.metric.surface) for one in measures} == {(4, MESH)}
    for one in measures:
        if one.method == "undeformed_retrieved":
            assert list(table.values[one].values()) == pytest.approx([0] * len(table.values[one]), abs=1e-6)
    # An untrained network's keypoints bend every model.
    assert _cleanliness(table, "refined", "chair", "squareness") > 1.0


def test_more_candidates_are_never_worse_and_the_oracle_is_best(table: Table) -> None:
    for occlusion in (None, 0.0, 0.5):
        for metric in ("no_learning", "feed_forward", "refined"):
            one, four = (_value(table, metric, "chair", k, occlusion) for k in (1, 4))
            oracle = _value(table, f"oracle_{metric}", "chair", None, occlusion)
            assert oracle <= four * (1 + 1e-5)
            # A fit chooses what is refined by more than its error.
            assert metric == "refined" or four <= one * (1 + 1e-5)


def test_the_floor_lies_below_all_methods_and_nothing_is_not_finite(table: Table) -> None:
    assert all(math.isfinite(value) for values in table.values.values() for value in values.values())
    assert all(value > 0 for one, values in table.values.items() if one.is_error for value in values.values())
    floor = _value(table, "sampling_floor", "chair")
    assert floor < 0.5 * _value(table, "undeformed_nearest", "chair")


def test_a_given_database_is_as_good_as_one_built_of_the_same_shapes(
    table: Table, packs: dict[str, Path], model: Model, database: Path
) -> None:
    again = make_table([packs["chair"]], {"m": model}, TableConfig(top_k=(4,)), {"m": database})
    assert again.categories("generated") == ["chair"]
    for one in (one for one in again.values if one.is_error):
        wanted = _value(table, one.method, "chair", one.metric.top_k)
        assert _value(again, one.method, "chair", one.metric.top_k) == pytest.approx(wanted, rel=1e-5)


def test_the_seed_decides(packs: dict[str, Path], model: Model, database: Path) -> None:
    first, same, other = (
        make_table([packs["chair"]], {"m": model}, TableConfig(limit=1, seed=seed), {"m": database})
        for seed in (0, 0, 1)
    )
    assert first.values == same.values
    assert _value(first, "undeformed_nearest", "chair") != _value(other, "undeformed_nearest", "chair")
    assert len(first.subjects()) == 1


def test_targets_that_are_in_the_database_are_told(packs: dict[str, Path], model: Model, database: Path) -> None:
    told: list[str] = []
    config = TableConfig(split="source", limit=2)
    found = make_table([packs["chair"]], {"m": model}, config, {"m": database}, report=told.append)
    assert "2 of 2 targets are in the database" in told[0]
    # The nearest shape is the target itself, sampled otherwise.
    assert _value(found, "sampling_floor", "chair") > 0.8 * _value(found, "undeformed_nearest", "chair")


def test_progress_ends_complete(packs: dict[str, Path], model: Model) -> None:
    last: dict[str, tuple[int, int]] = {}

    def progress(task: str, done: int, total: int) -> None:
        assert done >= last.get(task, (0, 0))[0]
        last[task] = (done, total)

    make_table([packs["chair"]], {"m": model}, TableConfig(limit=2), progress=progress)
    assert last == {
        "generated/chair: database": (9, 9),
        "generated/chair: baseline": (9, 9),
        "generated/chair: val": (2, 2),
    }


def test_wrong_arguments_are_told_in_one_sentence(packs: dict[str, Path], model: Model, tmp_path: Path) -> None:
    chair = packs["chair"]
    only_val = MeshPack.load(chair)
    rows = only_val.indices("val").tolist()
    MeshPack.from_meshes(
        [only_val[i] for i in rows], [str(only_val.model_id[i]) for i in rows], ["val"] * len(rows), "chair"
    ).save(tmp_path / "val.npz")
    stool = Model("other", {"stool": new_network(ModelConfig(category="stool", width=16, stages=1), 0)})
    cases: list[tuple[type[KpredError], str, dict]] = [
        (PackError, "no shape is in the split 'test'", {"config": TableConfig(split="test")}),
        (PackError, "at least one .npz", {"packs": []}),
        (PackError, "no such file", {"packs": [tmp_path / "none.npz"]}),
        (PackError, "'source' to search", {"packs": [tmp_path / "val.npz"]}),
        (DatabaseError, "none.kpred", {"databases": {"m": tmp_path / "none.kpred"}}),
        (ModelError, "no category 'chair'", {"models": {"m": stool}}),
        (ConfigError, "limit of targets", {"config": TableConfig(limit=0)}),
    ]
    for kind, words, changes in cases:
        arguments = {"packs": [chair], "models": {"m": model}, "config": TableConfig(), **changes}
        with pytest.raises(kind, match=words):
            make_table(**arguments)


def test_what_is_wrong_with_the_last_pack_is_told_before_the_first_is_measured(
    packs: dict[str, Path], model: Model
) -> None:
    only_chairs = Model("chairs", {"chair": model["chair"]})
    told: list[str] = []
    with pytest.raises(ModelError, match="'table'"):
        make_table(
            list(packs.values()),
            {"m": only_chairs},
            TableConfig(),
            progress=lambda task, done, total: told.append(task),
        )
    assert not told


def test_a_database_of_other_weights_is_refused(packs: dict[str, Path], model: Model, database: Path) -> None:
    config = model["chair"].config
    other = Model("other", {"chair": new_network(config, seed=1).eval()})
    with pytest.raises(DatabaseError, match="other weights"):
        make_table([packs["chair"]], {"m": other}, TableConfig(limit=1), {"m": database})


def test_folders_stand_for_their_packs(packs: dict[str, Path], tmp_path: Path) -> None:
    assert pack_files([packs["chair"].parent]) == [packs["chair"], packs["table"]]
    with pytest.raises(PackError, match="no mesh packs"):
        pack_files([tmp_path])
