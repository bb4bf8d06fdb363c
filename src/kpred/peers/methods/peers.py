"""Peers as methods on the bench, by the folder of their weights."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from kpred.evaluation.methods.method import Method
from kpred.fitting import RefineConfig
from kpred.peers.methods.cage_peers import KeypointDeformerMethod, NeuralCagesMethod
from kpred.peers.methods.flow_peer import ShapeFlowMethod
from kpred.peers.methods.part_peers import URedMethod, Uy2021Method
from kpred.peers.networks import KeypointDeformer, NeuralCages, ShapeFlow, URed, Uy2021, load_peers
from kpred.peers.networks.loading import training_record

METHODS: dict[type[Any], type[Any]] = {
    KeypointDeformer: KeypointDeformerMethod,
    NeuralCages: NeuralCagesMethod,
    Uy2021: Uy2021Method,
    URed: URedMethod,
    ShapeFlow: ShapeFlowMethod,
}
"""Method of each peer's networks."""


def peer_method(name: str, folder: str | os.PathLike[str]) -> tuple[Method, dict[str, Any]]:
    """Load a peer method from the folder of its weights, with its training record.

    Raises:
        ModelError: the folder holds no weights of a peer.
    """
    networks = load_peers(Path(folder))
    method: Method = METHODS[type(next(iter(networks.values())))](name, networks)
    return method, {"folder": str(folder), "training": training_record(folder)}


def refined(method: Method) -> list[Method]:
    """Return the method with this package's keypoint refinement, where it has keypoints."""
    if not isinstance(method, KeypointDeformerMethod):
        return []
    return [KeypointDeformerMethod(f"{method.name}_refined", method.networks, RefineConfig())]
