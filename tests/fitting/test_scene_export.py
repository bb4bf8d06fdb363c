"""Scenes in formats of several objects: each object stands where its result stands, in metres."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import kpred
from kpred.errors import OutputError
from kpred.fitting.object_fit import ObjectFit
from kpred.fitting.scene_export import SCENE_EXTENSIONS, scene_export
from kpred.scenes.objects import SceneObject
from kpred.scenes.scene import Scene
from kpred.shapes.unit import LengthUnit


@pytest.fixture(scope="module")
def room() -> kpred.SceneFit:
    """Two chairs, the second 2000 mm farther along x; y up."""
    fit = kpred.fit(kpred.sample_scan(), category="chair", up="y", top_k=2, deform="none")
    items = []
    for number in range(2):
        rows = np.arange(len(fit.points))
        item = ObjectFit(SceneObject(f"chair_{number}", "chair", fit.points, rows, "y"), fit)
        moved = item.moved(np.array([2000.0 * number, 0.0, 0.0]))
        assert moved.fit is not None
        items.append(replace(moved, fit=replace(moved.fit, unit=LengthUnit("mm", "given"))))
    return kpred.SceneFit(Scene(fit.points, up="y"), tuple(items))


def test_objects_stand_apart_in_metres(room: kpred.SceneFit) -> None:
    export = scene_export(room)
    assert export.metres == 0.001 and len({one.name for one in export.objects}) == 2
    first, second = (export.body_frame(one)[:3, 3] for one in export.objects)
    np.testing.assert_allclose(second - first, [2.0, 0.0, 0.0], atol=1e-9)


def test_every_format_of_several_objects_is_written(room: kpred.SceneFit, tmp_path: Path) -> None:
    for extension in SCENE_EXTENSIONS:
        if extension in (".usd", ".usda", ".usdc", ".usdz"):
            pytest.importorskip("pxr", reason="usd-core is not installed (the extra usd)")
        if extension == ".ifc":
            pytest.importorskip("ifcopenshell", reason="ifcopenshell is not installed (the extra bim)")
        folder = tmp_path / extension[1:]
        folder.mkdir()
        files = room.save(folder / f"room{extension}")
        assert files[0] == folder / f"room{extension}"
        assert sorted(files) == sorted(folder.rglob("*.*")) and all(file.stat().st_size for file in files)


def test_formats_of_one_object_and_empty_scenes_are_refused(room: kpred.SceneFit, tmp_path: Path) -> None:
    with pytest.raises(OutputError, match="scenes are .glb"):
        room.save(tmp_path / "room.obj")
    empty = replace(room, fits=tuple(replace(item, fit=None, error="no") for item in room.fits))
    for extension in (".glb", ".urdf"):
        with pytest.raises(OutputError, match="empty"):
            empty.save(tmp_path / f"room{extension}")
    assert not list(tmp_path.iterdir())
