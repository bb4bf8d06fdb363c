"""The report of a room: objects without a result first, each beside its scan, and what stayed unexplained."""

import re

import numpy as np
import pytest

import kpred
from kpred.fitting.fit_scene import SceneFit
from kpred.fitting.object_fit import ObjectFit
from kpred.reports.room_report import room_report
from kpred.scenes.objects import SceneObject
from kpred.scenes.scene import Scene


@pytest.fixture
def room(fit: kpred.Fit) -> SceneFit:
    def thing(name: str) -> SceneObject:
        return SceneObject(name, "chair", fit.points, np.arange(len(fit.points)), up="y")

    stray = np.full((1, 3), np.nan)
    scene = Scene(np.concatenate([fit.points, stray]), up="y", name="<room>")
    fits = (
        ObjectFit(thing("good"), fit),
        ObjectFit(thing("odd"), error="odd: a lamp is no chair.", skipped=True),
        ObjectFit(thing("<bad>"), error="<bad>: too few points."),
    )
    return SceneFit(scene, fits, unexplained=np.arange(5))


def test_failures_come_first_and_every_object_is_shown(room: SceneFit) -> None:
    text = room_report(room)
    assert "1 of 3 objects have a CAD model; 1 failed, 1 were skipped." in text
    rows = re.findall(r'<tr[^>]*><td data-key="([^"]+)"', text)
    assert rows == ["&lt;bad&gt;", "odd", "good"]
    assert text.count("<img") == 3 and "<bad>" not in text and "<room>" not in text
    assert f"5 of {len(room.scene.points) - 1} points" in text and "odd: a lamp is no chair." in text
    assert 'data-focus="2"' in text


def test_a_room_without_results_has_a_report(room: SceneFit) -> None:
    empty = SceneFit(room.scene, room.fits[1:])
    assert "0 of 2 objects" in room_report(empty)
