"""Networks: keypoints, region encoder with self-attention, influence head, retrieval tokens, region decoder."""

from kpred.nn.config import PRESETS, ModelConfig, preset
from kpred.nn.loading import Model, load_model, load_network, save_network
from kpred.nn.model import STAGES, KPRed

__all__ = [
    "PRESETS",
    "STAGES",
    "KPRed",
    "Model",
    "ModelConfig",
    "load_model",
    "load_network",
    "preset",
    "save_network",
]
