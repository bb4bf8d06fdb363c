"""Bad input and bad luck through the command line: one sentence, an exit code, and nothing lost or half-written."""

import io
import json
import os
import shutil
import signal
import sqlite3
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
import trimesh

from kpred.cli.main import FAILED, INTERRUPTED, OK, main
from kpred.database import Database
from kpred.database import sqlite as sqlite_backend
from kpred.errors import KpredError
from kpred.synthetic.generator import generate
from kpred.training.checkpoint import Checkpoint

Run = Callable[..., Any]
Refusal = Callable[..., str]

ONE_THREAD = {"OMP_NUM_THREADS": "1", "NUMBA_NUM_THREADS": "1", "HF_HUB_OFFLINE": "1"}
SMALL_TRAINING = ["--points=96", "--model.width=16", "--model.token-size=8", "--model.region-points=16"]
SMALL_TRAINING += ["--model.stages=1", "--deformation.batch=2", "--deformation.steps=3", "--threads=1"]


@pytest.fixture
def out(tmp_path: Path) -> Iterator[Path]:
    """A folder for output in which nothing may be left."""
    folder = tmp_path / "out"
    folder.mkdir()
    yield folder
    assert not list(folder.rglob("*"))


@pytest.fixture
def fit_line(files: Path, out: Path) -> Callable[..., list[object]]:
    def line(scan: Path, *more: object) -> list[object]:
        using = ["--model", files / "model", "--database", files / "tables.kpred", "--no-picture", "--json"]
        return ["fit", scan, "-o", out / "a.obj", *using, *more]

    return line


@pytest.fixture
def work(files: Path, tmp_path: Path) -> Path:
    """A copy of the files that a test may break."""
    return Path(shutil.copytree(files, tmp_path / "work"))


def cloud(count: int = 500) -> np.ndarray:
    return np.random.default_rng(0).random((count, 3))


def npy(points: np.ndarray) -> bytes:
    stream = io.BytesIO()
    np.save(stream, points)
    return stream.getvalue()


def ply(header: str, body: bytes = b"") -> bytes:
    return f"ply\nformat binary_little_endian 1.0\n{header}end_header\n".encode() + body


XYZ = "property float x\nproperty float y\nproperty float z\n"
KINDS = ("ply", "pcd", "xyz", "pts", "npy", "npz", "obj", "stl", "off", "glb", "gltf")
BAD_SCANS = {
    **{f"empty.{kind}": (b"", "the file is empty") for kind in KINDS},
    **{f"noise.{kind}": (bytes(range(256)) * 9, "") for kind in KINDS},
    "few.npy": (npy(cloud(63)), "63 distinct points; give a scan with at least 64 points"),
    "few.xyz": (b"0 0 0\n1 2 3\n", "2 distinct points"),
    "nan.npy": (npy(np.full((500, 3), np.nan)), "500 of 500 points are NaN or infinite"),
    "inf.npy": (npy(np.where(np.arange(500)[:, None] % 10, np.inf, cloud())), "NaN or infinite"),
    "same.npy": (npy(np.tile(cloud(1), (500, 1))), "1 distinct points"),
    "tens.npy": (npy(np.tile(cloud(10), (500, 1))), "10 distinct points"),
    "line.npy": (npy(np.linspace(0, 1, 500)[:, None] * [1, 2, 3]), "lie on one line"),
    "astronomic.npy": (npy(cloud() * 1e200), "too large to be a scan; check its unit"),
    "nothing.npy": (npy(cloud() * 1e-200), "too small to be a scan; check its unit"),
    "objects.npy": (npy(np.array([["a", "b", "c"]] * 99)), "not numbers"),
    "wide.npy": (npy(cloud()[:, :2].T), "shape is (2, 500)"),
    "cut.npy": (npy(cloud())[:5000], "cut short"),
    "promise.npy": (npy(cloud()).replace(b"(500, 3)", b"(9e9, 3)"), "not a readable numpy array"),
    "cut.ply": (ply(f"element vertex 500\n{XYZ}", bytes(12 * 400)), "cut short (400 of 500 points are there)"),
    "promise.ply": (ply(f"element vertex 999999999999\n{XYZ}", bytes(12)), "cut short"),
    "words.xyz": (b"1 2 3\n" * 99 + b"one two three\n", "line 100 does not hold x, y and z"),
    "pack.npz": (b"", "the file is empty"),
    "flat.obj": (b"v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n", "3 distinct points"),
    "lost.obj": (b"v 0 0 0\nv 1 0 0\nv 2 0 1\nf 1 2 9\n", "names a vertex that is not there"),
    "scan.step": (b"ISO-10303-21;", "unknown scan extension '.step'; convert it to .ply"),
    "scan": (b"1 2 3\n" * 99, "unknown scan extension ''"),
}


@pytest.mark.parametrize("name", BAD_SCANS)
def test_scans_that_cannot_be_fitted(name: str, tmp_path: Path, fit_line: Run, refusal: Refusal) -> None:
    content, words = BAD_SCANS[name]
    scan = tmp_path / name
    scan.write_bytes(content)
    sentence = refusal(*fit_line(scan))
    assert str(scan) in sentence
    assert words in sentence
    assert "; " in sentence  # what is wrong; the mend
    assert scan.read_bytes() == content


def test_scans_that_are_not_there(files: Path, tmp_path: Path, fit_line: Run, refusal: Refusal) -> None:
    assert "there is no such file; check the path" in refusal(*fit_line(tmp_path / "none.ply"))
    (tmp_path / "folder.ply").mkdir()
    assert "folder.ply: it is a folder; give one scan file" in refusal(*fit_line(tmp_path / "folder.ply"))
    assert "it is a pack of many meshes" in refusal(*fit_line(files / "table.npz"))
    search = ["database", "search", files / "tables.kpred", tmp_path / "none.ply", "--model", files / "model"]
    assert "none.ply" in refusal(*search)


@pytest.mark.parametrize("command", ["fit", "data", "database", "train"])
def test_debug_shows_where_an_error_came_from(
    command: str, files: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    none = str(tmp_path / "none.npz")
    line = {
        "fit": ["fit", none, "-o", str(tmp_path / "a.obj")],
        "data": ["data", "info", none],
        "database": ["database", "build", none, "--model", str(files / "model"), "-o", str(tmp_path / "a.kpred")],
        "train": ["train", "all", none, "-o", str(tmp_path / "run")],
    }[command]
    assert main([*line, "--json", "--debug"]) == FAILED
    printed = capsys.readouterr()
    assert "Traceback (most recent call last)" in printed.err
    assert "none.npz: there is no such file" in printed.err.splitlines()[-1]
    assert printed.out == ""
    assert not list(tmp_path.iterdir())


CLOUD_OF_TEN_MILLION = """
import contextlib, io, json, resource, sys, time
from kpred.cli.main import main

def fit(scan):
    began = time.process_time()
    with contextlib.redirect_stdout(io.StringIO()):
        assert main(["fit", scan, *sys.argv[3:]]) == 0
    return time.process_time() - began, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024

_, before = fit(sys.argv[1])
seconds, after = fit(sys.argv[2])
print(json.dumps({"seconds": seconds, "megabytes": after - before}))
"""


def test_ten_million_points_take_little_memory_and_time(files: Path, tmp_path: Path) -> None:
    scan, block = tmp_path / "huge.ply", (cloud(100_000) * [1, 0.7, 1]).astype("<f4").tobytes()
    with open(scan, "wb") as stream:
        stream.write(ply(f"element vertex 10000000\n{XYZ}"))
        for _ in range(100):
            stream.write(block)
    line = ["-o", tmp_path / "a.obj", "--model", files / "model", "--database", files / "tables.kpred", "--no-picture"]
    arguments = [str(word) for word in (files / "scan.ply", scan, *line)]
    done = program(["-c", CLOUD_OF_TEN_MILLION, *arguments])
    assert done.returncode == OK, done.stderr
    used = json.loads(done.stdout)
    assert used["seconds"] < 10
    assert used["megabytes"] < 100  # the file has 120, as float64 in memory it would be 240


def test_meshes_of_every_quality(files: Path, tmp_path: Path, run_json: Run, refusal: Refusal, out: Path) -> None:
    meshes = tmp_path / "meshes"
    meshes.mkdir()
    box = trimesh.creation.box((1, 0.8, 0.6))
    corners = "".join(f"v {x} {y} {z}\n" for x, y, z in box.vertices)
    good, bad = (
        {"quads.obj", "pentagon.off", "part_bad.obj"},
        {"flat.obj", "nan.obj", "cut.stl", "points.ply", "none.glb"},
    )
    (meshes / "quads.obj").write_text(corners + "f 1 2 4 3\nf 5 6 8 7\nf 1 2 6 5\n")
    (meshes / "pentagon.off").write_text("OFF\n5 1 0\n0 0 0\n2 0 0\n3 1 1\n1 2 2\n-1 1 1\n5 0 1 2 3 4\n")
    (meshes / "part_bad.obj").write_text(corners + "v nan 0 0\nf 1 1 1\nf 1 2 9\nf 1 2 4\nf 5 6 8\n")
    (meshes / "flat.obj").write_text("v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n")
    (meshes / "nan.obj").write_text("v nan 0 0\nv 1 0 0\nv 2 0 1\nf 1 2 3\n")
    (meshes / "cut.stl").write_bytes(box.export(file_type="stl")[:-60])
    (meshes / "points.ply").write_bytes(trimesh.PointCloud(cloud()).export(file_type="ply"))
    (meshes / "none.glb").write_bytes(b"")
    using = ["--category", "table", "--model", files / "model"]
    built = run_json("database", "build", meshes, *using, "-o", tmp_path / "a.kpred")
    assert (built["added"], len(built["left_out"])) == (len(good), len(bad))
    for name in bad:
        assert sum(name in sentence for sentence in built["left_out"]) == 1
    for name in good:
        (meshes / name).unlink()
    sentence = refusal("database", "build", meshes, *using, "-o", out / "b.kpred")
    assert str(meshes) in sentence
    assert any(name in sentence for name in bad)


def test_a_mesh_of_200_000_faces_is_added(files: Path, work: Path, tmp_path: Path, run_json: Run) -> None:
    meshes = tmp_path / "meshes"
    meshes.mkdir()
    side = 317  # 2 * 316 * 316 = 199712 triangles
    x, y = np.meshgrid(np.linspace(0, 1, side), np.linspace(0, 1, side))
    vertices = np.stack([x, 0.1 * np.sin(9 * x) * np.cos(7 * y), y], axis=2).reshape(-1, 3)
    corner = (np.arange(side - 1)[:, None] * side + np.arange(side - 1)).ravel()
    a, b, c, d = corner, corner + 1, corner + side, corner + side + 1
    faces = np.concatenate([np.stack([a, c, b], axis=1), np.stack([b, c, d], axis=1)])
    (meshes / "wave.ply").write_bytes(trimesh.Trimesh(vertices, faces, process=False).export(file_type="ply"))
    began = time.process_time()
    line = ["database", "add", work / "tables.kpred", meshes, "--category", "table", "--model", files / "model"]
    assert run_json(*line)["added"] == 1
    assert time.process_time() - began < 15
    with Database.open(work / "tables.kpred") as database:
        assert len(database.entry("wave").mesh.faces) == len(faces)


BROKEN = {
    "truncated database": ("tables.kpred", lambda data: data[: len(data) // 2], "damaged or cut short"),
    "empty database": ("tables.kpred", lambda data: b"", "is empty"),
    "foreign database": ("tables.kpred", lambda data: b"PK" + data, "is not a kpred database"),
    "database of a later kpred": ("tables.kpred", lambda data: data[:60] + b"\0\0\0\x63" + data[64:], "upgrade kpred"),
    "database of another program": ("tables.kpred", lambda data: data[:68] + b"abcd" + data[72:], "another program"),
    "truncated weights": ("model/model.safetensors", lambda data: data[: len(data) // 2], "is truncated"),
    "foreign weights": ("model/model.safetensors", lambda data: b"hello", "no safetensors file; copy it again"),
    "empty weights": ("model/model.safetensors", lambda data: b"", "is truncated or no safetensors file"),
    "missing weights": ("model/model.safetensors", None, "is missing; give a folder of trained weights"),
    "truncated config": ("model/config.json", lambda data: data[: len(data) // 2], "is not a kpred model config"),
    "foreign config": ("model/config.json", lambda data: b'{"architectures": ["Bert"]}', "config.json"),
    "config of a larger network": (
        "model/config.json",
        lambda data: data.replace(b'"width": 16', b'"width": 32'),
        "fit",
    ),
}


@pytest.mark.parametrize("name", BROKEN)
def test_broken_databases_and_weights(name: str, work: Path, out: Path, refusal: Refusal) -> None:
    file, change, words = BROKEN[name]
    path, database = work / file, work / "tables.kpred"
    content = path.read_bytes()
    path.unlink()
    if change is not None:
        path.write_bytes(change(content))
        assert path.read_bytes() != content
    before = database.read_bytes()
    model = ["--model", work / "model", "--json"]
    lines: list[list[object]] = [
        ["fit", work / "scan.ply", "-o", out / "a.obj", "--database", database, *model],
        ["database", "add", database, work / "table.npz", *model],
        ["evaluate", work / "table.npz", "--split", "source", "--database", database, "-o", out / "a.json", *model],
    ]
    if file == "tables.kpred":
        lines += [["database", "info", database, "--json"], ["database", "remove", database, "a", "--json"]]
        lines += [["info", "--database", database, "--json"]]
    else:
        lines += [["database", "build", work / "table.npz", "-o", out / "a.kpred", *model], ["info", *model]]
    for line in lines:
        sentence = refusal(*line)
        assert str(path if file == "tables.kpred" else work / "model") in sentence, line
        assert words in sentence
    assert database.read_bytes() == before
    assert {item.name for item in work.iterdir()} == {"model", "scan.ply", "table.npz", "tables.kpred"}


def test_a_file_in_the_place_of_a_model_folder(files: Path, fit_line: Run, refusal: Refusal) -> None:
    weights = files / "model" / "model.safetensors"
    assert f"{weights} is a file; give the folder" in refusal(*fit_line(files / "scan.ply", "--model", weights))


def test_an_empty_database_is_named(files: Path, tmp_path: Path, fit_line: Run, refusal: Refusal) -> None:
    path = tmp_path / "none.kpred"
    Database.create(path).close()
    assert f"{path} holds no models; add some" in refusal(*fit_line(files / "scan.ply", "--database", path))


def test_building_anew_overwrites_databases_alone(work: Path, run_json: Run, refusal: Refusal) -> None:
    line = ["database", "build", work / "table.npz", "--model", work / "model", "--no-resume", "-o"]
    for name in ("scan.ply", "table.npz"):
        before = (work / name).read_bytes()
        assert f"{name} is not a kpred database and would be lost" in refusal(*line, work / name)
        assert (work / name).read_bytes() == before
    database = work / "tables.kpred"
    database.write_bytes(database.read_bytes()[:5000])
    assert run_json(*line, database)["added"] == 8


@pytest.mark.parametrize("content", [b"", b"hello", b"\x80\x02}q\x00.", None], ids=["empty", "text", "pickle", "cut"])
def test_broken_checkpoints(content: bytes | None, files: Path, tmp_path: Path, refusal: Refusal) -> None:
    run = tmp_path / "run"
    run.mkdir()
    checkpoint = run / "deformation.checkpoint"
    if content is None:
        Checkpoint("deformation", 1, {}, {}, {"weight": torch.zeros(5000)}, {}, torch.zeros(1)).save(checkpoint)
        content = checkpoint.read_bytes()[:-2000]
    checkpoint.write_bytes(content)
    before = sorted(run.rglob("*"))
    for stage in ("deformation", "retrieval"):
        sentence = refusal("train", stage, files / "table.npz", "-o", run, *SMALL_TRAINING, "--json")
        assert f"{checkpoint} is truncated or no checkpoint; delete it" in sentence
    assert checkpoint.read_bytes() == content
    assert sorted(run.rglob("*")) == before


@pytest.mark.parametrize("kind", ["EXCLUSIVE", "IMMEDIATE"])
def test_a_database_locked_by_another_process(
    kind: str, work: Path, out: Path, refusal: Refusal, run_json: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    # The five seconds of patience are cut short; the lock and the other process are real.
    open_file = sqlite_backend.open_file
    monkeypatch.setattr(sqlite_backend, "open_file", lambda path, read_only, timeout: open_file(path, read_only, 0.05))
    database = work / "tables.kpred"
    before = database.read_bytes()
    hold = (
        "import sqlite3, sys; c = sqlite3.connect(sys.argv[1], isolation_level=None); c.execute('BEGIN ' + sys.argv[2])"
        "; print('held', flush=True); sys.stdin.read()"
    )
    command = [sys.executable, "-c", hold, str(database), kind]
    mesh = work / "more"
    mesh.mkdir()
    trimesh.creation.box().export(mesh / "box.obj")
    model = ["--model", work / "model", "--json"]
    reading: list[list[object]] = [
        ["database", "info", database, "--json"],
        ["fit", work / "scan.ply", "-o", out / "a.obj", "--database", database, "--no-picture", *model],
    ]
    writing: list[list[object]] = [
        ["database", "add", database, mesh, "--category", "table", *model],
        ["database", "remove", database, "frame_1_5", "--json"],
    ]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as other:
        assert other.stdout is not None
        assert other.stdout.readline() == "held\n"
        for line in writing + (reading if kind == "EXCLUSIVE" else []):
            sentence = refusal(*line)
            assert f"{database}: another process is writing to it; wait until that ends and try again" in sentence
        if kind == "IMMEDIATE":  # the other has not begun to write the file, so reading goes on
            assert run_json(*reading[0])["models"] == 8
        assert other.stdin is not None
        other.stdin.close()
    assert database.read_bytes() == before
    assert run_json(*writing[0])["added"] == 1


SESSION = """
import contextlib, io, json, os, resource, sys
from pathlib import Path
import torch
from kpred.cli.main import main
from kpred.ops import icosphere, mean_value_coordinates, nearest_neighbours

# Kernels are compiled, and cached on disk, before any limit holds.
cloud = torch.rand(1, 8, 3)
nearest_neighbours(cloud, cloud)
mean_value_coordinates(cloud, 3 * icosphere()[0][None], icosphere()[1])

def run(line, limit, folder):
    out, err = io.StringIO(), io.StringIO()
    resource.setrlimit(resource.RLIMIT_FSIZE, (limit, resource.RLIM_INFINITY))
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        code = main(line)
    resource.setrlimit(resource.RLIMIT_FSIZE, (resource.RLIM_INFINITY, resource.RLIM_INFINITY))
    left = sorted(str(p.relative_to(folder)) for p in Path(folder).rglob("*"))
    return {"code": code, "out": out.getvalue(), "err": err.getvalue(), "left": left}

steps, room = json.loads(sys.argv[1]), int(sys.argv[2])
if room:
    os.system(f"mount -t tmpfs -o size={room} none {sys.argv[3]}") == 0 or sys.exit(77)
answers = [run(line, limit if limit else resource.RLIM_INFINITY, sys.argv[3]) for line, limit in steps]
print(json.dumps(answers))
"""
"""Runs command lines one after the other, each with a limit to the size of files, in a folder of limited room."""


def program(words: list[str], prefix: tuple[str, ...] = ()) -> subprocess.CompletedProcess[str]:
    # A file that may not grow must not be a module's compiled code, which others would read later.
    environment = os.environ | ONE_THREAD | {"PYTHONDONTWRITEBYTECODE": "1"}
    command = [*prefix, sys.executable, *words]
    return subprocess.run(command, capture_output=True, text=True, timeout=3000, env=environment)


def session(
    steps: list[tuple[list[object], int]], folder: Path, room: int = 0, prefix: tuple[str, ...] = ()
) -> list[dict[str, Any]]:
    plain = json.dumps([([str(word) for word in line], limit) for line, limit in steps])
    done = program(["-c", SESSION, plain, str(room), str(folder)], prefix)
    if done.returncode == 77 or "unshare" in done.stderr or "setpriv" in done.stderr:
        pytest.skip(f"not permitted here: {done.stderr.strip()}")
    assert done.returncode == 0, done.stderr
    # Nothing but the answers on the real streams either: no traceback of a thread or of an object that is deleted.
    assert done.stderr == ""
    answers: list[dict[str, Any]] = json.loads(done.stdout)
    return answers


def one_sentence(answer: dict[str, Any]) -> str:
    assert answer["code"] == FAILED, answer
    assert answer["out"] == ""
    (sentence,) = without_notes(str(answer["err"])).splitlines()
    assert sentence.startswith("kpred: ")
    assert "unexpected" not in sentence
    return sentence + "\n"


def without_notes(errors: str) -> str:
    """What a command said on standard error, but for its notes."""
    return "".join(line for line in errors.splitlines(keepends=True) if not line.startswith("kpred: note: "))


def writing_lines(files: Path, folder: Path) -> dict[str, list[object]]:
    """A line for every kind of output; the value after -o is what its sentence must name."""
    model = ["--model", files / "model", "--json"]
    evaluate = ["evaluate", files / "table.npz", "--database", files / "tables.kpred"]
    fit = ["fit", files / "scan.ply", "--database", files / "tables.kpred", "--no-picture", "--partial", "no", *model]
    return {
        "mesh": [*fit, "-o", folder / "a.obj"],
        "pack": ["data", "generate", "chair", "-n", "24", "--json", "-o", folder / "a.npz"],
        "database": ["database", "build", files / "table.npz", *model, "-o", folder / "a.kpred"],
        "rows": [*evaluate, "--split", "source", "--limit", "1", *model, "-o", folder / "a.json"],
        "run": ["train", "deformation", files / "table.npz", *SMALL_TRAINING, "--json", "-o", folder / "run"],
    }


def test_files_that_may_not_grow(files: Path, tmp_path: Path) -> None:
    folder = tmp_path / "out"
    folder.mkdir()
    lines = writing_lines(files, folder)
    limits = {"mesh": 400, "pack": 4096, "database": 20_000, "rows": 400, "run": 20_000}
    for line in writing_lines(
        files, tmp_path
    ).values():  # once without limits: what they compile is cached in files, too
        assert main([str(word) for word in line]) == OK
    answers = session([(lines[kind], limits[kind]) for kind in lines], folder)
    for kind, answer in zip(lines, answers, strict=True):
        sentence = one_sentence(answer)
        assert str(Path(str(lines[kind][-1])).with_suffix("")) in sentence  # of a fit, the mesh or what lies beside it
        if kind != "run":
            assert answer["left"] == []
    assert not [name for name in answers[-1]["left"] if not name.startswith(("run", "run/log"))]
    assert not [name for name in answers[-1]["left"] if "checkpoint" in name or "model" in name]


def test_a_disk_that_is_full(files: Path, tmp_path: Path) -> None:
    if shutil.which("unshare") is None:
        pytest.skip("no unshare")
    folder = tmp_path / "disk"
    folder.mkdir()
    lines = writing_lines(files, folder)
    kinds = ["pack", "database", "run"]
    kept = folder / "b.kpred"
    build = ["database", "build", files / "table.npz", "--model", files / "model", "--json", "--batch", "1", "-o", kept]
    steps = [build, *(lines[kind] for kind in kinds), ["database", "info", kept, "--json"]]
    answers = session([(line, 0) for line in steps], folder, 250_000, ("unshare", "-rm"))
    # What was committed before the disk was full stays.
    assert f"{kept}: the disk is full; free some space and run the same again" in one_sentence(answers[0])
    assert answers[0]["left"] == ["b.kpred"]
    assert 0 < json.loads(answers[-1]["out"])["models"] < 8
    for kind, answer in zip(kinds, answers[1:-1], strict=True):
        sentence = one_sentence(answer)
        assert str(lines[kind][-1]) in sentence
        assert "No space left on device" in sentence or "the disk is full" in sentence
        assert not [name for name in answer["left"] if not name.startswith(("b.kpred", "run"))]
    assert not [name for name in answers[-1]["left"] if "checkpoint" in name or "model" in name]


def test_folders_that_may_not_be_written(files: Path, tmp_path: Path) -> None:
    folder = tmp_path / "out"
    folder.mkdir()
    shutil.copy(files / "tables.kpred", folder)
    lines = writing_lines(files, folder)
    lines["demo"] = ["demo", "--json", "-o", folder / "demo"]
    lines["remove"] = ["database", "remove", folder / "tables.kpred", "frame_1_5", "--json"]
    prefix: tuple[str, ...] = ()
    if os.geteuid() == 0:  # who may do everything must give that up first
        if shutil.which("setpriv") is None:
            pytest.skip("no setpriv")
        dropped = "-dac_override,-dac_read_search"
        prefix = ("setpriv", f"--bounding-set={dropped}", f"--inh-caps={dropped}")
    folder.chmod(0o555)
    try:
        answers = session([(line, 0) for line in lines.values()], folder, 0, prefix)
    finally:
        folder.chmod(0o755)
    for kind, answer in zip(lines, answers, strict=True):
        named = folder / "tables.kpred" if kind == "remove" else lines[kind][-1]
        assert str(named) in one_sentence(answer)
        assert answer["left"] == ["tables.kpred"]


def wait_for(happened: Callable[[], bool], child: subprocess.Popen[str]) -> None:
    until = time.monotonic() + 300
    while not happened():
        assert child.poll() is None, child.communicate()
        assert time.monotonic() < until
        time.sleep(0.005)


def started(line: list[object]) -> subprocess.Popen[str]:
    command = [sys.executable, "-m", "kpred", *map(str, line)]
    environment = os.environ | ONE_THREAD
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment)


def models_in(path: Path) -> int:
    if not path.exists():
        return 0
    try:
        with Database.open(path, read_only=True) as database:
            return len(database)
    except KpredError:  # the other process is writing just now
        return 0


@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGKILL])
def test_a_build_that_is_stopped_goes_on(how: signal.Signals, files: Path, tmp_path: Path, run_json: Run) -> None:
    pack, database = tmp_path / "table.npz", tmp_path / "out" / "a.kpred"
    generate("table", 16, seed=1, splits=False).save(pack)
    line = ["database", "build", pack, "--model", files / "model", "--batch", 1, "-o", database]
    with started([*line, "--json"]) as child:
        wait_for(lambda: models_in(database) > 0, child)
        child.send_signal(how)
        printed, errors = child.communicate(timeout=300)
    if how == signal.SIGINT:
        assert child.returncode == INTERRUPTED
        assert errors == f"kpred: stopped by Ctrl-C; {database} is whole, and the same command goes on with it\n"
        assert [item.name for item in database.parent.iterdir()] == ["a.kpred"]
    else:
        assert child.returncode == -signal.SIGKILL
    assert printed == ""
    done = models_in(database)
    assert 0 < done < 16
    with closing(sqlite3.connect(database)) as connection:
        assert connection.execute("PRAGMA integrity_check").fetchone() == ("ok",)
    again = run_json(*line)
    assert (again["present"], again["added"]) == (done, 16 - done)
    assert [item.name for item in database.parent.iterdir()] == ["a.kpred"]


def test_a_training_stopped_by_ctrl_c_goes_on(
    files: Path, tmp_path: Path, run_json: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    run, steps = tmp_path / "run", 30
    line = ["train", "deformation", files / "table.npz", "-o", run, *SMALL_TRAINING, "--checkpoint-every=1"]
    line += [f"--deformation.steps={steps}"]
    checkpoint = run / "deformation.checkpoint"
    with started([*line, "--json"]) as child:
        wait_for(checkpoint.exists, child)
        child.send_signal(signal.SIGINT)
        printed, errors = child.communicate(timeout=300)
    assert child.returncode == INTERRUPTED
    stopped = f"kpred: stopped by Ctrl-C; {run} keeps what was trained, and the same command goes on from it\n"
    assert without_notes(errors) == stopped
    assert printed == ""
    assert {item.name for item in run.iterdir()} <= {checkpoint.name, "log"}
    done = Checkpoint.load(checkpoint).step
    assert 0 < done < steps
    saved: list[int] = []
    save = Checkpoint.save
    monkeypatch.setattr(Checkpoint, "save", lambda self, path: (saved.append(self.step), save(self, path))[1])
    assert Path(run_json(*line)["model"]) == run / "model"
    assert saved == list(range(done + 1, steps + 1))


def test_a_second_ctrl_c_leaves_no_half_checkpoint(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(values: object, file: Any) -> None:
        file.write(b"half")
        raise KeyboardInterrupt

    path = tmp_path / "deformation.checkpoint"
    path.write_bytes(b"the one before")
    monkeypatch.setattr("kpred.training.checkpoint.torch.save", interrupted)
    with pytest.raises(KeyboardInterrupt):
        Checkpoint("deformation", 1, {}, {}, {}, {}, torch.zeros(1)).save(path)
    assert [item.name for item in tmp_path.iterdir()] == [path.name]
    assert path.read_bytes() == b"the one before"


@pytest.mark.parametrize("broken", ["record", "picture", "mesh"])
def test_the_files_of_a_fit_come_together_or_not_at_all(
    broken: str, files: Path, out: Path, refusal: Refusal, monkeypatch: pytest.MonkeyPatch
) -> None:
    def draw(fit: object, scan: object, path: Path) -> bool:
        Path(path).write_bytes(b"picture")
        return True

    def fail(*arguments: object, **options: object) -> None:
        raise OSError(28, os.strerror(28))

    monkeypatch.setattr("kpred.reports.fit_files.save_picture", draw)
    place = {
        "record": "pathlib.Path.write_text",
        "picture": "shutil.copyfile",
        "mesh": "kpred.atomic.os.replace",
    }
    monkeypatch.setattr(place[broken], fail)
    using = ["--model", files / "model", "--database", files / "tables.kpred", "--deform", "paper", "--json"]
    sentence = refusal("fit", files / "scan.ply", "-o", out / "a.ply", *using)
    assert {"record": "a.json", "picture": "a.png", "mesh": "a.ply"}[broken] in sentence
