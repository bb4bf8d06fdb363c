"""Figures of a device: the fits that are timed, and the steps of training, run on the CPU with little of everything."""

from dataclasses import replace

import torch
from device_rates import Sizes, fit_rates, record_of, training_step
from traffic import Peaks

from kpred.nn import STAGES, ModelConfig
from kpred.synthetic.generator import generate
from kpred.training.config import StageConfig, TrainConfig
from kpred.training.data import prepare
from kpred.training.run import new_network

CPU = torch.device("cpu")
SIZES = Sizes(batch=3, models=4, top_k=2, shapes=4, repeats=1, matrix=64, points=256)


def test_fits_are_timed_and_counted() -> None:
    most = Peaks(1e12, 1e12, 1e12)
    rates = list(fit_rates(CPU, SIZES, most))
    assert len(rates) == 2
    for rate in rates:
        assert rate.rate == 3 / rate.seconds > 0
        assert rate.cost.products > 0
        assert 0 < rate.arithmetic < 1
        assert "batch 3, 4 models, top 2" in rate.name
    assert rates[1].cost.operations > rates[0].cost.operations
    record = record_of(CPU, SIZES, most, rates)
    assert record["device"] == "cpu"
    assert [figure["each"] for figure in record["figures"]] == ["fits", "fits"]


def test_a_step_of_each_stage_learns_its_own_parts() -> None:
    stage_config = StageConfig(batch=2)
    config = TrainConfig(
        deformation=stage_config, retrieval=stage_config, partial=stage_config, points=96, keypoint_points=64
    )
    network = new_network(ModelConfig(category="table", width=16, token_size=8, region_points=16, stages=1), 0)
    data = prepare([generate("table", 4, seed=1, splits=False)], network, config.points, 0)
    for stage, parts in STAGES.items():
        step, batch = training_step(network, data, replace(config, warmup=0), stage, CPU)
        before = {name: value.clone() for name, value in network.state_dict().items()}
        step()
        changed = {
            name.partition(".")[0] for name, value in network.state_dict().items() if (value != before[name]).any()
        }
        assert batch == 2
        assert changed
        assert changed <= set(parts)
