"""A table without a scan, for laws of shapes; a fit of the bundled scan, for sessions; a fitted room of two objects."""

import numpy as np
import pytest
import trimesh

from kpred.database import Database, build_database
from kpred.fitting import sample_scan
from kpred.fitting.options import FitOptions
from kpred.fitting.stages import Context
from kpred.nn import load_model
from kpred.refinement.part_points import affine_solution
from kpred.refinement.structure_basis import structure_basis
from kpred.refinement.structure_config import StructureConfig
from kpred.shapes import read_scan
from kpred.studio.editable import structure_model
from kpred.studio.room import RoomSession
from kpred.studio.room_opening import RoomFiles, RoomOptions, open_room
from kpred.studio.state import State
from kpred.studio.structure_shape import StructureShape
from kpred.synthetic.generator import generate


@pytest.fixture(scope="session")
def table(tmp_path_factory: pytest.TempPathFactory) -> StructureShape:
    """A table of four legs and a thin top, as it is in a database; its unit box."""
    made = generate("table", 3, 11, splits=False)
    path = tmp_path_factory.mktemp("table") / "table.kpred"
    build_database(path, [(str(made.model_id[2]), "table", "generator", made[2])], load_model())
    with Database.open(path) as database:
        entry = database.entry(str(made.model_id[2]))
    basis = structure_basis(entry.structure, StructureConfig())
    return StructureShape(structure_model(entry, basis), affine_solution(basis, np.ones(3), np.zeros(3)))


@pytest.fixture(scope="session")
def start() -> State:
    """The bundled scan, fitted; shared by all sessions, since states never change."""
    return State.of(read_scan(sample_scan()), Context.load(None, None, None), FitOptions())


@pytest.fixture(scope="session")
def room_files(tmp_path_factory: pytest.TempPathFactory) -> RoomFiles:
    """A chair and a table on a floor, z up, and the numbers of their points."""
    folder, rng = tmp_path_factory.mktemp("room"), np.random.default_rng(0)
    points, numbers = [np.column_stack([rng.uniform(-1, 4, (500, 2)), np.zeros(500)])], [np.full(500, -1)]
    for number, (category, place) in enumerate({"chair": (0.0, 0.0), "table": (2.0, 1.5)}.items()):
        shape = generate(category, 3, seed=3)[number]
        surface = trimesh.Trimesh(shape.vertices, shape.faces, process=False)
        samples = np.asarray(trimesh.sample.sample_surface(surface, 800, seed=number)[0])
        points.append(samples[:, [2, 0, 1]] + [*place, 0.0])
        numbers.append(np.full(800, number))
    np.savetxt(folder / "room.xyz", np.concatenate(points))
    np.save(folder / "room.npy", np.concatenate(numbers))
    return RoomFiles(folder / "room.xyz", folder / "room.npy")


@pytest.fixture(scope="session")
def opened_room(room_files: RoomFiles, start: State) -> RoomSession:
    """That room, fitted; tests work on copies."""
    return open_room(room_files, start.context, RoomOptions(), None)


@pytest.fixture
def room(opened_room: RoomSession) -> RoomSession:
    return opened_room.copy()
