"""The recognizer: what its answers do not depend on, how far it corrects, and that it comes back from its folder."""

import json
from pathlib import Path

import pytest
import torch

from kpred.errors import ConfigError, ModelError
from kpred.nn import Recognizer, RecognizerConfig, load_model, load_recognizer, save_network, save_recognizer
from kpred.nn.calibration import Calibration, save_calibration
from kpred.nn.recognizer import MAX_YAW_CORRECTION, robust_unit_box

CONFIG = RecognizerConfig(("chair", "table"), width=16, blocks=1)


@pytest.fixture
def recognizer(seed: int) -> Recognizer:
    network = Recognizer(CONFIG)
    for parameter in network.parameters():
        parameter.data += 0.05 * torch.randn_like(parameter)
    return network.eval()


def test_answers_for_every_category_and_none(recognizer: Recognizer, clouds: torch.Tensor) -> None:
    logits, turn = recognizer(clouds)
    assert logits.shape == (3, 3) and turn.shape == (3,)
    assert not torch.allclose(logits[0], logits[1])


def test_answers_do_not_depend_on_order_place_and_unit(recognizer: Recognizer, clouds: torch.Tensor) -> None:
    wanted = recognizer(clouds)
    order = torch.randperm(clouds.shape[1])
    for other in (clouds[:, order], clouds * 1000.0, clouds + torch.tensor([3.0, -2.0, 5.0])):
        for one, two in zip(wanted, recognizer(other), strict=True):
            assert torch.allclose(one, two, atol=1e-4)


def test_the_correction_of_a_turn_is_bounded(recognizer: Recognizer, clouds: torch.Tensor) -> None:
    recognizer.output.bias.data[-1] = 1000.0
    assert torch.allclose(recognizer(clouds)[1], torch.full((3,), MAX_YAW_CORRECTION))


def test_a_few_strays_do_not_move_the_box(clouds: torch.Tensor) -> None:
    boxed = robust_unit_box(clouds)
    strays = clouds.clone()
    strays[:, :4] = 50.0
    assert (robust_unit_box(strays)[:, 4:] - boxed[:, 4:]).abs().max() < 0.1


def test_config_round_trip_and_refusals() -> None:
    assert RecognizerConfig.from_dict(json.loads(json.dumps(CONFIG.to_dict()))) == CONFIG
    with pytest.raises(ConfigError, match="no_such"):
        RecognizerConfig.from_dict({**CONFIG.to_dict(), "no_such": 1})
    for broken in ({"width": 0}, {"blocks": -1}, {"width": "wide"}):
        with pytest.raises(ConfigError):
            RecognizerConfig.from_dict({**CONFIG.to_dict(), **broken})


def test_it_comes_back_from_beside_the_categories(
    recognizer: Recognizer, clouds: torch.Tensor, tmp_path: Path, small
) -> None:
    for category in CONFIG.categories:
        save_network(small(category=category), tmp_path / category)
    assert load_model(tmp_path).recognizer is None
    save_recognizer(recognizer, tmp_path / "recognizer")
    model = load_model(tmp_path)
    assert model.categories == CONFIG.categories and model.recognizer is not None
    for one, two in zip(recognizer(clouds), model.recognizer(clouds), strict=True):
        assert torch.allclose(one, two, atol=0.02)  # weights are kept in half precision
    assert model.recognizer.config == CONFIG


def test_the_shared_recognizer_takes_over_where_the_other_does_not_know_all(
    recognizer: Recognizer, tmp_path: Path, small
) -> None:
    save_network(small(category="chair"), tmp_path / "chair")
    save_recognizer(recognizer, tmp_path / "recognizer")
    save_recognizer(Recognizer(RecognizerConfig(("chair", "lamp", "table"), width=16)), tmp_path / "recognizer_any")
    own, shared = (Calibration(("constant", "odds"), (number, 0.5), (number,), {}) for number in (1.0, 2.0))
    save_calibration(own, tmp_path)
    save_calibration(shared, tmp_path / "recognizer_any")
    model = load_model(tmp_path)
    assert model.categories == ("chair",), "recognizers are no networks of a category"
    for asked, found, calibration in (
        (("chair", "table"), model.recognizer, own),
        (("chair", "lamp"), model.shared_recognizer, shared),
        (("lamp",), model.shared_recognizer, shared),
        (("chair", "spaceship"), None, own),
    ):
        assert model.recognizer_of(asked) is found
        assert model.calibration_of(asked) == calibration
    assert set(model.scan_networks) == {"recognizer", "recognizer_any"}


def test_a_damaged_folder_is_named(recognizer: Recognizer, tmp_path: Path) -> None:
    save_recognizer(recognizer, tmp_path)
    weights = tmp_path / "model.safetensors"
    weights.write_bytes(weights.read_bytes()[:200])
    with pytest.raises(ModelError, match=r"model\.safetensors"):
        load_recognizer(tmp_path)


def test_a_second_opinion_is_averaged_and_comes_back_beside_the_first(
    recognizer: Recognizer, clouds: torch.Tensor, tmp_path: Path
) -> None:
    other = Recognizer(CONFIG).eval()
    alone = recognizer.predict_ensemble(clouds)
    assert all(torch.equal(one, two) for one, two in zip(alone, recognizer(clouds), strict=True))
    recognizer.second = other
    logits, turn = recognizer.predict_ensemble(clouds)
    pair = (recognizer(clouds), other(clouds))
    assert torch.allclose(logits, sum(one.log_softmax(1) for one, _ in pair) / 2, atol=1e-6)
    assert torch.allclose(turn, sum(one for _, one in pair) / 2, atol=1e-6)
    save_recognizer(recognizer, tmp_path)
    assert load_recognizer(tmp_path).second is None
    save_recognizer(other, tmp_path / "second")
    both = load_recognizer(tmp_path)
    for one, two in zip(both.predict_ensemble(clouds), (logits, turn), strict=True):
        assert torch.allclose(one, two, atol=0.02)
    save_recognizer(Recognizer(RecognizerConfig(("table",), width=16, blocks=1)), tmp_path / "second")
    with pytest.raises(ModelError, match="other categories"):
        load_recognizer(tmp_path)
