"""A fit by a server is the same fit: every option reaches it as it reaches a local one."""

import io
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tyro

from kpred.cli.fit import FitCommand
from kpred.cli.main import USAGE, main
from kpred.cli.remote_fit import form_of, server_of
from kpred.preprocessing.config import CleanConfig
from kpred.refinement.config import RefineConfig
from kpred.refinement.structure_config import StructureConfig
from kpred.server.worker import fit_options

LINES = [
    "",
    "--up -z --unit mm --category table --top-k 3 --partial yes --floor 0.1",
    "--frame known --deform scale --model-id desk_0042",
    "--sensor 0.1 -2.5e-7 3 --pose upright --partial no --density 450.5",
    "--no-clean --no-picture",
    "--cleaning.wall False --cleaning.points 300 --cleaning.outlier-ratio 7.25",
    "--deform free --refinement.prior 0.1 --refinement.iterations 3",
    "--structure.contact 0.1 --structure.ridge 1e-9",
]


def command(line: str, *more: str) -> FitCommand:
    return tyro.cli(
        FitCommand, args=["a.ply", "-o", "dir/Stuhl.OBJ", *line.split(), *more], config=(tyro.conf.FlagCreatePairsOff,)
    )


@pytest.mark.parametrize("line", LINES)
def test_the_form_says_what_the_command_says(line: str) -> None:
    pytest.importorskip("fastapi", reason="fastapi is not installed (the extra serve)")
    from starlette.datastructures import UploadFile

    from kpred.server.form import FitForm

    given = command(line)
    fields = form_of(given, Path("dir/Stuhl.OBJ"))
    form = FitForm.model_validate({**fields, "scan": UploadFile(io.BytesIO(), filename="a.ply")})
    found = fit_options(form.options())
    assert form.mesh_name == "Stuhl.OBJ" and form.picture == given.picture and form.density == given.density
    for name in ("category", "top_k", "frame", "deform", "model_id", "up", "pose", "floor", "unit"):
        assert found[name] == getattr(given, name), name
    assert found["partial"] == {"auto": None, "yes": True, "no": False}[given.partial]
    assert found["clean"] == (given.clean if given.cleaning == CleanConfig() else given.cleaning)
    assert (found["structure"] or StructureConfig()) == given.structure
    assert (found["refinement"] or RefineConfig()) == given.refinement
    if given.sensor is None:
        assert found["sensor"] is None
    else:
        np.testing.assert_array_equal(found["sensor"], given.sensor)


def test_the_environment_names_a_server_for_fits_that_it_can_do(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("KPRED_SERVER", raising=False)
    assert server_of(command("")) is None and command("").compiles
    monkeypatch.setenv("KPRED_SERVER", "http://a")
    assert server_of(command("")) == "http://a" and not command("").compiles
    assert server_of(command("--server http://b")) == "http://b"
    for line in ("--database mine.kpred", "--model kp-red", "--pose given:pose.txt"):
        assert server_of(command(line)) is None
    monkeypatch.setenv("KPRED_SERVER", "")
    assert server_of(command("")) is None


@pytest.mark.parametrize("words", [["--model", "x"], ["--database", "y.kpred"], ["--pose", "given:a.txt"]])
def test_what_a_server_does_not_have_is_refused(words: list[str], capsys: Any, tmp_path: Path) -> None:
    assert main(["fit", "a.ply", "-o", str(tmp_path / "a.glb"), "--server", "http://127.0.0.1:9", *words]) == USAGE
    assert f"leave out {words[0]} or --server" in capsys.readouterr().err
