"""Catalogue models scanned: the truth has no error, changes show as they are, and nothing is lost."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

from kpred.database import Database, Entry, build_database
from kpred.errors import ConfigError, DatabaseError, PackError, ScanError
from kpred.evaluation.database_source import database_source
from kpred.evaluation.metrics.summary import Scope
from kpred.evaluation.scans import outcome as fit_outcome
from kpred.evaluation.scans.catalogue import evaluate_catalogue
from kpred.evaluation.scans.catalogue_outcomes import CatalogueOutcome, board_thickness, measure_catalogue_scan
from kpred.evaluation.scans.catalogue_summaries import FIRST, summarise_catalogue
from kpred.evaluation.scans.outcome import FitSettings
from kpred.evaluation.scans.run import ScanConfig, ScanReport
from kpred.evaluation.scans.targets import ScanTarget, make_scan_target
from kpred.fitting import Fit, fit
from kpred.nn import Model
from kpred.shapes import MeshPack, open_shapes

CONFIG = ScanConfig(limit=2, top_k=3, tiles=2)


@pytest.fixture(scope="module")
def settings(packs: dict[str, Path], model: Model) -> Iterator[FitSettings]:
    with database_source([packs["chair"]], model, None, 0, None, pytest.fail) as database:
        yield FitSettings(model, database, top_k=3, seed=0)


@pytest.fixture(scope="module")
def entry(settings: FitSettings) -> Entry:
    return settings.database.entry(settings.database.model_ids("chair")[0])


@pytest.fixture(scope="module")
def target(entry: Entry) -> ScanTarget:
    return make_scan_target(entry.mesh, entry.model_id, 0, own_size=True)


@pytest.fixture(scope="module")
def some(target: ScanTarget, settings: FitSettings) -> Fit:
    """A fit of the right model."""
    return fit(target.scan, settings.model, settings.database, "chair", up="y", model_id=target.model_id)


@pytest.fixture(scope="module")
def report(packs: dict[str, Path], model: Model) -> ScanReport[CatalogueOutcome]:
    return evaluate_catalogue(list(packs.values()), model, None, CONFIG)


def _unit(entry: Entry) -> np.ndarray:
    return entry.frame.to_unit(entry.mesh.vertices.astype(np.float64))


def _there(vertices: np.ndarray, entry: Entry, target: ScanTarget) -> trimesh.Trimesh:
    return trimesh.Trimesh(target.frame.from_unit(vertices), entry.mesh.faces, process=False)


def _given(monkeypatch: pytest.MonkeyPatch, found: Fit) -> list[dict[str, Any]]:
    """Put a fit in the place of the real one; its options are recorded."""
    calls: list[dict[str, Any]] = []

    def given(points: np.ndarray, *arguments: Any, **options: Any) -> Fit:
        calls.append(options)
        return found

    monkeypatch.setattr(fit_outcome, "fit", given)
    return calls


def test_the_model_itself_has_no_error_and_lost_nothing(
    entry: Entry, target: ScanTarget, settings: FitSettings, some: Fit, monkeypatch: pytest.MonkeyPatch
) -> None:
    true, shifted = _there(_unit(entry), entry, target), _there(_unit(entry) + [0, 0.5, 0], entry, target)
    calls = _given(monkeypatch, replace(some, mesh=true, retrieved_mesh=shifted, frame=target.frame))
    outcome = measure_catalogue_scan(target, "chair", settings)
    assert calls == [{"up": "y", "category": "chair", "top_k": 3, "seed": 0}]
    assert outcome.distance == pytest.approx(0, abs=1e-6)
    assert outcome.undeformed_distance is not None and outcome.undeformed_distance > 0.01
    assert (outcome.rank, outcome.first) == (1, True)
    assert outcome.yaw == pytest.approx(0, abs=1e-9)
    assert outcome.thickness and outcome.thickness == pytest.approx([1.0] * len(outcome.thickness), abs=1e-6)
    # A tenth of the longest side away, which is 2 in the unit box.
    moved = _there(_unit(entry) + [0, 0, 40], entry, target)
    _given(monkeypatch, replace(some, mesh=moved, retrieved_mesh=true, frame=target.frame))
    outcome = measure_catalogue_scan(target, "chair", settings)
    assert outcome.distance == pytest.approx(20, rel=0.05)
    assert outcome.ratio is not None and outcome.ratio > 1e3


def test_another_model_has_no_thickness_to_compare_and_its_rank_is_said(
    entry: Entry, target: ScanTarget, settings: FitSettings, some: Fit, monkeypatch: pytest.MonkeyPatch
) -> None:
    other = replace(some.source, model_id="another")
    _given(monkeypatch, replace(some, source=other, candidates=(other, some.source)))
    outcome = measure_catalogue_scan(target, "chair", settings)
    assert (outcome.model, outcome.rank, outcome.first, outcome.thickness) == ("another", 2, False, ())
    _given(monkeypatch, replace(some, source=other, candidates=(other,)))
    assert measure_catalogue_scan(target, "chair", settings).rank is None


def test_thickness_is_against_the_models_own(entry: Entry) -> None:
    source = _unit(entry)
    sides = np.ptp(entry.structure.boxes, axis=1).min(axis=1)
    same = board_thickness(entry, 0.3 * source + [5, 0, 0], 0.3)
    assert len(same) == ((sides > 1e-3) & (sides < 0.15)).sum() > 0
    np.testing.assert_allclose(same, 1, atol=1e-6)
    squeezed = board_thickness(entry, source * 0.5, 1.0)
    np.testing.assert_allclose(squeezed, 0.5, atol=1e-6)


def test_models_stand_there_in_their_own_size(entry: Entry) -> None:
    whole = make_scan_target(entry.mesh, "whole", 3, views=0, own_size=True)
    side = np.ptp(entry.mesh.vertices, axis=0).max()
    height = np.ptp(whole.scan[:, 1])
    assert whole.frame.scale == pytest.approx(side / 2, rel=1e-5)
    # Strays lie in 1.3 times the box.
    assert np.ptp(entry.mesh.vertices[:, 1]) * 0.97 < height < np.ptp(entry.mesh.vertices[:, 1]) * 1.4


def test_more_views_see_more(entry: Entry) -> None:
    seen = [make_scan_target(entry.mesh, "views", 3, views) for views in (1, 4, 0)]
    hidden = [np.linalg.norm(one.whole[:, None] - one.visible[None], axis=2).min(axis=1).mean() for one in seen]
    assert hidden[0] > hidden[1] > 0.9 * hidden[2]
    assert [len(one.scan) for one in seen] == [2048] * 3


def test_every_scanned_model_is_reported(
    report: ScanReport[CatalogueOutcome], packs: dict[str, Path], model: Model
) -> None:
    source = {
        category: set(MeshPack.load(file).model_id[MeshPack.load(file).indices("source")].tolist())
        for category, file in packs.items()
    }
    assert [(dataset, one.category) for dataset, one in report.outcomes] == [("generated", "chair")] * 2 + [
        ("generated", "table")
    ] * 2
    assert all(one.model_id in source[one.category] for _, one in report.outcomes)
    rows = {(row.category, row.metric, row.group): row for row in report.summaries}
    assert rows["all", "right_model_first", "all"].n == 4
    assert rows["chair", "right_model_in_top_k", "all"].n == 2
    assert len(report.tiles) == 2
    again = evaluate_catalogue(list(packs.values()), model, None, CONFIG)
    without_times = [{**row, "milliseconds": 0} for row in report.to_json()["targets"]]
    assert [{**row, "milliseconds": 0} for row in again.to_json()["targets"]] == without_times


def test_a_database_alone_is_its_own_catalogue(packs: dict[str, Path], model: Model, tmp_path: Path) -> None:
    file = tmp_path / "mine.kpred"
    build_database(file, open_shapes(packs["table"], split="source"), model, seed=0)
    seen: list[tuple[str, int, int]] = []
    found = evaluate_catalogue((), model, file, ScanConfig(views=0, limit=1), progress=lambda *step: seen.append(step))
    ((dataset, outcome),) = found.outcomes
    assert (dataset, outcome.category) == ("mine", "table")
    assert found.header["database"] == str(file)
    assert seen == [("mine/table: scans", 1, 1)]
    with Database.open(file) as store:
        assert outcome.model_id in store
    with pytest.raises(DatabaseError, match="lacks 2 of the 2 models"):
        evaluate_catalogue([packs["chair"]], model, file, CONFIG)


RIGHT = CatalogueOutcome(
    model_id="a",
    category="chair",
    symmetry="none",
    model="a",
    rank=1,
    step="none",
    yaw=2.0,
    confidence=0.9,
    milliseconds=50.0,
    distance=0.01,
    undeformed_distance=0.02,
    thickness=(1.0, 0.5),
)
BENT = replace(RIGHT, model_id="b", model="b", step="structure", distance=0.03, thickness=(1.05,))
WRONG = replace(RIGHT, model_id="c", rank=4, distance=0.5, yaw=90.0, thickness=())
LOST = CatalogueOutcome(model_id="d", category="chair", symmetry="none", failure="too small")


def test_summaries_by_hand() -> None:
    scope = Scope("data", "source", "chair", 0)
    rows = {(row.metric, row.group): row for row in summarise_catalogue([RIGHT, BENT, WRONG, LOST], scope)}
    assert rows["right_model_first", "all"].value == 0.5
    assert rows["right_model_in_top_k", "all"].value == 0.75
    assert rows["yaw_right", "all"].value == 0.5
    assert rows["failed", "all"].value == 0.25
    assert (rows["distance", "all"].value, rows["distance", "all"].n) == (pytest.approx(0.18), 3)
    assert rows["distance", FIRST].value == pytest.approx(0.02)
    assert rows["distance_ratio", FIRST].value == pytest.approx((0.5 + 1.5) / 2)
    assert rows["board_thickness", FIRST].value == 1.0
    assert rows["boards_kept", FIRST].value == pytest.approx(2 / 3)
    assert [rows[f"step_{step}", FIRST].value for step in ("none", "scale", "structure")] == [0.5, 0.0, 0.5]
    assert {row.metric for row in summarise_catalogue([LOST], scope)} == {
        "right_model_first",
        "right_model_in_top_k",
        "yaw_right",
        "failed",
    }


def test_failures_are_kept(target: ScanTarget, settings: FitSettings, monkeypatch: pytest.MonkeyPatch) -> None:
    def fails(points: np.ndarray, *arguments: Any, **options: Any) -> Any:
        raise ScanError("scan: too small.")

    monkeypatch.setattr(fit_outcome, "fit", fails)
    outcome = measure_catalogue_scan(target, "chair", settings)
    assert outcome.failure == "scan: too small."
    assert outcome.to_json()["ratio"] is None


def test_impossible_settings(packs: dict[str, Path], model: Model, tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="views"):
        ScanConfig(views=-1)
    with pytest.raises(ConfigError, match="top_k"):
        ScanConfig(top_k=0)
    with pytest.raises(ConfigError, match="limit"):
        evaluate_catalogue([packs["chair"]], model, None, ScanConfig(limit=0))
    pack = MeshPack.load(packs["chair"])
    lone = tmp_path / "chair.npz"
    MeshPack.from_meshes(list(pack), list(pack.model_id), ["val"] * 12, "chair").save(lone)
    with pytest.raises(PackError, match="'source' to scan"):
        evaluate_catalogue([lone], model)
