"""A category of one's own on top of a model's shared networks: its name, its splits, and the whole model."""

from __future__ import annotations

import dataclasses
import os
import shutil
from pathlib import Path

import numpy as np

from kpred.errors import ConfigError, OutputError, PackError
from kpred.nn.config import SHARED, ModelConfig
from kpred.nn.loading import RECOGNIZER, SHARED_RECOGNIZER, VISIBILITY, Model, find_model, load_network
from kpred.shapes.pack import MeshPack
from kpred.training.recognition_data import OTHER

FEWEST, SENSIBLE = 4, 40
"""Shapes below which nothing can be trained and held out, and below which a person is warned."""

HELD_OUT = 0.2
MAX_HELD_OUT = 40

RESERVED = (SHARED, OTHER, RECOGNIZER, SHARED_RECOGNIZER, VISIBILITY)
"""Names that mean something else in a model's folder."""


def check_name(category: str, model: Model) -> None:
    """Check that a new category's name is none that the model has, and can be a folder's.

    Raises:
        ConfigError: it cannot.
    """
    if category in RESERVED or not category.replace("_", "").replace("-", "").isalnum():
        raise ConfigError(
            f"'{category}' cannot name a category: take letters, digits, - and _, and none of {', '.join(RESERVED)}."
        )
    if category in model.categories:
        raise ConfigError(
            f"The model {model.name} has networks of '{category}' already; choose another name, or train that category "
            "anew by `kpred train all`."
        )
    if SHARED not in model.networks:
        raise ConfigError(f"The model {model.name} has no shared networks '{SHARED}' to add to; give another one.")


def own_splits(pack: MeshPack, seed: int) -> MeshPack:
    """Hold out a fifth of the shapes, at most 40, as `val`, the rest as `source`; a pack with `val` is as it is.

    Raises:
        PackError: there are too few shapes.
    """
    if len(pack) < FEWEST:
        raise PackError(
            f"{len(pack)} shapes are too few to train on and to hold some out: give {FEWEST} or more, better "
            f"{SENSIBLE}. Without a training the shared networks serve any category: build a database."
        )
    if len(pack.indices("val")):
        if not len(pack.indices("source")):
            return dataclasses.replace(pack, split=np.where(pack.split == "train", "source", pack.split))
        return pack
    count = min(MAX_HELD_OUT, max(1, round(HELD_OUT * len(pack))))
    split = np.full(len(pack), "source")
    split[np.random.default_rng(seed).permutation(len(pack))[:count]] = "val"
    return dataclasses.replace(pack, split=split)


def advice(pack: MeshPack) -> list[str]:
    """Say in sentences what is to be known of these shapes before the training."""
    held_out = len(pack.indices("val"))
    found = [f"{len(pack) - held_out} shapes are trained on, {held_out} are held out."]
    if len(pack) < SENSIBLE:
        found.append(
            f"{len(pack)} shapes are few ({SENSIBLE} or more are sensible): see at the end whether the new networks "
            "are better than the shared ones."
        )
    return found


def shared_part(base: str | os.PathLike[str] | None, category: str) -> tuple[Path, ModelConfig]:
    """Return the folder of a model's shared networks, and their architecture under the category's name.

    Raises:
        ModelError: there are none.
    """
    folder = find_model(base) / SHARED
    return folder, dataclasses.replace(load_network(folder).config, category=category)


def complete_model(folder: Path, category: str, base: Path) -> None:
    """Make of a run's weights in `folder` a whole model: they move to `folder/CATEGORY`, beside a copy of the base.

    Raises:
        OutputError: the folder cannot be written.
    """
    try:
        target = folder / category
        target.mkdir(exist_ok=True)
        for file in [one for one in folder.iterdir() if one.is_file() and one.name != "calibration.json"]:
            file.replace(target / file.name)
        shutil.copytree(base, folder, dirs_exist_ok=True)
    except OSError as error:
        raise OutputError(f"{folder}: {error.strerror}; free space or choose another folder.") from error
