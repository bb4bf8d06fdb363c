"""Networks: keypoints, region encoder with self-attention, influence head, retrieval tokens, region decoder."""

from typing import TYPE_CHECKING

from kpred._lazy import lazy_names

if TYPE_CHECKING:
    from kpred.nn.config import PRESETS, ModelConfig, preset
    from kpred.nn.loading import (
        Model,
        load_model,
        load_network,
        load_recognizer,
        load_visibility,
        save_network,
        save_recognizer,
        save_visibility,
    )
    from kpred.nn.model import STAGES, KPRed
    from kpred.nn.recognizer import Recognizer, RecognizerConfig
    from kpred.nn.visibility import VisibilityConfig, VisibilityNetwork

__all__ = [
    "PRESETS",
    "STAGES",
    "KPRed",
    "Model",
    "ModelConfig",
    "Recognizer",
    "RecognizerConfig",
    "VisibilityConfig",
    "VisibilityNetwork",
    "load_model",
    "load_network",
    "load_recognizer",
    "load_visibility",
    "preset",
    "save_network",
    "save_recognizer",
    "save_visibility",
]

_MODULES = {
    "PRESETS": "kpred.nn.config",
    "STAGES": "kpred.nn.model",
    "KPRed": "kpred.nn.model",
    "Model": "kpred.nn.loading",
    "ModelConfig": "kpred.nn.config",
    "Recognizer": "kpred.nn.recognizer",
    "RecognizerConfig": "kpred.nn.recognizer",
    "VisibilityConfig": "kpred.nn.visibility",
    "VisibilityNetwork": "kpred.nn.visibility",
    "load_model": "kpred.nn.loading",
    "load_network": "kpred.nn.loading",
    "load_recognizer": "kpred.nn.loading",
    "load_visibility": "kpred.nn.loading",
    "preset": "kpred.nn.config",
    "save_network": "kpred.nn.loading",
    "save_recognizer": "kpred.nn.loading",
    "save_visibility": "kpred.nn.loading",
}

__getattr__, __dir__ = lazy_names(__name__, _MODULES)
