"""Virtual scans fitted twice: errors by other means, nothing lost, the same again, pooled as it says."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from scipy.spatial import cKDTree

from kpred.database import Database
from kpred.errors import DatabaseError, MeshError, ModelError, PackError, ScanError
from kpred.evaluation.database_source import database_source
from kpred.evaluation.metrics.summary import Scope, Summary
from kpred.evaluation.metrics.surfaces import Surface
from kpred.evaluation.scans import outcome as fit_outcome
from kpred.evaluation.scans.outcome import FitSettings, moved, try_fit
from kpred.evaluation.scans.run import ScanConfig
from kpred.evaluation.scans.scan_outcomes import Errors, ScanOutcome, measure_scan
from kpred.evaluation.scans.scan_summaries import confusion, reliability_of, summarise
from kpred.evaluation.scans.targets import ScanTarget, make_scan_target
from kpred.evaluation.scans.tiles import worst_and_typical
from kpred.evaluation.scans.virtual_scans import ScansReport, evaluate_scans
from kpred.fitting import Fit
from kpred.nn import Model
from kpred.ops import Frame
from kpred.ops.rotations import yaw_rotation
from kpred.shapes.pack import MeshPack
from kpred.synthetic.generator import generate

SCOPE = Scope("data", "val", "chair", 0)


@pytest.fixture(scope="module")
def others(packs: dict[str, Path]) -> Path:
    """A pack of things of no category, in a folder of its own."""
    things = generate("cabinet", 3, seed=0, splits=False)
    file = packs["chair"].parent.parent / "others" / "other.npz"
    file.parent.mkdir(exist_ok=True)
    MeshPack.from_meshes(list(things), list(things.model_id), ["val"] * 3, "other").save(file)
    return file


@pytest.fixture(scope="module")
def report(packs: dict[str, Path], others: Path, model: Model) -> ScansReport:
    return evaluate_scans([packs["chair"], packs["table"], others], model, None, ScanConfig(limit=2, top_k=2, tiles=2))


@pytest.fixture(scope="module")
def settings(packs: dict[str, Path], model: Model) -> Any:
    with database_source([packs["chair"], packs["table"]], model, None, 0, None, pytest.fail) as database:
        yield FitSettings(model, database, top_k=2, seed=0)


@pytest.fixture(scope="module")
def target(packs: dict[str, Path]) -> ScanTarget:
    return make_scan_target(MeshPack.load(packs["chair"])[3], "target", 0)


@pytest.fixture(scope="module")
def some(target: ScanTarget, settings: FitSettings) -> Fit:
    found = try_fit(target.scan, settings, up="y")
    assert isinstance(found, Fit)
    return found


def value(report: ScansReport, metric: str, dataset: str = "all", category: str = "all", group: str = "all") -> Summary:
    key = (metric, dataset, category, group)
    found = [s for s in report.summaries if (s.metric, s.dataset, s.category, s.group) == key]
    assert len(found) == 1
    return found[0]


class Given:
    """A fit that gives back what it is told, in the place of the real one."""

    def __init__(
        self, some: Fit, true: ScanTarget, mesh: trimesh.Trimesh, yaw: float = 0.0, category: str = "chair"
    ) -> None:
        self.some, self.true, self.mesh, self.yaw, self.category = some, true, mesh, yaw, category
        self.calls: list[dict[str, Any]] = []

    def __call__(self, points: np.ndarray, *arguments: Any, **options: Any) -> Fit:
        self.calls.append({"points": points, **options})
        frame = Frame(np.zeros(3), 1.0) if options.get("frame") == "known" else self.true.frame
        turned = Frame(frame.center, frame.scale, yaw_rotation(np.radians(self.yaw)) @ frame.rotation)
        mesh = trimesh.Trimesh(frame.from_unit(np.asarray(self.mesh.vertices)), self.mesh.faces, process=False)
        return replace(
            self.some,
            mesh=mesh,
            frame=turned,
            source=replace(self.some.source, category=self.category),
            confidence=0.75,
            warnings=("one",),
            timings={"read": 0.25, "mesh": 0.5},
        )


def unit_mesh(packs: dict[str, Path], target: ScanTarget) -> trimesh.Trimesh:
    mesh = MeshPack.load(packs["chair"])[3]
    low, high = mesh.bounds.astype(np.float64)
    return trimesh.Trimesh((mesh.vertices - (low + high) / 2) / ((high - low).max() / 2), mesh.faces, process=False)


def test_the_true_shape_has_no_errors_wherever_it_stands(
    packs: dict[str, Path], target: ScanTarget, settings: FitSettings, some: Fit, monkeypatch: pytest.MonkeyPatch
) -> None:
    perfect = Given(some, target, unit_mesh(packs, target))
    monkeypatch.setattr(fit_outcome, "fit", perfect)
    outcome = measure_scan(target, "chair", settings, keep_mesh=True)
    for errors in (outcome.unknown, outcome.known):
        assert errors is not None
        # What is left is the spacing of the samples.
        assert max(errors.whole, errors.visible) < 2e-4
        assert max(errors.centre, errors.size) < 1e-5
    assert outcome.right
    # A whole generated chair, seen from one side, stands on its feet for whoever looks.
    assert outcome.up_right
    assert outcome.yaw == pytest.approx(0, abs=1e-9)
    assert (outcome.confidence, outcome.warnings, outcome.milliseconds) == (0.75, 1, 750)
    assert outcome.result is not None
    np.testing.assert_allclose(outcome.result.bounds, [target.low, target.high], atol=1e-5)
    unknown, known = perfect.calls
    np.testing.assert_array_equal(unknown.pop("points"), target.scan)
    assert unknown == {"up": "y", "top_k": 2, "seed": 0}
    np.testing.assert_array_equal(known.pop("points"), target.known)
    assert known == {"frame": "known", "category": "chair", "partial": True, "top_k": 2, "seed": 0}


def test_errors_of_a_shifted_and_stretched_result(
    packs: dict[str, Path], target: ScanTarget, settings: FitSettings, some: Fit, monkeypatch: pytest.MonkeyPatch
) -> None:
    mesh = unit_mesh(packs, target)
    mesh.vertices = mesh.vertices * [1.0, 1.3, 1.0] + [0.2, 0.0, 0.0]
    monkeypatch.setattr(fit_outcome, "fit", Given(some, target, mesh))
    errors = measure_scan(target, "chair", settings).unknown
    assert errors is not None
    assert errors.centre == pytest.approx(0.1, abs=1e-5)
    assert errors.size == pytest.approx(0.3 * (target.high - target.low)[1] / 2 / 3, abs=1e-5)
    dense = trimesh.sample.sample_surface(mesh, 60_000, seed=1)[0]
    distances = cKDTree(dense).query(target.whole)[0]
    assert errors.whole == pytest.approx(np.square(distances).mean(), rel=0.02)
    assert errors.distance == pytest.approx(distances.mean(), rel=0.02)


@pytest.mark.parametrize(
    ("yaw", "category", "shift", "right"),
    [(0, "chair", 0.0, True), (14, "chair", 0.0, True), (16, "chair", 0.0, False), (180, "chair", 0.0, False)]
    + [(0, "table", 0.0, False), (0, "chair", 0.6, False)],
)
def test_right_needs_category_yaw_and_nearness(
    packs: dict[str, Path],
    target: ScanTarget,
    settings: FitSettings,
    some: Fit,
    monkeypatch: pytest.MonkeyPatch,
    yaw: float,
    category: str,
    shift: float,
    right: bool,
) -> None:
    mesh = unit_mesh(packs, target)
    mesh.vertices = mesh.vertices + [0.0, shift, 0.0]
    monkeypatch.setattr(fit_outcome, "fit", Given(some, target, mesh, float(yaw), category))
    outcome = measure_scan(target, "chair", settings)
    assert outcome.yaw == pytest.approx(yaw)
    assert outcome.right == right


def test_no_failure_is_lost(target: ScanTarget, settings: FitSettings, monkeypatch: pytest.MonkeyPatch) -> None:
    def fails(points: np.ndarray, *arguments: Any, **options: Any) -> Any:
        raise ScanError("scan: too\n small.") if "frame" in options else RuntimeError("the network fell over")

    monkeypatch.setattr(fit_outcome, "fit", fails)
    outcome = measure_scan(target, "chair", settings)
    assert outcome.failure == "unexpected RuntimeError: the network fell over"
    assert outcome.known_failure == "scan: too small."
    assert not outcome.right
    assert outcome.confidence is None
    rows = {row.metric: row for row in summarise([outcome], SCOPE) if row.group == "all"}
    assert rows["failed"].value == 1
    assert rows["right"].value == rows["category_right"].value == rows["yaw_right"].value == 0
    assert "ucd_whole_ratio" not in rows
    assert confusion([outcome]) == {"chair": {"failed": 1}}
    assert ScansReport({}, (), (("data", outcome),), confusion={}, reliability=None).failures == (
        "data/chair target, nothing given: unexpected RuntimeError: the network fell over",
        "data/chair target, all given: scan: too small.",
    )


ERRORS = Errors(whole=0.02, visible=0.01, distance=0.05, centre=0.1, size=0.2)
FINE = ScanOutcome(
    model_id="a",
    category="chair",
    symmetry="none",
    found="chair",
    confidence=0.9,
    yaw=3.0,
    up="z",
    unknown=ERRORS,
    known=replace(ERRORS, whole=0.01),
)
TURNED = replace(FINE, up="-z", yaw=90.0, confidence=0.6, unknown=replace(ERRORS, whole=0.04), symmetry="half turn")
LOST = ScanOutcome(model_id="c", category="chair", symmetry="none", failure="too small", known=ERRORS)
OTHER = ScanOutcome(model_id="d", category="other", symmetry="none", found="chair", confidence=0.3)
BOLD = replace(OTHER, confidence=0.8)


def test_summaries_by_hand() -> None:
    rows = {(row.metric, row.group): row for row in summarise([FINE, TURNED, LOST], SCOPE)}
    ratio = rows["ucd_whole_ratio", "all"]
    assert (ratio.value, ratio.n, ratio.statistic) == (pytest.approx(3), 2, "ratio of means")
    assert rows["ucd_whole_unknown", "all"].value == pytest.approx(0.03)
    assert rows["yaw_right", "all"].value == pytest.approx(1 / 3)
    assert (rows["yaw_right", "symmetry none"].value, rows["yaw_right", "symmetry none"].n) == (0.5, 2)
    assert (rows["yaw_right", "symmetry half turn"].value, rows["yaw_right", "symmetry half turn"].n) == (0, 1)
    assert rows["right", "all"].value == pytest.approx(1 / 3)
    assert rows["category_right", "all"].value == pytest.approx(2 / 3)
    assert rows["up_axis_right", "all"].value == pytest.approx(1 / 3)
    assert all(row.unit and row.frame for row in rows.values())
    found = reliability_of([FINE, TURNED, LOST, BOLD])
    assert found is not None
    assert found.n == 3
    assert found.auc == 1


def test_other_things_should_be_doubted() -> None:
    refused = replace(LOST, category="other", known=None)
    rows = {row.metric: row.value for row in summarise([OTHER, BOLD, replace(BOLD, warnings=1), refused], SCOPE)}
    assert rows["other_doubted"] == 0.5
    assert rows["other_warned"] == 0.5
    assert rows["other_unnoticed"] == 0.25
    assert rows["other_refused"] == 0.25
    assert "right" not in rows
    assert "other_doubted" not in {row.metric for row in summarise([replace(OTHER, confidence=None)], SCOPE)}


def test_every_target_is_reported_and_pooled(report: ScansReport) -> None:
    assert [(dataset, o.category) for dataset, o in report.outcomes] == [
        *[("generated", "chair")] * 2,
        *[("generated", "table")] * 2,
        *[("others", "other")] * 2,
    ]
    assert value(report, "right").n == value(report, "right", "generated").n == 4
    for metric in ("ucd_whole_unknown", "ucd_whole_known", "category_right"):
        parts = [value(report, metric, "generated", category) for category in ("chair", "table")]
        whole = value(report, metric)
        assert whole.n == sum(part.n for part in parts)
        assert whole.value == pytest.approx(sum(part.n * part.value for part in parts) / whole.n)
    assert value(report, "other_warned", "others", "other").n == 2
    assert sum(sum(counts.values()) for counts in report.confusion.values()) == 6
    assert set(report.confusion) == {"chair", "table", "other"}


def test_the_report_is_plain_json_with_units(report: ScansReport) -> None:
    content = json.loads(json.dumps(report.to_json(), allow_nan=False))
    assert set(content["header"]) >= {"model", "fingerprints", "seed", "limit", "split", "versions", "scans", "remarks"}
    assert len(content["targets"]) == 6
    for row in content["rows"]:
        assert row["unit"]
        assert row["frame"]
        assert row["dataset"]
    assert all(target["unknown"]["whole"] > 0 for target in content["targets"] if target["category"] != "other")


def test_the_same_arguments_give_the_same_rows(report: ScansReport, packs: dict[str, Path], model: Model) -> None:
    again = evaluate_scans([packs["chair"], packs["table"]], model, None, ScanConfig(limit=2, top_k=2))
    times = ("milliseconds", "other_milliseconds")
    mine = [s for s in report.summaries if s.dataset == "generated" and s.category != "all" and s.metric not in times]
    assert mine == [s for s in again.summaries if s.category != "all" and s.metric not in times]
    assert again.tiles == ()


def test_tiles_show_the_worst_first(report: ScansReport) -> None:
    # Two worst, one typical, one other thing.
    assert len(report.tiles) == 4
    assert report.tiles[3].lines[0].startswith("other ")
    assert [tile.verdict for tile in report.tiles[:3]] == sorted((t.verdict for t in report.tiles[:3]), reverse=True)


def test_failures_are_worse_than_wrong_and_wrong_than_right(target: ScanTarget) -> None:
    far = replace(FINE, model_id="far", unknown=replace(ERRORS, distance=0.09))
    wrong, bold = replace(TURNED, model_id="wrong"), replace(BOLD, model_id="bold")
    shown = [(replace(target, model_id=one.model_id), one) for one in (OTHER, FINE, far, wrong, LOST, bold)]
    tiles = worst_and_typical(shown, 3)
    assert [tile.lines[0] for tile in tiles] == ["chair c", "chair wrong", "chair far", "chair a", "other bold"]
    assert [tile.verdict for tile in tiles] == ["wrong", "wrong", "right", "right", "wrong"]
    assert tiles[0].lines[2] == "too small"


def test_targets_of_the_database_are_told(packs: dict[str, Path], model: Model) -> None:
    told: list[str] = []
    found = evaluate_scans(
        [packs["chair"]], model, None, ScanConfig(limit=1, top_k=1), split="source", report=told.append
    )
    assert found.header["remarks"] == told
    assert any("9 shapes of its split 'source' are in the database" in sentence for sentence in told)


def test_what_cannot_be_measured_is_said_before_the_work(
    packs: dict[str, Path], others: Path, model: Model, settings: FitSettings, tmp_path: Path
) -> None:
    with pytest.raises(PackError, match="split 'test'"):
        evaluate_scans([packs["chair"]], model, split="test")
    with pytest.raises(PackError, match=r"other\.npz: no pack with source shapes"):
        evaluate_scans([others], model)
    with pytest.raises(ModelError, match="table"):
        evaluate_scans([packs["table"]], Model("chairs", {"chair": model["chair"]}))
    no_source = MeshPack.load(packs["chair"])
    lone = tmp_path / "chair.npz"
    MeshPack.from_meshes(list(no_source), list(no_source.model_id), ["val"] * 12, "chair").save(lone)
    with pytest.raises(PackError, match="'source' to search; give a database"):
        evaluate_scans([lone], model)
    with Database.create(tmp_path / "empty.kpred") as empty, pytest.raises(DatabaseError, match="holds no chair"):
        evaluate_scans([lone], model, empty)


def test_distances_to_a_surface_hold_far_from_the_origin() -> None:
    box = trimesh.creation.box((2, 2, 2))
    box.vertices = box.vertices + [1e5, 0, 0]
    found = Surface(box).distances(np.array([[1e5 + 2.0, 0, 0], [1e5, 0.4, 0], [1e5, 1.0, 0]]))
    np.testing.assert_allclose(found, [1.0, 0.6, 0.0], atol=1e-9)
    with pytest.raises(MeshError, match="no face"):
        Surface(trimesh.Trimesh(np.eye(3), np.zeros((0, 3), int), process=False))


def test_moved_takes_a_mesh_into_the_unit_box() -> None:
    frame = Frame(np.array([1.0, 2.0, 3.0]), 0.5, yaw_rotation(1.0))
    box = trimesh.creation.box((1, 1, 1))
    there = trimesh.Trimesh(frame.from_unit(np.asarray(box.vertices)), box.faces, process=False)
    np.testing.assert_allclose(moved(there, frame).vertices, box.vertices, atol=1e-12)
