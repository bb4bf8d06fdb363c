"""The record of a fit follows its published schema, which knows every key."""

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import kpred
from kpred.fitting.options import FitOptions
from kpred.fitting.record import RECORD_VERSION, options_to_json
from kpred.fitting.refit import options_from_json
from kpred.json_output import json_text
from kpred.preprocessing.config import CleanConfig
from kpred.refinement.config import RefineConfig
from kpred.refinement.structure_config import StructureConfig

SCHEMA = Path(__file__).resolve().parents[2] / "docs" / "record.schema.json"


@pytest.fixture(scope="module")
def fits() -> dict[str, kpred.Fit]:
    """Fits of the sample scan by several ways of deformation."""
    steps = ("none", "structure", "free")
    return {step: kpred.fit(kpred.sample_scan(), category="chair", up="y", top_k=2, deform=step) for step in steps}


def as_written(fit: kpred.Fit) -> dict[str, Any]:
    content: dict[str, Any] = json.loads(json_text({**fit.record(), "scan": "a.ply", "mesh": "a.obj"}))
    return content


@pytest.mark.parametrize("step", ["none", "structure", "free"])
def test_records_follow_the_schema(fits: Mapping[str, kpred.Fit], step: str) -> None:
    jsonschema = pytest.importorskip("jsonschema")
    schema = json.loads(SCHEMA.read_text())
    jsonschema.Draft202012Validator.check_schema(schema)
    record = as_written(fits[step])
    jsonschema.validate(record, schema)
    assert record["record_version"] == RECORD_VERSION == schema["properties"]["record_version"]["const"]
    for broken in ({**record, "input": {}}, {**record, "more": 1}, {k: v for k, v in record.items() if k != "up"}):
        with pytest.raises(jsonschema.ValidationError):
            jsonschema.validate(broken, schema)


def test_it_names_what_the_fit_was_made_from(fits: Mapping[str, kpred.Fit]) -> None:
    record = as_written(fits["structure"])
    scan = kpred.sample_scan()
    assert record["input"]["path"] == str(scan)
    assert record["input"]["sha256"] == hashlib.sha256(scan.read_bytes()).hexdigest()
    assert record["database"]["path"] == record["weights"]["model"] == "bundled"
    assert record["versions"]["numpy"] == np.__version__
    matrix, placed = np.array(record["model_to_scan"]["matrix"]), fits["structure"].retrieved_mesh.vertices
    model = fits["structure"].placed.entry.mesh.vertices
    np.testing.assert_allclose(model @ matrix[:3, :3].T + matrix[:3, 3], placed, atol=1e-9)


def test_the_deformation_is_in_the_record(fits: Mapping[str, kpred.Fit]) -> None:
    records = {step: as_written(fit)["deformation"] for step, fit in fits.items()}
    assert np.shape(records["structure"]["structure_unknowns"])[0] == 3
    assert np.shape(records["structure"]["part_growth"])[1] == 3
    assert records["none"]["structure_unknowns"] is None and records["none"]["keypoint_displacement"] is None
    entry = fits["free"].placed.entry
    moved = entry.frame.to_unit(entry.mesh.vertices.astype(np.float64))
    moved = moved + entry.vertex_basis.astype(np.float64) @ np.array(records["free"]["keypoint_displacement"])
    np.testing.assert_allclose(fits["free"].frame.from_unit(moved), fits["free"].mesh.vertices, atol=1e-6)


def test_options_come_back_as_they_were(tmp_path: Path) -> None:
    options = FitOptions(
        top_k=3,
        deform="free",
        partial=True,
        up="-z",
        pose="identity",
        clean=CleanConfig(wall=False),
        seed=5,
        model_id="a",
        refinement=RefineConfig(reflection=0.25),
        structure=StructureConfig(contact=0.1),
        sensors=np.array([[0.1, 0.2, 0.3]]),
        floor=-1 / 3,
        unit="mm",
    )
    back = options_from_json(json.loads(json_text(options_to_json(options))), tmp_path)
    for name, value in vars(options).items():
        np.testing.assert_equal(getattr(back, name), value)
