"""Opening: a record finds its scan beside it, or where it is named; nothing else is read."""

import json
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from kpred.errors import ConfigError, KpredError
from kpred.fitting import sample_scan
from kpred.fitting.pipeline import Timer, run_fit
from kpred.json_output import json_text
from kpred.studio.gestures import WHOLE, SetSize
from kpred.studio.opening import open_fit_record, open_record
from kpred.studio.record import array_sha256, session_record
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


@pytest.fixture
def fit_record(start: State, tmp_path: Path) -> Path:
    """The record of a fit of the sample scan, as `kpred fit` writes it."""
    scan = tmp_path / "chair.ply"
    shutil.copy(sample_scan(), scan)
    fit = run_fit(scan, start.context, start.options, Timer())
    file = tmp_path / "chair.json"
    file.write_text(json_text(fit.record()))
    return file


def test_the_record_of_a_fit_opens_with_its_scan_and_options(fit_record: Path, start: State) -> None:
    opened = open_fit_record(fit_record, None, start.context)
    assert opened.name == "chair.ply" and opened.gestures == ()
    assert array_sha256(opened.start.vertices) == array_sha256(start.vertices)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"options": {"seed": 1, "clean": False}}, "no option 'clean'"),
        ({"input": {"sha256": "0" * 64}}, "has changed since"),
        ({"database": {"fingerprint": "0" * 64}}, "another database"),
        ({"weights": {"fingerprint": "0"}}, "other networks"),
        ({"options": {"categories": 7}}, "damaged"),
    ],
)
def test_another_scan_or_other_options_are_refused(
    fit_record: Path, start: State, change: dict[str, dict[str, Any]], words: str
) -> None:
    content = json.loads(fit_record.read_text())
    for key, values in change.items():
        content[key] |= values
    fit_record.write_text(json.dumps(content))
    with pytest.raises(KpredError, match=words) as failure:
        open_fit_record(fit_record, None, start.context)
    assert "\n" not in str(failure.value)
