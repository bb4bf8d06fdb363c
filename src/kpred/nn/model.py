"""One category's networks as one module: keypoints, influence, retrieval tokens, and their partial twins."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping

from torch import Tensor, nn

from kpred.nn.box import BoxPredictor
from kpred.nn.config import SHARED, ModelConfig
from kpred.nn.influence import InfluencePredictor
from kpred.nn.keypoints import KeypointPredictor
from kpred.nn.retrieval import RegionDecoder, RetrievalEncoder
from kpred.ops.cage import enclosing_cage, pulled_in_cage
from kpred.ops.regions import ball_counts, density_confidence
from kpred.ops.typing import Float

STAGES = {
    "deformation": ("keypoint_predictor", "influence_predictor"),
    "retrieval": ("retrieval_encoder", "region_decoder"),
    "partial": ("partial_keypoint_predictor", "partial_retrieval_encoder", "box_predictor"),
}
"""Which parts each training stage learns; everything else is frozen in it."""


class KPRed(nn.Module):
    """The networks of one category, or of all (`SHARED`); every method takes and gives unit-box coordinates."""

    def __init__(self, config: ModelConfig) -> None:
        super().__init__()
        self.config = config
        self.keypoint_predictor = KeypointPredictor(config)
        self.influence_predictor = InfluencePredictor(config)
        self.retrieval_encoder = RetrievalEncoder(config)
        self.region_decoder = RegionDecoder(config)
        self.partial_keypoint_predictor = KeypointPredictor(config, config.partial_blocks)
        self.partial_retrieval_encoder = RetrievalEncoder(config)
        self.box_predictor = BoxPredictor(config.box_blocks)

    def keypoints(self, points: Float[Tensor, "batch points 3"]) -> Float[Tensor, "batch keypoints 3"]:
        """Predict semantic keypoints of full shapes (Phi_full)."""
        return self.keypoint_predictor(points)

    def partial_keypoints(self, points: Float[Tensor, "batch points 3"]) -> Float[Tensor, "batch keypoints 3"]:
        """Predict keypoints of the whole shape from a partial cloud in the whole shape's frame (Phi_part)."""
        return self.partial_keypoint_predictor(points)

    def whole_box(
        self, points: Float[Tensor, "batch points 3"]
    ) -> tuple[Float[Tensor, "batch 2 3"], Float[Tensor, "batch 2 3"]]:
        """Predict the box of the whole object from a partial cloud that fills its own unit box.

        Returns:
            Lowest and highest corner in the input's frame, and how far each coordinate is off on average.
        """
        return self.box_predictor(points)

    def cage(self, points: Float[Tensor, "batch points 3"]) -> Float[Tensor, "batch vertices 3"]:
        """Build the source's cage; its faces are those of `kpred.ops.cage.icosphere(config.cage_subdivisions)`."""
        build = enclosing_cage if self.config.cage == "enclosing" else pulled_in_cage
        return build(points, subdivisions=self.config.cage_subdivisions)

    def influence(
        self,
        points: Float[Tensor, "batch points 3"],
        keypoints: Float[Tensor, "batch keypoints 3"],
        cage: Float[Tensor, "batch vertices 3"],
    ) -> Float[Tensor, "batch keypoints vertices"]:
        """Predict the influence vectors I_i of Eq. 1."""
        return self.influence_predictor(points, keypoints, cage)

    def retrieval_tokens(
        self, points: Float[Tensor, "batch points 3"], keypoints: Float[Tensor, "batch keypoints 3"]
    ) -> Float[Tensor, "batch keypoints token"]:
        """Encode retrieval tokens of full shapes."""
        return self.retrieval_encoder(points, keypoints)

    def partial_retrieval_tokens(
        self, points: Float[Tensor, "batch points 3"], keypoints: Float[Tensor, "batch keypoints 3"]
    ) -> Float[Tensor, "batch keypoints token"]:
        """Encode retrieval tokens of partial clouds, comparable to those of full shapes."""
        return self.partial_retrieval_encoder(points, keypoints)

    def confidence(
        self, points: Float[Tensor, "batch points 3"], keypoints: Float[Tensor, "batch keypoints 3"]
    ) -> Float[Tensor, "batch keypoints"]:
        """Compute d_i in [0, 1]: how densely each keypoint's support region was seen (ones without CB)."""
        if not self.config.confidence:
            return keypoints.new_ones(keypoints.shape[:2])
        counts = ball_counts(points, keypoints, self.config.radius)
        return density_confidence(counts, points.shape[1], self.config.radius, self.config.density)

    def fingerprint(self) -> str:
        """Hash the config and the weights (half precision, as stored) that make tokens and bases."""
        # What only partial scans are read by makes nothing that a database holds.
        partial = ("partial_blocks", "box_blocks")
        settings = [(key, value) for key, value in sorted(self.config.to_dict().items()) if key not in partial]
        digest = hashlib.sha256(repr(settings).encode())
        for name in ("keypoint_predictor", "influence_predictor", "retrieval_encoder"):
            for key, value in sorted(getattr(self, name).state_dict().items()):
                digest.update(key.encode())
                digest.update(value.detach().cpu().half().numpy().tobytes())
        return digest.hexdigest()[:16]


def network_of(networks: Mapping[str, KPRed], category: str) -> KPRed | None:
    """Return a category's own networks, else the shared ones; None where there are neither."""
    return next((networks[name] for name in (category, SHARED) if name in networks), None)
