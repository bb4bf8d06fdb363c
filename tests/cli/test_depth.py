"""`kpred fit-depth` on rendered depth pictures: files, place of the result, refusals."""

import json
import os
import shutil
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
import tyro
from PIL import Image

from kpred.cli.depth import FitDepthCommand
from kpred.cli.main import OK, main
from kpred.cli.output import Output
from kpred.cli.usage import UsageError
from kpred.errors import KpredError, ScanError
from kpred.fitting import pipeline as fit_scan
from kpred.nn import ModelConfig, save_network
from kpred.shapes.camera import Camera
from kpred.shapes.depth import write_depth
from kpred.shapes.render import render_faces
from kpred.synthetic.generator import generate
from kpred.training.run import new_network

PLACE = np.array([2.0, 0.5, -1.0])
"""Where the table stands in its room."""

SIZE = (320, 240)


@pytest.fixture(scope="session")
def room(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Untrained networks, a database of 4 tables, and two views of a table on a floor: depth, ids, pose, photograph."""
    folder = tmp_path_factory.mktemp("room")
    generate("table", 4, seed=1, splits=False).save(folder / "table.npz")
    config = ModelConfig(category="table", width=16, token_size=8, region_points=16, stages=1)
    save_network(new_network(config, seed=0), folder / "model")
    line = ["database", "build", folder / "table.npz", "--model", folder / "model", "-o", folder / "tables.kpred"]
    assert main([str(word) for word in line]) == OK
    table = generate("table", 6, seed=2)[5]
    there = table.vertices + PLACE
    floor = np.array([[-9, 0, -9], [9, 0, -9], [9, 0, 9], [-9, 0, 9]]) + [0, PLACE[1], 0]
    vertices = np.concatenate([there, floor])
    faces = np.concatenate([table.faces, np.array([[0, 1, 2], [0, 2, 3]]) + len(there)])
    matrix = np.array([[280.0, 0, SIZE[0] / 2], [0, 280, SIZE[1] / 2], [0, 0, 1]])
    np.savetxt(folder / "k.txt", matrix)
    np.savetxt(folder / "table.txt", np.stack([there.min(axis=0), there.max(axis=0)]))
    for view, eye in enumerate(([1.3, 1.3, 1.8], [-1.6, 1.1, 1.5])):
        forward = np.array([0, 0.35, 0]) - eye
        forward /= np.linalg.norm(forward)
        right = np.cross(forward, [0, 1, 0])
        right /= np.linalg.norm(right)
        pose = np.eye(4)
        pose[:3] = np.column_stack([right, np.cross(forward, right), forward, PLACE + eye])
        depth, face = render_faces(vertices, faces, Camera(matrix, *SIZE, pose))
        write_depth(folder / f"{view}.png", depth)
        ids = np.where(face < 0, 0, np.where(face < len(table.faces), 5, 2)).astype(np.uint8)
        Image.fromarray(ids).save(folder / f"ids{view}.png")
        np.savetxt(folder / f"pose{view}.txt", pose)
    Image.new("RGB", (640, 480), (180, 170, 150)).save(folder / "photo.jpg")
    return folder


@pytest.fixture
def line(room: Path) -> list[str]:
    words = [room / "0.png", "--intrinsics", room / "k.txt", "--model", room / "model"]
    return [*map(str, words), "--database", str(room / "tables.kpred"), "--no-picture"]


def run(words: Sequence[object]) -> None:
    tyro.cli(FitDepthCommand, args=[*map(str, words)], config=(tyro.conf.FlagCreatePairsOff,)).run(Output(True))


def refusal(words: Sequence[object], kind: type[Exception] = KpredError) -> str:
    with pytest.raises(kind) as caught:
        run(words)
    return str(caught.value)


def check_place(mesh_file: Path, low: np.ndarray, high: np.ndarray) -> None:
    mesh, size = trimesh.load_mesh(mesh_file), float(np.linalg.norm(high - low))
    assert np.linalg.norm(mesh.bounds.mean(axis=0) - (low + high) / 2) < size / 2
    assert 0.3 < float(np.linalg.norm(mesh.extents)) / size < 3


def test_two_views_give_a_mesh_in_the_world_and_an_overlay(
    room: Path, line: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words: list[Any] = [line[0], room / "1.png", *line[1:], "-o", tmp_path / "t.obj"]
    words += ["--pose", room / "pose0.txt", room / "pose1.txt", "--rgb", room / "photo.jpg"]
    words += ["--mask", room / "ids0.png", room / "ids1.png", "--mask-id", 5]
    run(words)
    printed = json.loads(capsys.readouterr().out)
    assert [Path(file).name for file in printed["files"]] == ["t.obj", "t.json", "t_overlay.png"]
    check_place(tmp_path / "t.obj", *np.loadtxt(room / "table.txt"))
    with Image.open(tmp_path / "t_overlay.png") as picture:
        drawn = np.asarray(picture).astype(int)
    assert drawn.shape == (480, 640, 3)
    blue = drawn[..., 2] > drawn[..., 0]
    with Image.open(room / "ids0.png") as ids:
        rows, columns = np.nonzero(np.asarray(ids) == 5)
    drawn_rows, drawn_columns = np.nonzero(blue)
    assert abs(drawn_rows.mean() / 2 - rows.mean()) < 40
    assert abs(drawn_columns.mean() / 2 - columns.mean()) < 40


def test_without_a_pose_the_result_is_in_the_cameras_axes(
    room: Path, line: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = [*line, "-o", tmp_path / "t.ply", "--mask", room / "ids0.png", "--mask-id", 5]
    run(words)
    assert json.loads(capsys.readouterr().out)["partial"] is True
    pose = np.loadtxt(room / "pose0.txt")
    low, high = np.loadtxt(room / "table.txt")
    corners = np.stack(np.meshgrid(*zip(low, high)), -1).reshape(-1, 3)
    local = Camera(np.loadtxt(room / "k.txt"), *SIZE, pose).to_camera(corners)
    check_place(tmp_path / "t.ply", local.min(axis=0), local.max(axis=0))


def test_the_camera_is_where_the_scan_was_seen_from(
    room: Path, line: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    given: list[np.ndarray] = []

    def spy(points: np.ndarray, *, sensor: np.ndarray, **options: Any) -> None:
        given.append(sensor)
        raise ScanError("it is enough to know what was asked for.")

    monkeypatch.setattr(fit_scan, "fit", spy)
    refusal([*line, "-o", tmp_path / "t.obj"])
    np.testing.assert_array_equal(given.pop(), np.zeros((1, 3)))  # the world is the camera's own frame
    poses = [room / "pose0.txt", room / "pose1.txt"]
    refusal([line[0], room / "1.png", *line[1:], "-o", tmp_path / "t.obj", "--pose", *poses])
    centres = [np.loadtxt(pose)[:3, 3] for pose in poses]
    np.testing.assert_allclose(given.pop(), centres, atol=1e-6)


@pytest.mark.parametrize("broken", ["t.obj", "t.json", "t_overlay.png"])
def test_all_files_are_written_or_none(
    broken: str, room: Path, line: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    replace = os.replace

    def stubborn(source: Path, target: Path) -> None:
        if Path(target).name == broken:
            raise OSError(28, os.strerror(28))
        replace(source, target)

    monkeypatch.setattr("kpred.atomic.os.replace", stubborn)
    before = json.dumps({"kpred": "the one before"})
    (tmp_path / "t.json").write_text(before)
    words = [*line, "-o", tmp_path / "t.obj", "--mask", room / "ids0.png", "--mask-id", 5]
    sentence = refusal([*words, "--rgb", room / "photo.jpg"])
    assert f"{tmp_path / broken}: No space left on device" in sentence
    assert {file.name: file.read_text() for file in tmp_path.iterdir()} == {"t.json": before}


ROTATION_OF_TWO = np.diag([2.0, 2.0, 2.0, 1.0])
NAN_POSE = np.where(np.eye(4) > 0, np.nan, 0.0)


@pytest.mark.parametrize(
    ("option", "content", "said"),
    [
        ("--pose", ROTATION_OF_TWO, "not a rotation"),
        ("--pose", np.diag([1.0, 1.0, -1.0, 1.0]), "not a rotation"),
        ("--pose", NAN_POSE, "tracking was lost"),
        ("--pose", np.eye(3), "3 x 3"),
        ("--pose", "not a matrix", "not numbers"),
        ("--pose", None, "no such file"),
        ("--intrinsics", np.diag([0.0, 280, 1]), "positive"),
        ("--intrinsics", np.full((3, 3), np.nan), "NaN"),
        ("--intrinsics", np.eye(2), "2 x 2"),
        ("--intrinsics", "focal length 280", "not numbers"),
        ("--intrinsics", None, "no such file"),
    ],
)
def test_broken_cameras_are_named_and_nothing_is_written(
    option: str, content: np.ndarray | str | None, said: str, line: list[str], tmp_path: Path
) -> None:
    file = tmp_path / "broken.txt"
    if isinstance(content, str):
        file.write_text(content)
    elif content is not None:
        np.savetxt(file, content)
    words: list[object] = [*line, "-o", tmp_path / "t.obj"]
    if option == "--pose":
        words += [option, file]
    else:
        words[words.index(option) + 1] = file
    sentence = refusal(words)
    assert str(file) in sentence
    assert said in sentence
    assert not (tmp_path / "t.obj").exists()


def test_intrinsics_of_another_picture_are_named(line: list[str], tmp_path: Path) -> None:
    numbers = {"fx": 280, "fy": 280, "cx": 160, "cy": 120, "width": 640, "height": 640}
    (tmp_path / "color.json").write_text(json.dumps(numbers))
    words: list[object] = [*line, "-o", tmp_path / "t.obj"]
    words[words.index("--intrinsics") + 1] = tmp_path / "color.json"
    sentence = refusal(words)
    assert "color.json is of a camera with 640 x 640" in sentence


def test_a_fragment_too_small_to_judge_is_counted(room: Path, line: list[str], tmp_path: Path) -> None:
    few = np.zeros((SIZE[1], SIZE[0]), dtype=bool)
    few[120, 150:160] = True
    np.save(tmp_path / "few.npy", few)
    sentence = refusal([*line, "-o", tmp_path / "t.obj", "--mask", tmp_path / "few.npy"])
    assert line[0] in sentence
    assert "at least 64 are needed" in sentence


def test_a_frame_whose_tracking_was_lost_is_named(room: Path, line: list[str], tmp_path: Path) -> None:
    np.savetxt(tmp_path / "lost.txt", np.full((4, 4), -np.inf))
    assert "lost.txt" in refusal([*line, "-o", tmp_path / "t.obj", "--pose", tmp_path / "lost.txt"])


def test_a_photograph_of_another_view_is_refused_before_the_fit(room: Path, line: list[str], tmp_path: Path) -> None:
    Image.new("RGB", (300, 300)).save(tmp_path / "square.png")
    assert "proportions" in refusal([*line, "-o", tmp_path / "t.obj", "--rgb", tmp_path / "square.png"])
    assert not (tmp_path / "t.obj").exists()


def test_inputs_are_never_overwritten(room: Path, line: list[str], tmp_path: Path) -> None:
    photograph = tmp_path / "t_overlay.png"
    Image.new("RGB", SIZE).save(photograph)
    assert "overwrite" in refusal([*line, "-o", tmp_path / "t.obj", "--rgb", photograph])
    (tmp_path / "k.json").write_text(json.dumps({"fx": 280, "fy": 280, "cx": 160, "cy": 120}))
    words = [*line, "-o", tmp_path / "k.obj"]
    words[words.index("--intrinsics") + 1] = str(tmp_path / "k.json")
    assert "overwrite" in refusal(words)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--pose", "a.txt", "b.txt"], "names 2 files for 1 depth picture"),
        (["--mask", "a.png", "b.png"], "--mask names 2 files"),
        (["--mask-id", "3"], "--mask-id needs --mask"),
    ],
)
def test_options_that_make_no_sense_together(words: list[str], said: str, line: list[str], tmp_path: Path) -> None:
    assert said in refusal([*line, "-o", tmp_path / "t.obj", *words], UsageError)


def test_several_pictures_need_poses(room: Path, line: list[str], tmp_path: Path) -> None:
    words = [line[0], str(room / "1.png"), *line[1:], "-o", str(tmp_path / "t.obj")]
    assert "--pose, one each" in refusal(words, UsageError)


def test_a_folder_of_pictures_with_their_poses(
    room: Path, line: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for view in range(2):
        for source, place in ((f"{view}.png", "depth"), (f"pose{view}.txt", "pose"), (f"ids{view}.png", "masks")):
            (tmp_path / place).mkdir(exist_ok=True)
            shutil.copy(room / source, tmp_path / place / f"{view}{Path(source).suffix}")
    (tmp_path / "intrinsic").mkdir()
    shutil.copy(room / "k.txt", tmp_path / "intrinsic/intrinsic_depth.txt")
    words = [tmp_path, *line[3:], "--up", "y", "--mask", tmp_path / "masks", "--mask-id", 5, "-o", tmp_path / "t.obj"]
    run(words)
    assert json.loads(capsys.readouterr().out)["files"]
    check_place(tmp_path / "t.obj", *np.loadtxt(room / "table.txt"))
    assert "leave --pose and --rgb out" in refusal([*words, "--pose", room / "pose0.txt"], UsageError)
    assert "--intrinsics is needed" in refusal([line[0], *line[3:], "-o", tmp_path / "u.obj"], UsageError)
