"""Results named by annotated models: they fill the results' boxes, and the nearest proportions win."""

import json
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from kpred.errors import ScanError
from kpred.scenes.scan2cad import AlignedModel, Alignment
from kpred.scenes.scan2cad_pool import read_pool, with_pool_models

CHAIR, TABLE = "03001627", "04379243"
CENTER = np.array([0.0, -0.1, 0.02])


def model(id_cad: str, half_size: list[float], catid: str = CHAIR) -> AlignedModel:
    return AlignedModel(id_cad, "chair", catid, id_cad, np.eye(4), half_size=np.array(half_size), center=CENTER)


def alignment() -> Alignment:
    quaternion = Rotation.from_euler("z", 40, degrees=True).as_quat()[[3, 0, 1, 2]]
    return Alignment(
        CHAIR, "own", np.array([1.0, 2.0, 0.5]), quaternion, np.full(3, 1.2), np.array([0.2, 0.4, 0.25]), name="chair_1"
    )


def test_the_models_box_becomes_the_results_box() -> None:
    (found,) = with_pool_models([alignment()], [model("pool", [0.3, 0.3, 0.2])])
    assert (found.catid_cad, found.id_cad, found.name) == (CHAIR, "pool", "chair_1")
    signs = np.stack(np.meshgrid([-1, 1], [-1, 1], [-1, 1]), axis=-1).reshape(-1, 3)
    own = signs * alignment().half_size @ alignment().matrix()[:3, :3].T + alignment().translation
    corners = signs * [0.3, 0.3, 0.2] + CENTER
    np.testing.assert_allclose(corners @ found.matrix()[:3, :3].T + found.matrix()[:3, 3], own, atol=1e-9)


def test_of_a_category_the_nearest_proportions_win_and_others_have_none() -> None:
    pool = [model("flat", [0.4, 0.1, 0.4]), model("alike", [0.11, 0.2, 0.12]), model("table", [0.2, 0.4, 0.25], TABLE)]
    (found,) = with_pool_models([alignment()], pool)
    assert found.id_cad == "alike"
    assert with_pool_models([alignment()], pool[2:]) == []


def test_the_pool_is_read_from_the_annotation_of_the_scan(tmp_path: Path) -> None:
    trs = {"translation": [0, 0, 0], "rotation": [1, 0, 0, 0], "scale": [1, 1, 1]}
    box = {"bbox": [0.3, 0.3, 0.2], "center": [0, 0, 0]}
    entry = {"trs": trs, "catid_cad": CHAIR, "id_cad": "a", "sym": "__SYM_NONE"}
    scene = {
        "id_scan": "scene0001_00",
        "trs": trs,
        "aligned_models": [entry | box, entry | box, entry | {"id_cad": "b"}],
    }
    file = tmp_path / "full_annotations.json"
    file.write_text(json.dumps([scene]))
    assert [one.id_cad for one in read_pool(file, "scene0001_00")] == ["a"]
    with pytest.raises(ScanError, match="scene0002_00"):
        read_pool(file, "scene0002_00")
