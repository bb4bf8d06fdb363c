"""Records of sessions: what is written replays; what is damaged, hostile or foreign is refused."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from kpred.errors import ConfigError
from kpred.studio.gestures import WHOLE, MoveKeypoint, SetSize
from kpred.studio.record import array_sha256, read_record, session_record
from kpred.studio.session import Session
from kpred.studio.state import State


@pytest.fixture
def session(start: State) -> Session:
    x, y, z = start.keypoints[0] + 0.02
    made = Session(start)
    made.do(MoveKeypoint(0, (x, y, z), True, "y"))
    made.do(SetSize(WHOLE, "y", 1.03 * float(start.part_sizes(WHOLE)[1])))
    return made


def _written(folder: Path, session: Session) -> Path:
    file = folder / "session.json"
    file.write_text(session_record(session, "/a/folder/of/mine/chair.ply"), encoding="utf-8")
    return file


def test_a_record_replays_to_the_mesh_that_it_names(session: Session, tmp_path: Path) -> None:
    record = read_record(_written(tmp_path, session))
    record.check_scan(session.start.points, "chair.ply")
    record.check_networks(session.start.context)
    start = State.of(session.start.points, session.start.context, record.fit_options())
    assert array_sha256(Session.replay(start, record.gestures).state.vertices) == record.vertices_sha256


def test_a_record_names_no_folder(session: Session, tmp_path: Path) -> None:
    assert "/a/folder" not in _written(tmp_path, session).read_text()
    assert read_record(tmp_path / "session.json").scan == "chair.ply"


def test_another_scan_is_refused(session: Session, tmp_path: Path) -> None:
    record = read_record(_written(tmp_path, session))
    with pytest.raises(ConfigError, match="not the scan"):
        record.check_scan(session.start.points[1:], "other.ply")


@pytest.mark.parametrize(
    ("path", "value"),
    [
        (("studio",), 999),
        (("studio",), "1"),
        (("scan",), None),
        (("scan", "name"), 3),
        (("options",), {"clean": False}),
        (("options",), {"top_k": 0}),
        (("options", "top_k"), "10"),
        (("options", "seed"), [1]),
        (("options", "deform"), "melt"),
        (("gestures",), [{"gesture": "Turn"}]),
        (("gestures",), 7),
        (("gestures",), [{"gesture": "PinKeypoint", "keypoint": 0, "pinned": True}] * 2001),
        (("networks",), []),
        (("result",), {}),
    ],
)
def test_hostile_records_are_refused_in_a_sentence(
    session: Session, tmp_path: Path, path: tuple[str, ...], value: Any
) -> None:
    file = _written(tmp_path, session)
    content = json.loads(file.read_text())
    place = content
    for key in path[:-1]:
        place = place[key]
    place[path[-1]] = value
    file.write_text(json.dumps(content))
    with pytest.raises(ConfigError) as failure:
        read_record(file)
    assert str(file) in str(failure.value)


@pytest.mark.parametrize("text", ["", "[]", "{}", "[" * 100_000, '{"kpred": "1.0"}', "\x00\xff"])
def test_files_that_are_no_records_are_refused(tmp_path: Path, text: str) -> None:
    file = tmp_path / "x.json"
    file.write_text(text)
    with pytest.raises(ConfigError, match="record of kpred studio"):
        read_record(file)
    with pytest.raises(ConfigError):
        read_record(tmp_path / "missing.json")


def test_a_name_with_folders_loses_them(session: Session, tmp_path: Path) -> None:
    file = _written(tmp_path, session)
    content = json.loads(file.read_text())
    content["scan"]["name"] = "../../etc/passwd"
    file.write_text(json.dumps(content))
    assert read_record(file).scan == "passwd"


def test_equal_points_have_equal_hashes() -> None:
    assert array_sha256(np.zeros((3, 3))) == array_sha256(np.zeros((3, 3), np.float32))
    assert array_sha256(np.zeros((3, 3))) != array_sha256(np.ones((3, 3)))
