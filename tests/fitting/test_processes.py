"""Fits in forked processes, and the number of threads that a fit leaves behind."""

import os
import subprocess
import sys

import pytest

FORKED = """
import multiprocessing, torch, kpred
from kpred.fitting.defaults import sample_scan

def model(_):
    return kpred.fit(sample_scan(), up="y").source.model_id

if __name__ == "__main__":
    counts = [torch.get_num_threads()]
    expected = model(0)
    with multiprocessing.get_context("fork").Pool(1) as pool:
        assert pool.map_async(model, [0, 1]).get(timeout=240) == [expected, expected]
    counts.append(torch.get_num_threads())
    torch.set_num_threads(1)
    model(0)
    print(*counts, torch.get_num_threads())
"""


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork here")
def test_a_forked_process_fits_and_threads_stay_as_many_as_were_asked_for() -> None:
    environment = {**os.environ, "OMP_NUM_THREADS": "2", "NUMBA_NUM_THREADS": "2"}
    done = subprocess.run(
        [sys.executable, "-c", FORKED], env=environment, capture_output=True, text=True, timeout=300, check=False
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.split() == ["2", "2", "1"]
