"""Mending of crops: at most three gestures each, and records that replay to the mended mesh."""

from pathlib import Path

import numpy as np
import trimesh
from mend_crops import MENDS, mend, write
from PIL import Image

from kpred.fitting.options import FitOptions
from kpred.fitting.stages import Context
from kpred.studio.gestures import WHOLE, RefitRest, SetSize
from kpred.studio.record import array_sha256, read_record
from kpred.studio.session import Session
from kpred.studio.state import State
from kpred.synthetic.generator import generate


def test_six_crops_are_mended_by_at_most_three_gestures() -> None:
    assert len(MENDS) == 6
    assert all(1 <= len(gestures) <= 3 for gestures in MENDS.values())


def test_a_mended_scan_replays_from_its_record(tmp_path: Path) -> None:
    shape = generate("table", 1, seed=3, splits=False)[0]
    surface = trimesh.Trimesh(shape.vertices, shape.faces, process=False)
    points = np.asarray(trimesh.sample.sample_surface(surface, 1500, seed=0)[0])
    scan = tmp_path / "table_00.ply"
    trimesh.PointCloud(points).export(scan)
    context = Context.load(None, None, None)

    mended = mend(scan, (SetSize(WHOLE, "y", 1.1 * float(np.ptp(points[:, 1]))), RefitRest()), context)
    write([mended], tmp_path / "out")

    assert mended.row().startswith("| table_00 | *Set the sizes*: height ")
    record = read_record(tmp_path / "out" / "table_00.studio.json")
    start = State.of(mended.session.start.points, context, FitOptions(**record.options))
    again = Session.replay(start, record.gestures).state
    assert array_sha256(again.vertices) == record.vertices_sha256 == array_sha256(mended.session.state.vertices)
    with Image.open(tmp_path / "out" / "mended.png") as picture:
        assert picture.width > picture.height > 100
