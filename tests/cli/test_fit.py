"""`kpred fit`: its options reach the fit, its doubts are told, and what makes no sense is refused by name."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any, get_args

import numpy as np
import pytest
import trimesh

from kpred.cli.main import FAILED, OK, USAGE, main
from kpred.errors import ScanError
from kpred.fitting import pipeline as fit_scan
from kpred.fitting.result import Fit
from kpred.preprocessing.config import CleanConfig
from kpred.refinement.config import Deform, RefineConfig
from kpred.refinement.structure_config import StructureConfig

Run = Callable[..., Any]


@pytest.fixture
def line(files: Path, tmp_path: Path) -> list[object]:
    using = ["--model", files / "model", "--database", files / "tables.kpred", "--no-picture", "--top-k", 2]
    return ["fit", files / "scan.ply", "-o", tmp_path / "a.obj", *using]


@pytest.fixture
def given(monkeypatch: pytest.MonkeyPatch) -> Callable[..., dict[str, Any]]:
    """Runs a command line up to its fit, and returns the options that the fit is called with."""

    def options(*words: object) -> dict[str, Any]:
        found: dict[str, Any] = {}

        def spy(scan: np.ndarray, **more: Any) -> Fit:
            found.update(more)
            raise ScanError("it is enough to know what was asked for.")

        with monkeypatch.context() as patch:
            patch.setattr(fit_scan, "fit", spy)
            assert main([*map(str, words)]) == FAILED
        return found

    return options


@pytest.mark.parametrize(
    ("words", "option", "value"),
    [
        ([], "up", "auto"),
        ([], "sensor", None),
        ([], "floor", None),
        ([], "pose", None),
        ([], "clean", True),
        (["--up", "-z"], "up", "-z"),
        (["--up", "y", "--pose", "identity"], "pose", "identity"),
        (["--up", "y", "--pose", "upright"], "pose", "upright"),
        (["--up", "y", "--floor", -2.5], "floor", -2.5),
        (["--no-clean"], "clean", False),
        (["--cleaning.wall", False, "--cleaning.points", 300], "clean", CleanConfig(wall=False, points=300)),
        ([], "deform", "auto"),
        *((["--deform", way], "deform", way) for way in get_args(Deform)),
        ([], "model_id", None),
        (["--model-id", "table_00003"], "model_id", "table_00003"),
        ([], "refinement", RefineConfig()),
        (
            ["--deform", "free", "--refinement.prior", 0.1, "--refinement.reflection", 0],
            "refinement",
            RefineConfig(prior=0.1, reflection=0.0),
        ),
        ([], "structure", StructureConfig()),
        (
            ["--deform", "structure", "--structure.contact", 0.5, "--structure.iterations", 3],
            "structure",
            StructureConfig(contact=0.5, iterations=3),
        ),
        (["--category", "table"], "category", "table"),
        (["--partial", "yes"], "partial", True),
        (["--partial", "no"], "partial", False),
    ],
)
def test_options_reach_the_fit(
    words: list[object], option: str, value: object, line: list[object], given: Callable[..., dict[str, Any]]
) -> None:
    assert given(*line, *words)[option] == value


@pytest.mark.parametrize("command", ["fit-many", "scene", "fit-depth"])
def test_every_command_that_fits_takes_them(command: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Up to the first file that is missing: the options themselves are understood."""
    inputs = {"fit-depth": ["--intrinsics", "nothing.txt"]}.get(command, [])
    line = [command, tmp_path / "nothing.ply", *inputs, "-o", tmp_path / "a.glb", "--deform", "none"]
    assert main([*map(str, line), "--model-id", "table_00003"]) == FAILED
    assert main([*map(str, line), "--deform", "lattice"]) == USAGE


def test_a_named_model_is_placed_undeformed(line: list[object], run_json: Run) -> None:
    found = run_json(*line, "--deform", "none", "--up", "y")
    other = next(one["model_id"] for one in found["candidates"] if one["model_id"] != found["model_id"])
    named = run_json(*line, "--deform", "none", "--up", "y", "--model-id", other)
    assert [one["model_id"] for one in named["candidates"]] == [other]
    assert named["step"] == "none"
    assert named["cleanliness"]["squareness"] == pytest.approx(0, abs=1e-3)
    matrix = np.array(named["model_to_scan"]["matrix"])[:3, :3]
    np.testing.assert_allclose(matrix.T @ matrix, matrix[0] @ matrix[0] * np.eye(3), rtol=1e-6, atol=1e-6)
    # The scan is in centimetres, the model in metres.
    assert named["model_to_scan"]["resized"] and not named["model_to_scan"]["own_size"]


def test_the_sensor_reaches_the_fit(line: list[object], given: Callable[..., dict[str, Any]]) -> None:
    np.testing.assert_array_equal(given(*line, "--sensor", 1000, -20.5, 3e2)["sensor"], [1000, -20.5, 300])


def test_cleaning_is_told_step_by_step_and_can_be_switched_off(line: list[object], run_json: Run) -> None:
    steps = {step["name"] for step in run_json(*line, "--up", "y")["cleaning"]}
    assert {"duplicates", "outliers", "floor", "wall", "density"} <= steps
    without = run_json(*line, "--up", "y", "--cleaning.wall", False, "--cleaning.outliers", False)
    assert {step["name"] for step in without["cleaning"]} == steps - {"wall", "outliers", "islands"}
    assert run_json(*line, "--up", "y", "--no-clean")["cleaning"] == []


def test_a_given_pose_turns_the_result(files: Path, tmp_path: Path, line: list[object], run_json: Run) -> None:
    def matrix(yaw: float) -> np.ndarray:
        return np.asarray(trimesh.transformations.rotation_matrix(yaw, [0, 1, 0]))

    for yaw in (0.3, -2.0):
        np.savetxt(tmp_path / "pose.txt", matrix(yaw))
        done = run_json(*line, "--up", "y", "--pose", f"given:{tmp_path / 'pose.txt'}")
        turn = np.array(done["unit_box_to_scan"])[:3, :3]
        np.testing.assert_allclose(turn / np.linalg.norm(turn, axis=0), matrix(yaw)[:3, :3], atol=1e-6)


def test_a_table_of_which_only_the_top_was_scanned_stands_on_the_floor(
    files: Path, tmp_path: Path, run_json: Run
) -> None:
    points = np.asarray(trimesh.load(files / "scan.ply").vertices)
    low, high = points[:, 1].min(), points[:, 1].max()
    np.save(tmp_path / "top.npy", points[points[:, 1] > low + 0.7 * (high - low)])
    options = ["--category", "table", "--up", "y", "--partial", "yes", "--no-picture"]
    run_json("fit", tmp_path / "top.npy", "-o", tmp_path / "a.obj", *options, "--floor", low)
    mesh = trimesh.load_mesh(tmp_path / "a.obj")
    assert mesh.bounds[0, 1] == pytest.approx(low, abs=0.02 * (high - low))
    assert mesh.bounds[1, 1] == pytest.approx(high, abs=0.15 * (high - low))


def test_a_known_frame_takes_the_scan_as_it_stands(
    files: Path, tmp_path: Path, line: list[object], run_json: Run
) -> None:
    points = np.asarray(trimesh.load(files / "scan.ply").vertices)
    low, high = points.min(axis=0), points.max(axis=0)
    np.save(tmp_path / "unit.npy", (points - (low + high) / 2) * 2 / (high - low).max())
    done = run_json(line[0], tmp_path / "unit.npy", *line[2:], "--frame", "known")
    assert done["frame_known"] is True
    np.testing.assert_array_equal(done["unit_box_to_scan"], np.eye(4))


def test_confidence_and_doubts_are_shown(
    line: list[object], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    really_fit = fit_scan.fit
    doubts = ("It may be a chair as well.", "Cleaning removed 60 % of the scan.")

    def doubtful(scan: np.ndarray, **more: Any) -> Fit:
        shares = {"table": 0.7, "chair": 0.3}
        return replace(really_fit(scan, **more), warnings=doubts, confidence=0.125, category_confidence=shares)

    monkeypatch.setattr(fit_scan, "fit", doubtful)
    assert main([*map(str, line)]) == OK
    printed = capsys.readouterr()
    assert printed.err.splitlines() == [f"kpred: note: {doubt}" for doubt in doubts]
    rows = [row.split() for row in printed.out.splitlines()]
    assert ["category", "confidence", "0.7", "probability"] in rows
    assert ["confidence", "0.125", "probability"] in rows
    assert len([row for row in rows if row]) < 24
    shown = [row[0] for row in rows if row]
    assert {"model", "change", "own", "surface", "right", "flat"} <= set(shown)
    assert main([*map(str, line), "--json"]) == OK
    printed = capsys.readouterr()
    assert [row for row in printed.err.splitlines() if row.startswith("kpred: note: ")] == [
        f"kpred: note: {doubt}" for doubt in doubts
    ]
    result = json.loads(printed.out)
    assert (result["confidence"], result["warnings"]) == (0.125, list(doubts))
    assert result["category_confidence"] == {"table": 0.7, "chair": 0.3}


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--frame", "known", "--pose", "identity"], "leave out --pose and --floor"),
        (["--frame", "known", "--floor", "0"], "leave out --pose and --floor"),
        (["--no-clean", "--cleaning.wall", "False"], "leave out --no-clean or the settings"),
        (["--refinement.prior", "0.1"], "those of --deform free"),
        (["--deform", "scale", "--structure.contact", "0.5"], "those of --deform auto and structure"),
        (["--deform", "lattice"], "lattice"),
        (["--floor", "nan"], "finite"),
        (["--sensor", "0", "inf", "0"], "finite"),
        (["--sensor", "1", "2"], "--sensor"),
        (["--up", "w"], "w"),
    ],
)
def test_options_that_make_no_sense(
    words: list[str], said: str, line: list[object], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main([*map(str, line), *words]) == USAGE
    assert said in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


SQUASHED = np.diag([1.0, 0.0, 1.0, 1.0])
SHEARED = np.eye(4) + 0.5 * np.eye(4, k=1)
MIRRORED = np.diag([1.0, 1.0, -1.0, 1.0])


@pytest.mark.parametrize(
    ("pose", "said"),
    [
        (SQUASHED, "squashes an axis"),
        (SHEARED, "sheared"),
        (MIRRORED, "mirrors"),
        (np.full((4, 4), np.nan), "finite numbers"),
        (np.eye(5), "shape (5, 5)"),
        (None, "No such file"),
    ],
    ids=["squashed", "sheared", "mirrored", "nan", "shape", "missing"],
)
def test_broken_poses_are_named(
    pose: np.ndarray | None, said: str, line: list[object], tmp_path: Path, refusal: Callable[..., str]
) -> None:
    file = tmp_path / "broken.npy"
    if pose is not None:
        np.save(file, pose)
    sentence = refusal(*line, "--pose", f"given:{file}")
    assert str(file) in sentence
    assert said in sentence
    assert not (tmp_path / "a.obj").exists()


def test_pose_estimators_that_are_not_there_are_named(line: list[object], refusal: Callable[..., str]) -> None:
    sentence = refusal(*line, "--pose", "upwright")
    assert "'upwright'" in sentence
    assert "identity, upright, given:FILE" in sentence


def test_impossible_settings_of_cleaning_are_named(line: list[object], refusal: Callable[..., str]) -> None:
    assert "wall_beyond must be positive" in refusal(*line, "--cleaning.wall-beyond", 0)


@pytest.mark.parametrize(
    ("setting", "value", "said"),
    [
        ("free-space", -1, "free_space must not be negative"),
        ("iterations", 0, "iterations must be at least 1"),
        ("finalists", 0, "finalists must be at least 1"),
    ],
)
def test_impossible_settings_of_refinement_are_named(
    setting: str, value: float, said: str, line: list[object], refusal: Callable[..., str]
) -> None:
    assert said in refusal(*line, "--deform", "free", f"--refinement.{setting}", value)


def test_without_a_name_the_result_lies_in_this_folder(
    files: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    refusal: Callable[..., str],
) -> None:
    monkeypatch.chdir(tmp_path)
    line = ["fit", files / "scan.ply", "--model", files / "model", "--database", files / "tables.kpred", "--no-picture"]
    assert main([*map(str, line), "--top-k", "1"]) == OK
    assert sorted(file.name for file in tmp_path.iterdir()) == ["scan_fitted.glb", "scan_fitted.json"]
    assert main([*map(str, line), "--top-k", "1"]) == OK  # Its own results are replaced, others are not.
    (tmp_path / "scan_fitted.json").write_text("{}")
    capsys.readouterr()
    assert "kpred did not make it" in refusal(*line)


def test_a_report_is_written_with_the_result_and_refused_before_the_work(
    line: list[object], tmp_path: Path, run_json: Run, refusal: Callable[..., str]
) -> None:
    assert "does not exist" in refusal(*line, "--report", tmp_path / "none" / "a.html")
    assert "reports are .html files" in refusal(*line, "--report", tmp_path / "a.txt")
    assert not list(tmp_path.iterdir())
    found = run_json(*line, "--report", tmp_path / "a.html")
    assert str(tmp_path / "a.html") in found["files"]
    assert found["model_id"] in (tmp_path / "a.html").read_text()
