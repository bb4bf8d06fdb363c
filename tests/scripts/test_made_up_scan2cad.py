"""The made-up layout is read by the same readers as the real one, and what it lacks is found by them."""

import json
from pathlib import Path

import numpy as np
import pytest
from made_up_scan2cad import CATEGORIES, write_made_up_scan2cad

from kpred.datasets.scan2cad import Scan2Cad
from kpred.errors import ConfigError, ScanError
from kpred.evaluation.scans.scenes import annotated_mesh, scan_of
from kpred.scenes.objects import objects_of
from kpred.scenes.scan2cad import read_annotations
from kpred.scenes.scene import read_scene

SCENES = 20


@pytest.fixture(scope="module")
def layout(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("made-up")


@pytest.fixture(scope="module", autouse=True)
def made(layout: Path):
    return write_made_up_scan2cad(layout, SCENES)


def test_what_is_said_to_be_there_is_there(layout: Path, made) -> None:
    annotations = read_annotations(layout / "full_annotations.json")
    assert len(annotations) == SCENES
    there, bins = 0, 0
    for annotation in annotations:
        try:
            scan_of(layout, annotation.id_scan)
        except ScanError:
            continue
        furniture = [model for model in annotation.models if model.category in CATEGORIES]
        there += sum(model.id_cad != "not-downloaded" for model in furniture)
        bins += len(annotation.models) - len(furniture)
    assert (there, bins) == (made.objects, made.others)
    assert made.objects > 2 * SCENES
    assert made.missing_scans == 2
    assert made.missing_models > 0


def test_the_check_of_a_download_finds_what_is_missing(layout: Path, made) -> None:
    issues = Scan2Cad(layout).check().issues
    assert sum(issue.what == "scan" for issue in issues) == made.missing_scans
    assert any("not-downloaded" in issue.name for issue in issues)


def test_scans_lie_on_their_models(layout: Path) -> None:
    scene = read_scene(scan_of(layout, "scene9000_00"))
    found = [item for item in objects_of(scene, layout / "full_annotations.json") if item.category in CATEGORIES]
    for item in found:
        mesh = annotated_mesh(item.annotation, layout)
        low, high = np.asarray(mesh.vertices).min(0), np.asarray(mesh.vertices).max(0)
        inside = (item.points > low - 0.03) & (item.points < high + 0.03)
        assert inside.all(1).mean() > 0.95
        assert abs(low[2]) < 1e-3  # on the floor


def test_the_same_seed_gives_the_same_layout(layout: Path, tmp_path: Path) -> None:
    write_made_up_scan2cad(tmp_path, 3, seed=0)
    again = json.loads((tmp_path / "full_annotations.json").read_text())
    assert again == json.loads((layout / "full_annotations.json").read_text())[:3]
    write_made_up_scan2cad(tmp_path / "other", 3, seed=1)
    assert json.loads((tmp_path / "other" / "full_annotations.json").read_text()) != again
    with pytest.raises(ConfigError, match="at least one scene"):
        write_made_up_scan2cad(tmp_path, 0)
