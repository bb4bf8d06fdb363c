"""Opening: a record finds its scan beside it, or where it is named; nothing else is read."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from kpred.errors import ConfigError
from kpred.fitting import sample_scan
from kpred.studio.gestures import WHOLE, SetSize
from kpred.studio.opening import open_record
from kpred.studio.record import session_record
from kpred.studio.session import Session
from kpred.studio.state import State


@pytest.fixture
def recorded(start: State, tmp_path: Path) -> tuple[Path, Session]:
    session = Session(start)
    session.do(SetSize(WHOLE, "y", 1.03 * float(start.part_sizes(WHOLE)[1])))
    file = tmp_path / "chair.studio.json"
    file.write_text(session_record(session, sample_scan().name))
    return file, session


def test_a_record_opens_with_the_scan_beside_it(recorded: tuple[Path, Session]) -> None:
    file, session = recorded
    with pytest.raises(ConfigError, match="not beside it.*--scan"):
        open_record(file, None, session.start.context)
    shutil.copy(sample_scan(), file.parent)
    opened = open_record(file, None, session.start.context)
    again = Session.replay(opened.start, opened.gestures)
    np.testing.assert_array_equal(again.state.vertices, session.state.vertices)


def test_a_record_reads_no_file_outside_of_its_folder(recorded: tuple[Path, Session]) -> None:
    file, session = recorded
    folder = file.parent / "inner"
    folder.mkdir()
    shutil.copy(sample_scan(), file.parent)
    content = json.loads(file.read_text())
    content["scan"]["name"] = f"../{sample_scan().name}"
    hostile = folder / file.name
    hostile.write_text(json.dumps(content))
    with pytest.raises(ConfigError, match="not beside it"):
        open_record(hostile, None, session.start.context)


def test_unknown_categories_are_refused(recorded: tuple[Path, Session]) -> None:
    file, session = recorded
    content = json.loads(file.read_text())
    content["categories"] = ["spaceship"]
    file.write_text(json.dumps(content))
    with pytest.raises(ConfigError, match="spaceship"):
        open_record(file, sample_scan(), session.start.context)
