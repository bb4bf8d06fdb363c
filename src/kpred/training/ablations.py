"""The paper's ablations as named rows, and the training of what is missing of them.

Rows (a) to (f) switch geometric self-attention (GSA), deformation-aware retrieval (DAR) and local-global features (LGF)
(paper, table of ablations); a last one switches off the confidence-based features of partial scans (CB, its figure).
What rows share is trained once: keypoints and influence depend on GSA alone, and CB is of the partial stage alone.
"""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch

from kpred.errors import CheckpointError, ConfigError, OutputError
from kpred.json_output import write_json
from kpred.nn import STAGES, KPRed, ModelConfig, save_network
from kpred.nn.weights import WEIGHTS_FILE
from kpred.shapes.pack import MeshPack
from kpred.training.checkpoint import Checkpoint
from kpred.training.config import TrainConfig
from kpred.training.data import Progress, TrainingData, prepare
from kpred.training.loop import StepReport, train_stage
from kpred.training.run import new_network

RECORD = "ablation.json"


@dataclass(frozen=True)
class Ablation:
    """One row: which parts it has.

    Attributes:
        name: of the row and of its folder.
        gsa: geometric self-attention in the influence predictor; without it, one global PointNet feature.
        dar: deformation-aware retrieval; without it, tokens learn from reconstruction (Psi_1) alone.
        lgf: local-global feature embedding; without it, one global feature is the retrieval token.
        cb: confidence-based features; without them every keypoint of a partial scan counts the same.
        partial: whether it is measured on partial shapes, and so needs the partial stage.
    """

    name: str
    gsa: bool = True
    dar: bool = True
    lgf: bool = True
    cb: bool = True
    partial: bool = False

    def changed(self, config: ModelConfig) -> ModelConfig:
        """Return the same architecture with this row's parts."""
        return dataclasses.replace(
            config, self_attention=self.gsa, deformation_aware=self.dar, local_global=self.lgf, confidence=self.cb
        )


FULL_ROWS = (
    Ablation("a", gsa=False, dar=False, lgf=False),
    Ablation("b", gsa=False, lgf=False),
    Ablation("c", dar=False, lgf=False),
    Ablation("d", dar=False),
    Ablation("e", lgf=False),
    Ablation("f"),
)
"""The paper's table, measured on full shapes."""

PARTIAL_ROWS = (Ablation("with-cb", partial=True), Ablation("without-cb", cb=False, partial=True))
"""The paper's figure, measured on partial shapes; `with-cb` is (f)."""

ROWS = {row.name: row for row in (*FULL_ROWS, *PARTIAL_ROWS)}


def rows_named(names: Sequence[str]) -> tuple[Ablation, ...]:
    """Return rows by name, each once, in the order of the paper.

    Raises:
        ConfigError: there is no row of a name, or no name.
    """
    unknown = [name for name in names if name not in ROWS]
    if unknown or not names:
        raise ConfigError(f"There is no row {', '.join(unknown) or 'named'}; the ablations are {', '.join(ROWS)}.")
    return tuple(row for name, row in ROWS.items() if name in names)


def deformation_run(row: Ablation) -> str:
    """Name of the run whose keypoints and influence a row has."""
    return f"deformation-{'with' if row.gsa else 'without'}-gsa"


def recorded_training(folder: Path, rows: Sequence[Ablation]) -> tuple[TrainConfig, str | None]:
    """Read the settings and `source_split` of the training of rows below a category's folder.

    Rows that are not there, or not trained to the end, do not count.

    Raises:
        ConfigError: they were trained by different ones, and so say nothing about their parts; or none is there.
        CheckpointError: a record is damaged.
    """
    records = {row.name: _read_record(folder / row.name) or {} for row in rows}
    found = {name: record for name, record in records.items() if record.get("finished") is True}
    if not found:
        raise ConfigError(f"{folder} holds no finished row; train some, or copy them there.")
    first, *others = found
    for name in others:
        one, other = ({**found[row]["training"], "source_split": found[row]["source_split"]} for row in (first, name))
        changed = [key for key in one if one[key] != other.get(key)]
        if changed:
            raise ConfigError(
                f"{folder}: rows {first} and {name} were trained differently ({', '.join(changed)}), so that they "
                "cannot be compared; train them by the same settings, or name only rows that were."
            )
    return TrainConfig.from_dict(found[first]["training"]), found[first]["source_split"]


class AblationRuns:
    """The runs of one category's ablations below one folder.

    `deformation-with-gsa/`, `deformation-without-gsa/` and one folder for each row; each holds checkpoints, weights in
    `model/`, and a record of its settings. A run that was stopped goes on where it was.
    """

    def __init__(
        self,
        packs: Sequence[MeshPack],
        model: ModelConfig,
        config: TrainConfig,
        folder: Path,
        data_hash: str,
        device: torch.device | str = "cpu",
        source_split: str | None = None,
        progress: Progress | None = None,
        report: StepReport | None = None,
    ) -> None:
        """Prepare runs; `data_hash`: of the packs' content; `model`: settings that all rows share."""
        self.packs, self.model, self.config, self.folder = list(packs), model, config, folder
        self.facts = {"data": data_hash, "source_split": source_split, "training": config.to_dict()}
        self.device, self.source_split = device, source_split
        self.progress, self.report = progress, report
        self._data: TrainingData | None = None

    def finished(self, row: Ablation) -> bool:
        """Test whether a row's weights exist, trained to the end by these settings."""
        record = _read_record(self.folder / row.name)
        whole = (self.folder / row.name / "model" / WEIGHTS_FILE).is_file()
        return whole and record is not None and record.get("finished") is True and not self._changed(row, record)

    def weights(self, row: Ablation) -> Path:
        """Return the folder of a row's weights; trains missing ones.

        Raises:
            CheckpointError: a folder holds a run by other settings, or a damaged checkpoint.
            PackError: the packs hold too few shapes.
            OutputError: a folder cannot be written.
        """
        folder = self.folder / row.name
        if self.finished(row):
            return folder / "model"
        self.claim(row.name, row)
        if row.partial:
            # With CB and without it go on from the same retrieval.
            self._train(self._retrieval(ROWS["f"]), row, "partial", folder)
            self.claim(row.name, row, finished=True)
        else:
            self._retrieval(row)
        return folder / "model"

    def _retrieval(self, row: Ablation) -> KPRed:
        name = deformation_run(row)
        # What is learned later does not count: all rows of one GSA share it.
        shared = Ablation(name, gsa=row.gsa)
        for run in (shared, row):
            self.claim(run.name, run)
        deformation = self._train(None, shared, "deformation", self.folder / name)
        self.claim(name, shared, finished=True)
        network = self._train(deformation, row, "retrieval", self.folder / row.name)
        self.claim(row.name, row, finished=True)
        return network

    def _train(self, before: KPRed | None, row: Ablation, stage: str, folder: Path) -> KPRed:
        """Train one stage in `folder`, on the parts of earlier stages that `before` has."""
        network = new_network(row.changed(self.model), self.config.seed).to(self.device)
        if before is not None:
            for earlier in list(STAGES)[: list(STAGES).index(stage)]:
                for part in STAGES[earlier]:
                    getattr(network, part).load_state_dict(getattr(before, part).state_dict())
        checkpoint = folder / f"{stage}.checkpoint"
        if checkpoint.exists():
            done = Checkpoint.load(checkpoint, self.device)
            if done.step >= getattr(self.config, stage).steps and done.model_config == network.config.to_dict():
                network.load_state_dict(done.weights)
                if not (folder / "model" / WEIGHTS_FILE).is_file():  # killed before it could export them
                    save_network(network, folder / "model")
                return network.eval()

        def report_step(name: str, step: int, total: int, losses: dict[str, float]) -> None:
            if self.report is not None:
                self.report(f"{self.model.category} {row.name}: {name}", step, total, losses)

        train_stage(network, self._prepared(network), self.config, stage, folder, report=report_step)
        return network.eval()

    def _prepared(self, network: KPRed) -> TrainingData:
        if self._data is None:
            self._data = prepare(
                self.packs,
                network,
                self.config.points,
                self.config.seed,
                self.device,
                self.source_split,
                self.progress,
            )
        return self._data

    def claim(self, name: str, row: Ablation, finished: bool = False) -> None:
        """Write the record of a run's settings; refuse a folder that was trained by others."""
        folder = self.folder / name
        record = _read_record(folder) or {}
        changed = self._changed(row, record) if record else []
        if changed:
            raise CheckpointError(
                f"{folder} was trained by other settings or data ({', '.join(changed)}); give another folder, or the "
                "same packs and settings."
            )
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise OutputError(f"Cannot make the folder {folder}: {error.strerror}; choose another.") from error
        values = {**self._facts(row), "finished": finished or record.get("finished") is True}
        if values != record:
            write_json(folder / RECORD, values)

    def _changed(self, row: Ablation, record: dict[str, Any]) -> list[str]:
        """Return the names of settings in which a record differs from this run."""
        found = []
        for key, value in self._facts(row).items():
            other = record.get(key)
            if isinstance(value, dict) and isinstance(other, dict):
                found += [f"{key}.{name}" for name in {**value, **other} if value.get(name) != other.get(name)]
            elif value != other:
                found.append(key)
        return found

    def _facts(self, row: Ablation) -> dict[str, Any]:
        # Through JSON, so that they compare with what is read back.
        facts: dict[str, Any] = json.loads(json.dumps({**self.facts, "model": row.changed(self.model).to_dict()}))
        return facts


def _read_record(folder: Path) -> dict[str, Any] | None:
    """Read the record of a run; None without one.

    Raises:
        CheckpointError: it is damaged.
    """
    try:
        record = json.loads((folder / RECORD).read_text())
    except FileNotFoundError:
        return None
    except (OSError, ValueError) as error:
        raise CheckpointError(f"{folder / RECORD} is damaged; delete the folder to train it again.") from error
    if not isinstance(record, dict):
        raise CheckpointError(f"{folder / RECORD} is damaged; delete the folder to train it again.")
    return record
