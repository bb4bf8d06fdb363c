"""Records of rooms: what is written replays; what is damaged, hostile or of another room is refused."""

import json
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from kpred.errors import ConfigError, KpredError
from kpred.studio.gestures import WHOLE, SetSize
from kpred.studio.record import read_record
from kpred.studio.room import RoomSession
from kpred.studio.room_opening import RoomFiles, open_room_record
from kpred.studio.room_record import is_room_record, read_room_record, room_record


@pytest.fixture
def recorded(room: RoomSession, tmp_path: Path) -> Path:
    first, second = room.objects
    state = room.session(first).state
    room.session(first).do(SetSize(WHOLE, "y", 1.04 * float(state.part_sizes(WHOLE)[1])))
    room.leave_out(second, True)
    file = tmp_path / "room.studio.json"
    file.write_text(room_record(room))
    return file


def test_a_record_replays_to_the_same_room(recorded: Path, room: RoomSession, room_files: RoomFiles) -> None:
    with pytest.raises(ConfigError, match="not beside it.*--scan"):
        open_room_record(recorded, None, room.context, None)
    for file in (room_files.scan, room_files.objects):
        assert file is not None
        shutil.copy(file, recorded.parent)
    again = open_room_record(recorded, None, room.context, None)
    assert again.left_out == room.left_out
    np.testing.assert_array_equal(
        again.session(room.objects[0]).state.vertices, room.session(room.objects[0]).state.vertices
    )
    assert room_record(again) == recorded.read_text()


def test_another_room_is_refused(recorded: Path, room: RoomSession, room_files: RoomFiles, tmp_path: Path) -> None:
    other = tmp_path / "other.xyz"
    np.savetxt(other, np.loadtxt(room_files.scan) + 0.001)
    with pytest.raises(ConfigError, match="not the room room.xyz"):
        open_room_record(recorded, RoomFiles(other, room_files.objects), room.context, None)


def test_records_of_rooms_and_scans_are_told_apart(recorded: Path) -> None:
    assert is_room_record(recorded)
    with pytest.raises(ConfigError, match="record of a room"):
        read_record(recorded)


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("objects", {"chair_1": [{"gesture": "EraseDisk"}]}),
        ("objects", {"chair_1": "x"}),
        ("objects", [1]),
        ("left_out", [3]),
        ("options", {"up": 1}),
        ("room", {"name": 3}),
        ("weights", None),
    ],
)
def test_a_damaged_record_is_a_sentence(recorded: Path, key: str, value: Any) -> None:
    content = json.loads(recorded.read_text())
    content[key] = value
    recorded.write_text(json.dumps(content))
    with pytest.raises(KpredError, match=recorded.name) as failure:
        read_room_record(recorded)
    assert "\n" not in str(failure.value)


def test_a_record_names_files_beside_it_alone(recorded: Path) -> None:
    content = json.loads(recorded.read_text())
    content["room"]["name"] = "../../etc/passwd"
    content["objects_file"] = "/etc/shadow"
    recorded.write_text(json.dumps(content))
    record = read_room_record(recorded)
    assert (record.scan, record.objects) == ("passwd", "shadow")
