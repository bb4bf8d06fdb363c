"""Any network on disk: a folder with config.json and model.safetensors, checked against each other before use."""

from __future__ import annotations

import json
import os
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import torch
from safetensors import SafetensorError, safe_open
from safetensors.torch import load_file, save_file
from torch import nn

from kpred.errors import ConfigError, ModelError, OutputError

Network = TypeVar("Network", bound=nn.Module)

CONFIG_FILE = "config.json"
WEIGHTS_FILE = "model.safetensors"

MAX_SETTING = 4096
"""Settings of a config up to this are built without being compared with the weights' header first."""


def load_weights(folder: Path, build: Callable[[dict[str, Any]], Network], device: torch.device | str) -> Network:
    """Load any network from its folder: `build` makes it from the values of config.json.

    Memory is taken only for what the weights file holds: the sizes in the config are compared with its header first.

    Raises:
        ModelError: a file is missing, truncated or does not fit the other, or a weight is not finite.
    """
    shapes = _shapes(folder)
    network = _build(folder, build, shapes)
    try:
        weights = load_file(folder / WEIGHTS_FILE, device=str(device))
    except (SafetensorError, OSError) as error:
        raise ModelError(f"{folder / WEIGHTS_FILE} is truncated or no safetensors file; copy it again.") from error
    for name, value in weights.items():
        if not torch.isfinite(value).all():
            raise ModelError(
                f"{folder / WEIGHTS_FILE}: {name} has weights that are not finite; train or copy it again."
            )
    try:
        network.load_state_dict({key: value.float() for key, value in weights.items()})
    except RuntimeError as error:
        raise _misfit(folder) from error
    network.to(device).eval().requires_grad_(False)
    return network


def save_weights(
    network: nn.Module, config: dict[str, Any], folder: Path, dtype: torch.dtype, leave_out: str | None = None
) -> None:
    """Write any network and its config into a folder, each file atomically, but for parts whose name begins so.

    Raises:
        OutputError: the folder cannot be written.
    """
    state = {key: value for key, value in network.state_dict().items() if not (leave_out and key.startswith(leave_out))}
    tensors = {key: value.detach().cpu().to(dtype).contiguous() for key, value in state.items()}
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=folder) as scratch:
            save_file(tensors, Path(scratch) / WEIGHTS_FILE)
            (Path(scratch) / CONFIG_FILE).write_text(json.dumps(config, indent=2) + "\n", encoding="utf-8")
            # Safetensors makes private files; a plain one has the mode of the user's umask.
            os.chmod(Path(scratch) / WEIGHTS_FILE, (Path(scratch) / CONFIG_FILE).stat().st_mode)
            for name in (WEIGHTS_FILE, CONFIG_FILE):
                os.replace(Path(scratch) / name, folder / name)
    except OSError as error:
        raise OutputError(
            f"The weights cannot be written to {folder} ({error.strerror}); free space or choose another folder."
        ) from error


def _shapes(folder: Path) -> dict[str, tuple[int, ...]]:
    """Name -> shape of the tensors in the weights file, as its header says."""
    file = folder / WEIGHTS_FILE
    try:
        with safe_open(str(file), framework="pt") as stored:
            return {name: tuple(stored.get_slice(name).get_shape()) for name in stored.keys()}  # noqa: SIM118
    except FileNotFoundError as error:
        raise ModelError(f"{file} is missing; give a folder of trained weights.") from error
    except (SafetensorError, OSError) as error:
        raise ModelError(f"{file} is truncated or no safetensors file; copy it again.") from error


def _build(folder: Path, build: Callable[[dict[str, Any]], Network], shapes: dict[str, tuple[int, ...]]) -> Network:
    """Make the network of a config whose sizes are those of the weights."""
    file = folder / CONFIG_FILE
    try:
        values = json.loads(file.read_text(encoding="utf-8"))
        if not isinstance(values, dict):
            raise ConfigError("this is not a kpred model config; train or copy it again.")
        # No setting of an architecture counts more than the weights' longest side and number of tensors do.
        most = max([len(shapes), *(max(shape, default=0) for shape in shapes.values())])
        large = [name for name, value in values.items() if isinstance(value, int) and value > max(most, MAX_SETTING)]
        if large:
            raise ConfigError(f"{large[0]} is {values[large[0]]}, more than the weights hold; copy both files again.")
        if _planned(build, values) != shapes:
            raise _misfit(folder)
        return build(values)
    except FileNotFoundError as error:
        raise ModelError(f"{file} is missing; give a folder of trained weights.") from error
    except (ValueError, RecursionError) as error:
        raise ModelError(f"{file} is not a kpred model config ({error}); train or copy it again.") from error
    except ConfigError as error:
        raise ModelError(f"{file}: {error}") from error
    except OSError as error:
        raise ModelError(f"{file} cannot be read ({error.strerror}); check its permissions.") from error


def _planned(build: Callable[[dict[str, Any]], nn.Module], values: dict[str, Any]) -> dict[str, tuple[int, ...]] | None:
    """Name -> shape of the tensors that a config's network has; None where no network can have its sizes."""
    try:
        with torch.device("meta"):
            return {name: tuple(value.shape) for name, value in build(values).state_dict().items()}
    except (RuntimeError, OverflowError, TypeError, MemoryError):
        return None


def _misfit(folder: Path) -> ModelError:
    return ModelError(f"The weights in {folder} do not fit their {CONFIG_FILE}; copy both files again.")
