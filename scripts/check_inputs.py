"""Run the cases of a folder of inputs and compare what comes out with the right values.

    python scripts/check_inputs.py INPUTS [HOSTILE] [--cases scripts/input_cases.toml] [--json] [--only WORD]

`INPUTS` holds one folder a case; the table of cases says which command runs there and what is right. Commands run in
this process, with their outputs in a temporary folder. `HOSTILE` holds damaged files: each is read by every reader of
its extension, and must be read or refused in one sentence of the package, in ten seconds of processor time and 1 GB
beyond its own size. Prints one line a case and the sums; exit code 1 if one is wrong.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import json
import os
import re
import resource
import shlex
import signal
import sys
import tempfile
import tomllib
import warnings
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from types import FrameType
from typing import Any

import numpy as np
import trimesh
from scipy.spatial import cKDTree

from kpred.cli.main import OK, main
from kpred.errors import KpredError
from kpred.scenes.objects import objects_of
from kpred.scenes.scene import Scene, read_scene
from kpred.shapes.depth import DEPTH_EXTENSIONS, read_depth, read_mask
from kpred.shapes.formats.keyed_content import EXTENSIONS
from kpred.shapes.intrinsics_file import read_intrinsics_file
from kpred.shapes.manifest import read_manifest
from kpred.shapes.mesh_io import MESH_EXTENSIONS, read_geometry, read_mesh
from kpred.shapes.pack import MeshPack
from kpred.shapes.pose_file import read_pose
from kpred.shapes.scan import SCAN_EXTENSIONS, read_scan

CASES = Path(__file__).with_name("input_cases.toml")
SAMPLES = 20_000
SECONDS, MEGABYTES = 10.0, 1000
"""Processor time and growth of memory that one damaged file may take."""


SCENE = Scene(np.random.default_rng(0).normal(size=(1616, 3)))
READERS: tuple[tuple[Any, tuple[str, ...]], ...] = (
    (read_scan, SCAN_EXTENSIONS),
    (read_mesh, MESH_EXTENSIONS),
    (read_scene, SCAN_EXTENSIONS),
    (read_depth, DEPTH_EXTENSIONS),
    (read_mask, DEPTH_EXTENSIONS),
    (read_intrinsics_file, EXTENSIONS),
    (read_pose, EXTENSIONS),
    (MeshPack.load, (".npz",)),
    (lambda file: list(read_manifest(file)), (".parquet",)),
    (lambda file: objects_of(SCENE, file), (".npy", ".npz", ".txt", ".ply", ".json")),
)


@dataclass(frozen=True)
class Verdict:
    """A case, whether its outcome is right, and what it was."""

    case: str
    right: bool
    outcome: str


class _Hang(BaseException):
    """Raised by the alarm; no reader catches it."""


def run_cases(inputs: Path, table: dict[str, Any], only: str) -> Iterator[Verdict]:
    """Run the commands of all cases whose folder is there."""
    truths = {
        name: _truth(inputs, entry) for name, entry in table["truth"].items() if (inputs / entry["file"]).exists()
    }
    for case in table["case"]:
        name = f"{case['folder']}: {case['command']}"
        if only in name and (inputs / case["folder"]).is_dir():
            with tempfile.TemporaryDirectory(prefix="kpred-inputs-") as folder:
                outcome, problems = _run(inputs / case["folder"], case, Path(folder), truths)
            yield Verdict(name, not problems, "; ".join([*problems, outcome]))


def _truth(inputs: Path, entry: dict[str, Any]) -> np.ndarray:
    """Sample points (SAMPLES, 3) on the surface of a mesh, or read a scan, turned to y up."""
    file = inputs / entry["file"]
    if entry.get("rows"):
        points = np.load(file)[: entry["rows"]]
    else:
        mesh = read_mesh(file)
        points = trimesh.sample.sample_surface(trimesh.Trimesh(mesh.vertices, mesh.faces), SAMPLES, seed=0)[0]
    return points @ _Z_UP if entry.get("up") == "z" else points


_Z_UP = np.array([[1.0, 0, 0], [0, 0, -1.0], [0, 1.0, 0]])
"""Rows (x, y, z) with z up times this have y up; its transpose leads back."""


def _run(folder: Path, case: dict[str, Any], out: Path, truths: dict[str, np.ndarray]) -> tuple[str, list[str]]:
    """Run one command; return what came out, and what is wrong with it."""
    words = shlex.split(case["command"].replace("OUT", str(out)))
    printed, errors, before = io.StringIO(), io.StringIO(), Path.cwd()
    os.chdir(folder)
    try:
        with contextlib.redirect_stdout(printed), contextlib.redirect_stderr(errors):
            code = main([*words, "--json"])
    finally:
        os.chdir(before)
    said = errors.getvalue() + printed.getvalue()
    problems = [f"not said: {word!r}" for word in case.get("said", []) if not re.search(word, said)]
    problems += [f"said: {word!r}" for word in case.get("unsaid", []) if re.search(word, said)]
    if (code == OK) != case.get("done", True):
        problems.append(f"exit code {code}")
    if code != OK:
        return f"refused: {errors.getvalue().strip().splitlines()[-1]}", problems
    record = json.loads(printed.getvalue())
    return _compare(case, record, out, truths, problems)


def _compare(
    case: dict[str, Any], record: Any, out: Path, truths: dict[str, np.ndarray], problems: list[str]
) -> tuple[str, list[str]]:
    """Compare a record and the mesh as it was written with the right values."""
    outcome = []
    for key in ("model_id", "category"):
        if key in case:
            outcome.append(str(record[key]))
            problems += [] if record[key] == case[key] else [f"{key} should be {case[key]}"]
    if "confidence" in case:
        low, high = case["confidence"]
        outcome.append(f"confidence {record['confidence']:.3f}")
        problems += [] if low <= record["confidence"] <= high else [f"confidence should be {low} to {high}"]
    if "truth" in case:
        written = next(file for file in out.glob("out.*") if file.suffix in MESH_EXTENSIONS)
        there, back = _distances(case, written, truths[case["truth"]])
        outcome.append(f"{there:.2f} and {back:.2f} % of the diagonal away")
        problems += [] if max(there, back) <= case["distance"] else [f"should be within {case['distance']} %"]
    return ", ".join(outcome) or "done", problems


def _distances(case: dict[str, Any], file: Path, truth: np.ndarray) -> tuple[float, float]:
    """Return the mean distances truth -> result and back, % of the truth's diagonal."""
    placed = truth @ _Z_UP.T if case.get("up") == "z" else truth
    placed = placed + np.array(case.get("at", [0.0, 0.0, 0.0]))
    centre = placed.mean(axis=0)
    found = read_geometry(file)
    mesh = trimesh.Trimesh(found.vertices - centre, found.faces, process=False)
    samples = trimesh.sample.sample_surface(mesh, SAMPLES, seed=1)[0]
    diagonal = float(np.linalg.norm(np.ptp(placed, axis=0)))
    there = cKDTree(samples).query(placed - centre)[0].mean()
    back = cKDTree(placed - centre).query(samples)[0].mean()
    return 100 * float(there) / diagonal, 100 * float(back) / diagonal


def read_hostile(folder: Path) -> Iterator[Verdict]:
    """Read every file of a folder by every reader of its extension."""

    def alarm(_number: int, _frame: FrameType | None) -> None:
        raise _Hang

    signal.signal(signal.SIGPROF, alarm)
    for file in sorted(file for file in folder.iterdir() if file.suffix != ".md"):
        wrong = [what for read, extensions in READERS if file.suffix in extensions for what in _problem(read, file)]
        yield Verdict(file.name, not wrong, "; ".join(wrong) or "read or refused")


def _problem(read: Any, file: Path) -> Iterator[str]:
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    signal.setitimer(signal.ITIMER_PROF, SECONDS)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            read(file)
    except KpredError as error:
        if "\n" in str(error):
            yield f"a sentence of several lines: {error}"
    except _Hang:
        yield f"longer than {SECONDS:g} s"
    except Exception as error:
        yield f"{type(error).__name__}: {error}"
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
    grown = (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) / 1024
    if grown > MEGABYTES + file.stat().st_size / 1e6:
        yield f"{grown:.0f} MB of memory"


def run() -> int:
    """Check, print, return 1 if a case is wrong."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("inputs", type=Path)
    parser.add_argument("hostile", type=Path, nargs="?")
    parser.add_argument("--cases", type=Path, default=CASES)
    parser.add_argument("--only", default="", help="run only cases whose name contains this")
    parser.add_argument("--json", action="store_true")
    given = parser.parse_args()
    verdicts = {"inputs": run_cases(given.inputs.resolve(), tomllib.loads(given.cases.read_text()), given.only)}
    if given.hostile is not None:
        verdicts["hostile"] = read_hostile(given.hostile)
    found: dict[str, list[Verdict]] = {}
    for kind, stream in verdicts.items():
        found[kind] = []
        for verdict in stream:
            found[kind].append(verdict)
            if not given.json:
                print(f"{'right' if verdict.right else 'WRONG'}  {verdict.case}\n       {verdict.outcome}", flush=True)
    sums = {kind: {"right": sum(v.right for v in rows), "of": len(rows)} for kind, rows in found.items()}
    if given.json:
        print(
            json.dumps({**sums, "cases": {kind: [asdict(v) for v in rows] for kind, rows in found.items()}}, indent=2)
        )
    else:
        print(", ".join(f"{kind}: {count['right']} of {count['of']} right" for kind, count in sums.items()))
    return 0 if all(count["right"] == count["of"] for count in sums.values()) else 1


if __name__ == "__main__":
    sys.exit(run())
