"""What `kpred database check` doubts: turned fronts, other units, twins, no licence; and nothing of good models."""

from pathlib import Path

import numpy as np

from kpred.database import Database, build_database
from kpred.database.doubts import check_models
from kpred.nn import load_model
from kpred.shapes.mesh import Mesh
from kpred.synthetic.generator import generate

QUARTER = np.array([[0.0, 0, 1], [0, 1, 0], [-1, 0, 0]])


def test_each_fault_is_named_and_good_models_are_not_doubted(tmp_path: Path) -> None:
    pack, model = generate("chair", 2, 44, splits=False), load_model()
    good, other = pack[0], pack[1]
    shapes = [
        ("good", "chair", "", good),
        ("inches", "chair", "", Mesh(other.vertices * 39.37, other.faces)),
        ("same", "chair", "", other),
        ("turned", "chair", "", Mesh((other.vertices @ QUARTER.T).astype(np.float32), other.faces)),
    ]
    build_database(tmp_path / "a.kpred", shapes, model)
    with Database.open(tmp_path / "a.kpred", read_only=True) as database:
        found = {(doubt.model_id, doubt.kind): doubt.sentence for doubt in check_models(database, model.recognizer)}
    assert {key for key in found if key[1] != "licence"} == {("inches", "size"), ("same", "twice"), ("turned", "front")}
    assert {name for name, kind in found if kind == "licence"} == {"good", "inches", "same", "turned"}
    assert "seems to be x;" in found["turned", "front"]
    assert "inches" in found["same", "twice"]
