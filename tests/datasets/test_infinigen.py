"""Furniture of Infinigen, with a stand-in for its environment: what is drawn, kept, listed and refused."""

import json
import sys
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from kpred.cli.main import OK, main
from kpred.datasets.infinigen import FACTORIES, generate_infinigen
from kpred.errors import ConfigError, MeshError
from kpred.shapes.pack import MeshPack

_STAND_IN = """#!{python}
# Called as the worker is: [worker.py, folder, max_faces, jobs...]. Makes a box as high as its seed says.
import os, sys
import numpy as np
folder, jobs = sys.argv[2], sys.argv[4:]
corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], np.float32)
faces = np.array([[0, 1, 2], [1, 3, 2], [4, 6, 5], [5, 6, 7]], np.int32)
with open(os.path.join(folder, "calls.txt"), "a") as calls:
    for job in jobs:
        factory, seed = job.split(":")
        calls.write(job + chr(10))
        if factory == "{broken}":
            print("failed", factory + "_" + seed, "RuntimeError: no legs")
            continue
        height = 0.5 + int(seed) % 100 / 100
        np.savez(os.path.join(folder, factory + "_" + seed + ".npz"), vertices=corners * [1, height, 1], faces=faces)
        print("done", factory + "_" + seed)
"""


def _python(folder: Path, broken: str = "none") -> Path:
    file = folder / f"python-{broken}"
    file.write_text(_STAND_IN.format(python=sys.executable, broken=broken))
    file.chmod(0o755)
    return file


def test_shapes_are_drawn_by_category_seed_and_number_alone(tmp_path: Path) -> None:
    python = _python(tmp_path)
    few = generate_infinigen("table", 8, tmp_path / "a", seed=1, python=python).pack
    more = generate_infinigen("table", 60, tmp_path / "b", seed=1, python=python, workers=3).pack
    assert more.model_id[:8].tolist() == few.model_id.tolist()
    assert more.split[:8].tolist() == few.split.tolist()
    assert set(more.split.tolist()) == {"source", "train", "val"}
    assert set(more.extra["factory"].tolist()) == set(FACTORIES["table"])
    assert more.model_id[0] == f"{more.extra['factory'][0]}_{more.extra['seed'][0]}"
    height = more[0].bounds[1, 1]
    assert height == pytest.approx(0.5 + int(more.extra["seed"][0]) % 100 / 100)
    other = generate_infinigen("table", 8, tmp_path / "c", seed=2, python=python).pack
    assert not set(other.model_id) & set(few.model_id)


def test_what_was_made_is_not_made_again_and_damage_is_mended(tmp_path: Path) -> None:
    python, folder = _python(tmp_path), tmp_path / "shapes"
    first = generate_infinigen("chair", 6, folder, python=python)
    assert (first.made, first.kept) == (6, 0)
    again = generate_infinigen("chair", 9, folder, python=python)
    assert (again.made, again.kept) == (3, 6)
    assert max(Counter((folder / "calls.txt").read_text().split()).values()) == 1
    file = next(folder.glob("*.npz"))
    file.write_bytes(b"cut")
    torn = generate_infinigen("chair", 9, folder, python=python)
    assert [str(file) in issue.why for issue in torn.failed] == [True]
    mended = generate_infinigen("chair", 9, folder, python=python)
    assert (mended.made, mended.kept) == (1, 8)
    assert np.array_equal(mended.pack.vertices, again.pack.vertices)


def test_failures_are_listed_and_do_not_stop_the_rest(tmp_path: Path) -> None:
    python = _python(tmp_path, "LargeShelfFactory")
    done = generate_infinigen("cabinet", 30, tmp_path / "shapes", python=python, workers=2)
    assert done.failed
    assert all("LargeShelfFactory" in issue.name and "no legs" in issue.why for issue in done.failed)
    assert len(done.pack) + len(done.failed) == 30
    nothing = _python(tmp_path, "nothing")
    nothing.write_text("#!/bin/sh\nexit 1\n")
    with pytest.raises(MeshError, match="made none of 3"):
        generate_infinigen("cabinet", 3, tmp_path / "none", python=nothing)


def test_refusals(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="no factories for 'piano'.*toilet"):
        generate_infinigen("piano", 3, tmp_path)
    with pytest.raises(ConfigError, match="at least 1"):
        generate_infinigen("chair", 0, tmp_path)
    with pytest.raises(ConfigError, match="has no infinigen"):
        generate_infinigen("chair", 2, tmp_path / "shapes", python=sys.executable)
    with pytest.raises(ConfigError, match="cannot be run"):
        generate_infinigen("chair", 2, tmp_path / "shapes", python=tmp_path / "no-python")


def test_the_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "chair.npz"
    line = ["data", "infinigen", "chair", "-n", "5", "-o", str(file), "--python", str(_python(tmp_path)), "--json"]
    assert main(line) == OK
    said = json.loads(capsys.readouterr().out)
    assert (said["shapes"], said["made"], said["failed"]) == (5, 5, [])
    assert len(MeshPack.load(file)) == 5


def test_there_are_twenty_five_categories_and_no_factory_is_in_two() -> None:
    assert len(FACTORIES) >= 25
    names = [name for factories in FACTORIES.values() for name in factories]
    assert len(set(names)) == len(names)
