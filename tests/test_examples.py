"""The examples run as they stand and leave files behind."""

import subprocess
import sys
from pathlib import Path

import pytest

EXAMPLES = sorted((Path(__file__).resolve().parents[1] / "examples").glob("*.py"))


def test_there_are_examples() -> None:
    assert EXAMPLES[0].name == "01_fit_one_scan.py"


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda path: path.stem)
def test_example_runs(example: Path, tmp_path: Path) -> None:
    from kpred import sample_scan

    arguments = [str(sample_scan())] if example.name.startswith("01") else []
    run = subprocess.run(
        [sys.executable, str(example), *arguments, str(tmp_path)], capture_output=True, text=True, timeout=300
    )
    assert run.returncode == 0, run.stderr[-2000:]
    assert any(tmp_path.rglob("*.*"))
