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


def peer_method(name: str, folder: str | os.PathLike[str], refined: bool = False) -> Method:
    """Load a peer by the folder of its weights.

    Args:
        name: of the peer in tables.
        refined: whether KeypointDeformer has a row with this package's keypoint refinement too.

    Raises:
        ModelError: the folder holds no weights of a peer.
    """
    networks = load_peers(Path(folder))
    kind = METHODS[type(next(iter(networks.values())))]
    more = {"refinement": RefineConfig()} if refined and kind is KeypointDeformerMethod else {}
    method: Method = kind(name, networks, {"folder": str(folder), "training": training_record(folder)}, **more)
    return method
