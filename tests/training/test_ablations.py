"""Ablation rows differ in their parts alone, share what they have in common, and go on where they were stopped."""

import dataclasses
import json
from pathlib import Path

import pytest
import torch
from ablation_weights import RunParts, TrainedRuns, adopt, parts_of, read_runs, write_runs

from kpred.errors import CheckpointError, ConfigError
from kpred.nn import STAGES, KPRed, ModelConfig, load_network
from kpred.shapes.pack import MeshPack
from kpred.training.ablations import (
    FULL_ROWS,
    PARTIAL_ROWS,
    ROWS,
    Ablation,
    AblationRuns,
    recorded_training,
    rows_named,
)
from kpred.training.config import StageConfig, TrainConfig

MODEL = ModelConfig(category="table", width=16, token_size=8, region_points=16)
STAGE = StageConfig(steps=3, batch=2)
TRAIN = TrainConfig(
    deformation=STAGE, retrieval=STAGE, partial=STAGE, points=96, keypoint_points=64, warmup=1, checkpoint_every=1
)

WORDS = {"with": "f", "without": "a"}


def _runs(pack: MeshPack, folder: Path, config: TrainConfig = TRAIN, report=None) -> AblationRuns:
    return AblationRuns([pack], MODEL, config, folder, "hash of the pack", report=report)


def _same(one: KPRed, other: KPRed, part: str) -> bool:
    mine, theirs = getattr(one, part).state_dict(), getattr(other, part).state_dict()
    return set(mine) == set(theirs) and all(torch.equal(mine[key], theirs[key]) for key in mine)


@pytest.fixture(scope="module")
def trained(pack: MeshPack, tmp_path_factory: pytest.TempPathFactory) -> dict[str, KPRed]:
    """All rows of a pack."""
    runs = _runs(pack, tmp_path_factory.mktemp("runs"))
    return {row.name: load_network(runs.weights(row)) for row in ROWS.values()}


def test_the_rows_are_those_of_the_paper() -> None:
    table = {row.name: (row.gsa, row.dar, row.lgf) for row in FULL_ROWS}
    assert table == {
        "a": (False, False, False),
        "b": (False, True, False),
        "c": (True, False, False),
        "d": (True, False, True),
        "e": (True, True, False),
        "f": (True, True, True),
    }
    assert [row.changed(MODEL).confidence for row in PARTIAL_ROWS] == [True, False]
    assert Ablation("f").changed(MODEL) == MODEL
    with pytest.raises(ConfigError, match="no row g; the ablations are a, b"):
        rows_named(["a", "g"])
    assert [row.name for row in rows_named(["f", "a"])] == ["a", "f"]


def test_rows_have_their_own_architecture_and_share_what_they_have_in_common(trained: dict[str, KPRed]) -> None:
    for name, network in trained.items():
        assert network.config == ROWS[name].changed(MODEL)
    for name in "bcdef":
        like = "a" if name == "b" else "c"
        for part in ("keypoint_predictor", "influence_predictor"):
            assert _same(trained[name], trained[like], part)
    assert not _same(trained["c"], trained["e"], "retrieval_encoder")
    for name in ("with-cb", "without-cb"):
        assert _same(trained[name], trained["f"], "retrieval_encoder")
        assert not _same(trained[name], trained["f"], "partial_keypoint_predictor")
    assert not _same(trained["with-cb"], trained["without-cb"], "partial_keypoint_predictor")


@pytest.mark.parametrize("stopped_in", ["deformation", "retrieval", "partial"])
def test_a_row_that_was_stopped_goes_on_to_the_same_weights(
    stopped_in: str, pack: MeshPack, trained: dict[str, KPRed], tmp_path: Path
) -> None:
    def stop(stage: str, done: int, total: int, losses: dict[str, float]) -> None:
        if stage.endswith(stopped_in) and done == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        _runs(pack, tmp_path, report=stop).weights(ROWS["with-cb"])
    again = _runs(pack, tmp_path)
    assert not again.finished(ROWS["with-cb"])
    network = load_network(again.weights(ROWS["with-cb"]))
    assert again.finished(ROWS["with-cb"])
    assert again.finished(ROWS["f"])
    for part, _ in network.named_children():
        assert _same(network, trained["with-cb"], part)


def test_what_is_finished_is_not_trained_again(pack: MeshPack, tmp_path: Path) -> None:
    _runs(pack, tmp_path).weights(ROWS["e"])

    def fail(stage: str, done: int, total: int, losses: dict[str, float]) -> None:
        assert stage.endswith("retrieval"), "keypoints and influence are there"

    runs = _runs(pack, tmp_path, report=fail)
    runs.weights(ROWS["c"])
    before = {file: file.stat().st_mtime_ns for file in tmp_path.rglob("*") if file.is_file()}
    for name in ("c", "e"):
        runs.weights(ROWS[name])
    assert {file: file.stat().st_mtime_ns for file in tmp_path.rglob("*") if file.is_file()} == before
    # Killed between the last checkpoint and the export: the weights come from the checkpoint.
    weights = tmp_path / "c" / "model" / "model.safetensors"
    content = weights.read_bytes()
    weights.unlink()
    assert not runs.finished(ROWS["c"])
    runs.weights(ROWS["c"])
    assert weights.read_bytes() == content


def test_other_settings_data_and_damage_are_refused(pack: MeshPack, tmp_path: Path) -> None:
    row = ROWS["e"]
    _runs(pack, tmp_path).weights(row)
    longer = dataclasses.replace(TRAIN, retrieval=dataclasses.replace(STAGE, steps=4))
    assert not _runs(pack, tmp_path, longer).finished(row)
    with pytest.raises(CheckpointError, match=r"other settings or data \(training.retrieval\)"):
        _runs(pack, tmp_path, longer).weights(row)
    other = AblationRuns([pack], MODEL, TRAIN, tmp_path, "another hash")
    with pytest.raises(CheckpointError, match=r"\(data\)"):
        other.weights(row)
    wider = AblationRuns([pack], dataclasses.replace(MODEL, width=32), TRAIN, tmp_path, "hash of the pack")
    with pytest.raises(CheckpointError, match=r"\(model.width\)"):
        wider.weights(row)
    for text in ("{", json.dumps([1])):
        (tmp_path / "e" / "ablation.json").write_text(text)
        with pytest.raises(CheckpointError, match=r"ablation.json is damaged"):
            _runs(pack, tmp_path).weights(row)


def _as_parts(trained: dict[str, KPRed]) -> RunParts:
    parts = {row: parts_of(trained[row], "retrieval") for row in "abcdef"}
    parts |= {f"deformation-{word}-gsa": parts_of(trained[row], "deformation") for word, row in WORDS.items()}
    return parts | {row.name: parts_of(trained[row.name], "partial") for row in PARTIAL_ROWS}


def test_rows_that_were_trained_elsewhere_are_taken_over(
    pack: MeshPack, trained: dict[str, KPRed], tmp_path: Path
) -> None:
    file = tmp_path / "trained.safetensors"
    write_runs(file, TrainedRuns(MODEL, TRAIN, "hash of the pack", None, _as_parts(trained), {"device": "elsewhere"}))
    found = read_runs(file)
    assert (found.model, found.training, found.data) == (MODEL, TRAIN, "hash of the pack")
    assert found.facts == {"device": "elsewhere"}
    runs = _runs(pack, tmp_path / "runs", found.training)
    assert adopt(runs, found.parts) == list(ROWS)
    for name, row in ROWS.items():
        assert runs.finished(row)
        network = load_network(runs.weights(row))
        for stage in ("deformation", "retrieval", *(["partial"] if row.partial else [])):
            for part in STAGES[stage]:
                assert _same(network, trained[name], part), (name, part)


def test_of_what_was_trained_elsewhere_only_whole_rows_are_taken(
    pack: MeshPack, trained: dict[str, KPRed], tmp_path: Path
) -> None:
    parts = _as_parts(trained)
    for run in ("deformation-without-gsa", "e", "without-cb"):
        del parts[run]
    runs = _runs(pack, tmp_path)
    assert adopt(runs, parts) == ["c", "d", "f", "with-cb"]
    assert not (tmp_path / "a").exists()
    assert not runs.finished(ROWS["e"])
    file = tmp_path / "trained.safetensors"
    write_runs(file, TrainedRuns(MODEL, TRAIN, "hash", None, parts, {}))
    file.write_bytes(file.read_bytes()[:-100])
    with pytest.raises(CheckpointError, match="not all of it"):
        read_runs(file)
    with pytest.raises(CheckpointError, match="no such file"):
        read_runs(tmp_path / "none.safetensors")


def test_the_settings_of_rows_are_read_back_if_they_are_all_the_same(
    pack: MeshPack, trained: dict[str, KPRed], tmp_path: Path
) -> None:
    with pytest.raises(ConfigError, match="holds no finished row"):
        recorded_training(tmp_path, FULL_ROWS)
    adopt(_runs(pack, tmp_path), _as_parts(trained))
    assert recorded_training(tmp_path, list(ROWS.values())) == (TRAIN, None)
    record = json.loads((tmp_path / "e" / "ablation.json").read_text())
    record["training"]["retrieval"]["steps"] = 4
    (tmp_path / "e" / "ablation.json").write_text(json.dumps(record))
    with pytest.raises(ConfigError, match=r"rows a and e were trained differently \(retrieval\)"):
        recorded_training(tmp_path, list(ROWS.values()))
    assert recorded_training(tmp_path, rows_named(["c", "f"])) == (TRAIN, None)
