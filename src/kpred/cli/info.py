"""`kpred info`: what is installed, which models and which database there are."""

from __future__ import annotations

import platform
from dataclasses import dataclass
from typing import Any

from kpred.cli.command import Command, FitsCommand
from kpred.cli.output import Output


@dataclass(frozen=True, kw_only=True)
class InfoCommand(FitsCommand):
    """Show versions, the models and the database that a fit would use.

    examples:
      kpred info
      kpred info --model runs/chair --json
    """

    def run(self, output: Output) -> None:
        """Collect and print the facts. What is named must be there; what is bundled may be reported missing."""
        versions, devices, model, database = _versions(), _devices(), self._model(), self._database()
        output.result({"versions": versions, "devices": devices, "model": model, "database": database})
        output.table("versions", ["", "version"], list(versions.items()))
        output.note(f"devices: {', '.join(devices)}\n")
        if "missing" in model:
            output.note(f"model: {model['missing']}\n")
        else:
            columns = ["category", "keypoints", "token", "weights", "fingerprint"]
            output.table(f"model {model['name']}", columns, [list(row.values()) for row in model["categories"]])
        if "missing" in database:
            output.note(f"database: {database['missing']}")
        else:
            rows = [(name, c["models"], c["fingerprint"]) for name, c in database["categories"].items()]
            output.table(f"database {database['path']}", ["category", "models", "made by weights"], rows)

    def _model(self) -> dict[str, Any]:
        from kpred.errors import ModelError
        from kpred.nn import load_model

        try:
            model = load_model(self.model)
        except ModelError as error:
            if self.model is not None:
                raise
            return {"missing": str(error)}
        rows = [
            {
                "category": category,
                "keypoints": network.config.keypoints,
                "token_size": network.config.token_size,
                "weights": sum(weights.numel() for weights in network.parameters()),
                "fingerprint": _fingerprint(network),
            }
            for category, network in model.items()
        ]
        return {"name": model.name, "categories": rows}

    def _database(self) -> dict[str, Any]:
        from kpred.database import Database
        from kpred.errors import DatabaseError
        from kpred.fitting import bundled_database_path

        try:
            with Database.open(self.database or bundled_database_path(), read_only=True) as database:
                return database.info()
        except DatabaseError as error:
            if self.database is not None:
                raise
            return {"missing": str(error)}


def _versions() -> dict[str, str]:
    from importlib.metadata import PackageNotFoundError, version

    from kpred._version import __version__

    found = {"kpred": __version__, "python": platform.python_version()}
    for name in ("torch", "numpy", "scipy", "trimesh", "SQLAlchemy", "pyvista"):
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            found[name] = "not installed"
    return found


def _devices() -> list[str]:
    import torch

    names = [f"cpu ({torch.get_num_threads()} threads)"]
    return names + [f"cuda:{i} ({torch.cuda.get_device_name(i)})" for i in range(torch.cuda.device_count())]


def _fingerprint(network: Any) -> str:
    value = network.fingerprint
    return str(value() if callable(value) else value)


COMMAND: type[Command] = InfoCommand
