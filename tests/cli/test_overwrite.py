"""Files beside a result: those that kpred did not make are not replaced."""

import json
import os
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from kpred.cli.fit_files import check_foreign, check_output
from kpred.cli.output import printable
from kpred.errors import OutputError


def test_foreign_files_beside_the_mesh_stay(tmp_path: Path) -> None:
    mesh, scan = tmp_path / "chair.obj", tmp_path / "scan.ply"
    scan.write_text("scan")
    check_output(mesh, scan)
    mesh.write_text("an old mesh, which was named")
    check_output(mesh, scan)
    for name in ("chair.png", "chair.json"):
        (tmp_path / name).write_text("my own")
        with pytest.raises(OutputError, match=rf"{name}: it is there, and kpred did not make it; give --overwrite"):
            check_output(mesh, scan)
        check_output(mesh, scan, overwrite=True)
        (tmp_path / name).unlink()
    (tmp_path / "chair.png").write_text("my own")
    check_output(mesh, scan, picture=False)
    (tmp_path / "chair.json").write_text(json.dumps({"kpred": "0.0.1"}))
    check_output(mesh, scan)


@pytest.mark.parametrize("content", ["[1]", "{}", "{", "[" * 100_000])
def test_other_json_is_no_record(tmp_path: Path, content: str) -> None:
    (tmp_path / "a.json").write_text(content)
    with pytest.raises(OutputError, match=r"a\.json: it is there"):
        check_foreign(tmp_path / "a.json", [tmp_path / "a.json"])


def test_fit_refuses_before_it_works(files: Path, tmp_path: Path, refusal: Callable[..., str]) -> None:
    (tmp_path / "out.png").write_text("my own")
    said = refusal("fit", files / "scan.ply", "-o", tmp_path / "out.obj", "--model", "no such model")
    assert "out.png: it is there" in said
    assert (tmp_path / "out.png").read_text() == "my own" and len(list(tmp_path.iterdir())) == 1


def test_far_away_stl_is_refused_before_it_works(tmp_path: Path, refusal: Callable[..., str]) -> None:
    cloud = np.random.default_rng(0).normal(size=(500, 3)) + [694386.2, 5155487.5, 381.0]
    np.save(tmp_path / "utm.npy", cloud)
    said = refusal("fit", tmp_path / "utm.npy", "-o", tmp_path / "out.stl", "--model", "no such model")
    assert "too coarse; use .ply, .obj or .glb" in said


def test_characters_that_steer_a_terminal_are_shown_as_text() -> None:
    assert printable("chair\x1b[31m\x07 Stühle\r") == "chair\\x1b[31m\\x07 Stühle\\r"


def test_new_files_honour_the_umask(tmp_path: Path) -> None:
    from kpred.shapes.mesh import Mesh
    from kpred.shapes.mesh_output import write_mesh

    before = os.umask(0o077)
    try:
        write_mesh(tmp_path / "a.ply", Mesh(np.eye(3), np.array([[0, 1, 2]])))
    finally:
        os.umask(before)
    assert (tmp_path / "a.ply").stat().st_mode & 0o777 == 0o600
