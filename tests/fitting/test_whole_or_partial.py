"""Whether a scan is whole, where its box is known: its extent says no, a better explanation as a whole says yes."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from kpred.database import Database
from kpred.fitting.candidates import Candidates
from kpred.fitting.defaults import resolve_database, resolve_model
from kpred.fitting.options import FitOptions
from kpred.fitting.stages import CleanScan, Context, Tried, try_poses
from kpred.fitting.visibility import Visibility, fills_unit_box, lacks_parts
from kpred.fitting.whole_or_partial import deform_readings
from kpred.pose.recognition import PoseHypothesis

HALF_SEEN = Visibility(np.full((9, 9, 9), 0.6, np.float32))


@pytest.fixture(scope="module")
def database() -> Database:
    return resolve_database(None)


@pytest.fixture(scope="module")
def cloud(database: Database) -> torch.Tensor:
    """Points of a table of the database, which fill the unit box, in random order."""
    name = database.model_ids("table")[3]
    points = torch.from_numpy(database.candidates("table", [name]).points[0])
    return points[torch.randperm(len(points), generator=torch.Generator().manual_seed(0))]


def tried(cloud: torch.Tensor, database: Database, partial: bool | None) -> Tried:
    context = Context(resolve_model(None), database, ("table",))
    scan = CleanScan(cloud.double().numpy(), len(cloud), "y", None, ())
    options = FitOptions(top_k=4, frame="known", partial=partial, clean=False)
    return try_poses(scan, [PoseHypothesis(np.eye(3), "table")], context, options)


def without(candidates: Candidates, names: set[str]) -> Candidates:
    rows = [row for row, name in enumerate(candidates.model_ids) if name not in names]
    return candidates.take(torch.tensor(rows))


def test_a_whole_object_fills_its_box_and_a_half_does_not(cloud: torch.Tensor) -> None:
    assert fills_unit_box(cloud)
    assert not fills_unit_box(cloud[cloud[:, 0] > 0])
    assert not fills_unit_box(cloud[cloud[:, 1] > 0])
    assert not fills_unit_box(0.8 * cloud)


def test_a_scan_that_does_not_fill_the_known_box_lacks_parts(cloud: torch.Tensor) -> None:
    model = resolve_model(None)
    assert not lacks_parts(cloud, model, "table", known=True)
    assert lacks_parts(0.8 * cloud, model, "table", known=True)


def test_a_whole_scan_that_is_taken_for_a_part_is_read_as_whole_if_a_model_explains_it(
    cloud: torch.Tensor, database: Database
) -> None:
    whole = tried(cloud, database, partial=False).best.candidates
    others = without(tried(cloud, database, partial=True).best.candidates, set(whole.model_ids))
    assert len(others.model_ids) > 0
    result = deform_readings(others, whole, HALF_SEEN, "auto")
    assert result.candidates is whole


def test_a_reading_as_whole_that_explains_no_better_is_left_out(cloud: torch.Tensor, database: Database) -> None:
    good = tried(cloud, database, partial=True).best.candidates
    worse = replace(good, partial=False)
    assert deform_readings(good, worse, HALF_SEEN, "auto").candidates is good
    assert deform_readings(good, None, HALF_SEEN, "auto").candidates is good
