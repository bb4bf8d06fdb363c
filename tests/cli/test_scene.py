"""`kpred scene` on small files: what it writes and prints, and how it refuses."""

import json
import os
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

from kpred.cli import main as cli
from kpred.cli.main import FAILED, OK, main
from kpred.fitting import fit_scene as scene_module
from kpred.fitting.result import Fit
from kpred.nn import ModelConfig, save_network
from kpred.scenes.scan2cad import read_annotations
from kpred.synthetic.generator import generate
from kpred.training.run import new_network


@pytest.fixture(autouse=True)
def _registered(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(cli.COMMANDS, "scene", "Fit every object of a scanned scene.")


@pytest.fixture(scope="session")
def files(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Untrained networks and a database of tables, and a room with two tables."""
    folder = tmp_path_factory.mktemp("rooms")
    generate("table", 4, seed=1, splits=False).save(folder / "table.npz")
    config = ModelConfig(category="table", width=16, token_size=8, region_points=16, stages=1)
    save_network(new_network(config, seed=0), folder / "model")
    line = ["database", "build", folder / "table.npz", "--model", folder / "model", "-o", folder / "tables.kpred"]
    assert main([str(word) for word in line]) == OK
    parts = []
    for number in range(2):
        mesh = generate("table", 4, seed=1)[number]
        surface = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
        parts.append(
            trimesh.sample.sample_surface(surface, 500, seed=0)[0][:, [0, 2, 1]] * [1, -1, 1] + [4 * number, 0, 0]
        )
    trimesh.PointCloud(np.concatenate(parts)).export(folder / "room.ply")
    boxes = [
        {"name": "left", "category": "table", "center": [0, 0, 1], "size": [3.9, 9, 9], "yaw": 0.0},
        {"name": "right", "category": "desk", "center": [4, 0, 1], "size": [3.9, 9, 9]},
        {"name": "fern", "category": "plant", "center": [4, 0, 1], "size": [3.9, 9, 9]},
        {"name": "nothing", "category": "table", "center": [40, 0, 1], "size": [1, 1, 1]},
        {"name": "flat", "category": "table", "center": [40, 0, 1], "size": [1, 0, 1]},
    ]
    (folder / "boxes.json").write_text(json.dumps(boxes))
    return folder


def words(files: Path, out: Path, objects: str = "boxes.json", *more: str) -> list[str]:
    options = ["--objects", files / objects, "--model", files / "model", "--database", files / "tables.kpred"]
    return [*map(str, ["scene", files / "room.ply", "-o", out, *options, "--top-k", 2]), *more]


def test_a_scene_is_fitted_and_told(files: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "scene.glb"
    assert main(words(files, out, "boxes.json", "--no-picture", "--json")) == OK
    printed = capsys.readouterr()
    result = json.loads(printed.out)
    statuses = {entry["name"]: entry["status"] for entry in result["objects"]}
    assert statuses == {"left": "fitted", "right": "fitted", "fern": "skipped", "nothing": "failed", "flat": "failed"}
    assert "skipped: fern: plant is not among" in printed.err
    assert "failed: nothing: no point of the scan lies in its box" in printed.err
    written = {Path(file).name for file in result["files"]}
    assert written == {"scene.glb", "scene.json", "scene_scan2cad.json", "room.csv"}
    assert written == {file.name for file in tmp_path.iterdir()}
    loaded = trimesh.load_scene(out)
    assert {name.split()[0] for name in loaded.graph.nodes_geometry} == {"left", "right"}
    (annotation,) = read_annotations(tmp_path / "scene_scan2cad.json", "room")
    assert len(annotation.models) == len((tmp_path / "room.csv").read_text().splitlines()) == 2
    record = json.loads((tmp_path / "scene.json").read_text())
    assert record["objects"] == result["objects"]


def test_table_and_picture_for_people(files: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([*words(files, tmp_path / "scene.glb"), "--report", str(tmp_path / "room.html")]) == OK
    printed = capsys.readouterr()
    assert "scene room" in printed.out
    for word in ("left", "right", "fern", "mean distance", "skipped", "wrote"):
        assert word in printed.out
    assert (tmp_path / "scene.png").stat().st_size > 10_000
    assert "2 of 5 objects have a CAD model" in (tmp_path / "room.html").read_text()


def test_confidence_and_doubts_of_each_object_are_shown(
    files: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    really_fit = scene_module.fit

    def doubtful(points: np.ndarray, *arguments: Any, **options: Any) -> Fit:
        found = really_fit(points, *arguments, **options)
        return replace(found, confidence=0.25, warnings=("It may face another way.",))

    monkeypatch.setattr(scene_module, "fit", doubtful)
    assert main(words(files, tmp_path / "scene.glb", "boxes.json", "--no-picture")) == OK
    printed = capsys.readouterr()
    rows = {row.split()[0]: row for row in printed.out.splitlines() if row.strip()}
    for name in ("left", "right"):
        assert "0.25" in rows[name] and "see the notes" in rows[name]
        assert f"kpred: note: {name}: It may face another way." in printed.err
    assert "see the notes" not in rows["fern"]
    record = json.loads((tmp_path / "scene.json").read_text())
    doubts = {entry["name"]: (entry.get("confidence"), entry.get("warnings")) for entry in record["objects"]}
    assert doubts["left"] == (0.25, ["It may face another way."])
    assert doubts["fern"] == (None, None)


@pytest.mark.parametrize("switch", [[], ["--no-floor"]])
def test_the_floor_is_found_and_can_be_left_out(
    switch: list[str], files: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    scan = np.asarray(trimesh.load(files / "room.ply").vertices)
    rng = np.random.default_rng(0)
    floor = np.column_stack([rng.uniform(-3, 7, 4000), rng.uniform(-3, 3, 4000), rng.normal(-0.1, 0.01, 4000)])
    trimesh.PointCloud(np.concatenate([scan, floor])).export(tmp_path / "room.ply")
    np.save(tmp_path / "table.npy", np.repeat([7001, 7002, 0], [500, 500, 4000]))
    line = words(files, tmp_path / "scene.glb", str(tmp_path / "table.npy"), "--no-picture", "--json", *switch)
    line[1] = str(tmp_path / "room.ply")
    assert main(line) == OK
    result = json.loads(capsys.readouterr().out)
    floors = [entry["floor"] for entry in result["objects"]]
    if switch:
        assert result["floor"] is None
        assert floors == [None, None]
    else:
        assert result["floor"]["source"] == "points"
        assert floors == pytest.approx([-0.1, -0.1], abs=0.02)


@pytest.mark.parametrize("broken", ["scene.glb", "scene.json", "scene_scan2cad.json", "room.csv"])
def test_all_files_are_written_or_none(
    broken: str, files: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    move = os.replace

    def stubborn(source: Path, target: Path) -> None:
        if Path(target).name == broken:
            raise OSError(28, os.strerror(28))
        move(source, target)

    monkeypatch.setattr("kpred.atomic.os.replace", stubborn)
    assert main(words(files, tmp_path / "scene.glb", "boxes.json", "--no-picture")) == FAILED
    assert f"{tmp_path / broken}: No space left on device" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


def test_broken_annotations_cost_only_themselves(
    files: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    def placed(x: float, **changes: Any) -> dict[str, Any]:
        trs = {"translation": [x, 0, 1], "rotation": [1, 0, 0, 0], "scale": [1, 1, 1]}
        table = {"catid_cad": "04379243", "id_cad": "m", "trs": trs, "bbox": [1.9, 4, 4], "center": [0, 0, 0]}
        return table | changes

    def turned(**changes: Any) -> dict[str, Any]:
        return placed(0.0)["trs"] | changes

    without_size = {key: value for key, value in placed(0.0).items() if key != "bbox"}
    models = [
        placed(4.0),
        placed(0.0, trs=turned(scale=[1, 1, float("nan")])),
        placed(0.0, trs=turned(rotation=[0, 0, 0, 0])),
        placed(0.0, trs=turned(translation=[0, 0])),
        placed(0.0, trs=None),
        without_size,
        placed(90.0),
        placed(0.0, id_cad=""),
        "nonsense",
    ]
    identity = {"translation": [0, 0, 0], "rotation": [1, 0, 0, 0], "scale": [1, 1, 1]}
    annotation = [{"id_scan": "room", "trs": identity, "aligned_models": models}]
    (tmp_path / "full_annotations.json").write_text(json.dumps(annotation))
    line = words(files, tmp_path / "scene.glb", str(tmp_path / "full_annotations.json"), "--no-picture", "--json")
    assert main(line) == OK
    objects = json.loads(capsys.readouterr().out)["objects"]
    assert [entry["status"] for entry in objects] == ["fitted"] + ["failed"] * 8
    said = [
        *("its scale is not 3 finite numbers", "its rotation is a zero quaternion", "its translation is not 3"),
        *("it has no trs", "its CAD model 04379243/m is missing", "no point of the scan", "it names no CAD model"),
        "it names no CAD model",
    ]
    for entry, sentence in zip(objects[1:], said, strict=True):
        assert entry["name"] in entry["error"]
        assert sentence in entry["error"]


def test_a_fragment_is_told_by_name_and_the_rest_is_fitted(
    files: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    numbers = np.repeat([7001, 7002, 7003], [500, 40, 460])
    np.save(tmp_path / "numbers.npy", numbers)
    line = words(files, tmp_path / "scene.glb", str(tmp_path / "numbers.npy"), "--no-picture")
    assert main(line) == OK
    printed = capsys.readouterr()
    assert "failed: table_7002: " in printed.out
    assert "40 distinct points" in printed.out
    assert {"table_7001", "table_7003"} <= {
        name.split()[0] for name in trimesh.load_scene(tmp_path / "scene.glb").graph.nodes_geometry
    }


def test_help_has_examples(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["scene", "--help"]) == OK
    text = capsys.readouterr().out
    assert "usage: kpred scene" in text
    assert "kpred scene" in text.partition("examples:")[2]


@pytest.mark.parametrize(
    ("name", "content", "sentence"),
    [
        ("short.npy", np.ones(7, np.int64), "it labels 7 points, but the scene has 1000"),
        ("empty.json", "[]", "it has no objects"),
        ("cut.json", "[{", "not valid JSON"),
        ("plants.json", '[{"category": "plant", "min": [-9, -9, -9], "max": [9, 9, 9]}]', "none of its 1 objects"),
        ("none.json", None, "there is no such file of objects"),
    ],
)
def test_refusals(
    files: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    name: str,
    content: np.ndarray | str | None,
    sentence: str,
) -> None:
    if isinstance(content, str):
        (tmp_path / name).write_text(content)
    elif content is not None:
        np.save(tmp_path / name, content)
    assert main(words(files, tmp_path / "out.glb", str(tmp_path / name))) == FAILED
    errors = [line for line in capsys.readouterr().err.splitlines() if line.startswith("kpred: ")]
    assert len(errors) == 1
    assert sentence in errors[0]
    assert not (tmp_path / "out.glb").exists()


def test_outputs_are_checked_first(files: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(words(files, tmp_path / "scene.obj")) == FAILED
    assert "scenes are .glb," in capsys.readouterr().err
    assert main(words(files, tmp_path / "none" / "scene.glb")) == FAILED
    assert "does not exist" in capsys.readouterr().err
    before = (files / "boxes.json").read_bytes()
    assert main(words(files, files / "boxes.glb")) == FAILED
    assert "would overwrite" in capsys.readouterr().err
    assert (files / "boxes.json").read_bytes() == before
