"""Weights on disk: a folder of config.json + model.safetensors a category, or a folder of such folders."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from importlib import resources
from importlib.util import find_spec
from pathlib import Path

import torch
from torch import nn

from kpred.errors import ModelError
from kpred.nn.calibration import Calibration, load_calibration
from kpred.nn.config import SHARED, ModelConfig
from kpred.nn.hub import fetch_from_hub, is_hub_address
from kpred.nn.model import KPRed, network_of
from kpred.nn.recognizer import Recognizer, RecognizerConfig
from kpred.nn.visibility import VisibilityConfig, VisibilityNetwork
from kpred.nn.weights import CONFIG_FILE, WEIGHTS_FILE, load_weights, save_weights

RECOGNIZER = "recognizer"
"""Folder of the recognizer beside the categories' folders."""

SHARED_RECOGNIZER = "recognizer_any"
"""Folder of the recognizer of many more categories, and of the calibration of confidence with it."""

SECOND = "second"
"""Folder of another recognizer in the first one's."""

VISIBILITY = "visibility"
"""Folder of the visibility network beside the categories' folders."""


@dataclass(frozen=True, eq=False)
class Model(Mapping[str, KPRed]):
    """Networks of one or several categories under one name; a mapping from category to `KPRed`.

    Networks of the category `SHARED` serve every category that has none of its own.
    `recognizer` predicts category and yaw of a scan, where the model has one; without it both are found by fitting.
    `shared_recognizer` does so where there are categories that `recognizer` does not know.
    `visibility` predicts where a scanner would have seen surface, where the model has such a network.
    `calibration` turns evidence into confidence; None takes the built-in one. `shared_calibration`: where
    `shared_recognizer` gave the evidence.
    """

    name: str
    networks: dict[str, KPRed]
    recognizer: Recognizer | None = None
    visibility: VisibilityNetwork | None = None
    calibration: Calibration | None = None
    shared_recognizer: Recognizer | None = None
    shared_calibration: Calibration | None = None

    def __getitem__(self, category: str) -> KPRed:
        """Return the category's networks.

        Raises:
            ModelError: if the model was not trained for it.
        """
        found = network_of(self.networks, category)
        if found is None:
            known = ", ".join(self.networks)
            raise ModelError(f"The model {self.name} knows no category '{category}'; it knows {known}.")
        return found

    def __contains__(self, category: object) -> bool:
        return category in self.networks or SHARED in self.networks

    def __iter__(self) -> Iterator[str]:
        return iter(self.networks)

    def __len__(self) -> int:
        return len(self.networks)

    # Two models are the same only if they are one object: weights are not compared.
    __eq__ = object.__eq__
    __hash__ = object.__hash__

    @property
    def categories(self) -> tuple[str, ...]:
        """Names of the categories with networks of their own."""
        return tuple(name for name in self.networks if name != SHARED)

    @property
    def scan_networks(self) -> dict[str, nn.Module]:
        """The networks beside those of the categories, by their folders' names."""
        found = {
            RECOGNIZER: self.recognizer,
            SHARED_RECOGNIZER: self.shared_recognizer,
            VISIBILITY: self.visibility,
        }
        return {name: network for name, network in found.items() if network is not None}

    def recognizer_of(self, categories: Iterable[str]) -> Recognizer | None:
        """Return the recognizer that knows all of the categories, the shared one only if the other does not."""
        wanted = tuple(categories)
        for one in (self.recognizer, self.shared_recognizer):
            if one is not None and one.knows(wanted):
                return one
        return None

    def calibration_of(self, categories: Iterable[str]) -> Calibration | None:
        """Return the calibration of confidence for results of these categories; None takes the built-in one."""
        found = self.recognizer_of(categories)
        return self.shared_calibration if found is not None and found is self.shared_recognizer else self.calibration

    def to(self, device: torch.device | str) -> Model:
        """Move the networks to `device` in place, and return this model."""
        for network in (*self.networks.values(), *self.scan_networks.values()):
            network.to(device)
        return self


BUNDLED = {"bundled": "kpred", "kp-red-plus": "kpred", "kp-red": "kpred_paper"}
"""Names of models, and the installed packages that hold them: this project's own, and the paper's."""


def bundled_model_path(name: str = "bundled") -> Path:
    """Return the folder of a model with a name in `BUNDLED`.

    Raises:
        ModelError: the package that holds it is not installed.
    """
    package = BUNDLED[name]
    if find_spec(package) is None:
        raise ModelError(f"The model {name} comes with another package; `pip install ./paper` in a checkout of kpred.")
    folder = Path(str(resources.files(package)))
    return folder / "bundled" / "model" if package == "kpred" else folder


def is_folder_name(name: str) -> bool:
    """Check whether a name of a model means a folder, not a model of the package or of the Hub."""
    return name not in BUNDLED and not is_hub_address(name)


def find_model(name_or_path: str | os.PathLike[str] | None = None) -> Path:
    """Find the folder of the weights that `load_model` loads; one of a hub is fetched.

    Raises:
        ModelError: if nothing is there.
    """
    if name_or_path is None or str(name_or_path) in BUNDLED:
        folder = bundled_model_path("bundled" if name_or_path is None else str(name_or_path))
        if not folder.is_dir():
            raise ModelError(f"The bundled weights are missing at {folder}; reinstall kpred.")
        return folder
    folder, name = Path(name_or_path), str(name_or_path)
    if folder.is_file():
        raise ModelError(f"{folder} is a file; give the folder that holds {CONFIG_FILE} and {WEIGHTS_FILE}.")
    if is_hub_address(name):
        return fetch_from_hub(name)
    if not folder.is_dir():
        raise ModelError(
            f"There is no model folder {name}; give a folder of trained weights, hf://owner/name@revision, or "
            "leave it out for the bundled ones."
        )
    return folder


def load_model(name_or_path: str | os.PathLike[str] | None = None, device: torch.device | str = "cpu") -> Model:
    """Load weights: None or a name in `BUNDLED` for those of the package, else a folder or `hf://owner/name@revision`.

    A folder holds config.json and model.safetensors of one category, or one such folder a category and, if there are
    any, `recognizer`, `recognizer_any`, `visibility` and calibration.json. Only such an address is looked up on the
    Hugging Face Hub.

    Raises:
        ModelError: if nothing is there, a file is truncated, or weights and config do not fit each other.
    """
    folder, name = find_model(name_or_path), "bundled" if name_or_path is None else str(name_or_path)
    if (folder / CONFIG_FILE).is_file():
        network = load_network(folder, device)
        return Model(name, {network.config.category: network}, calibration=load_calibration(folder))
    common = (RECOGNIZER, SHARED_RECOGNIZER, VISIBILITY)
    parts = sorted(part for part in folder.iterdir() if (part / CONFIG_FILE).is_file() and part.name not in common)
    if not parts:
        raise ModelError(f"No weights in {folder}: expected {CONFIG_FILE} and {WEIGHTS_FILE}, or a folder a category.")
    networks = {network.config.category: network for network in (load_network(part, device) for part in parts)}
    recognizer, shared_recognizer, visibility = ((folder / part / CONFIG_FILE).is_file() for part in common)
    return Model(
        name,
        networks,
        load_recognizer(folder / RECOGNIZER, device) if recognizer else None,
        load_visibility(folder / VISIBILITY, device) if visibility else None,
        load_calibration(folder),
        load_recognizer(folder / SHARED_RECOGNIZER, device) if shared_recognizer else None,
        load_calibration(folder / SHARED_RECOGNIZER) if shared_recognizer else None,
    )


def load_network(folder: str | os.PathLike[str], device: torch.device | str = "cpu") -> KPRed:
    """Load one category's networks from its folder, in evaluation mode, single precision, without gradients.

    Raises:
        ModelError: if a file is missing, truncated or does not fit the other.
    """
    return load_weights(Path(folder), lambda values: KPRed(ModelConfig.from_dict(values)), device)


def load_recognizer(folder: str | os.PathLike[str], device: torch.device | str = "cpu") -> Recognizer:
    """Load a recognizer from its folder, in evaluation mode, single precision, without gradients.

    One in the folder `second` inside is its second opinion.

    Raises:
        ModelError: if a file is missing, truncated or does not fit the other, or the two know other categories.
    """
    folder = Path(folder)
    network = load_weights(folder, lambda values: Recognizer(RecognizerConfig.from_dict(values)), device)
    if (folder / SECOND / CONFIG_FILE).is_file():
        network.second = load_recognizer(folder / SECOND, device)
        if network.second.config.categories != network.config.categories:
            raise ModelError(f"{folder / SECOND} knows other categories than {folder}; copy both again.")
    return network


def load_visibility(folder: str | os.PathLike[str], device: torch.device | str = "cpu") -> VisibilityNetwork:
    """Load a visibility network from its folder, in evaluation mode, single precision, without gradients.

    Raises:
        ModelError: if a file is missing, truncated or does not fit the other.
    """
    return load_weights(Path(folder), lambda values: VisibilityNetwork(VisibilityConfig.from_dict(values)), device)


def save_network(network: KPRed, folder: str | os.PathLike[str], half: bool = True) -> None:
    """Write config.json and model.safetensors (half precision by default), each file atomically.

    Raises:
        OutputError: if the folder cannot be written.
    """
    save_weights(network, network.config.to_dict(), Path(folder), torch.float16 if half else torch.float32)


def save_recognizer(network: Recognizer, folder: str | os.PathLike[str]) -> None:
    """Write config.json and model.safetensors in half precision, each file atomically; without the second opinion.

    Raises:
        OutputError: if the folder cannot be written.
    """
    save_weights(network, network.config.to_dict(), Path(folder), torch.float16, leave_out=f"{SECOND}.")


def save_visibility(network: VisibilityNetwork, folder: str | os.PathLike[str]) -> None:
    """Write config.json and model.safetensors in half precision, each file atomically.

    Raises:
        OutputError: if the folder cannot be written.
    """
    save_weights(network, network.config.to_dict(), Path(folder), torch.float16)
