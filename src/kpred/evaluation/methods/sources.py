"""The source shapes of one category: what every method retrieves from and deforms, prepared once for all of them."""

from __future__ import annotations

import hashlib
import tempfile
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from functools import cached_property
from pathlib import Path

import torch
from torch import Tensor

from kpred.database import Database, build_database
from kpred.database.encode import PreparedMesh, prepare_mesh
from kpred.errors import MeshError, PackError
from kpred.evaluation.database_source import SOURCE_SPLIT
from kpred.evaluation.metrics.cloud_errors import cloud_errors
from kpred.nn import Model
from kpred.ops.typing import Float
from kpred.shapes.pack import MeshPack


class Sources:
    """Source shapes in their unit boxes, and what several methods need of them, made at first use.

    A context manager: databases that are built here are temporary files, removed at its end.

    Attributes:
        category: of the shapes; model_ids: M ids; points: (M, 2048, 3) of their surfaces; seed: of these points.
        meshes: of the shapes, where they come from a pack; none where they come from a database.
    """

    def __init__(
        self, category: str, model_ids: Sequence[str], points: Tensor, seed: int, meshes: Sequence[PreparedMesh] = ()
    ) -> None:
        self.category, self.model_ids, self.points, self.seed = category, tuple(model_ids), points, seed
        self.meshes = tuple(meshes)
        self._databases: dict[int, Database] = {}
        self._undeformed: tuple[Tensor, bool, Tensor] | None = None
        self._stack = ExitStack()

    @classmethod
    def of_pack(cls, pack: MeshPack, name: str, seed: int, report: Callable[[str], None]) -> Sources:
        """Prepare the shapes of the split `source`; those without a surface go to `report` and are left out.

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
        points = torch.stack([item.points for item in meshes])
        return cls(pack.category, [item.model_id for item in meshes], points, seed, meshes)

    @classmethod
    def of_databases(cls, category: str, models: Mapping[str, Model], stores: Mapping[str, Database]) -> Sources:
        """Take the shapes of databases of the same shapes, one of each model.

        Args:
            models, stores: by name, at least one; the points are those of the first database.

        Raises:
            DatabaseError: a database holds no model of the category.
        """
        arrays = next(iter(stores.values())).candidates(category)
        found = cls(category, arrays.model_ids, torch.from_numpy(arrays.points), 0)
        found._databases = {id(model): stores[name] for name, model in models.items()}
        return found

    def __enter__(self) -> Sources:
        return self

    def __exit__(self, *error: object) -> None:
        self._stack.close()
        self._databases.clear()

    def __len__(self) -> int:
        return len(self.model_ids)

    @cached_property
    def digest(self) -> str:
        """Hash of the ids."""
        return hashlib.sha256("\n".join(self.model_ids).encode()).hexdigest()[:16]

    def undeformed_errors(self, target: Float[Tensor, "points 3"], partial: bool) -> Float[Tensor, " models"]:
        """Compute the distance of a target to every source as it is (CD; UCD if partial), unit box squared.

        The last answer is kept: several methods need that of the same target one after the other.
        """
        if self._undeformed is None or self._undeformed[0] is not target or self._undeformed[1] != partial:
            self._undeformed = (target, partial, cloud_errors(target, self.points, partial))
        return self._undeformed[2]

    def database(self, model: Model) -> Database:
        """Return the database of the sources that a model's networks made; it is built if there is none.

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
