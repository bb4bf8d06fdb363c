"""Calibration: weights of the right signs, confidence as the regression says it, and what cannot be calibrated on."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from kpred.errors import ConfigError, ModelError, PackError
from kpred.evaluation.database_source import database_source
from kpred.evaluation.scans.calibration import (
    MIN_WEIGHT,
    SIGNS,
    WITH_ODDS,
    WITHOUT_ODDS,
    CalibrationSample,
    calibrate,
    collect_samples,
    probability,
    regression,
)
from kpred.evaluation.scans.outcome import FitSettings
from kpred.fitting.confidence import BUILT_IN, FEATURES, Evidence, confidence, explained_factor
from kpred.nn import Model


def _evidence(rng: np.random.Generator) -> Evidence:
    return Evidence(
        error=float(rng.uniform(0.01, 0.2)),
        unexplained=float(rng.uniform(0, 0.4)),
        seen=float(rng.uniform(0.2, 1)),
        category=float(rng.uniform(0.4, 1)),
        turn=float(rng.uniform(0.4, 1)),
        odds=float(rng.normal(2, 3)),
        box=float(rng.uniform(0.01, 0.2)),
        change=float(rng.uniform(0.01, 0.2)),
    )


@pytest.fixture(scope="module")
def samples() -> list[CalibrationSample]:
    """Outcomes that follow the odds and the explained fraction, and nothing else."""
    rng = np.random.default_rng(0)
    evidence = [_evidence(rng) for _ in range(800)]
    chances = [explained_factor(one.unexplained) / (1 + np.exp(2 - (one.odds or 0.0))) for one in evidence]
    return [
        CalibrationSample("chair", "views", bool(rng.random() < chance), one)
        for chance, one in zip(chances, evidence, strict=True)
    ]


def test_there_is_a_sign_for_every_feature_but_the_constant() -> None:
    assert len(SIGNS) == len(FEATURES) - 1
    evidence = _evidence(np.random.default_rng(0))
    assert len(evidence.features()) == len(FEATURES)
    assert len(dataclasses.replace(evidence, odds=None).features()) == len(FEATURES) - 1


def test_weights_have_the_signs_that_they_must_have(samples: list[CalibrationSample]) -> None:
    found, _ = calibrate(samples, {})
    for weights in (found.weights[1:], found.weights_without_odds[1:]):
        for weight, sign in zip(weights, SIGNS, strict=False):
            assert sign * weight >= MIN_WEIGHT - 1e-6
    # What decides has the largest weight, near the true one of 1.
    assert found.weights[-1] == pytest.approx(1, abs=0.3)


def test_what_is_said_is_what_happens(samples: list[CalibrationSample]) -> None:
    found, held_out = calibrate(samples, {"seed": 1})
    assert held_out[WITH_ODDS].ece < 0.08
    assert held_out[WITH_ODDS].n == 400
    auc, blind = held_out[WITH_ODDS].auc, held_out[WITHOUT_ODDS].auc
    assert auc is not None and blind is not None
    # What is explained tells something without the odds too.
    assert auc > 0.8
    assert auc > blind + 0.05
    assert found.made_from["seed"] == 1
    assert (found.made_from["samples"], found.made_from["right"]) == (800, sum(one.right for one in samples))


def test_confidence_is_that_of_the_regression(samples: list[CalibrationSample]) -> None:
    found, _ = calibrate(samples, {})
    for sample in samples[:20]:
        features = sample.evidence.features()[None]
        wanted = probability(features, np.array(found.weights))[0] * explained_factor(sample.evidence.unexplained)
        assert confidence(sample.evidence, found) == pytest.approx(wanted)
        assert confidence(sample.evidence) == confidence(sample.evidence, BUILT_IN)
    assert confidence(samples[0].evidence, found) != confidence(samples[0].evidence)


def test_a_calibration_of_other_features_is_refused(samples: list[CalibrationSample]) -> None:
    found, _ = calibrate(samples, {})
    other = dataclasses.replace(found, features=("something", *found.features[1:]))
    with pytest.raises(ModelError, match="kpred train confidence"):
        confidence(samples[0].evidence, other)


def test_what_a_factor_takes_from_confidence_is_known_to_the_weights(rng: np.random.Generator) -> None:
    features = np.column_stack([np.ones(4000), rng.uniform(-3, 3, 4000)])
    true, factor = np.array([1.0, -0.5]), rng.choice([0.3, 1.0], 4000)
    right = rng.random(4000) < probability(features, true) * factor
    np.testing.assert_allclose(regression(features, right, factor), true, atol=0.2)
    assert regression(features, right)[0] < 0.6


def test_without_a_recognizer_odds_have_no_weight(samples: list[CalibrationSample]) -> None:
    blind = [dataclasses.replace(one, evidence=dataclasses.replace(one.evidence, odds=None)) for one in samples]
    found, held_out = calibrate(blind, {})
    assert set(held_out) == {WITHOUT_ODDS}
    assert found.weights == (*found.weights_without_odds, 0.0)


def test_the_likeliest_weights_are_found(rng: np.random.Generator) -> None:
    features = np.column_stack([np.ones(4000), rng.uniform(-3, 3, 4000)])
    true = np.array([0.5, -0.5])
    right = rng.random(4000) < probability(features, true)
    np.testing.assert_allclose(regression(features, right), true, atol=0.15)


@pytest.mark.parametrize("choose", [lambda s: s[:5], lambda s: [one for one in s if one.right], lambda s: []])
def test_what_cannot_be_calibrated_on(samples: list[CalibrationSample], choose) -> None:
    with pytest.raises(ConfigError, match="both right and wrong"):
        calibrate(choose(samples), {})


def test_samples_survive_their_json(samples: list[CalibrationSample]) -> None:
    assert [CalibrationSample.from_json(one.to_json()) for one in samples[:5]] == samples[:5]


def test_samples_are_fits_of_every_shape(packs: dict[str, Path], model: Model) -> None:
    with database_source(list(packs.values()), model, None, 0, None, pytest.fail) as database:
        settings = FitSettings(model, database, 2, 0)
        seen: list[tuple[str, int, int]] = []
        told: list[str] = []
        found = collect_samples(
            [packs["chair"]], settings, limit=2, progress=lambda *step: seen.append(step), report=told.append
        )
        assert len(found) + len(told) == 2
        assert seen == [("chair: scans", 1, 2), ("chair: scans", 2, 2)]
        assert found == collect_samples([packs["chair"]], settings, limit=2)
        assert {one.category for one in found} <= {"chair"}
        with pytest.raises(PackError, match="'test'"):
            collect_samples([packs["chair"]], settings, split="test")
