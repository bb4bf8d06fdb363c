"""Data sets: layouts, what is missing, and preparations that lose nothing and read nothing twice."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from kpred.cli.main import FAILED, OK, main
from kpred.datasets import Dataset, open_dataset, prepare_dataset
from kpred.errors import ConfigError, PackError
from kpred.shapes.mesh import Mesh
from kpred.shapes.mesh_io import read_mesh, write_mesh
from kpred.shapes.pack import MeshPack
from kpred.synthetic.generator import generate

CHAIR, TABLE = "03001627", "04379243"


def _write(mesh: Mesh, file: Path) -> None:
    file.parent.mkdir(parents=True, exist_ok=True)
    write_mesh(file, mesh)


@pytest.fixture
def shapenet(tmp_path: Path) -> Path:
    """Six chairs and two tables in ShapeNet's layout, and a split; chair 5 is not in the split."""
    root = tmp_path / "ShapeNet"
    lines = ["id,synsetId,modelId,split"]
    for synset, category, count in ((CHAIR, "chair", 6), (TABLE, "table", 2)):
        for i, mesh in enumerate(generate(category, count, seed=1)):
            _write(mesh, root / synset / f"{category}{i}" / "models" / "model_normalized.obj")
            if (category, i) != ("chair", 5):
                # As spreadsheets write it.
                lines.append(f"{i},{synset.lstrip('0')},{category}{i},{('source', 'train', 'val', 'test')[i % 4]}")
    (tmp_path / "split.csv").write_text("\n".join(lines) + "\n")
    return root


def _shapenet(root: Path, category: str | None = None) -> Dataset:
    return open_dataset(root, split_file=root.parent / "split.csv", category=category)


def test_shapenet_by_its_split(shapenet: Path, tmp_path: Path) -> None:
    check = _shapenet(shapenet).check()
    assert check.complete
    assert check.found == {
        "chair": {"source": 2, "test": 1, "train": 1, "val": 1},
        "table": {"source": 1, "train": 1},
    }
    assert any("1 models" in remark and "not in the split" in remark for remark in check.remarks)
    done = prepare_dataset(_shapenet(shapenet), tmp_path / "packs", workers=1)
    pack = MeshPack.load(done.packs["chair"])
    assert dict(zip(pack.model_id, pack.split, strict=True)) == {
        "chair0": "source", "chair1": "train", "chair2": "val", "chair3": "test", "chair4": "source"
    }  # fmt: skip
    # ShapeNet faces -z, packs face +z.
    raw = read_mesh(shapenet / CHAIR / "chair0" / "models" / "model_normalized.obj")
    np.testing.assert_array_equal(pack[0].vertices, raw.vertices * np.float32([-1, 1, -1]))
    np.testing.assert_array_equal(pack[0].faces, raw.faces)


def test_missing_models_and_synsets_are_named_once_each(shapenet: Path) -> None:
    (shapenet / CHAIR / "chair2" / "models" / "model_normalized.obj").unlink()
    for file in sorted((shapenet / TABLE).rglob("*"), reverse=True):
        file.rmdir() if file.is_dir() else file.unlink()
    (shapenet / TABLE).rmdir()
    check = _shapenet(shapenet).check()
    assert [(issue.what, issue.name) for issue in check.issues] == [
        ("synset", f"{TABLE} (table)"),
        ("model", f"{CHAIR}/chair2"),
    ]
    assert "2 models of the split" in check.issues[0].why
    assert _shapenet(shapenet, "chair").check().found == {"chair": {"source": 2, "test": 1, "train": 1}}


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("synsetId,modelId\n3001627,chair0\n", "lacks the column split"),
        ("synsetId,modelId,split\n3001627,chair0,training\n", "line 2"),
        ("synsetId,modelId,split\n3001627,chair0\n", "line 2"),
        ("synsetId,modelId,split\n3001627,a,train\n3001627,a,val\n", "in two splits"),
        ("synsetId,modelId,split\n3001627,unknown,train\n", "no model of"),
    ],
)
def test_broken_splits_are_refused(shapenet: Path, text: str, sentence: str) -> None:
    (shapenet.parent / "split.csv").write_text(text)
    with pytest.raises(PackError, match=sentence):
        _shapenet(shapenet).shapes()


def test_corrupt_meshes_are_left_out_counted_and_listed(shapenet: Path, tmp_path: Path) -> None:
    broken = shapenet / CHAIR / "chair1" / "models" / "model_normalized.obj"
    broken.write_bytes(b"\x00\x01 not a mesh")
    (shapenet / CHAIR / "chair3" / "models" / "model_normalized.obj").write_text("v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n")
    done = prepare_dataset(_shapenet(shapenet), tmp_path / "packs", workers=1)
    assert [issue.name for issue in done.skipped] == ["chair1", "chair3"]
    assert str(broken) in done.skipped[0].why
    record = json.loads((tmp_path / "packs" / "prepared.json").read_text())
    assert [issue["name"] for issue in record["skipped"]] == ["chair1", "chair3"]
    assert MeshPack.load(done.packs["chair"]).model_id.tolist() == ["chair0", "chair2", "chair4"]


def _contents(folder: Path) -> dict[str, list[np.ndarray]]:
    packs = {file.name: MeshPack.load(file) for file in sorted(folder.glob("*.npz"))}
    return {
        name: [pack.vertices, pack.faces, pack.model_id, pack.split, pack.face_offsets] for name, pack in packs.items()
    }


def _same(first: Path, second: Path) -> bool:
    a, b = _contents(first), _contents(second)
    return a.keys() == b.keys() and all(
        np.array_equal(x, y) for name in a for x, y in zip(a[name], b[name], strict=True)
    )


def test_only_what_changed_is_read_again_and_workers_do_not_matter(shapenet: Path, tmp_path: Path) -> None:
    first = prepare_dataset(_shapenet(shapenet), tmp_path / "one", workers=1)
    assert (first.read, first.kept) == (7, 0)
    again = prepare_dataset(_shapenet(shapenet), tmp_path / "one", workers=1)
    assert (again.read, again.kept) == (0, 7)
    prepare_dataset(_shapenet(shapenet), tmp_path / "two", workers=2)
    assert _same(tmp_path / "one", tmp_path / "two")
    _write(generate("chair", 9, seed=8)[8], shapenet / CHAIR / "chair0" / "models" / "model_normalized.obj")
    # Touching a file does not change its content.
    os.utime(shapenet / CHAIR / "chair1" / "models" / "model_normalized.obj", (0, 0))
    changed = prepare_dataset(_shapenet(shapenet), tmp_path / "one", workers=1)
    assert (changed.read, changed.kept) == (1, 6)
    assert not _same(tmp_path / "one", tmp_path / "two")


_SLOW = """
import sys, time
from kpred.datasets import open_dataset, prepare_dataset
from kpred.datasets import dataset
read = dataset.ShapeFile.read
def slowly(self):
    time.sleep(0.3)
    return read(self)
dataset.ShapeFile.read = slowly
prepare_dataset(open_dataset(sys.argv[1], split_file=sys.argv[2]), sys.argv[3], workers=1)
"""


def test_killed_and_given_again_it_ends_as_if_never_killed(shapenet: Path, tmp_path: Path) -> None:
    words = [sys.executable, "-c", _SLOW, str(shapenet), str(tmp_path / "split.csv"), str(tmp_path / "cut")]
    process = subprocess.Popen(words)
    cache = tmp_path / "cut" / "cache"
    until = time.monotonic() + 60
    while len(list(cache.glob("[0-9a-f]*.npz"))) < 2 and time.monotonic() < until:
        time.sleep(0.02)
    process.send_signal(signal.SIGKILL)
    assert process.wait() == -signal.SIGKILL
    kept = len(list(cache.glob("[0-9a-f]*.npz")))
    assert 2 <= kept < 7
    assert not list((tmp_path / "cut").glob("*.npz"))
    done = prepare_dataset(_shapenet(shapenet), tmp_path / "cut", workers=1)
    assert (done.read, done.kept) == (7 - kept, kept)
    prepare_dataset(_shapenet(shapenet), tmp_path / "whole", workers=1)
    assert _same(tmp_path / "cut", tmp_path / "whole")


def test_a_damaged_cache_is_mended(shapenet: Path, tmp_path: Path) -> None:
    prepare_dataset(_shapenet(shapenet), tmp_path / "packs", workers=1)
    file = next((tmp_path / "packs" / "cache").glob("*.npz"))
    file.write_bytes(file.read_bytes()[:40])
    with pytest.raises(PackError, match="damaged and was removed"):
        prepare_dataset(_shapenet(shapenet), tmp_path / "packs", workers=1)
    assert prepare_dataset(_shapenet(shapenet), tmp_path / "packs", workers=1).read == 1


@pytest.fixture
def modelnet(tmp_path: Path) -> Path:
    root = tmp_path / "ModelNet40"
    turned = np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]], dtype=np.float32)  # y up -> z up
    for i, mesh in enumerate(generate("table", 30, seed=2)):
        name = "desk" if i % 3 == 0 else "table"
        split = "test" if i % 5 == 0 else "train"
        _write(Mesh(mesh.vertices @ turned.T, mesh.faces), root / name / split / f"{name}_{i:04}.off")
    return root


def test_modelnet(modelnet: Path, tmp_path: Path) -> None:
    dataset = open_dataset(modelnet)
    assert dataset.kind == "modelnet"
    shapes = {shape.model_id: shape for shape in dataset.shapes()}
    assert {shape.category for shape in shapes.values()} == {"table"}
    assert sum(shape.split == "test" for shape in shapes.values()) == 6
    assert 0 < sum(shape.split == "source" for shape in shapes.values()) < 12
    original = generate("table", 30, seed=2)[1]
    np.testing.assert_allclose(shapes["table_0001"].read().bounds, original.bounds, atol=1e-4)
    for file in (modelnet / "desk" / "test").iterdir():
        file.unlink()
    assert [issue.name for issue in dataset.check().issues] == ["desk/test"]


@pytest.fixture
def scan2cad(tmp_path: Path) -> Path:
    """Two scenes with a chair each, of which one model and one scan are missing."""
    root = tmp_path / "Scan2CAD"
    trs = {"translation": [0, 0, 0], "rotation": [1, 0, 0, 0], "scale": [1, 1, 1]}
    model = {"trs": trs, "catid_cad": CHAIR, "sym": "__SYM_NONE"}
    scenes = [
        {"id_scan": f"scene000{i}_00", "trs": trs, "aligned_models": [{**model, "id_cad": f"chair{i}"}]}
        for i in range(2)
    ]
    root.mkdir()
    (root / "full_annotations.json").write_text(json.dumps(scenes))
    chair = generate("chair", 1, seed=1)[0]
    _write(chair, root / "Assets" / "shapenet-sample" / CHAIR / "chair0" / "models" / "model_normalized.obj")
    _write(chair, tmp_path / "scans" / "scene0001_00" / "scene0001_00_vh_clean_2.ply")
    return root


def test_scan2cad(scan2cad: Path, tmp_path: Path) -> None:
    dataset = open_dataset(scan2cad, scannet=tmp_path / "scans")
    assert dataset.kind == "scan2cad"
    check = dataset.check()
    assert check.found == {
        "scenes": {"annotated": 2, "with scan": 1, "with labels": 0},
        "chair": {"source": 1},
    }
    assert {(issue.what, issue.name) for issue in check.issues} == {
        ("model", f"{CHAIR}/chair1"),
        ("scan", "scene0000_00"),
        ("labels", "scene0001_00"),
    }
    (scan2cad / "full_annotations.json").write_text("[{")
    with pytest.raises(PackError, match="not valid JSON"):
        dataset.check()


def test_packs_and_folders(tmp_path: Path) -> None:
    (tmp_path / "packs").mkdir()
    generate("table", 4, seed=1, splits=False).save(tmp_path / "packs" / "table.npz")
    flat = Mesh(np.float32([[0, 0, 0], [1, 0, 0], [2, 0, 0]]), np.int32([[0, 1, 2]]))
    MeshPack.from_meshes([flat, flat], ["a", "a"], ["val", "val"], "chair").save(tmp_path / "packs" / "chair.npz")
    (tmp_path / "packs" / "lamp.npz").write_bytes(b"nothing")
    check = open_dataset(tmp_path / "packs").check()
    assert check.kind == "packs"
    assert check.found == {"chair": {"val": 2}, "table": {"source": 4}}
    assert [(issue.what, issue.name) for issue in check.issues] == [
        ("shape", "a"), ("shape", "a"), ("shape", "a"), ("pack", "lamp.npz")
    ]  # fmt: skip
    assert any("no split source" in remark for remark in check.remarks)
    for i, mesh in enumerate(generate("table", 2, seed=1)):
        _write(mesh, tmp_path / "meshes" / "desks" / f"{i}.ply")
    folder = open_dataset(tmp_path / "meshes")
    assert folder.kind == "folder"
    assert folder.check().found == {"table": {"source": 2}}


def test_the_commands(shapenet: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    split = ["--split-file", str(tmp_path / "split.csv")]
    assert main(["data", "check", str(shapenet), *split, "--json"]) == OK
    assert json.loads(capsys.readouterr().out)["complete"] is True
    (shapenet / CHAIR / "chair2" / "models" / "model_normalized.obj").unlink()
    assert main(["data", "check", str(shapenet), *split, "--json"]) == FAILED
    printed = capsys.readouterr()
    assert json.loads(printed.out)["issues"][0]["name"] == f"{CHAIR}/chair2"
    assert "it is not complete (1 x model)" in printed.err
    line = ["data", "prepare", str(shapenet), *split, "--category", "chair", "--workers", "1"]
    assert main([*line, "-o", str(tmp_path / "packs"), "--json"]) == OK
    printed = capsys.readouterr()
    assert json.loads(printed.out)["read"] == 4
    assert "4 meshes read, 0 taken from the cache, 0 left out" in printed.err
    assert main(["data", "prepare", str(tmp_path / "packs"), "-o", str(tmp_path / "again")]) == FAILED
    assert "prepared already" in capsys.readouterr().err


def test_refusals(shapenet: Path, tmp_path: Path) -> None:
    with pytest.raises(PackError, match="no such file or folder"):
        open_dataset(tmp_path / "none")
    with pytest.raises(ConfigError, match="needs a split file"):
        open_dataset(shapenet, "shapenet")
    with pytest.raises(ConfigError, match="no kind of data set"):
        open_dataset(shapenet, "kitti")
    with pytest.raises(ConfigError, match="at least 1 worker"):
        prepare_dataset(_shapenet(shapenet), tmp_path / "packs", workers=0)
    with pytest.raises(PackError, match="cannot be read"):
        open_dataset(shapenet, split_file=tmp_path / "none.csv").check()
