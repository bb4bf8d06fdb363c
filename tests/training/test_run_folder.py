"""A run folder is one training's at a time."""

import subprocess
import sys
from pathlib import Path

import pytest

from kpred.errors import OutputError
from kpred.training.run_folder import run_folder

HOLD = """
import sys
from pathlib import Path
from kpred.training.run_folder import run_folder
with run_folder(Path(sys.argv[1])):
    print("held", flush=True)
    sys.stdin.read()
"""


def test_the_second_training_is_told_and_the_folder_of_the_first_stays(tmp_path: Path) -> None:
    folder = tmp_path / "runs" / "sofa"
    with subprocess.Popen([sys.executable, "-c", HOLD, folder], stdin=subprocess.PIPE, stdout=subprocess.PIPE) as child:
        assert child.stdout is not None
        assert child.stdout.readline() == b"held\n"
        with pytest.raises(OutputError, match=f"Another training is running in {folder}"), run_folder(folder):
            pytest.fail("held twice")
        assert folder.is_dir()
        child.communicate(b"")
    with run_folder(folder), run_folder(folder):
        (folder / "kept").touch()
    assert [item.name for item in folder.iterdir()] == ["kept"]


def test_an_empty_folder_goes_where_the_training_fails(tmp_path: Path) -> None:
    with pytest.raises(ZeroDivisionError), run_folder(tmp_path / "run"):
        raise ZeroDivisionError
    assert not (tmp_path / "run").exists()
    (tmp_path / "file").touch()
    with pytest.raises(OutputError, match="Cannot make the run folder"), run_folder(tmp_path / "file" / "run"):
        pytest.fail("made")
