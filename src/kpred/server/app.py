"""The web application: `POST /fit`, health, version, and a page about them."""

from __future__ import annotations

import asyncio
import io
import json
import shutil
import tempfile
import zipfile
from collections.abc import Mapping
from concurrent.futures import Future
from pathlib import Path
from typing import Annotated, Any
from urllib.parse import quote

from fastapi import FastAPI, Form, Request
from fastapi.exceptions import RequestValidationError
from fastapi.responses import HTMLResponse, JSONResponse, Response
from starlette.exceptions import HTTPException

from kpred._version import __version__
from kpred.errors import KpredError
from kpred.server.form import FitForm
from kpred.server.gate import Gate, Limits
from kpred.server.job import ANSWER, NOTES, VERSION, FitAnswer, FitJob
from kpred.server.page import server_page
from kpred.server.pool import Pool

GONE = 499
"""Status in logs of a request whose client has gone."""

STATUS = {"TimeLimit": 504, "WorkerDied": 500, "Unexpected": 500, "MemoryError": 413}
"""Statuses of errors; all others are of the scan or the options: 422."""

ABOUT = (
    "Scan in, CAD mesh out. POST a scan of one object to `/fit`; the answer is a ZIP of the mesh (GLB in metres, y up, "
    "unless another format is named) and its record (JSON), or one of the two alone. Errors are JSON: `error` is one "
    "sentence, `kind` its class."
)

ANSWERS: dict[int | str, dict[str, Any]] = {
    200: {
        "description": "The mesh and its record",
        "content": {
            "application/zip": {},
            "model/gltf-binary": {},
            "application/octet-stream": {},
            "application/json": {},
        },
    },
    408: {"description": "The scan came too slowly"},
    413: {"description": "The request is too large"},
    422: {"description": "The scan or an option cannot be used; the sentence says why"},
    503: {"description": "Too many scans at once; `Retry-After` proposes when to try again"},
    504: {"description": "The fit took too long"},
}


def make_app(pool: Pool, folder: Path, limits: Limits | None = None, hosts: tuple[str, ...] = ()) -> Gate:
    """Make the application.

    Args:
        pool: fits the scans. folder: for uploads, empty when no request is worked on.
        limits: of requests. hosts: names that are answered (`Gate`).
    """
    app = FastAPI(title="kpred", version=__version__, description=ABOUT, docs_url=None, redoc_url=None)

    @app.post("/fit", responses=ANSWERS, response_class=Response, summary="Fit a CAD model to a scan")
    async def fit(request: Request, form: Annotated[FitForm, Form(media_type="multipart/form-data")]) -> Response:
        place = Path(tempfile.mkdtemp(dir=folder))
        try:
            job = await asyncio.to_thread(_keep, form, place)
        except BaseException:
            shutil.rmtree(place, ignore_errors=True)
            raise
        future = pool.submit(job)
        future.add_done_callback(lambda _: shutil.rmtree(place, ignore_errors=True))
        found = await _while_there(request, future)
        return Response(status_code=GONE) if found is None else _response(form, job, found)

    @app.get("/health", summary="Whether fits are answered, and how many wait")
    async def health() -> JSONResponse:
        ready = pool.ready
        content = {"status": "ok" if ready else "starting", "workers": ready, "waiting": pool.waiting}
        return JSONResponse(content, 200 if ready else 503)

    @app.get("/version", summary="Version and limits")
    async def version() -> dict[str, Any]:
        allowed = limits or Limits()
        return {
            "kpred": __version__,
            "megabytes": allowed.megabytes,
            "seconds": allowed.seconds,
            "requests": allowed.requests,
        }

    @app.get("/", include_in_schema=False)
    async def about() -> HTMLResponse:
        return HTMLResponse(server_page(app.openapi()))

    _add_errors(app)
    return Gate(app, limits or Limits(), hosts)


def _keep(form: FitForm, place: Path) -> FitJob:
    """Write the upload into its folder and return the job."""
    with open(place / form.scan_name, "wb") as stream:
        shutil.copyfileobj(form.scan.file, stream, 1 << 20)
    more = form.answer == "files"
    return FitJob(
        folder=str(place),
        scan=form.scan_name,
        shown=form.shown,
        mesh=form.mesh_name,
        options=form.options(),
        picture=form.picture and more,
        report=form.report and more,
        density=form.density,
    )


async def _while_there(request: Request, future: Future[FitAnswer]) -> FitAnswer | None:
    """Wait for an answer; None when the client has gone: its job leaves the line, or its result is dropped."""
    answer = asyncio.wrap_future(future)
    gone = asyncio.ensure_future(request.receive())
    both: set[asyncio.Future[Any]] = {answer, gone}
    try:
        await asyncio.wait(both, return_when=asyncio.FIRST_COMPLETED)
        return answer.result() if answer.done() and not answer.cancelled() else None
    finally:
        gone.cancel()
        answer.cancel()


def _response(form: FitForm, job: FitJob, found: FitAnswer) -> Response:
    if found.error:
        return _error(STATUS.get(found.kind, 422), found.error, found.kind)
    headers = {ANSWER: form.answer, NOTES: json.dumps(found.notes)[:8000], VERSION: __version__}
    record = next(content for name, content in found.files.items() if name.endswith(".json"))
    if form.answer == "record":
        return Response(record, headers=headers, media_type="application/json")
    if form.answer == "files":
        headers["content-disposition"] = _attachment(f"{form.name}.zip")
        return Response(_zip(found.files), headers=headers, media_type="application/zip")
    beside = set(found.files) - {job.mesh, f"{form.name}.json"}
    if beside:
        sentence = (
            f"The format {form.format} has several files ({', '.join(sorted(beside))} too); ask for answer=files."
        )
        return _error(422, sentence, "OutputError")
    headers["content-disposition"] = _attachment(job.mesh)
    kind = "model/gltf-binary" if job.mesh.lower().endswith(".glb") else "application/octet-stream"
    return Response(found.files[job.mesh], headers=headers, media_type=kind)


def _zip(files: Mapping[str, bytes]) -> bytes:
    """Pack files, the mesh first, uncompressed: most answers stay on this machine."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        for name, content in files.items():
            archive.writestr(zipfile.ZipInfo(name), content)
    return buffer.getvalue()


def _attachment(name: str) -> str:
    return f"attachment; filename*=UTF-8''{quote(name)}"


def _add_errors(app: FastAPI) -> None:
    """Answer every error with one sentence."""

    @app.exception_handler(RequestValidationError)
    async def invalid(_: Request, error: RequestValidationError) -> JSONResponse:
        first = error.errors()[0]
        place = ".".join(str(part) for part in first["loc"][1:3]) or "form"
        return _error(422, f"{place}: {first['msg'].rstrip('.')}.", "ConfigError")

    @app.exception_handler(KpredError)
    async def refused(_: Request, error: KpredError) -> JSONResponse:
        return _error(422, str(error), type(error).__name__)

    @app.exception_handler(ValueError)
    async def impossible(_: Request, error: ValueError) -> JSONResponse:
        return _error(422, str(error), "ConfigError")

    @app.exception_handler(HTTPException)
    async def http(_: Request, error: HTTPException) -> JSONResponse:
        return _error(error.status_code, f"{str(error.detail).rstrip('.')}.", "Http")


def _error(status: int, sentence: str, kind: str) -> JSONResponse:
    return JSONResponse({"error": sentence, "kind": kind}, status, {VERSION: __version__})
