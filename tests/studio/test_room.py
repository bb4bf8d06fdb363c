"""Rooms: objects are corrected each for itself, left out and taken in; the result stands in the frame of the scan."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from kpred.errors import ConfigError
from kpred.studio.gestures import WHOLE, SetSize
from kpred.studio.room import RoomSession


def _taller(room: RoomSession, name: str) -> SetSize:
    return SetSize(WHOLE, "y", 1.05 * float(room.session(name).state.part_sizes(WHOLE)[1]))


def test_an_object_begins_as_it_stands_in_the_room(room: RoomSession) -> None:
    for name, item in zip(room.objects, room.items(), strict=True):
        assert item.fit is not None
        np.testing.assert_allclose(room.session(name).state.vertices, item.fit.mesh.vertices, atol=1e-5)


def test_corrections_of_one_object_leave_the_others(room: RoomSession) -> None:
    first, second = room.objects
    before = room.result()
    room.session(first).do(_taller(room, first))
    after = room.result()
    corrected, kept = after.fits[0].fit, after.fits[1].fit
    assert corrected is not None and kept is before.fits[1].fit
    np.testing.assert_array_equal(corrected.mesh.vertices, room.session(first).state.vertices)
    assert second not in room.sessions


def test_what_is_left_out_is_not_in_the_result_until_it_is_taken_in(room: RoomSession) -> None:
    first = room.objects[0]
    room.leave_out(first, True)
    assert [item.object.name for item in room.result().fitted] == [room.objects[1]]
    room.leave_out(first, False)
    assert len(room.result().fitted) == 2


def test_copies_do_not_mix(room: RoomSession) -> None:
    first = room.objects[0]
    other = room.copy()
    other.session(first).do(_taller(other, first))
    other.leave_out(room.objects[1], True)
    assert not room.session(first).gestures and not room.left_out
    assert len(room.result().fitted) == 2


def test_a_tilted_room_is_corrected_level_and_returned_tilted(room: RoomSession) -> None:
    leveling = Rotation.from_euler("xyz", (7, -4, 3), degrees=True).as_matrix()
    scan = replace(room.room.scan, points=room.room.scan.points @ leveling)
    tilted = RoomSession(replace(room.room, scan=scan, leveling=leveling), room.name, room.context, room.options)
    first = room.objects[0]
    for one in (room, tilted):
        one.session(first).do(_taller(one, first))
    level, back = room.result(), tilted.result()
    for flat, leaning in zip(level.fitted, back.fitted, strict=True):
        assert flat.fit is not None and leaning.fit is not None
        np.testing.assert_allclose(leaning.fit.mesh.vertices @ leveling.T, flat.fit.mesh.vertices, atol=1e-9)


def test_unknown_objects_are_refused(room: RoomSession) -> None:
    with pytest.raises(ConfigError, match="no object 'sofa_1'"):
        room.session("sofa_1")
    with pytest.raises(ConfigError, match="no object"):
        room.leave_out("sofa_1", True)
