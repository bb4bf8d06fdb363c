"""Opening rooms: objects that a file names are fitted; a scan of one object is none."""

from pathlib import Path

import numpy as np
import pytest

from kpred.errors import ConfigError
from kpred.fitting import sample_scan
from kpred.fitting.options import FitOptions
from kpred.studio.room import RoomSession
from kpred.studio.room_opening import RoomOptions, is_plainly_room
from kpred.studio.state import State


def test_objects_of_a_file_are_fitted_where_they_stand(opened_room: RoomSession) -> None:
    assert len(opened_room.objects) == 2
    for item in opened_room.items():
        assert item.fit is not None
        apart = (
            item.fit.mesh.bounds.mean(axis=0) - (item.object.points.min(axis=0) + item.object.points.max(axis=0)) / 2
        )
        assert abs(apart).max() < 0.1 * max(item.fit.mesh.extents)


def test_an_object_is_no_room_and_a_room_is_one(start: State, tmp_path: Path) -> None:
    assert not is_plainly_room(sample_scan(), start.context, FitOptions())
    rng = np.random.default_rng(0)
    floor = np.column_stack([rng.uniform(0, 5, (2000, 2)), np.zeros(2000)])
    wall = np.column_stack([rng.uniform(0, 5, 1000), np.zeros(1000), rng.uniform(0, 2.5, 1000)])
    np.savetxt(tmp_path / "room.xyz", np.concatenate([floor, wall]))
    assert is_plainly_room(tmp_path / "room.xyz", start.context, FitOptions(up="z"))


def test_impossible_options_are_refused() -> None:
    with pytest.raises(ConfigError, match="deform"):
        RoomOptions(deform="melt")
