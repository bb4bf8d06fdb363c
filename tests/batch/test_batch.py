"""Batches: every scan once, whatever is killed; bad scans and rows are listed; another batch is refused."""

import json
import os
import signal
import subprocess
import sys
import time
from dataclasses import replace
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest

from kpred.batch import BatchSettings, fit_many
from kpred.batch.journal import Journal
from kpred.batch.run import BatchRun
from kpred.batch.task import Task, read_tasks
from kpred.batch.worker import Outcome
from kpred.batch.worker_pool import ProcessWorkerPool
from kpred.errors import ConfigError, ManifestError
from kpred.nn import ModelConfig, save_network
from kpred.synthetic.generator import generate
from kpred.training.run import new_network


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    """A folder with a small model, its database, and eight scans, two of which are none."""
    from kpred.cli.main import OK, main

    folder = tmp_path_factory.mktemp("batch")
    generate("table", 4, seed=1, splits=False).save(folder / "table.npz")
    config = ModelConfig(category="table", width=16, token_size=8, region_points=16, stages=1)
    save_network(new_network(config, seed=0), folder / "model")
    line = ["database", "build", folder / "table.npz", "--model", folder / "model", "-o", folder / "tables.kpred"]
    assert main([str(word) for word in line]) == OK
    (folder / "scans" / "deep").mkdir(parents=True)
    rng = np.random.default_rng(0)
    for i in range(6):
        cloud = rng.uniform(-1, 1, (300, 3)) * (1, 0.5, 0.7)
        np.save(folder / "scans" / ("deep/" if i % 2 else "") / f"scan {i}.npy", cloud)
    (folder / "scans" / "few.xyz").write_text("0 0 0\n1 1 1\n")
    (folder / "scans" / "damaged.ply").write_bytes(b"ply\nnonsense")
    (folder / "scans" / "notes.md").write_text("not a scan")
    return folder


@pytest.fixture
def settings(place):
    return BatchSettings(str(place / "model"), str(place / "tables.kpred"), frame="known", deform="paper", clean=False)


def rows(out):
    return [json.loads(line) for line in (out / "results.jsonl").read_text().splitlines()]


def records(out):
    return [file for file in out.rglob("[!.]*.json") if file.name != "job.json"]


def contents(out):
    """Name -> what was found, of every record, without what may differ between two runs."""
    found = {}
    for file in records(out):
        record = json.loads(file.read_text())
        record.pop("timings_seconds")
        found[record["batch"]["name"]] = record
        assert (out / record["batch"]["mesh"]).stat().st_size > 0
    return found


@pytest.fixture(scope="module")
def whole(place, tmp_path_factory):
    """The result of a batch that nobody disturbed."""
    out = tmp_path_factory.mktemp("whole") / "out"
    files = str(place / "model"), str(place / "tables.kpred")
    report = fit_many(
        place / "scans", out, BatchSettings(*files, frame="known", deform="paper", clean=False), workers=1
    )
    return out, report


def test_a_folder_is_fitted_once_and_bad_scans_are_listed(place, settings, whole):
    out, report = whole
    assert (report.fitted, report.present, report.retried) == (6, 0, 0)
    assert sorted(name for name, _ in report.failed) == ["damaged.ply", "few.xyz"]
    failures = [json.loads(line) for line in (out / "failures.jsonl").read_text().splitlines()]
    assert [failure["name"] for failure in failures] == [name for name, _ in report.failed]
    assert sorted(row["name"] for row in rows(out)) == sorted(contents(out))
    assert {file.relative_to(out).as_posix() for file in records(out)} == {
        f"{'deep/' if i % 2 else ''}scan {i}.json" for i in range(6)
    }
    before = {file: file.stat().st_mtime_ns for file in [*records(out), *out.rglob("*.ply")]}
    second = fit_many(place / "scans", out, settings, workers=1)
    assert (second.fitted, second.present, len(second.failed)) == (0, 6, 2)
    assert {file: file.stat().st_mtime_ns for file in before} == before
    assert len(rows(out)) == 6


def test_another_batch_is_refused_and_so_is_a_second_run(place, settings, whole, tmp_path):
    out, _ = whole
    with pytest.raises(ManifestError, match="top_k was 10"):
        fit_many(place / "scans", out, BatchSettings(**{**settings.to_dict(), "top_k": 3}), workers=1)
    job = {"source": "x"}
    with Journal(tmp_path / "out", job), pytest.raises(ManifestError, match="another run"):
        Journal(tmp_path / "out", job)
    with Journal(tmp_path / "out", job):
        pass
    (tmp_path / "empty").mkdir()
    with pytest.raises(ManifestError, match="no scans"):
        fit_many(tmp_path / "empty", tmp_path / "other", settings)
    with pytest.raises(ConfigError, match="at least 1"):
        fit_many(place / "scans", tmp_path / "other", settings, workers=0)
    assert not (tmp_path / "other").exists()


RUN = """
import sys
from kpred.batch import BatchSettings, fit_many
if __name__ == "__main__":
    place, out = sys.argv[1:]
    settings = BatchSettings(place + "/model", place + "/tables.kpred", frame="known", deform="paper", clean=False)
    fit_many(place + "/scans", out, settings, workers=1)
"""


def test_killed_and_resumed_it_ends_as_if_nothing_had_happened(place, settings, whole, tmp_path):
    out, script = tmp_path / "out", tmp_path / "run.py"
    script.write_text(RUN)
    process = subprocess.Popen([sys.executable, script, place, out], start_new_session=True)
    try:
        deadline = time.monotonic() + 120
        while len(records(out)) < 2 and time.monotonic() < deadline:
            time.sleep(0.01)
    finally:
        os.killpg(process.pid, signal.SIGKILL)  # the run and its workers
        process.wait()
    done = len(records(out))
    assert done >= 2
    # What a kill may leave: a file half written, a line half written, a record that no line tells of.
    some = records(out)[0]
    (some.parent / f".{some.stem}.1.0123abcd.json").write_text("half")
    lines = (out / "results.jsonl").read_text().splitlines(keepends=True)
    (out / "results.jsonl").write_text("".join(lines[:-1]) + '{"name": "hal')
    report = fit_many(place / "scans", out, settings, workers=1)
    assert report.present == done
    assert report.fitted == 6 - done
    assert contents(out).keys() == contents(whole[0]).keys()
    for name, record in contents(out).items():
        assert record["candidates"] == contents(whole[0])[name]["candidates"]
    assert sorted(row["name"] for row in rows(out)) == sorted(contents(out))
    assert [file.name for file in out.rglob(".*")] == [".lock"]


def test_a_parquet_manifest_with_broken_rows(place, settings, tmp_path):
    pyarrow = pytest.importorskip("pyarrow")
    from pyarrow import parquet

    good = str(place / "scans" / "scan 0.npy")
    table = pyarrow.table(
        {
            "path": [good, None, "", "missing.npy", good, str(place / "scans" / "deep" / "scan 1.npy"), "a\0b", good],
            "id": ["a", "b", "c", "d", "a", None, "f", "g"],
            "category": ["table", None, None, None, None, "table", None, "sofa"],
            "more": list(range(8)),
        }
    )
    manifest = tmp_path / "scans.parquet"
    parquet.write_table(table, manifest)
    report = fit_many(manifest, tmp_path / "out", settings, workers=1)
    failed = dict(report.failed)
    assert report.fitted == 2
    assert sorted(failed) == ["a (row 4)", "b", "c", "d", "f", "g"]
    assert "row 1" in failed["b"]
    assert "row 2" in failed["c"]
    assert "missing.npy" in failed["d"]
    assert "sofa" in failed["g"]
    assert sorted(row["name"] for row in rows(tmp_path / "out")) == sorted(
        ["a", str(place / "scans" / "deep" / "scan 1.npy")]
    )
    manifest.write_bytes(manifest.read_bytes()[:-20])
    with pytest.raises(ManifestError, match=r"scans\.parquet.*no whole Parquet"):
        fit_many(manifest, tmp_path / "other", settings)
    parquet.write_table(pyarrow.table({"file": ["x"]}), manifest)
    with pytest.raises(ManifestError, match="no column 'path'"):
        fit_many(manifest, tmp_path / "other", settings)
    with pytest.raises(ManifestError, match="no such file"):
        list(read_tasks(tmp_path / "none.parquet"))


class Unreliable:
    """A pool without processes, of which tasks named `killer` kill a worker, and all that is at hand dies with it."""

    size = 2

    def __init__(self, accidents):
        self.accidents, self.at_hand, self.max_at_hand = accidents, [], 0

    def start(self, group):
        self.at_hand.append(group)
        self.max_at_hand = max(self.max_at_hand, len(self.at_hand))

    def finished(self):
        if any(task.name == "killer" for group in self.at_hand for task in group):
            dead, self.at_hand = self.at_hand, []
            return [(group, None) for group in dead]
        group = self.at_hand.pop(0)
        return [(group, [self._outcome(task.name) for task in group])]

    def _outcome(self, name):
        if self.accidents.get(name, 0):
            self.accidents[name] -= 1
            return Outcome(name, None, "the disk was full", retry=True)
        return Outcome(name, {"name": name})

    def close(self):
        pass


@pytest.mark.parametrize("group_size", [1, 2, 3])
def test_accidents_are_tried_again_and_a_killer_takes_nobody_with_it(tmp_path, group_size):
    names = ["a", "b", "killer", "c", "d", "e", "f"]
    pool = Unreliable({"b": 1, "e": 9})
    read = []

    def tasks():
        for name in names:
            read.append(name)
            assert len(read) <= len(set(read) - set(pool_names(pool))) + 4 * group_size  # never far ahead of the work
            yield Task(name, name)

    with Journal(tmp_path, {}) as journal:
        report = BatchRun(pool, journal, attempts=3, progress=None, group_size=group_size).run(tasks())
    assert dict(report.failed) == {"killer": "the process that fitted it died", "e": "the disk was full"}
    assert report.fitted == 5
    assert pool.max_at_hand <= 4
    assert sorted(row["name"] for row in rows(tmp_path)) == ["a", "b", "c", "d", "f"]


def pool_names(pool):
    return [task.name for group in pool.at_hand for task in group]


def test_a_worker_that_dies_is_replaced(place, settings, tmp_path, monkeypatch):
    # The workers are real processes and really die; what they run is in a module that they can import.
    folder = str(Path(__file__).parent)
    monkeypatch.syspath_prepend(folder)
    monkeypatch.setenv("PYTHONPATH", folder)
    monkeypatch.setattr("kpred.batch.worker_pool.fit_tasks", import_module("killing_worker").killing_fit)
    out = tmp_path / "out"
    with Journal(out, {}) as journal:
        pool = ProcessWorkerPool(1, settings, str(out))
        try:
            report = BatchRun(pool, journal, attempts=2, progress=None, group_size=3).run(read_tasks(place / "scans"))
        finally:
            pool.close()
    assert report.fitted == 6
    assert dict(report.failed)["few.xyz"] == "the process that fitted it died"
    assert len(rows(out)) == 6


def test_shares_of_a_gpu_need_a_cluster(place, settings, tmp_path):
    with pytest.raises(ConfigError, match="--ray local"):
        fit_many(place / "scans", tmp_path / "out", settings, gpus=0.25)
    assert not (tmp_path / "out").exists()


def test_networks_on_a_device_find_the_same(place, settings, whole, tmp_path):
    from kpred.batch.worker import fit_task

    task = next(task for task in read_tasks(place / "scans") if task.name == "scan 0.npy")
    task = replace(task, place="scan 0")
    # Another name of the CPU goes the way of every device: what goes into a network moves there, and back.
    outcome = fit_task(task, settings, str(tmp_path), device="cpu:0")
    assert outcome.problem == ""
    assert outcome.row == contents(whole[0])["scan 0.npy"]["batch"]


def test_scans_that_are_read_together_are_fitted_as_each_alone(tmp_path, monkeypatch):
    from kpred.batch.worker import fit_task, fit_tasks
    from kpred.bench.fits import scans
    from kpred.fitting.defaults import resolve_model
    from kpred.fitting.encoding import EncodedAhead

    chosen = BatchSettings(category="chair", frame="known")
    for number, cloud in enumerate(scans(resolve_model(None), 9)["chair"]):
        np.save(tmp_path / f"{number}.npy", cloud)
    (tmp_path / "damaged.ply").write_bytes(b"ply\nnonsense")
    *tasks, broken = read_tasks(tmp_path)
    for task in tasks:
        assert fit_task(task, chosen, str(tmp_path / "alone")).problem == ""
    asked = []
    encode = EncodedAhead.encode
    monkeypatch.setattr(EncodedAhead, "encode", lambda *given: asked.append(given[-1]) or encode(*given))
    outcomes = fit_tasks([*tasks, broken, Task("none", None, problem="broken row")], chosen, str(tmp_path / "together"))
    assert [outcome.problem for outcome in outcomes[: len(tasks)]] == [""] * len(tasks)
    assert not [partial for partial in asked if not partial], "every scan was among those that were read"
    assert "damaged.ply" in outcomes[-2].problem
    assert outcomes[-1].problem == "broken row"
    alone, together = contents(tmp_path / "alone"), contents(tmp_path / "together")
    assert len(alone) == 3
    assert alone.keys() == together.keys()
    for name, record in alone.items():
        other = together[name]
        assert other["batch"]["model_id"] == record["batch"]["model_id"]
        assert other["batch"]["error"] == pytest.approx(record["batch"]["error"], rel=1e-4)
        np.testing.assert_allclose(other["keypoints"], record["keypoints"], atol=1e-4)
