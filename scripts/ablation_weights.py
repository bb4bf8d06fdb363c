"""What trained ablation rows are made of, in one small file: how they travel from the machine that trained them.

Rows share parts (`kpred.training.ablations`): each run's own are kept once.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from safetensors import SafetensorError, safe_open
from safetensors.torch import save_file
from torch import Tensor

from kpred.atomic import atomic_path
from kpred.errors import CheckpointError
from kpred.nn import STAGES, KPRed, ModelConfig, save_network
from kpred.training.ablations import ROWS, AblationRuns, deformation_run
from kpred.training.config import TrainConfig
from kpred.training.run import new_network

KEY = "kpred-ablations"

RunParts = dict[str, dict[str, Tensor]]
"""Run (`deformation-with-gsa`, a row) -> weights of the parts that it trained, named as in the network."""


@dataclass(frozen=True)
class TrainedRuns:
    """Runs of one category.

    Attributes:
        model: settings that all rows share; training: of all runs, with the steps that were made.
        data: SHA-256 of the pack; source_split: whose shapes were deformed, None for all; parts: of each run.
        facts: where and how fast it was trained.
    """

    model: ModelConfig
    training: TrainConfig
    data: str
    source_split: str | None
    parts: RunParts
    facts: dict[str, Any]


def parts_of(network: KPRed, stage: str) -> dict[str, Tensor]:
    """Return the weights that a stage learns, on the CPU."""
    return {
        f"{part}.{key}": value.detach().cpu().contiguous()
        for part in STAGES[stage]
        for key, value in getattr(network, part).state_dict().items()
    }


def load_parts(network: KPRed, weights: Mapping[str, Tensor], stage: str) -> None:
    """Put the parts of a stage into a network.

    Raises:
        KeyError: one is not among the weights. RuntimeError: one does not fit.
    """
    for part in STAGES[stage]:
        module = getattr(network, part)
        module.load_state_dict({key: weights[f"{part}.{key}"].float() for key in module.state_dict()})


def adopt(runs: AblationRuns, parts: RunParts) -> list[str]:
    """Take over runs that were trained elsewhere by the same settings and data, and return the rows that are whole.

    What a row lacks is left out: its folder is not touched, and `AblationRuns.weights` trains it.

    Raises:
        CheckpointError: a folder holds a run by other settings or data.
        OutputError: a folder cannot be written.
    """
    taken = []
    for row in ROWS.values():
        before = {"deformation": deformation_run(row), "retrieval": "f" if row.partial else row.name}
        needed = before | ({"partial": row.name} if row.partial else {})
        if any(run not in parts for run in needed.values()):
            continue
        network = new_network(row.changed(runs.model), runs.config.seed)
        for stage, run in needed.items():
            load_parts(network, parts[run], stage)
        runs.claim(row.name, row)
        save_network(network, runs.folder / row.name / "model")
        runs.claim(row.name, row, finished=True)
        taken.append(row.name)
    return taken


def write_runs(file: Path, runs: TrainedRuns) -> None:
    """Write the file in half precision, atomically.

    Raises:
        OutputError: it cannot be written.
    """
    tensors, same = _distinct(
        {f"{run}/{key}": value.half() for run, parts in runs.parts.items() for key, value in parts.items()}
    )
    record = {
        "model": runs.model.to_dict(),
        "training": runs.training.to_dict(),
        "data": runs.data,
        "source_split": runs.source_split,
        "facts": runs.facts,
        "same": same,
    }
    with atomic_path(file) as temporary:
        save_file(tensors, temporary, metadata={KEY: json.dumps(record)})


def read_runs(file: Path) -> TrainedRuns:
    """Read the file.

    Raises:
        CheckpointError: it is missing, truncated, or something else.
    """
    parts: RunParts = {}
    try:
        with safe_open(file, framework="pt") as stored:
            record = json.loads((stored.metadata() or {})[KEY])
            for key in stored.keys():  # noqa: SIM118 - it is no dict
                for place in (key, *record["same"].get(key, [])):
                    run, _, name = place.partition("/")
                    parts.setdefault(run, {})[name] = stored.get_tensor(key)
        return TrainedRuns(
            ModelConfig.from_dict(record["model"]),
            TrainConfig.from_dict(record["training"]),
            record["data"],
            record["source_split"],
            parts,
            record["facts"],
        )
    except FileNotFoundError as error:
        raise CheckpointError(f"{file}: there is no such file; give one that train_ablations.py wrote.") from error
    except (SafetensorError, OSError, KeyError, ValueError, TypeError) as error:
        raise CheckpointError(f"{file} holds no ablation runs, or not all of it; copy it again.") from error


def steps_of(config: TrainConfig) -> dict[str, int]:
    """Return the steps of each stage."""
    return {stage: getattr(config, stage).steps for stage in STAGES}


def _distinct(tensors: dict[str, Tensor]) -> tuple[dict[str, Tensor], dict[str, list[str]]]:
    """Return each distinct tensor under its first name, and the other names of it."""
    first: dict[bytes, str] = {}
    kept: dict[str, Tensor] = {}
    same: dict[str, list[str]] = {}
    for name, value in tensors.items():
        content = repr(tuple(value.shape)).encode() + value.numpy().tobytes()
        if content in first:
            same.setdefault(first[content], []).append(name)
        else:
            first[content], kept[name] = name, value
    return kept, same
