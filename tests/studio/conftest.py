"""A table without a scan, for laws of shapes; and one fit of the bundled scan, for sessions."""

import numpy as np
import pytest

from kpred.database import Database
from kpred.fitting import bundled_database_path, sample_scan
from kpred.fitting.options import FitOptions
from kpred.fitting.stages import Context
from kpred.refinement.part_points import affine_solution
from kpred.refinement.structure_basis import structure_basis
from kpred.refinement.structure_config import StructureConfig
from kpred.shapes import read_scan
from kpred.studio.editable import structure_model
from kpred.studio.state import State
from kpred.studio.structure_shape import StructureShape


@pytest.fixture(scope="session")
def table() -> StructureShape:
    """A table of four legs and a thin top, as it is in the database; its unit box."""
    with Database.open(bundled_database_path()) as database:
        entry = database.entry("coffee_11_2")
    basis = structure_basis(entry.structure, StructureConfig())
    return StructureShape(structure_model(entry, basis), affine_solution(basis, np.ones(3), np.zeros(3)))


@pytest.fixture(scope="session")
def start() -> State:
    """The bundled scan, fitted; shared by all sessions, since states never change."""
    return State.of(read_scan(sample_scan()), Context.load(None, None, None), FitOptions())
