"""Networks of peers: other published methods, in this project's own code, for the same bench."""

from kpred.nn.peers.keypoint_deformer import KeypointDeformer, KeypointDeformerConfig
from kpred.nn.peers.loading import PEERS, load_peer, load_peers, save_peer
from kpred.nn.peers.neural_cages import NeuralCages, NeuralCagesConfig
from kpred.nn.peers.part_boxes import PartBoxes
from kpred.nn.peers.shapeflow import ShapeFlow, ShapeFlowConfig
from kpred.nn.peers.u_red import URed, URedConfig
from kpred.nn.peers.uy2021 import Uy2021, Uy2021Config

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
