"""What a worker does: fit one scan and write its files. Model and database are loaded once a process."""

from __future__ import annotations

import signal
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from kpred.batch.task import Task
from kpred.batch.time_limit import time_limit
from kpred.database.address import without_password
from kpred.json_output import json_text
from kpred.parent import end_with_parent
from kpred.refinement.config import Deform
from kpred.shapes.unit_name import UnitName

if TYPE_CHECKING:
    import numpy as np

    from kpred.nn import Model


@dataclass(frozen=True)
class BatchSettings:
    """How all scans of a batch are fitted; the names are those of `kpred.fit`.

    Attributes:
        mesh: extension of the meshes that are written; an empty one writes records alone.
        time_limit: seconds after which a scan is given up; None sets none. It is no part of what a batch is.
    """

    model: str | None = None
    database: str | None = None
    category: str | None = None
    top_k: int = 10
    frame: Literal["auto", "known"] = "auto"
    up: str = "auto"
    deform: Deform = "auto"
    model_id: str | None = None
    clean: bool = True
    unit: UnitName | Literal["auto"] = "auto"
    mesh: str = ".ply"
    time_limit: float | None = None

    @property
    def batched(self) -> bool:
        """Whether the networks read several scans at once: only where nothing of a scan's frame is to be found."""
        return self.frame == "known"

    def to_dict(self) -> dict[str, Any]:
        """Return the settings that results depend on, as plain values; addresses without passwords."""
        values = asdict(self)
        del values["time_limit"]
        return values | {"database": None if self.database is None else without_password(self.database)}


@dataclass(frozen=True)
class Outcome:
    """What became of one scan.

    Attributes:
        row: the line of `results.jsonl`; None where it failed.
        problem: why; empty where it did not.
        retry: trying again may help.
    """

    name: str
    row: dict[str, Any] | None
    problem: str = ""
    retry: bool = False


def single_threaded() -> None:
    """Use one thread in this process, of torch and of compiled kernels: workers share the cores."""
    import torch

    torch.set_num_threads(1)


def begin_worker(parent: int) -> None:
    """Prepare a process of this machine: one thread, and it ends with the process `parent` that started it."""
    # Ctrl-C reaches all processes of a terminal; the parent stops the workers, which then print no tracebacks.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    end_with_parent(parent)
    single_threaded()


def fit_tasks(tasks: Sequence[Task], settings: BatchSettings, out: str, device: str = "cpu") -> list[Outcome]:
    """Fit several scans as `fit_task`; networks read scans in known frames as one batch."""
    read_ahead = _read_ahead(tasks, settings, device) if settings.batched and len(tasks) > 1 else {}
    return [fit_task(task, settings, out, device, read_ahead.get(task.name)) for task in tasks]


@dataclass(frozen=True, eq=False)
class ReadAhead:
    """A scan (N, 3) as it was read from its file, and the model whose networks have seen it."""

    scan: np.ndarray
    model: Model


def fit_task(
    task: Task, settings: BatchSettings, out: str, device: str = "cpu", read_ahead: ReadAhead | None = None
) -> Outcome:
    """Fit one scan, write `stem`.json and its mesh below `out`, all or none, and say what became of it.

    `device`: where the networks run; all else is the CPU's.
    """
    from kpred.atomic import write_together
    from kpred.errors import KpredError, OutputError, ScanError
    from kpred.fitting.export import result_writers
    from kpred.fitting.pipeline import fit

    if task.path is None or task.problem:
        return Outcome(task.name, None, task.problem or "no file is named")
    try:
        with time_limit(settings.time_limit, task.path):
            found = fit(
                task.path if read_ahead is None else read_ahead.scan,
                _model(settings, device) if read_ahead is None else read_ahead.model,
                settings.database,
                task.category or settings.category,
                top_k=settings.top_k,
                frame=settings.frame,
                up=settings.up,
                deform=settings.deform,
                model_id=settings.model_id,
                clean=settings.clean,
                unit=settings.unit,
            )
        place = Path(out, f"{task.stem}.json")
        place.parent.mkdir(parents=True, exist_ok=True)
        mesh = f"{task.stem}{settings.mesh}" if settings.mesh else None
        row = {
            "name": task.name,
            "model_id": found.source.model_id,
            "category": found.category,
            "step": found.source.step,
            "confidence": found.confidence,
            "error": found.source.error,
            "warnings": len(found.warnings),
            "record": f"{task.stem}.json",
            "mesh": mesh,
        }
        found = replace(found, source_data=found.source_data.from_file(task.path))
        text = json_text({**found.record(), "scan": task.path, "mesh": mesh, "batch": row}, indent=1)
        # The record comes last: where it is, the scan is done.
        writers: dict[Path, Callable[[Path], object]] = {}
        if mesh:
            writers |= result_writers(found, Path(out, mesh))
        writers[place] = lambda file: file.write_text(text, encoding="utf-8")
        write_together(writers)
    except OutputError as error:
        return Outcome(task.name, None, str(error), retry=True)
    except ScanError as error:
        return Outcome(task.name, None, str(error))
    except KpredError as error:
        return Outcome(task.name, None, str(error), retry="locked" in str(error) or "another process" in str(error))
    except Exception as error:  # one bad scan must not stop the rest, whatever is wrong with it
        return Outcome(task.name, None, f"{type(error).__name__}: {error}", retry=True)
    return Outcome(task.name, row)


def _read_ahead(tasks: Sequence[Task], settings: BatchSettings, device: str) -> dict[str, ReadAhead]:
    """Encode scans of one category and size as one batch, by task name; invalid scans are left to `fit_task`."""
    import numpy as np
    import torch

    from kpred.errors import KpredError
    from kpred.fitting.defaults import resolve_model
    from kpred.fitting.encoding import EncodedAhead
    from kpred.fitting.raw_scan import read_points
    from kpred.fitting.stages import SCAN_POINTS
    from kpred.shapes.scan import read_scan

    groups: dict[tuple[str, int], dict[str, tuple[np.ndarray, np.ndarray]]] = {}
    for task in tasks:
        category = task.category or settings.category
        if category is None or task.path is None or task.problem:
            continue
        with suppress(KpredError, OSError):
            scan = read_scan(task.path)
            points = read_points(scan, seed=0)[:SCAN_POINTS]  # those that the fit will take
            groups.setdefault((category, len(points)), {})[task.name] = scan, points
    model = resolve_model(_model(settings, device))
    found: dict[str, ReadAhead] = {}
    for (category, _), group in groups.items():
        if category not in model:
            continue
        seen = model
        if len(group) > 1:
            clouds = torch.from_numpy(np.stack([points for _, points in group.values()])).float()
            seen = replace(model, networks={category: EncodedAhead(model[category], clouds)})
        found |= {name: ReadAhead(scan, seen) for name, (scan, _) in group.items()}
    return found


def _model(settings: BatchSettings, device: str) -> Model | str | None:
    return settings.model if device == "cpu" else _placed(settings.model, device)


@lru_cache(maxsize=1)
def _placed(name: str | None, device: str) -> Model:
    """Load the model on a device, with hooks that move inputs there and outputs back."""
    from torch import Tensor, nn

    from kpred.nn import load_model

    def moved(values: Any, where: str) -> Any:
        if isinstance(values, tuple):
            return tuple(moved(value, where) for value in values)
        return values.to(where) if isinstance(values, Tensor) else values

    model = load_model(name).to(device)
    parts: list[nn.Module] = [part for network in model.values() for part in network.children()]
    parts += model.scan_networks.values()
    for part in parts:
        part.register_forward_pre_hook(lambda _, inputs: moved(inputs, device))
        part.register_forward_hook(lambda _, __, output: moved(output, "cpu"))
    return model
