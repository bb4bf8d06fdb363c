"""Checks of readable CAD models during a build: their up axis, and parts that are no furniture."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np

from kpred.database.orientation_check import OrientationCheck, up_rotation
from kpred.nn import Recognizer
from kpred.shapes.helper_parts import helper_part
from kpred.shapes.mesh import Mesh
from kpred.shapes.source import Shape

_MAX_NAMED = 10


class ModelCheck:
    """Looks at shapes on their way into a database, and collects sentences about them."""

    def __init__(self, recognizer: Recognizer | None, up: str = "y") -> None:
        """Start a check; `recognizer`: None skips the up axis; `up`: the shapes' axis that becomes y."""
        self._orientation = None if recognizer is None else OrientationCheck(recognizer)
        self._rotation = up_rotation(up).astype(np.float32)
        self._helpers: list[str] = []

    def watch(self, shapes: Iterable[Shape]) -> Iterator[Shape]:
        """Yield the shapes, rotated so that their up axis is y."""
        for shape in shapes:
            mesh = shape.mesh
            appearance = shape.appearance
            if not np.array_equal(self._rotation, np.eye(3)):
                appearance = None if appearance is None else appearance.rotated(self._rotation)
                mesh = Mesh(mesh.vertices @ self._rotation.T, mesh.faces, mesh.name, mesh.face_parts)
            if self._orientation is not None:
                self._orientation.observe(mesh, shape.model_id, shape.category)
            problem = helper_part(mesh)
            if problem is not None:
                self._helpers.append(f"{shape.model_id}: {problem}")
            yield shape._replace(mesh=mesh, appearance=appearance)

    def warnings(self) -> list[str]:
        """Return sentences about all shapes so far; only some are named."""
        sentences = [f"{item}; remove it from the mesh if so." for item in self._helpers[:_MAX_NAMED]]
        if len(self._helpers) > _MAX_NAMED:
            sentences.append(f"{len(self._helpers) - _MAX_NAMED} more models seem to hold parts of other things.")
        axis = None if self._orientation is None else self._orientation.warning()
        return ([] if axis is None else [axis]) + sentences
