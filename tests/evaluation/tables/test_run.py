"""Whole evaluations on small packs with untrained networks: the numbers are those of the fit and of slow references."""

import math
from dataclasses import asdict
from pathlib import Path

import numpy as np
import pytest
import torch
from scipy.spatial import cKDTree

from kpred.database import Database, build_database
from kpred.errors import ConfigError, DatabaseError, KpredError, ModelError, PackError
from kpred.evaluation import evaluate, run_header
from kpred.evaluation.tables.cleanliness_scores import MEASURES
from kpred.evaluation.tables.measuring import pack_files, steps_of
from kpred.evaluation.tables.rows import UNIT, Row
from kpred.evaluation.tables.targets import Target, read_targets
from kpred.fitting import fit
from kpred.fitting.deform import Deform, ModelPoints
from kpred.fitting.encoding import encode_scan
from kpred.nn import Model, ModelConfig
from kpred.shapes import MeshPack, open_shapes
from kpred.training.run import new_network


@pytest.fixture(scope="module")
def database(packs: dict[str, Path], model: Model, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("database") / "both.kpred"
    for file in packs.values():
        build_database(path, open_shapes(file, split="source"), model, seed=0)
    return path


@pytest.fixture(scope="module")
def rows(packs: dict[str, Path], model: Model) -> list[Row]:
    return evaluate(list(packs.values()), model, top_k=(1, 4), protocol="all", occlusions=(0.0, 0.5), oracle=True)


def _targets(packs: dict[str, Path], category: str) -> list[Target]:
    return read_targets(MeshPack.load(packs[category]), "p", "val", None, 0, pytest.fail)


def _value(
    rows: list[Row], metric: str, category: str, top_k: int | None = None, occlusion: float | None = None
) -> float:
    protocol = "full" if occlusion is None else "partial"
    found = [
        row.value
        for row in rows
        if (row.metric, row.category, row.top_k, row.protocol) == (metric, category, top_k, protocol)
        and row.occlusion == (occlusion or 0.0)
        and row.unit == UNIT
    ]
    assert len(found) == 1
    return found[0]


def _cleanliness(rows: list[Row], metric: str, category: str, measure: str) -> float:
    (found,) = (
        row.value
        for row in rows
        if (row.metric, row.category, row.distance, row.protocol) == (metric, category, measure, "full")
    )
    return found


def test_undeformed_nearest_is_the_least_chamfer_distance_to_any_source(
    rows: list[Row], packs: dict[str, Path], database: Path
) -> None:
    with Database.open(database) as store:
        shapes = store.candidates("chair").points
    nearest = []
    for target in _targets(packs, "chair"):
        tree = cKDTree(target.points.numpy())
        both = [
            (tree.query(shape)[0] ** 2).mean() + (cKDTree(shape).query(target.points.numpy())[0] ** 2).mean()
            for shape in shapes
        ]
        nearest.append(min(both))
    assert _value(rows, "undeformed_nearest", "chair") == pytest.approx(sum(nearest) / len(nearest), rel=1e-4)


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
    rows: list[Row],
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
    measured = _value(rows, metric, "chair", 4)
    assert measured == pytest.approx(sum(errors) / len(errors), rel=1e-4)
    for name in ("flatness", "squareness", "contact_gap"):
        wanted = sum(getattr(one, name) for one in clean) / len(clean)
        assert _cleanliness(rows, metric, "chair", name) == pytest.approx(wanted, rel=1e-3, abs=1e-6)


def test_feed_forward_is_the_lowest_error_of_the_networks_own_keypoints(
    rows: list[Row], packs: dict[str, Path], model: Model, database: Path
) -> None:
    errors = []
    with Database.open(database) as store:
        for target in _targets(packs, "chair"):
            names = fit(_as_fit_sees_them(target.points), model, store, "chair", 4, "known", partial=False).candidates
            keypoints = encode_scan(target.points[None], model["chair"], partial=False).keypoints[0].numpy()
            entries = [store.entry(candidate.model_id) for candidate in names]
            results = [one.points + one.point_basis @ (keypoints - one.keypoints) for one in entries]
            errors.append(min(_chamfer(target.points.numpy(), result) for result in results))
    assert _value(rows, "feed_forward", "chair", 4) == pytest.approx(sum(errors) / len(errors), rel=1e-4)


def test_partial_numbers_are_those_of_what_a_fit_delivers(
    rows: list[Row], packs: dict[str, Path], model: Model, database: Path
) -> None:
    errors, whole = [], []
    with Database.open(database) as store:
        for target in _targets(packs, "table"):
            cloud = target.visible(0.5)
            found = fit(_as_fit_sees_them(cloud), model, store, "table", 4, "known", partial=True)
            tree = cKDTree(found.placed.explanation.points)
            errors.append((tree.query(cloud.numpy())[0] ** 2).mean())
            whole.append((tree.query(target.points.numpy())[0] ** 2).mean())
    assert _value(rows, "structure", "table", 4, 0.5) == pytest.approx(sum(errors) / len(errors), rel=1e-4)
    assert _value(rows, "structure_whole", "table", 4, 0.5) == pytest.approx(sum(whole) / len(whole), rel=1e-4)


def test_undeformed_models_have_lost_nothing_and_bent_ones_have(rows: list[Row]) -> None:
    measured = {row.distance for row in rows if row.unit != UNIT}
    assert measured == set(MEASURES)
    assert all(row.top_k == 4 for row in rows if row.unit != UNIT)
    for name in MEASURES:
        for row in rows:
            if row.distance == name and row.metric == "undeformed_retrieved":
                assert (row.value, row.percentile_95) == pytest.approx((0, 0), abs=1e-6)
    # An untrained network's keypoints bend every model.
    assert _cleanliness(rows, "refined", "chair", "squareness") > 1.0


def test_more_candidates_are_never_worse_and_the_oracle_is_best(rows: list[Row]) -> None:
    for occlusion in (None, 0.0, 0.5):
        for metric in ("no_learning", "feed_forward", "refined"):
            one, four = (_value(rows, metric, "chair", k, occlusion) for k in (1, 4))
            oracle = _value(rows, f"oracle_{metric}", "chair", None, occlusion)
            assert oracle <= four * (1 + 1e-5)
            # A fit chooses what is refined by more than its error.
            assert metric == "refined" or four <= one * (1 + 1e-5)


def test_the_rows_of_all_are_means_over_all_instances(rows: list[Row]) -> None:
    single = {}
    for row in rows:
        single.setdefault((row.protocol, row.occlusion, row.metric, row.distance, row.top_k), {})[row.category] = row
    for found in single.values():
        together = found["all"]
        # Models without symmetry have no mirror to lose.
        parts = [found[name] for name in ("chair", "table") if name in found]
        assert together.n == sum(part.n for part in parts)
        assert together.n == 6 or together.distance == "mirror"
        wanted = sum(part.value * part.n for part in parts) / together.n
        assert together.value == pytest.approx(wanted)
        assert together.dataset == "all"
        assert parts[0].dataset == "generated"
        assert all(row.database_models == 9 for row in found.values())


def test_the_floor_lies_below_all_methods_and_nothing_is_not_finite(rows: list[Row]) -> None:
    assert all(math.isfinite(row.value) for row in rows)
    assert all(row.value > 0 for row in rows if row.unit == UNIT)
    floor = _value(rows, "sampling_floor", "chair")
    assert floor < 0.5 * _value(rows, "undeformed_nearest", "chair")


def test_a_given_database_is_as_good_as_one_built_of_the_same_shapes(
    rows: list[Row], packs: dict[str, Path], model: Model, database: Path
) -> None:
    again = evaluate([packs["chair"]], model, database, top_k=4)
    assert {row.category for row in again} == {"chair"}
    for row in (row for row in again if row.unit == UNIT):
        assert row.value == pytest.approx(_value(rows, row.metric, "chair", row.top_k), rel=1e-5)


def test_the_seed_decides(packs: dict[str, Path], model: Model, database: Path) -> None:
    first, same, other = (evaluate([packs["chair"]], model, database, limit=1, seed=seed) for seed in (0, 0, 1))
    assert [asdict(row) for row in first] == [asdict(row) for row in same]
    assert first[0].value != other[0].value
    assert first[0].n == 1


def test_targets_that_are_in_the_database_are_told(packs: dict[str, Path], model: Model, database: Path) -> None:
    told: list[str] = []
    found = evaluate([packs["chair"]], model, database, split="source", limit=2, report=told.append)
    assert "2 of 2 targets are in the database" in told[0]
    ratio = {row.metric: row.ratio_to_undeformed for row in found}
    assert ratio["sampling_floor"] is not None
    assert ratio["sampling_floor"] > 0.8  # the nearest shape is the target itself, sampled otherwise


def test_progress_ends_complete(packs: dict[str, Path], model: Model) -> None:
    last: dict[str, tuple[int, int]] = {}

    def progress(task: str, done: int, total: int) -> None:
        assert done >= last.get(task, (0, 0))[0]
        last[task] = (done, total)

    evaluate([packs["chair"]], model, limit=2, progress=progress)
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
        (ConfigError, "top_k", {"top_k": 0}),
        (ConfigError, "top_k", {"top_k": ()}),
        (ConfigError, "Occlusions", {"protocol": "partial", "occlusions": (1.0,)}),
        (PackError, "'test'", {"split": "test"}),
        (PackError, "at least one", {"packs": []}),
        (PackError, "no such file", {"packs": [tmp_path / "none.npz"]}),
        (PackError, "'source' to search", {"packs": [tmp_path / "val.npz"]}),
        (DatabaseError, "none.kpred", {"database": tmp_path / "none.kpred"}),
        (ModelError, "no category 'chair'", {"model": stool}),
    ]
    for kind, words, changes in cases:
        arguments = {"packs": [chair], "model": model, **changes}
        with pytest.raises(kind, match=words):
            evaluate(**arguments)


def test_an_unknown_protocol_is_told() -> None:
    with pytest.raises(ConfigError, match="full, partial, all"):
        steps_of("half", (0.0,))


def test_what_is_wrong_with_the_last_pack_is_told_before_the_first_is_measured(
    packs: dict[str, Path], model: Model
) -> None:
    only_chairs = Model("chairs", {"chair": model["chair"]})
    told: list[str] = []
    with pytest.raises(ModelError, match="'table'"):
        evaluate(list(packs.values()), only_chairs, progress=lambda task, done, total: told.append(task))
    assert not told


def test_a_database_of_other_weights_is_refused(packs: dict[str, Path], model: Model, database: Path) -> None:
    config = model["chair"].config
    other = Model("other", {"chair": new_network(config, seed=1).eval()})
    with pytest.raises(DatabaseError, match="other weights"):
        evaluate([packs["chair"]], other, database, limit=1)


def test_folders_stand_for_their_packs(packs: dict[str, Path], tmp_path: Path) -> None:
    assert pack_files([packs["chair"].parent]) == [packs["chair"], packs["table"]]
    with pytest.raises(PackError, match="no mesh packs"):
        pack_files([tmp_path])


def test_the_header_names_model_database_seed_and_versions(model: Model) -> None:
    header = run_header(model, None, split="val", top_k=10, protocol="full", limit=None, seed=5)
    assert header["fingerprints"] == {name: network.fingerprint() for name, network in model.items()}
    assert header["seed"] == 5
    assert header["versions"]["torch"].split("+")[0] == torch.__version__.split("+")[0]
    assert "source" in header["database"]
