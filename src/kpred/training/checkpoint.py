"""Checkpoints: everything that a run needs to go on exactly where it was, written atomically."""

from __future__ import annotations

import dataclasses
import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from kpred.errors import CheckpointError, OutputError

VERSION = 1


@dataclass(frozen=True)
class Checkpoint:
    """State after `step` steps of a stage: weights, optimiser, random state, and the configs that made them."""

    stage: str
    step: int
    model_config: dict[str, Any]
    train_config: dict[str, Any]
    weights: dict[str, Tensor]
    optimizer: dict[str, Any]
    random_state: Tensor

    def save(self, path: Path) -> None:
        """Write to `path` through a temporary file, so that a kill leaves the old checkpoint or the new one.

        Raises:
            OutputError: if the folder cannot be written or the disk is full.
        """
        scratch = path.with_name(path.name + ".part")
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            with open(scratch, "wb") as file:
                torch.save({"version": VERSION, **self.__dict__}, file)
                file.flush()
                os.fsync(file.fileno())
            os.replace(scratch, path)
        except (OSError, RuntimeError) as error:
            scratch.unlink(missing_ok=True)
            # torch's own error speaks of positions in a zip file; what the system said may stand behind it.
            cause = error if isinstance(error, OSError) else error.__context__
            reason = cause.strerror if isinstance(cause, OSError) and cause.strerror else "a part of it was not written"
            raise OutputError(
                f"The checkpoint {path} cannot be written ({reason}); free space or give another run folder."
            ) from error
        except BaseException:  # a second Ctrl-C
            scratch.unlink(missing_ok=True)
            raise

    @classmethod
    def load(cls, path: Path, device: torch.device | str = "cpu") -> Checkpoint:
        """Read a checkpoint.

        Raises:
            CheckpointError: if it is missing, truncated, foreign or of another version.
        """
        try:
            values = torch.load(path, map_location=device, weights_only=True)
        except FileNotFoundError as error:
            raise CheckpointError(f"There is no checkpoint {path}; start the run without resuming.") from error
        except Exception as error:  # foreign bytes make the unpickler fail in any way it can
            raise CheckpointError(
                f"{path} is truncated or no checkpoint; delete it to start this stage again."
            ) from error
        names = {field.name for field in dataclasses.fields(cls)}
        if not isinstance(values, dict) or values.pop("version", None) != VERSION or set(values) != names:
            raise CheckpointError(
                f"{path} is no checkpoint of this version of kpred; delete it to start this stage again."
            )
        values["random_state"] = values["random_state"].cpu()
        return cls(**values)
