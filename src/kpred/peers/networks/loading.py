"""Weights of peers on disk: config.json, which names the peer, and model.safetensors."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

import torch

from kpred.errors import ConfigError, ModelError
from kpred.nn.weights import CONFIG_FILE, load_weights, save_weights
from kpred.peers.networks.keypoint_deformer import KeypointDeformer, KeypointDeformerConfig
from kpred.peers.networks.neural_cages import NeuralCages, NeuralCagesConfig
from kpred.peers.networks.shapeflow import ShapeFlow, ShapeFlowConfig
from kpred.peers.networks.u_red import URed, URedConfig
from kpred.peers.networks.uy2021 import Uy2021, Uy2021Config

Peer = KeypointDeformer | NeuralCages | Uy2021 | URed | ShapeFlow

PEERS: dict[str, tuple[type[Any], type[Any]]] = {
    "keypoint-deformer": (KeypointDeformer, KeypointDeformerConfig),
    "neural-cages": (NeuralCages, NeuralCagesConfig),
    "uy2021": (Uy2021, Uy2021Config),
    "u-red": (URed, URedConfig),
    "shapeflow": (ShapeFlow, ShapeFlowConfig),
}
"""Network and config of each peer by its name."""


def peer_name(network: Peer) -> str:
    """Return the name of a network's peer."""
    return next(name for name, (kind, _) in PEERS.items() if isinstance(network, kind))


def save_peer(network: Peer, folder: str | os.PathLike[str]) -> None:
    """Write a peer's weights in half precision, each file atomically.

    Raises:
        OutputError: if the folder cannot be written.
    """
    save_weights(network, {"peer": peer_name(network), **network.config.to_dict()}, Path(folder), torch.float16)


def load_peer(folder: str | os.PathLike[str], device: torch.device | str = "cpu") -> Peer:
    """Load a peer's network of one category, in evaluation mode, single precision, without gradients.

    Raises:
        ModelError: if a file is missing, truncated, of another kind, or does not fit the other.
    """
    return load_weights(Path(folder), _build, device)


def load_peers(folder: str | os.PathLike[str], device: torch.device | str = "cpu") -> dict[str, Peer]:
    """Load a peer's networks by category, from a model folder, a run folder, or a folder of these.

    Raises:
        ModelError: if there are none, or two of one category or of different peers.
    """
    networks: dict[str, Peer] = {}
    for place in _places(Path(folder)):
        network = load_peer(place, device)
        category = network.config.category
        if category in networks or any(peer_name(other) != peer_name(network) for other in networks.values()):
            raise ModelError(f"{folder} holds several peers for one category, or different ones; name one folder.")
        networks[category] = network
    if not networks:
        raise ModelError(f"{folder} holds no weights of a peer; give the folder of a run of `kpred train peer`.")
    return networks


def holds_peers(folder: str | os.PathLike[str]) -> bool:
    """Test whether a folder holds weights of peers rather than of this package's networks."""
    return bool(_places(Path(folder)))


def training_record(folder: str | os.PathLike[str]) -> list[dict[str, Any]]:
    """Read the training record beside the weights of `load_peers`, if any."""
    records = []
    for place in _places(Path(folder)):
        try:
            records.append(json.loads((place / "training.json").read_text()))
        except (OSError, ValueError):
            continue
    return records


def _places(root: Path) -> list[Path]:
    """List the folders of peers' weights: the folder itself, its `model`, or those in it."""
    found = [place for place in (root, root / "model") if _is_peer(place)]
    if not found and root.is_dir():
        found = [place for part in sorted(root.iterdir()) for place in (part, part / "model") if _is_peer(place)]
    return found


def _is_peer(folder: Path) -> bool:
    try:
        values = json.loads((folder / CONFIG_FILE).read_text())
    except (OSError, ValueError):
        return False
    return isinstance(values, dict) and values.get("peer") in PEERS


def _build(values: dict[str, Any]) -> Peer:
    given = dict(values)
    name = given.pop("peer", None)
    if name not in PEERS:
        raise ConfigError(f"this is not a peer ({name}); give weights of {', '.join(PEERS)}.")
    kind, config = PEERS[name]
    network: Peer = kind(config.from_dict(given))
    return network
