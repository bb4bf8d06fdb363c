"""`kpred train add`: a category of one's own on top of the shared networks, and names and numbers that it refuses."""

import dataclasses
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from kpred.cli.main import main
from kpred.errors import ConfigError, PackError
from kpred.nn import load_model
from kpred.nn.loading import bundled_model_path
from kpred.shapes.pack import MeshPack
from kpred.synthetic.generator import generate
from kpred.training.adding import advice, check_name, own_splits

Run = Callable[..., Any]

SHORT = (
    "--threads",
    1,
    "--device",
    "cpu",
    *(w for s in ("deformation", "retrieval", "partial") for w in (f"--{s}.steps", 2)),
)


@pytest.fixture(scope="module")
def trees(tmp_path_factory: pytest.TempPathFactory) -> MeshPack:
    return generate("plant", 8, 3, splits=False)


def test_the_model_keeps_all_it_knew_and_gets_the_category(trees: MeshPack, tmp_path: Path, run_json: Run) -> None:
    trees.save(tmp_path / "trees.npz")
    report = run_json(
        "train", "add", "palm", tmp_path / "trees.npz", "-o", tmp_path / "run", "--limit", 1, *SHORT, "--base=bundled"
    )
    folder = tmp_path / "run" / "model"
    assert report["model"] == str(folder)
    base, added = load_model(), load_model(folder)
    assert set(added.categories) == {*base.categories, "palm"}
    assert all(added[name].fingerprint() == base[name].fingerprint() for name in (*base.categories, "any"))
    assert added["palm"].fingerprint() != base["any"].fingerprint()
    files = bundled_model_path().rglob("*")
    assert all(
        (folder / f.relative_to(bundled_model_path())).read_bytes() == f.read_bytes() for f in files if f.is_file()
    )
    assert {row["model"] for row in report["held_out"]} >= {"added", "shared"}
    assert any("few" in sentence for sentence in report["notes"])


def test_the_same_command_again_goes_on_and_ends_alike(trees: MeshPack, tmp_path: Path, run_json: Run) -> None:
    trees.save(tmp_path / "trees.npz")
    line = ("train", "add", "palm", tmp_path / "trees.npz", "-o", tmp_path / "run", "--limit", 1, *SHORT)
    first, again = run_json(*line), run_json(*line)
    assert first["held_out"] == again["held_out"]


def test_a_folder_of_meshes_is_a_pack(trees: MeshPack, tmp_path: Path, run_json: Run) -> None:
    meshes = tmp_path / "meshes"
    meshes.mkdir()
    for i in range(5):
        vertices = "".join(f"v {x} {y} {z}\n" for x, y, z in trees[i].vertices)
        faces = "".join(f"f {a + 1} {b + 1} {c + 1}\n" for a, b, c in trees[i].faces)
        (meshes / f"tree{i}.obj").write_text(vertices + faces)
    report = run_json("train", "add", "palm", meshes, "-o", tmp_path / "run", "--limit", 1, *SHORT)
    assert report["notes"][0].startswith("4 shapes are trained on, 1")


def test_a_whole_training_on_few_shapes_says_so(
    trees: MeshPack, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    trees.save(tmp_path / "trees.npz")
    line = [
        "train",
        "deformation",
        tmp_path / "trees.npz",
        "-o",
        tmp_path / "run",
        *SHORT[:4],
        "--deformation.steps",
        1,
    ]
    assert main([str(word) for word in line]) == 0
    assert "8 shapes are few to train on" in capsys.readouterr().err


def test_three_shapes_are_refused_with_the_way_out(trees: MeshPack) -> None:
    rows = [trees[i] for i in range(3)]
    few = MeshPack.from_meshes(rows, ["a", "b", "c"], ["source"] * 3, "palm")
    with pytest.raises(PackError, match=r"3 shapes are too few.*build a database"):
        own_splits(few, 0)


def test_splits_are_made_where_none_are_and_kept_where_some_are(trees: MeshPack) -> None:
    made = own_splits(trees, 0)
    assert len(made.indices("val")) == 2
    assert len(made.indices("source")) == 6
    assert np.array_equal(own_splits(trees, 0).split, made.split)
    own = dataclasses.replace(trees, split=np.array(["val"] + ["source"] * 7))
    assert np.array_equal(own_splits(own, 0).split, own.split)
    assert len(advice(dataclasses.replace(made, split=made.split))) == 2


@pytest.mark.parametrize("name", ["chair", "any", "other", "recognizer", "visibility", "../up", "", "a b"])
def test_names_that_are_taken_or_no_folders_are_refused(name: str) -> None:
    with pytest.raises(ConfigError, match="choose another name|cannot name"):
        check_name(name, load_model())


def test_a_model_without_shared_networks_cannot_be_added_to(tmp_path: Path) -> None:
    shutil.copytree(bundled_model_path() / "chair", tmp_path / "chair")
    with pytest.raises(ConfigError, match="no shared networks"):
        check_name("palm", load_model(tmp_path))
