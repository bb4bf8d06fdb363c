"""Settings of the structure-keeping deformation; they need no other package, so that the command line is quick."""

from __future__ import annotations

from dataclasses import dataclass, replace


@dataclass(frozen=True)
class StructureConfig:
    """How a model is deformed without bending what is flat, straight, square or mirrored in it.

    Weights are relative to that of the scan's points, which is 1 in all.

    Attributes:
        controls: of the B-spline along each axis.
        iterations: rounds of nearest neighbours and least squares.
        points: of the source and of the scan that are used in each round.
        smoothness: weight of second differences of the spline's controls; ridge: of the controls themselves.
        part_ridge: weight of a part's own motion and growth; growth_ridge: of its growth relative to its own size;
            bend_ridge: of the bend of a part that is bent already.
        contact: weight of a gap that opens across a contact; sliding: of parts that slide along it; joint: of the
            middle of a contact where one part is small or both lean; flush: of a step between ends that are flush;
            repeat: of differing thicknesses of parts that have one size.
        lean_gain: fall of the mean squared distance, unit box, from which a part may lean.
        thickness: weight of the growth of boards seen from one side.
        unseen: weight of the pull of unseen surface toward where the search begins.
        floor: weight of what stands on the floor, where its height is known.
        robust: a point farther than this many times the median distance counts less and less; 0 is off.
    """

    controls: int = 10
    iterations: int = 12
    points: int = 2048
    smoothness: float = 1e-4
    ridge: float = 1e-7
    part_ridge: float = 1e-5
    growth_ridge: float = 1e-5
    bend_ridge: float = 1e-3
    contact: float = 1.0
    sliding: float = 2e-4
    joint: float = 1.0
    flush: float = 0.003
    repeat: float = 0.1
    lean_gain: float = 3e-5
    thickness: float = 1.0
    unseen: float = 1.0
    floor: float = 2.0
    robust: float = 20.0

    def sketch(self) -> StructureConfig:
        """Reduce to what selects the models worth deforming: few rounds, with a quarter of the points."""
        return replace(self, iterations=max(1, self.iterations // 3), points=max(1, self.points // 4))

    def quick(self) -> StructureConfig:
        """Reduce to the few rounds, with half of the points, by which finalists are found."""
        return replace(self, iterations=max(1, self.iterations // 3), points=max(1, self.points // 2))

    def final(self) -> StructureConfig:
        """Reduce to the rounds that are left after those of `quick`."""
        return replace(self, iterations=max(1, self.iterations - self.quick().iterations))
