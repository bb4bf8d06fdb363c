"""The source shapes of one category: what every method retrieves from and deforms, prepared once for all of them."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from functools import cached_property
from pathlib import Path
from types import TracebackType

import torch
from torch import Tensor

from kpred.database import Database, build_database
from kpred.database.encode import PreparedMesh, prepare_mesh
from kpred.errors import MeshError, PackError
from kpred.evaluation.searched import SOURCE_SPLIT
from kpred.evaluation.tables.baselines import NoLearning, undeformed_errors
from kpred.nn import Model
from kpred.ops.typing import Float
from kpred.shapes.pack import MeshPack


class Sources:
    """Source shapes in their unit boxes, and what several methods need of them; each is made when it is asked for.

    A context manager: databases are temporary files, removed at its end.

    Attributes:
        category: of the shapes; meshes: M of them, each with 2048 points; seed: of these points.
    """

    def __init__(self, category: str, meshes: Sequence[PreparedMesh], seed: int) -> None:
        self.category, self.meshes, self.seed = category, tuple(meshes), seed
        self._databases: dict[int, Database] = {}
        self._undeformed: tuple[Tensor, bool, Tensor] | None = None
        self._stack = ExitStack()

    @classmethod
    def of_pack(cls, pack: MeshPack, name: str, seed: int, report: Callable[[str], None]) -> Sources:
        """The shapes of the split `source`; those without a surface go to `report` and are left out.

        Raises:
            PackError: no shape is left.
        """
        meshes = []
        for row in pack.indices(SOURCE_SPLIT):
            try:
                meshes.append(prepare_mesh(pack[int(row)], str(pack.model_id[row]), seed))
            except MeshError as error:
                report(f"left out of the sources: {error}")
        if not meshes:
            raise PackError(f"{name}: no shape is in the split '{SOURCE_SPLIT}' to search; give another pack.")
        return cls(pack.category, meshes, seed)

    def __enter__(self) -> Sources:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._stack.close()
        self._databases.clear()

    def __len__(self) -> int:
        return len(self.meshes)

    @property
    def model_ids(self) -> tuple[str, ...]:
        """M ids."""
        return tuple(item.model_id for item in self.meshes)

    @cached_property
    def points(self) -> Float[Tensor, "models points 3"]:
        """Surface points of all shapes, each in its own unit box."""
        return torch.stack([item.points for item in self.meshes])

    @cached_property
    def baseline(self) -> NoLearning:
        """Bases that need no network."""
        return NoLearning.build(self.model_ids, self.category, self.points)

    def undeformed_errors(self, target: Float[Tensor, "points 3"], partial: bool) -> Float[Tensor, " models"]:
        """Distance of the target to every source as it is (CD; UCD if partial), unit box squared.

        Several methods ask for that of the same target one after the other: the last answer is kept.
        """
        if self._undeformed is None or self._undeformed[0] is not target or self._undeformed[1] != partial:
            self._undeformed = (target, partial, undeformed_errors(target, self.points, partial))
        return self._undeformed[2]

    def database(self, model: Model) -> Database:
        """A database of the sources, made by the model's networks.

        Raises:
            ModelError: the model does not know the category.
        """
        if id(model) not in self._databases:
            network = model[self.category]
            folder = self._stack.enter_context(tempfile.TemporaryDirectory(prefix="kpred-"))
            path = Path(folder) / "source.kpred"
            shapes = ((item.model_id, self.category, SOURCE_SPLIT, item.mesh) for item in self.meshes)
            build_database(path, shapes, {self.category: network}, seed=self.seed)
            self._databases[id(model)] = self._stack.enter_context(Database.open(path, read_only=True))
        return self._databases[id(model)]
