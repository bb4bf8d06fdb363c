"""The examples run as they stand and leave files behind."""

import runpy
import sys
from pathlib import Path

import numpy as np
import pytest
import trimesh

WRITTEN = {
    "01_fit_one_scan": ("fitted.obj", "candidate_0.obj", "candidate_2.obj"),
    "02_your_own_database": ("my_tables.kpred", "my_table_fitted.glb"),
    "03_partial_scan": ("partial_scan.xyz", "partial_fitted.obj"),
    "04_train_your_category": ("cabinet.npz", "cabinet_run/model/model.safetensors"),
    "05_evaluate": ("chair.npz", "table.json"),
    "06_depth_image": ("depth_fitted.obj", "depth_overlay.png"),
    "07_scene": ("room.ply", "boxes.json", "scene.glb"),
}
"""Files that each example writes and its text or code names."""

EXAMPLES = sorted((Path(__file__).resolve().parents[1] / "examples").glob("*.py"))


def test_all_examples_are_listed() -> None:
    assert [example.stem for example in EXAMPLES] == list(WRITTEN)


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda path: path.stem)
def test_example_runs(example: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from kpred import sample_scan

    arguments = [str(sample_scan())] if example.name.startswith("01") else []
    monkeypatch.setattr(sys, "argv", [str(example), *arguments, str(tmp_path)])
    runpy.run_path(str(example), run_name="__main__")
    for name in WRITTEN[example.stem]:
        assert (tmp_path / name).stat().st_size > 0
        if name.endswith((".obj", ".glb")):
            mesh = trimesh.load(tmp_path / name, force="mesh")
            assert len(mesh.faces) > 10 and np.isfinite(mesh.vertices).all()
