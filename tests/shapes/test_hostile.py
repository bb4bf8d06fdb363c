"""Damaged and hostile files: one sentence of the package's own errors, at once and in little memory."""

import importlib.util
import json
import resource
import signal
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path
from types import FrameType, ModuleType
from typing import Any

import numpy as np
import pytest
from PIL import Image

from kpred.errors import KpredError, PackError, ScanError
from kpred.scenes.objects import objects_of
from kpred.scenes.scene import Scene, read_scene
from kpred.shapes.depth import DEPTH_EXTENSIONS, read_depth, read_mask
from kpred.shapes.formats.keyed_content import EXTENSIONS
from kpred.shapes.intrinsics_file import read_intrinsics_file
from kpred.shapes.manifest import read_manifest
from kpred.shapes.mesh_io import MESH_EXTENSIONS, read_mesh
from kpred.shapes.pack import MeshPack
from kpred.shapes.pose_file import read_pose
from kpred.shapes.scan import SCAN_EXTENSIONS, read_scan

SCENE = Scene(np.random.default_rng(0).normal(size=(1616, 3)))
READERS: dict[Callable[[Path], Any], tuple[str, ...]] = {
    read_scan: SCAN_EXTENSIONS,
    read_mesh: MESH_EXTENSIONS,
    read_scene: SCAN_EXTENSIONS,
    read_depth: DEPTH_EXTENSIONS,
    read_mask: DEPTH_EXTENSIONS,
    read_intrinsics_file: EXTENSIONS,
    read_pose: EXTENSIONS,
    MeshPack.load: (".npz",),
    lambda file: list(read_manifest(file)): (".parquet",),
    lambda file: objects_of(SCENE, file): (".npy", ".npz", ".txt", ".ply", ".json"),
}


@pytest.fixture
def at_once() -> Iterator[None]:
    """Fails a test that takes over 30 s of processor time or 10 minutes, by an exception that no reader catches."""

    class TooLong(BaseException):
        pass

    def stop(_number: int, _frame: FrameType | None) -> None:
        raise TooLong

    before = {number: signal.signal(number, stop) for number in (signal.SIGALRM, signal.SIGPROF)}
    signal.alarm(600)
    signal.setitimer(signal.ITIMER_PROF, 30)
    yield
    signal.alarm(0)
    signal.setitimer(signal.ITIMER_PROF, 0)
    for number, handler in before.items():
        signal.signal(number, handler)


def read_by_all(file: Path) -> None:
    """Read a file by every reader of its extension; each gives a result or an error of the package, in one line."""
    for read, extensions in READERS.items():
        if file.suffix.lower() in extensions:
            try:
                read(file)
            except KpredError as error:
                assert file.name[:100] in str(error) and "\n" not in str(error)


@pytest.mark.filterwarnings("ignore")
def test_collected_hostile_files(shared_data: Path, at_once: None) -> None:
    files = sorted(file for file in (shared_data / "hostile").iterdir() if file.suffix != ".md")
    assert len(files) > 50
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    for file in files:
        read_by_all(file)
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 1e6  # kilobytes


@pytest.fixture(scope="module")
def fuzzer() -> ModuleType:
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(Path(__file__).parents[2] / "scripts")
        return importlib.import_module("fuzz_readers")


def test_two_thousand_mutated_files(fuzzer: ModuleType, tmp_path: Path) -> None:
    findings = list(fuzzer.fuzz(2000, seed=0, folder=tmp_path / "cases", keep=tmp_path / "kept"))
    assert not findings


def test_the_fuzzer_finds_what_it_looks_for(
    fuzzer: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "a.bin").write_bytes(bytes(range(200)))

    def careless(file: Path) -> None:
        if file.read_bytes() != bytes(range(200)):
            raise KeyError("foreign")

    monkeypatch.setattr(fuzzer, "cases", lambda folder: [fuzzer.Case(tmp_path / "a.bin", careless)])
    findings = list(fuzzer.fuzz(20, seed=0, folder=tmp_path, keep=tmp_path / "kept"))
    assert len(findings) >= 15 and all("KeyError" in finding.what for finding in findings)
    again = list(fuzzer.fuzz(20, seed=0, folder=tmp_path))
    assert [finding.index for finding in again] == [finding.index for finding in findings]


# ---- small files that ask for much


def test_bombs_are_refused_before_they_expand(tmp_path: Path, at_once: None) -> None:
    with zipfile.ZipFile(tmp_path / "pack.npz", "w", zipfile.ZIP_DEFLATED, compresslevel=9) as archive:
        archive.writestr("vertices.npy", bytes(200_000_000))
    with pytest.raises(PackError, match=r"pack\.npz: its 0\.2 GB are more"):
        MeshPack.load(tmp_path / "pack.npz")
    Image.new("I;16", (9000, 9000)).save(tmp_path / "bomb.png")
    for read in (read_depth, read_mask):
        with pytest.raises(ScanError, match=r"bomb\.png: .*(too many|exceeds limit)"):
            read(tmp_path / "bomb.png")


def test_archives_that_would_grow_without_measure_are_refused(tmp_path: Path, at_once: None) -> None:
    for name, array in (("scan", np.zeros((3, 4_000_000))), ("objects", np.zeros(12_000_000))):
        np.savez_compressed(tmp_path / f"{name}.npz", array)
    np.savez_compressed(tmp_path / "depth.npz", np.zeros((4000, 3000)))
    readers: list[tuple[str, Callable[[Path], Any]]] = [
        ("scan", read_scan),
        ("objects", lambda file: objects_of(SCENE, file)),
        ("depth", read_depth),
    ]
    for name, read in readers:
        with pytest.raises(ScanError, match=rf"{name}\.npz: its arr_0\.npy would grow \d+ times"):
            read(tmp_path / f"{name}.npz")


@pytest.mark.parametrize("opening", ["[", '{"a":', '{"aligned_models":['])
def test_deep_json(tmp_path: Path, opening: str, at_once: None) -> None:
    for name in ("a.json", "a.gltf"):
        (tmp_path / name).write_text(opening * 100_000)
        read_by_all(tmp_path / name)


@pytest.mark.parametrize(("count", "words"), [(50_000, "too many vertices"), (1_000_000, "are too many")])
def test_instances_without_end(tmp_path: Path, count: int, words: str, at_once: None) -> None:
    """An instance takes 12 bytes, but their vertices would take gigabytes."""
    vertices = np.random.default_rng(0).normal(size=(1000, 3)).astype("<f4").tobytes()
    places = np.zeros((count, 3), "<f4").tobytes()
    (tmp_path / "a.bin").write_bytes(vertices + places)
    views = [(0, len(vertices)), (len(vertices), len(places))]
    extension = {"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": 1}}}
    content = {
        "asset": {"version": "2.0"},
        "buffers": [{"byteLength": 12_000 + 12 * count, "uri": "a.bin"}],
        "bufferViews": [{"buffer": 0, "byteOffset": start, "byteLength": length} for start, length in views],
        "accessors": [
            {"bufferView": view, "componentType": 5126, "type": "VEC3", "count": entries}
            for view, entries in ((0, 1000), (1, count))
        ],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
        "nodes": [{"mesh": 0, "extensions": extension}],
    }
    (tmp_path / "a.gltf").write_text(json.dumps(content))
    with pytest.raises(ScanError, match=words):
        read_scan(tmp_path / "a.gltf")
