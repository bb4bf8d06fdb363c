"""Networks of peers: other published methods, in this project's own code, for the same bench."""

from kpred.peers.networks.keypoint_deformer import KeypointDeformer, KeypointDeformerConfig
from kpred.peers.networks.loading import PEERS, load_peer, load_peers, save_peer
from kpred.peers.networks.neural_cages import NeuralCages, NeuralCagesConfig
from kpred.peers.networks.part_boxes import PartBoxes
from kpred.peers.networks.shapeflow import ShapeFlow, ShapeFlowConfig
from kpred.peers.networks.u_red import URed, URedConfig
from kpred.peers.networks.uy2021 import Uy2021, Uy2021Config

__all__ = [
    "PEERS",
    "KeypointDeformer",
    "KeypointDeformerConfig",
    "NeuralCages",
    "NeuralCagesConfig",
    "PartBoxes",
    "ShapeFlow",
    "ShapeFlowConfig",
    "URed",
    "URedConfig",
    "Uy2021",
    "Uy2021Config",
    "load_peer",
    "load_peers",
    "save_peer",
]
