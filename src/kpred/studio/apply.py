"""What each gesture does to a state."""

from __future__ import annotations

from dataclasses import replace
from functools import singledispatch

import numpy as np

from kpred.errors import ConfigError, ScanError
from kpred.fitting.defaults import shared_categories
from kpred.ops.rotations import yaw_rotation
from kpred.pose.estimators import GivenPose
from kpred.shapes.scan import MINIMUM_POINTS
from kpred.shapes.unit import LengthUnit, guess_unit
from kpred.studio.drag import AXES, Drag, check_keypoint
from kpred.studio.gestures import (
    AUTO,
    WHOLE,
    ChooseCategory,
    ChooseDeform,
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
from kpred.studio.state import State, run_alone

REACH = 1.3
"""Points of the scan farther from the middle of the object's unit box than this are not the object's."""


@singledispatch
def apply(gesture: Gesture, state: State) -> State:
    """Apply a gesture to a state, which stays as it is, and return the new one.

    Raises:
        KpredError: the gesture cannot be done here; the sentence says why.
    """
    raise TypeError(f"{type(gesture).__name__} is no gesture")


@apply.register
def _category(gesture: ChooseCategory, state: State) -> State:
    wanted = None if gesture.category == AUTO else gesture.category
    categories = tuple(shared_categories(state.context.model, state.context.database, wanted))
    return state.fitted(replace(state.context, categories=categories), state.options)


@apply.register
def _up(gesture: ChooseUp, state: State) -> State:
    # A pose that was given before belongs to another up axis.
    return state.fitted(state.context, replace(state.options, up=gesture.up, pose=None, frame="auto"))


@apply.register
def _turn(gesture: Turn, state: State) -> State:
    # Turning the object one way is turning the scan the other way in the object's own axes.
    rotation = yaw_rotation(-np.radians(gesture.degrees)) @ state.fit.frame.rotation
    return state.fitted(state.context, replace(state.options, pose=GivenPose(rotation), frame="auto"))


@apply.register
def _deform(gesture: ChooseDeform, state: State) -> State:
    again = state.fitted(state.context, replace(state.options, deform=gesture.deform))
    chosen = state.fit.source.model_id
    return again if again.fit.source.model_id == chosen else _model(ChooseModel(chosen), again)


@apply.register
def _unit(gesture: ChooseUnit, state: State) -> State:
    if gesture.unit == "auto":
        unit = guess_unit(state.part_sizes(WHOLE), state.fit.category)
    else:
        unit = LengthUnit(gesture.unit, "given")
    searched, fit = replace(state.searched, unit=unit), replace(state.fit, unit=unit)
    return replace(state, options=replace(state.options, unit=gesture.unit), searched=searched, fit=fit)


@apply.register
def _crop(gesture: Crop, state: State) -> State:
    along = state.points @ np.array(gesture.axes).T
    inside = ((along >= gesture.low) & (along <= gesture.high)).all(axis=1)
    if inside.sum() < MINIMUM_POINTS:
        raise ScanError(
            f"The box holds {int(inside.sum())} points of the scan; a fit needs at least {MINIMUM_POINTS}: make it "
            "larger."
        )
    return state.fitted(state.context, state.options, state.points[inside])


@apply.register
def _model(gesture: ChooseModel, state: State) -> State:
    if gesture.model_id == state.searched.source.model_id:
        return state.with_fit(state.searched)
    database = state.context.database
    if gesture.model_id not in database:
        raise ConfigError(f"The database has no model {gesture.model_id[:80]!r}; choose one of the list.")
    category = database.entry(gesture.model_id).category
    context = replace(state.context, categories=(category,))
    if category != state.fit.category:
        pose = state.options.pose
    else:
        pose = GivenPose(state.searched.frame.rotation)
    options = replace(state.options, model_id=gesture.model_id, pose=None if state.options.known else pose)
    return state.with_fit(run_alone(state.points, context, options))


@apply.register
def _move(gesture: MoveKeypoint, state: State) -> State:
    drag = Drag.begin(state, gesture.keypoint, gesture.mirror, gesture.axis)
    return drag.dropped(np.array(gesture.place))


@apply.register
def _pin(gesture: PinKeypoint, state: State) -> State:
    check_keypoint(state, gesture.keypoint)
    pins = {pin: place for pin, place in state.pins.items() if pin != gesture.keypoint}
    if gesture.pinned:
        pins[gesture.keypoint] = state.shape.keypoints[gesture.keypoint].copy()
    return replace(state, pins=pins)


@apply.register
def _size(gesture: SetSize, state: State) -> State:
    axis, parts = AXES.index(gesture.axis), state.fit.placed.entry.structure.parts
    if gesture.part != WHOLE and not 0 <= gesture.part < parts:
        raise ConfigError(f"There is no part {gesture.part}; choose one of 0 to {parts - 1}, or the whole object.")
    length = gesture.length / state.fit.frame.scale
    shape = state.shape.resize(gesture.part, axis, length, state.held)
    return replace(state.with_shape(shape), sizes={**state.sizes, (gesture.part, axis): length})


@apply.register
def _refit(gesture: RefitRest, state: State) -> State:
    frame = state.fit.frame
    goal = frame.to_unit(state.points)
    inside = (np.abs(goal) < REACH).all(axis=1)
    return state.with_shape(state.shape.refit(goal[inside] if inside.any() else goal, state.held))
