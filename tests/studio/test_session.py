"""Sessions: gestures are done, undone, redone and replayed; failures change nothing; sessions do not mix."""

from pathlib import Path

import numpy as np
import pytest

from kpred.errors import ConfigError, KpredError, ScanError
from kpred.studio.gestures import (
    WHOLE,
    ChooseModel,
    ChooseUnit,
    ChooseUp,
    Crop,
    Gesture,
    MoveKeypoint,
    PinKeypoint,
    RefitRest,
    SetSize,
    Turn,
)
from kpred.studio.session import Session
from kpred.studio.state import State


def _move(state: State, keypoint: int = 0, by: float = 0.03) -> MoveKeypoint:
    x, y, z = state.keypoints[keypoint]
    return MoveKeypoint(keypoint, (x, y + by, z))


def _size(state: State) -> SetSize:
    return SetSize(WHOLE, "y", 1.05 * float(state.part_sizes(WHOLE)[1]))


def test_undo_and_redo_walk_through_the_same_states(start: State) -> None:
    session = Session(start)
    states = [session.state]
    for gesture in (_move(start), _size(start), RefitRest(), PinKeypoint(0, False)):
        states.append(session.do(gesture))
    for state in states[-2::-1]:
        assert session.undo() is state
    assert session.undo() is start and not session.can_undo
    for state in states[1:]:
        assert session.redo() is state
    assert session.redo() is states[-1] and not session.can_redo


def test_a_new_gesture_drops_what_was_undone(start: State) -> None:
    session = Session(start)
    session.do(_move(start))
    session.undo()
    session.do(_size(start))
    assert not session.can_redo
    assert session.gestures == (_size(start),)


def test_replayed_gestures_give_the_same_mesh_to_the_bit(start: State) -> None:
    session = Session(start)
    other = start.candidates[1].model_id
    for gesture in (ChooseModel(other), Turn(10.0)):
        session.do(gesture)
    session.do(_move(session.state))
    session.do(RefitRest())
    again = Session.replay(start, session.gestures)
    np.testing.assert_array_equal(again.state.vertices, session.state.vertices)


@pytest.mark.parametrize(
    ("gesture", "words"),
    [
        (Crop((50.0, 50.0, 50.0), (51.0, 51.0, 51.0)), "holds 0 points"),
        (ChooseModel("no_such_model"), "no model 'no_such_model'"),
        (MoveKeypoint(12, (0.0, 0.0, 0.0)), "no keypoint 12"),
        (PinKeypoint(-1, True), "no keypoint -1"),
        (SetSize(999, "y", 1.0), "no part 999"),
        (SetSize(WHOLE, "y", 1000.0), "cannot be reached"),
    ],
)
def test_a_gesture_that_fails_says_so_in_a_sentence_and_changes_nothing(
    start: State, gesture: Gesture, words: str
) -> None:
    session = Session(start)
    with pytest.raises(KpredError, match=words) as failure:
        session.do(gesture)
    assert str(failure.value).endswith(".") and "\n" not in str(failure.value)
    assert session.state is start and session.gestures == ()


def test_replaying_names_the_gesture_that_fails(start: State) -> None:
    with pytest.raises(ConfigError, match=r"Gesture 2 \(PinKeypoint\)"):
        Session.replay(start, [PinKeypoint(0, True), PinKeypoint(77, True)])


def test_sessions_with_one_start_do_not_mix(start: State) -> None:
    one, other = Session(start), Session(start)
    before = start.vertices.copy()
    one.do(_move(start))
    assert other.state is start and other.gestures == ()
    np.testing.assert_array_equal(start.vertices, before)


def test_swapping_to_the_first_candidate_brings_the_first_result_back(start: State) -> None:
    session = Session(start)
    session.do(ChooseModel(start.candidates[2].model_id))
    assert session.state.fit.source.model_id == start.candidates[2].model_id
    assert [one.model_id for one in session.state.candidates] == [one.model_id for one in start.candidates]
    session.do(ChooseModel(start.candidates[0].model_id))
    np.testing.assert_array_equal(session.state.vertices, start.vertices)


def test_a_turn_turns_the_front_from_z_towards_x(start: State) -> None:
    before = start.fit.frame.rotation
    after = Session(start).do(Turn(90.0)).fit.frame.rotation
    # Rows are the object's axes in the scan's frame: its new front was its right side.
    np.testing.assert_allclose(after[2], before[0], atol=1e-9)
    np.testing.assert_allclose(after[1], before[1], atol=1e-9)


def test_another_unit_changes_lengths_in_metres_alone(start: State) -> None:
    state = Session(start).do(ChooseUnit("mm"))
    assert state.result.unit.metres == 0.001
    np.testing.assert_array_equal(state.vertices, start.vertices)


def test_another_up_axis_is_taken(start: State) -> None:
    up = Session(start).do(ChooseUp("x")).fit.frame.rotation[1]
    np.testing.assert_allclose(up, [1.0, 0.0, 0.0], atol=1e-9)


def test_a_crop_leaves_the_points_in_the_box(start: State) -> None:
    low, high = start.points.min(axis=0), start.points.max(axis=0)
    middle = float(low[1] + 0.7 * (high[1] - low[1]))
    x, z = (float(high[axis]) for axis in (0, 2))
    corner = float(low[0]), float(low[1]), float(low[2])
    try:
        state = Session(start).do(Crop(corner, (x, middle, z)))
    except ScanError as error:
        pytest.fail(str(error))
    assert len(state.points) == np.count_nonzero(start.points[:, 1] <= middle)
    assert state.points[:, 1].max() <= middle


def test_a_moved_keypoint_is_pinned_until_it_is_released(start: State) -> None:
    session = Session(start)
    moved = session.do(_move(start, 0, 0.04))
    assert set(moved.pins) == {0}
    place = moved.keypoints[0]
    refitted = session.do(RefitRest())
    np.testing.assert_allclose(refitted.keypoints[0], place, atol=0.01)
    assert session.do(PinKeypoint(0, False)).pins == {}


def test_corrections_reach_the_result_that_is_saved(start: State, tmp_path: Path) -> None:
    state = Session(start).do(_size(start))
    result = state.result
    assert np.ptp(result.mesh.vertices, axis=0).max() == pytest.approx(1.05 * state.fit.mesh.extents[1], rel=0.01)
    assert "The shape was corrected by hand." in result.warnings
    assert result.to_json()["step"] == "structure"
    files = result.save(tmp_path / "chair.glb")
    assert files[0].stat().st_size > 0
