"""A Ray cluster of this machine: the same batch, and a worker that is killed."""

import os
import signal

import numpy as np
import pytest

from kpred.batch import BatchSettings
from kpred.batch.journal import Journal
from kpred.batch.run import BatchRun
from kpred.batch.task import Task
from kpred.errors import ConfigError

pytest.importorskip("ray", reason="Ray is not installed: pip install 'kpred[ray]'")


def test_no_cluster_is_told(tmp_path, monkeypatch):
    # Another test may have a cluster of its own on this machine meanwhile.
    monkeypatch.setenv("RAY_TMPDIR", str(tmp_path))
    monkeypatch.delenv("RAY_ADDRESS", raising=False)
    from kpred.batch.ray_pool import RayWorkerPool

    with pytest.raises(ConfigError, match="No Ray cluster"):
        RayWorkerPool("auto", 1, BatchSettings(), str(tmp_path))


@pytest.mark.slow
def test_a_killed_worker_is_started_again_and_every_scan_is_fitted_once(tmp_path):
    from kpred.batch.ray_pool import RayWorkerPool

    rng = np.random.default_rng(0)
    tasks = []
    for i in range(5):
        file = tmp_path / f"{i}.npy"
        np.save(file, rng.uniform(-1, 1, (300, 3)) * (1, 0.5, 0.7))
        tasks.append(Task(file.name, str(file), "chair"))
    out = tmp_path / "out"
    settings = BatchSettings(category="chair", frame="known", deform="paper", clean=False)
    with Journal(out, {}) as journal:
        pool = RayWorkerPool("local", 1, settings, str(out))
        killed = []

        def kill_once(report):
            if report.fitted == 1 and not killed:
                killed.extend(pool.workers())
                os.kill(killed[0], signal.SIGKILL)

        try:
            report = BatchRun(pool, journal, attempts=3, progress=kill_once).run(iter(tasks))
        finally:
            pool.close()
    assert killed
    assert report.fitted == 5
    assert report.failed == []
    assert len((out / "results.jsonl").read_text().splitlines()) == 5
    assert len(list(out.rglob("[!.]*.ply"))) == 5
