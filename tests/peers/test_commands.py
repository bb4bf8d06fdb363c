"""`kpred train peer` and `kpred evaluate peers`: trained, measured, written, refused; and the methods' own laws."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import torch

from kpred.cli.main import FAILED, OK, USAGE, main
from kpred.evaluation.methods.method import Query
from kpred.evaluation.methods.sources import Sources
from kpred.fitting import RefineConfig
from kpred.peers.methods.cage_peers import KeypointDeformerMethod, NeuralCagesMethod
from kpred.peers.methods.flow_peer import Descent, ShapeFlowMethod
from kpred.peers.methods.peers import peer_method
from kpred.peers.networks import PEERS, load_peers
from kpred.shapes.pack import MeshPack
from kpred.synthetic.generator import generate

SHORT = ["--optimisation.steps", "3", "--optimisation.batch", "2", "--points", "96"]
NAMES = {"keypoint-deformer": "kd", "neural-cages": "nc", "uy2021": "uy", "u-red": "ur", "shapeflow": "sf"}


OVER = ShapeFlowMethod.over


@pytest.fixture(autouse=True)
def short_search(monkeypatch: pytest.MonkeyPatch) -> None:
    """ShapeFlow fits a target for a moment only."""
    short = Descent(points=64, steps=3, tuning_steps=2)
    monkeypatch.setattr(ShapeFlowMethod, "over", lambda method, sources: OVER(replace(method, descent=short), sources))


@pytest.fixture(scope="module")
def pack(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Eight tables: five sources, one to train on, two targets."""
    tables = generate("table", 8, seed=4, splits=False)
    splits = ["source"] * 5 + ["train"] + ["val"] * 2
    file = tmp_path_factory.mktemp("packs") / "table.npz"
    MeshPack.from_meshes(list(tables), list(tables.model_id), splits, "table").save(file)
    return file


@pytest.fixture(scope="module")
def runs(pack: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("runs")
    for peer in PEERS:
        assert main(["train", "peer", peer, str(pack), "-o", str(folder / peer / "table"), *SHORT]) == OK
    return folder


def test_peers_are_measured_beside_the_baselines(
    pack: Path, runs: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    methods = [word for peer, name in NAMES.items() for word in ("--method", f"{name}={runs / peer / 'table'}")]
    out = tmp_path / "rows.json"
    line = ["evaluate", "peers", str(pack), *methods, "--refined-peers", "--top-k", "1", "4", "-o", str(out), "--json"]
    assert main(line) == OK
    said = json.loads(capsys.readouterr().out)
    written = json.loads(out.read_text())
    assert said == written
    found = {(row["model"], row["method"], row["top_k"]): row for row in said["rows"]}
    rows = {("", "no_learning"), ("kd", "refined"), *((name, "feed_forward") for name in NAMES.values())}
    alone = {("", "undeformed_nearest", None), ("", "sampling_floor", None)}
    assert set(found) == alone | {(*row, k) for row in rows for k in (1, 4)}
    for row in rows:
        assert found[(*row, 4)]["value"] <= found[(*row, 1)]["value"]
        assert found[(*row, 4)]["n"] == 2
    assert found["kd", "refined", 4]["value"] < found["kd", "feed_forward", 4]["value"]
    assert len(written["targets"]) == 2
    assert said["header"]["models"]["uy"]["training"][0]["shapes"] == {"sources": 5, "targets": 6}


@pytest.fixture(scope="module")
def sources(pack: Path) -> Sources:
    return Sources.of_pack(MeshPack.load(pack), str(pack), 0, pytest.fail)


@pytest.mark.parametrize("peer", list(PEERS))
@pytest.mark.parametrize("partial", [False, True])
def test_what_is_retrieved_comes_in_order(peer: str, partial: bool, runs: Path, sources: Sources) -> None:
    method = peer_method("name", runs / peer)
    target = sources.points[2]
    target = target[target[:, 0] > 0] if partial else target
    with torch.inference_mode():
        searcher = method.over(sources)
        found = searcher.deform(target, 3, partial)
        alone = searcher.deform(target, 1, partial)
    assert len(set(found.model_ids)) == 3
    assert alone.model_ids == found.model_ids[:1]
    torch.testing.assert_close(alone.points, found.points[:1], atol=1e-5, rtol=1e-4)
    assert found.points.shape == (3, *sources.points[2].shape)
    assert method.provenance["training"][0]["peer"] == peer


def test_a_target_that_is_a_source_is_nearest_to_itself(runs: Path, sources: Sources) -> None:
    target = sources.points[2]
    for peer, kind in (("keypoint-deformer", KeypointDeformerMethod), ("neural-cages", NeuralCagesMethod)):
        with torch.inference_mode():
            found = kind(peer, load_peers(runs / peer)).over(sources).deform(target, 1, False)
        assert found.model_ids == sources.model_ids[2:3]
        if kind is KeypointDeformerMethod:  # its own keypoints move nothing
            torch.testing.assert_close(found.points[0], target, atol=1e-5, rtol=0)


def test_refinement_needs_no_peer_of_its_own(runs: Path, sources: Sources) -> None:
    networks = load_peers(runs / "keypoint-deformer")
    target = 0.9 * sources.points[1] + 0.01
    with torch.inference_mode():
        method = KeypointDeformerMethod("kd", networks, refinement=RefineConfig())
        plain, refined = method.over(sources).predict(Query("target", target, False, (1,)))
    assert (plain.method, refined.method) == ("feed_forward", "refined")
    assert refined.model_id == plain.model_id
    assert refined.error is not None and plain.error is not None
    assert refined.error < plain.error


@pytest.mark.parametrize(
    ("words", "code", "sentence"),
    [
        (["train", "peer", "uy2021"], USAGE, "no pack was named"),
        (["train", "peer", "uy2022", "{pack}"], USAGE, "did you mean `kpred train peer uy2021`?"),
        (["train", "peer", "uy2021", "{pack}", "--device", "cuda:99"], FAILED, "is not there or unknown"),
        (["evaluate", "peers"], USAGE, "no pack was named"),
        (["evaluate", "peers", "{pack}", "--method", "uy"], USAGE, "--method must be NAME=PATH"),
        (["evaluate", "peers", "{pack}", "--method", "uy={new}"], FAILED, "No weights in"),
        (["evaluate", "peers", "{other}", "--method", "uy={runs}/uy2021"], FAILED, "were not in the training"),
        (
            ["evaluate", "peers", "{chair}", "--method", "kd={runs}/keypoint-deformer"],
            FAILED,
            "knows no category 'chair'",
        ),
    ],
)
def test_refusals(
    words: list[str],
    code: int,
    sentence: str,
    pack: Path,
    runs: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    places: dict[str, Any] = {"pack": pack, "runs": runs, "new": tmp_path / "new"}
    places["new"].mkdir()
    make: Callable[[str, int], MeshPack] = lambda category, seed: generate(category, 12, seed=seed)  # noqa: E731
    for name, category in (("other", "table"), ("chair", "chair")):
        places[name] = tmp_path / name / f"{category}.npz"
        places[name].parent.mkdir()
        shapes = make(category, 9)
        splits = ["source", "val"] * 6
        MeshPack.from_meshes(list(shapes), list(shapes.model_id), splits, category).save(places[name])
    assert main([word.format(**places) for word in words]) == code
    printed = capsys.readouterr()
    assert sentence in printed.err
    assert "Traceback" not in printed.err
