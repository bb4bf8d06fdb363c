"""Weights on disk: round trip in half precision, and one sentence for every broken folder."""

import json
import os
import shutil
from pathlib import Path

import pytest
import torch
from safetensors.torch import save_file

from kpred.errors import ModelError, OutputError
from kpred.nn import KPRed, Model, load_model, load_network, save_network
from kpred.nn.config import SHARED, preset
from kpred.nn.loading import BUNDLED
from kpred.nn.model import network_of
from kpred.nn.weights import CONFIG_FILE, WEIGHTS_FILE


@pytest.fixture
def saved(small, tmp_path: Path) -> tuple[KPRed, Path]:
    network = small(category="table")
    save_network(network, tmp_path / "weights")
    return network, tmp_path / "weights"


@pytest.mark.parametrize("half", [True, False])
def test_round_trip(small, tmp_path: Path, clouds, half: bool) -> None:
    network = small()
    save_network(network, tmp_path / "a", half=half)
    loaded = load_network(tmp_path / "a")
    assert loaded.config == network.config
    assert loaded.fingerprint() == network.fingerprint()
    assert not loaded.training
    assert not any(p.requires_grad for p in loaded.parameters())
    assert all(p.dtype == torch.float32 for p in loaded.parameters())
    tolerance = 5e-3 if half else 0
    torch.testing.assert_close(loaded.keypoints(clouds), network.keypoints(clouds), rtol=0, atol=tolerance)
    assert sorted(os.listdir(tmp_path / "a")) == [CONFIG_FILE, WEIGHTS_FILE], "something temporary was left"
    # A second trip changes nothing any more.
    save_network(loaded, tmp_path / "b", half=half)
    again = load_network(tmp_path / "b")
    assert all(torch.equal(x, y) for x, y in zip(loaded.parameters(), again.parameters(), strict=True))


def test_half_precision_halves_the_file(small, tmp_path: Path) -> None:
    network = small()
    sizes = []
    for half in (True, False):
        save_network(network, tmp_path, half=half)
        sizes.append((tmp_path / WEIGHTS_FILE).stat().st_size)
    count = sum(p.numel() for p in network.parameters())
    assert sizes[0] < 2 * count + 20_000
    assert sizes[1] - sizes[0] == pytest.approx(2 * count, abs=2000)


def test_one_folder_or_one_a_category(saved, small, tmp_path: Path) -> None:
    network, folder = saved
    alone = load_model(folder)
    assert alone.categories == ("table",)
    assert alone["table"].fingerprint() == network.fingerprint()
    save_network(small(category="chair", seed=1), tmp_path / "all" / "chair")
    save_network(network, tmp_path / "all" / "table")
    both = load_model(tmp_path / "all")
    assert isinstance(both, Model)
    assert both.categories == ("chair", "table")
    assert len(both) == 2 and list(both) == ["chair", "table"]
    assert both["table"].fingerprint() == network.fingerprint() != both["chair"].fingerprint()
    with pytest.raises(ModelError, match="no category 'sofa'; it knows chair, table"):
        both["sofa"]


def test_a_shared_network_serves_the_categories_without_one(saved, small, tmp_path: Path) -> None:
    network, folder = saved
    shared = small(category=SHARED, seed=1)
    save_network(shared, tmp_path / "all" / SHARED)
    save_network(network, tmp_path / "all" / "table")
    model = load_model(tmp_path / "all")
    assert model.categories == ("table",) and list(model) == [SHARED, "table"]
    assert "sofa" in model and model["sofa"].fingerprint() == shared.fingerprint()
    assert model["table"].fingerprint() == network.fingerprint()
    assert network_of(load_model(folder).networks, "sofa") is None
    assert load_model(tmp_path / "all" / SHARED)["lamp"].fingerprint() == shared.fingerprint()


def _break(folder: Path, how: str, small) -> None:
    config, weights = folder / CONFIG_FILE, folder / WEIGHTS_FILE
    if how == "no weights":
        weights.unlink()
    elif how == "no config":
        config.unlink()
    elif how == "weights cut":
        weights.write_bytes(weights.read_bytes()[: weights.stat().st_size // 2])
    elif how == "weights cut in the header":
        weights.write_bytes(weights.read_bytes()[:100])
    elif how == "weights empty":
        weights.write_bytes(b"")
    elif how == "weights foreign":
        weights.write_text("this is not a safetensors file at all, but a text of some length\n" * 50)
    elif how == "weights of another network":
        save_file({"layer.weight": torch.zeros(3, 3)}, weights)
    elif how == "weights of another width":
        save_network(small(width=32, category="table"), folder / "other")
        os.replace(folder / "other" / WEIGHTS_FILE, weights)
    elif how == "config cut":
        config.write_text(config.read_text()[:40])
    elif how == "config binary":
        config.write_bytes(b"\x80\xff\x00\x01")
    elif how == "config a list":
        config.write_text("[1, 2]")
    elif how == "config null":
        config.write_text("null")
    elif how == "config of wrong types":
        config.write_text(json.dumps({"width": "wide"}))
    elif how == "config newer":
        config.write_text(json.dumps({**json.loads(config.read_text()), "future": 1}))
    elif how == "config impossible":
        config.write_text(json.dumps({"keypoints": 0}))


@pytest.mark.parametrize(
    ("how", "message"),
    [
        ("no weights", f"{WEIGHTS_FILE} is missing"),
        ("no config", f"{CONFIG_FILE} is missing"),
        ("weights cut", f"{WEIGHTS_FILE} is truncated"),
        ("weights cut in the header", f"{WEIGHTS_FILE} is truncated"),
        ("weights empty", f"{WEIGHTS_FILE} is truncated"),
        ("weights foreign", "no safetensors file"),
        ("weights of another network", "do not fit"),
        ("weights of another width", "do not fit"),
        ("config cut", "not a kpred model config"),
        ("config binary", "not a kpred model config"),
        ("config a list", "not a kpred model config"),
        ("config null", "not a kpred model config"),
        ("config of wrong types", "width must be of type int"),
        ("config newer", "unknown settings.*future"),
        ("config impossible", "keypoints must be at least 1"),
    ],
)
def test_a_broken_folder_gets_one_sentence_that_names_it(saved, small, how: str, message: str) -> None:
    _, folder = saved
    _break(folder, how, small)
    with pytest.raises(ModelError, match=message) as caught:
        load_network(folder)
    assert str(folder) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_places_without_a_model(tmp_path: Path) -> None:
    with pytest.raises(ModelError, match=f"No weights in {tmp_path}"):
        load_model(tmp_path)
    with pytest.raises(ModelError, match="no model folder no_such_folder"):
        load_model("no_such_folder")
    with pytest.raises(ModelError, match="no model folder"):
        load_model(tmp_path / "missing")
    (tmp_path / "file").write_text("")
    with pytest.raises(ModelError, match="file is a file; give the folder"):
        load_model(tmp_path / "file")


def test_only_an_address_of_the_hub_reaches_the_hub(monkeypatch: pytest.MonkeyPatch, tmp_path: Path, saved) -> None:
    import huggingface_hub

    asked: list[tuple[str, str]] = []

    def fetch(repository: str, revision: str, **_options: object) -> str:
        asked.append((repository, revision))
        return str(saved[1])

    monkeypatch.setattr(huggingface_hub, "snapshot_download", fetch)
    monkeypatch.chdir(tmp_path)
    for mistyped in ("runs/chiar", "someone/weights", "someone/weights@main", "hf:/someone/weights@main"):
        with pytest.raises(ModelError, match=f"no model folder {mistyped}"):
            load_model(mistyped)
    for unfinished in ("hf://someone/weights", "hf://weights@main", "hf://a/b@", "hf://a/b/c@main", "hf://a/b@../../x"):
        with pytest.raises(ModelError, match="hf://owner/name@revision"):
            load_model(unfinished)
    assert asked == []
    assert load_model("hf://someone/weights@v1.0").categories == ("table",)
    assert asked == [("someone/weights", "v1.0")]


def test_the_hub_out_of_reach_is_a_model_error(monkeypatch: pytest.MonkeyPatch) -> None:
    import huggingface_hub

    def refuse(*_args: object, **_options: object) -> str:
        raise ConnectionError("no route")

    monkeypatch.setattr(huggingface_hub, "snapshot_download", refuse)
    with pytest.raises(ModelError, match="someone/weights@main.*Hub"):
        load_model("hf://someone/weights@main")


def test_weights_that_were_fetched_before_need_no_network(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, saved
) -> None:
    # The layout in which huggingface_hub keeps what it has fetched.
    commit = "0" * 40
    repository = tmp_path / "models--someone--weights"
    shutil.copytree(saved[1], repository / "snapshots" / commit)
    (repository / "refs").mkdir()
    (repository / "refs" / "v1.0").write_text(commit)
    from huggingface_hub import constants

    monkeypatch.setattr(constants, "HF_HUB_CACHE", str(tmp_path))
    monkeypatch.setattr(constants, "HF_HUB_OFFLINE", True)
    for revision in ("v1.0", commit):
        assert load_model(f"hf://someone/weights@{revision}").name == f"hf://someone/weights@{revision}"
    with pytest.raises(ModelError, match="someone/weights@v2.0.*Hub"):
        load_model("hf://someone/weights@v2.0")


@pytest.mark.parametrize("value", [float("nan"), float("inf")])
def test_weights_that_are_not_finite_are_refused_by_name(saved, value: float) -> None:
    network, folder = saved
    network.keypoint_predictor.wide.weight.data[3, 4] = value
    save_network(network, folder)
    with pytest.raises(ModelError, match="keypoint_predictor.wide.weight.*not finite") as caught:
        load_network(folder)
    assert str(folder / WEIGHTS_FILE) in str(caught.value)


@pytest.mark.parametrize(
    "sizes",
    [
        {"width": 2_000_000, "heads": 1},
        {"keypoints": 10**12},
        {"token_size": 10**9},
        {"stages": 10**9},
        {"partial_blocks": 10**7},
        {"cage_subdivisions": 40},
        {"region_points": 10**9},
    ],
    ids=str,
)
def test_sizes_that_the_weights_do_not_have_are_refused_before_memory_is_taken(
    saved, sizes: dict[str, int], monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = saved[1]
    config = json.loads((folder / CONFIG_FILE).read_text())
    (folder / CONFIG_FILE).write_text(json.dumps({**config, **sizes}))
    built: list[str] = []
    monkeypatch.setattr(KPRed, "__init__", lambda *_: built.append("built"))
    with pytest.raises(ModelError, match=str(folder)):
        load_network(folder)
    assert built == []


@pytest.mark.parametrize(("mask", "mode"), [(0o077, 0o600), (0o022, 0o644), (0o002, 0o664)])
def test_weights_have_the_mode_that_the_umask_asks_for(small, tmp_path: Path, mask: int, mode: int) -> None:
    before = os.umask(mask)
    try:
        save_network(small(), tmp_path / "weights")
    finally:
        os.umask(before)
    assert {file.stat().st_mode & 0o777 for file in (tmp_path / "weights").iterdir()} == {mode}


def test_a_failed_write_leaves_the_old_weights(saved, small, monkeypatch: pytest.MonkeyPatch) -> None:
    network, folder = saved

    def full(*_args: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("kpred.nn.weights.save_file", full)
    with pytest.raises(OutputError, match="No space left on device"):
        save_network(small(category="table", seed=5), folder)
    assert load_network(folder).fingerprint() == network.fingerprint()
    assert sorted(os.listdir(folder)) == [CONFIG_FILE, WEIGHTS_FILE]


def test_a_folder_that_cannot_be_made(small, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError, match="cannot be written"):
        save_network(small(), tmp_path / "file" / "weights")


def test_a_model_whose_package_is_missing_names_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(BUNDLED, "kp-red", "no_such_package")
    with pytest.raises(ModelError, match="pip install ./paper"):
        load_model("kp-red")


def test_models_are_known_by_name() -> None:
    pytest.importorskip("kpred_paper", reason="the paper's weights are a package of their own: pip install ./paper")
    own, paper = load_model("kp-red-plus"), load_model("kp-red")
    assert sorted(own.categories) == sorted(paper) == ["cabinet", "chair", "table"]
    assert own["chair"].fingerprint() == load_model()["chair"].fingerprint()
    for category in paper:
        assert paper[category].config == preset("kp-red", category)
        assert own[category].config == preset("kp-red-plus", category)
