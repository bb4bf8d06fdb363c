"""The process that fits: model and database are loaded once, and warm, before the first scan comes."""

from __future__ import annotations

import os
import signal
import warnings
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

from kpred.errors import KpredError
from kpred.json_output import json_text
from kpred.parent import end_with_parent
from kpred.server.job import REPORT, FitAnswer, FitJob, named_record

if TYPE_CHECKING:
    from multiprocessing.connection import Connection

    from kpred.database import Database
    from kpred.nn import Model


@dataclass(frozen=True)
class WorkerSettings:
    """What a worker loads.

    Attributes:
        model, database: names or paths; None means bundled.
        threads: of this process; None leaves them as they are, so that results are those of the command line.
    """

    model: str | None = None
    database: str | None = None
    threads: int | None = None


def work(connection: Connection, settings: WorkerSettings, parent: int) -> None:
    """Load and warm up, send "" (or what is missing, in one sentence), then answer jobs until the other end closes."""
    # Ctrl-C reaches all processes of a terminal; the server ends its workers.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    end_with_parent(parent)
    try:
        model, database = _load(settings)
    except KpredError as error:
        connection.send(str(error))
        return
    connection.send("")
    with suppress(EOFError, BrokenPipeError):
        while True:
            connection.send(answer(connection.recv(), model, database))


def answer(job: FitJob, model: Model, database: Database) -> FitAnswer:
    """Fit one scan; what goes wrong becomes one sentence that names the scan as the user does."""
    try:
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always", UserWarning)
            files, record = _fit(job, model, database)
        notes = tuple(_shown(str(one.message), job) for one in caught if issubclass(one.category, UserWarning))
        return FitAnswer(files, record, notes)
    except KpredError as error:
        return FitAnswer(error=_shown(str(error), job), kind=type(error).__name__)
    except MemoryError:
        return FitAnswer(error="not enough memory; give a smaller input", kind="MemoryError")
    except Exception as error:  # one bad scan must not end the worker, whatever is wrong with it
        return FitAnswer(error=_shown(f"unexpected {type(error).__name__}: {error}", job), kind="Unexpected")


def _fit(job: FitJob, model: Model, database: Database) -> tuple[dict[str, bytes], dict[str, Any]]:
    from kpred.fitting.pipeline import fit
    from kpred.reports.fit_files import write_files
    from kpred.shapes import read_scan
    from kpred.shapes.mesh_output import check_precision

    scan_path, mesh = Path(job.folder, job.scan), Path(job.folder, "results", job.mesh)
    mesh.parent.mkdir()
    scan = read_scan(scan_path)
    check_precision(mesh, scan)
    result = fit(scan, model, database, **fit_options(job.options))
    result = replace(result, source_data=result.source_data.from_file(scan_path))
    report = mesh.with_name(REPORT) if job.report else None
    written = write_files(
        result,
        scan,
        mesh,
        scan_path=scan_path,
        shown=job.shown,
        picture=job.picture,
        density=job.density,
        report=report,
    )
    record = named_record(written.record, job.shown, job.shown, job.mesh)
    files = {file.name: file.read_bytes() for file in written.files}
    files[mesh.with_suffix(".json").name] = json_text(record).encode()
    return files, record


def fit_options(values: Mapping[str, Any]) -> dict[str, Any]:
    """Return plain values as arguments of `kpred.fit`.

    Raises:
        ConfigError: a setting has an impossible value.
    """
    import numpy as np

    from kpred.errors import ConfigError
    from kpred.preprocessing.config import CleanConfig
    from kpred.refinement.config import RefineConfig
    from kpred.refinement.structure_config import StructureConfig

    found = dict(values)
    kinds: dict[str, type] = {"clean": CleanConfig, "refinement": RefineConfig, "structure": StructureConfig}
    for name, kind in kinds.items():
        if isinstance(found.get(name), Mapping):
            try:
                found[name] = kind(**found[name])
            except TypeError as error:
                raise ConfigError(f"{name}: its settings cannot be used ({error}).") from error
    if found.get("sensor") is not None:
        found["sensor"] = np.array(found["sensor"], dtype=np.float64)
    return found


def _load(settings: WorkerSettings) -> tuple[Model, Database]:
    """Load model and database, check them against each other, and fit the sample scan once."""
    from kpred.fitting.defaults import resolve_database, resolve_model, sample_scan, shared_categories
    from kpred.fitting.pipeline import fit
    from kpred.rendering.drawing_process import keep_drawing_process
    from kpred.rendering.picture import save_picture

    if settings.threads is not None:
        _limit_threads(settings.threads)
    model, database = resolve_model(settings.model), resolve_database(settings.database)
    shared_categories(model, database, None)
    keep_drawing_process()
    # Code is compiled or loaded, models are read, graphics started: the first request finds them ready.
    with suppress(KpredError), warnings.catch_warnings(action="ignore"), TemporaryDirectory() as folder:
        result = fit(sample_scan(), model, database)
        result.record()
        save_picture(result, result.points, Path(folder, "a.png"))
    return model, database


def _limit_threads(threads: int) -> None:
    import numba
    import torch

    torch.set_num_threads(threads)
    numba.set_num_threads(min(threads, numba.config.NUMBA_NUM_THREADS))


def _shown(sentence: str, job: FitJob) -> str:
    """Name the scan as the user does, and no folder of this machine."""
    named = sentence.replace(os.path.join(job.folder, job.scan), job.shown)
    return named.replace(os.path.join(job.folder, "results") + os.sep, "").replace(job.folder + os.sep, "")
