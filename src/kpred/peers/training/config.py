"""Settings of the peers' trainings; what was published is the default where it was."""

from __future__ import annotations

from dataclasses import dataclass, field

from kpred.errors import ConfigError
from kpred.training.config import StageConfig
from kpred.training.single_stage import SingleStageConfig


@dataclass(frozen=True)
class PeerTraining(SingleStageConfig):
    """What the trainings of all peers share.

    Attributes:
        stretch: targets are scaled per axis by up to this factor and put back into their unit boxes (1 is off).
    """

    stretch: float = 1.0


@dataclass(frozen=True)
class KeypointDeformerTraining(PeerTraining):
    """Losses of KeypointDeformer.

    Attributes:
        warmup: first steps with the keypoint loss alone.
        keypoint_weight: of the Chamfer distance between keypoints and farthest-point samples.
        spread_samples: farthest-point samples, twice the keypoints.
        offset_weight: of the mean square of the influence's offset. The published code has 10^6, which in a short
            training leaves no offset at all.
    """

    warmup: int = 200
    keypoint_weight: float = 2.0
    spread_samples: int = 24
    offset_weight: float = 0.1


@dataclass(frozen=True)
class NeuralCagesTraining(PeerTraining):
    """Losses of Neural Cages.

    Attributes:
        coordinate_weight: of the mean square of negative mean value coordinates (1, published).
        shape_weight: of the change of normals and of the lack of symmetry (0.1, published). Unlike the published
            ones both are means over points, and normals are those of two neighbours.
    """

    points: int = 512
    coordinate_weight: float = 1.0
    shape_weight: float = 0.1


@dataclass(frozen=True)
class PartsTraining(PeerTraining):
    """What the trainings of methods of parts share.

    Attributes:
        scaled_start: whether layers are scaled by what they say of real data before the first step
            (`kpred.peers.training.standardise`), in place of the published batch normalisation.
    """

    scaled_start: bool = True


@dataclass(frozen=True)
class Uy2021Training(PartsTraining):
    """Losses of Uy et al. 2021.

    Attributes:
        candidates: sources deformed to each target of a batch (10).
        warmup: first steps in which candidates are drawn at random; after them half of them are drawn by the
            retrieval's own odds, so that the deformation learns what is retrieved.
        retrieval_weight: of the cross-entropy of the odds of the retrieval against those of the deformation errors.
        temperature: odds of sources fall by e for each such fraction of the mean error by which they are worse.
    """

    optimisation: StageConfig = field(default_factory=lambda: StageConfig(steps=10_000, batch=8))
    candidates: int = 10
    warmup: int = 500
    retrieval_weight: float = 0.1
    temperature: float = 0.2

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.candidates < 2:
            raise ConfigError(f"Retrieval is learned from at least 2 candidates, but candidates = {self.candidates}.")


@dataclass(frozen=True)
class URedTraining(PartsTraining):
    """Losses of U-RED, all as published but divided by 30.

    Attributes:
        sources: of a step; each is deformed to each target of the batch (the publication has one for each target).
        decoded_points: of a cloud, whose residuals and reconstruction are learned in a step.
        mirror_weight: of the Chamfer distance from the target to the mirrored result.
        consistency_weight: between the results for whole and partial targets.
        residual_weight: of the L1 error of the predicted residuals; a hundredth of it: of their own length.
        reconstruction_weight: of the clouds' reconstruction, by which the encoders are kept honest.
        whole_fraction: of the steps that train the branch for whole targets. The others train that for partial ones,
            which starts as its copy (the publication trains both at once, which takes twice the time).
        occlusion: least and greatest fraction of a target hidden from the branch for partial ones.
    """

    sources: int = 8
    decoded_points: int = 32
    mirror_weight: float = 1.0
    consistency_weight: float = 0.33
    residual_weight: float = 0.1
    reconstruction_weight: float = 1.0
    whole_fraction: float = 0.75
    occlusion: tuple[float, float] = (0.25, 0.75)

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 0 <= self.occlusion[0] <= self.occlusion[1] < 1:
            raise ConfigError(f"Occlusion must be two fractions in [0, 1), low then high, but is {self.occlusion}.")
        if min(self.sources, self.decoded_points) < 1 or not 0 < self.whole_fraction <= 1:
            raise ConfigError("sources and decoded_points must be at least 1, whole_fraction above 0 and at most 1.")


@dataclass(frozen=True)
class ShapeFlowTraining(PeerTraining):
    """Losses of ShapeFlow: there is only the Chamfer distance, both ways between the shapes of a pair."""

    points: int = 512

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.stretch != 1.0:
            raise ConfigError("ShapeFlow has a code for every shape, so that shapes cannot be stretched; leave it out.")
