"""Measures of whole rooms: overlaps, precision and recall, and the files of labelled rooms."""

import json
from pathlib import Path

import numpy as np
import pytest

from kpred.errors import ScanError
from kpred.evaluation.rooms.labelled import LabelledRoom, labelled_rooms, true_objects
from kpred.evaluation.rooms.matching import Match, average_precision, counted, match_objects, right_rows
from kpred.evaluation.rooms.pages import room_page, summary_page
from kpred.evaluation.rooms.run import RoomOutcome, RoomReport, summarize
from kpred.evaluation.rooms.virtual import room_rotation
from kpred.scenes.objects import SceneObject
from kpred.scenes.scene import Scene


@pytest.fixture
def room() -> LabelledRoom:
    """A chair of 400 points, a table of 200, something of 300 that the labels leave open, and 100 of nothing."""
    points = np.random.default_rng(0).random((1000, 3))
    return LabelledRoom("rooms", Scene(points), np.repeat([0, 1, 2, -1], [400, 200, 300, 100]), ("chair", "table", ""))


def found(category: str, rows: range, score: float) -> SceneObject:
    indices = np.array(rows)
    return SceneObject(f"{category}_{rows.start}", category, np.zeros((len(indices), 3)), indices, score=score)


def test_the_overlap_is_intersection_over_union(room: LabelledRoom) -> None:
    first, second = match_objects(room, [found("table", range(300, 600), 0.4), found("chair", range(0, 200), 0.9)])
    assert (first.category, first.true, first.iou, first.row) == ("chair", "chair", 0.5, 0)
    assert (second.category, second.true, second.row) == ("table", "table", 1)
    assert second.iou == pytest.approx(200 / 300)


def test_of_two_detections_of_one_object_the_surer_one_is_right() -> None:
    matches = [
        Match("chair", 0.9, "chair", 0.6, 0),
        Match("chair", 0.8, "chair", 0.9, 0),
        Match("table", 0.7, "chair", 1.0, 1),
    ]
    assert right_rows(matches, 0.5) == [True, False, False]
    assert right_rows(matches, 0.7) == [False, True, False]
    assert right_rows(matches, 0.5, any_category=True) == [True, False, True]


def test_what_the_labels_leave_open_is_neither_right_nor_wrong(room: LabelledRoom) -> None:
    matches = match_objects(room, [found("chair", range(600, 900), 0.9), found("chair", range(900, 1000), 0.5)])
    right = right_rows(matches, 0.25)
    assert counted(matches, right, "chair") == [False]
    assert true_objects(room) == {0: "chair", 1: "table", 2: ""}


def test_precision_and_recall_of_all_rooms(room: LabelledRoom) -> None:
    matches = match_objects(room, [found("chair", range(0, 400), 0.9), found("cabinet", range(400, 600), 0.8)])
    outcome = RoomOutcome(
        "rooms", "one", 1000, true_objects(room), tuple(matches), interpenetration=0.01, off_floor=(0.0, 0.05)
    )
    rows = {(row.category, row.metric, row.frame): row.value for row in summarize([outcome], "rooms", 0)}
    frame = "points of the scan, IoU 0.5"
    assert rows["all", "recall", frame] == 0.5
    assert rows["all", "precision", frame] == 0.5
    assert rows["chair", "recall", frame] == 1.0
    assert rows["all", "category_right_of_located", "IoU 0.5"] == 0.5
    assert rows["all", "on_the_floor_within_1_cm", "results that stand on it"] == 0.5
    report = RoomReport({}, summarize([outcome], "rooms", 0), [outcome])
    assert room_page(report).rows[0][2:7] == (2, 2, 1, 1, None)
    assert len(summary_page(report).rows) == len(report.summaries)


def test_average_precision_is_the_area_under_the_best_precision() -> None:
    def match(score: float) -> Match:
        return Match("chair", score, "chair", 0.9, 0)

    rooms = [([match(0.9), match(0.3)], [True, True]), ([match(0.6), match(0.2)], [False, False])]
    # Right, wrong, right, wrong: precision 1 up to a recall of 1/4, and 2/3 up to 2/4.
    assert average_precision(rooms, "chair", 4) == pytest.approx(1 / 4 + 2 / 3 / 4)
    assert average_precision(rooms, "table", 4) == 0.0


def test_folders_of_labelled_rooms_are_read(tmp_path: Path) -> None:
    points = np.random.default_rng(0).random((300, 3))
    lines = [f"{x} {y} {z}" for x, y, z in points]
    header = (
        "ply\nformat ascii 1.0\nelement vertex 300\nproperty float x\nproperty float y\nproperty float z\nend_header\n"
    )
    (tmp_path / "one.ply").write_text(header + "\n".join(lines) + "\n")
    np.save(tmp_path / "one.instances.npy", np.repeat([0, 1, 2], 100))
    (tmp_path / "one.names.json").write_text(json.dumps(["", "bookcase", "otherprop"]))
    (room,) = labelled_rooms(tmp_path)
    assert true_objects(room) == {1: "cabinet", 2: ""}
    np.save(tmp_path / "one.instances.npy", np.zeros(7, np.int64))
    with pytest.raises(ScanError, match="300"):
        list(labelled_rooms(tmp_path))
    with pytest.raises(ScanError, match="add labelled rooms"):
        list(labelled_rooms(tmp_path.parent / "nowhere"))


def test_rooms_of_packs_stand_upright() -> None:
    np.testing.assert_allclose(room_rotation(0.7) @ [0, 1, 0], [0, 0, 1], atol=1e-12)
    assert np.linalg.det(room_rotation(0.7)) == pytest.approx(1.0)
