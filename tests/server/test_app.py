"""The web application: what comes in becomes a job, what comes back an answer; every error is one sentence."""

import asyncio
import io
import json
import zipfile
from pathlib import Path
from typing import Any

import pytest
from starlette.testclient import TestClient

from kpred._version import __version__
from kpred.server.app import make_app
from kpred.server.gate import Limits
from kpred.server.job import FitAnswer

SCAN = {"scan": ("chair.ply", b"ply ...")}


@pytest.fixture
def client(workers: Any, tmp_path: Path) -> TestClient:
    return TestClient(make_app(workers, tmp_path, Limits(megabytes=1.0)))


def test_files_are_a_zip_with_the_mesh_first(client: TestClient, workers: Any, tmp_path: Path) -> None:
    answer = client.post("/fit", files=SCAN, data={"up": "z", "name": "стул", "picture": "true", "sensor": "1 2 3.5"})
    assert answer.status_code == 200 and answer.headers["content-type"] == "application/zip"
    assert zipfile.ZipFile(io.BytesIO(answer.content)).namelist() == ["стул.glb", "стул.json"]
    assert json.loads(answer.headers["kpred-notes"]) == ["a note"] and answer.headers["kpred-version"] == __version__
    (job,) = workers.jobs
    assert workers.uploads == [b"ply ..."] and job.shown == "chair.ply" and job.picture and not job.report
    assert (job.options["up"], job.options["sensor"], job.options["category"]) == ("z", [1.0, 2.0, 3.5], None)
    assert not list(tmp_path.iterdir())


def test_mesh_and_record_alone(client: TestClient, workers: Any) -> None:
    mesh = client.post("/fit", files=SCAN, data={"answer": "mesh", "picture": "true"})
    assert (mesh.content, mesh.headers["content-type"]) == (b"glTF", "model/gltf-binary")
    assert "result.glb" in mesh.headers["content-disposition"] and not workers.jobs[0].picture
    record = client.post("/fit", files=SCAN, data={"answer": "record", "format": "stl"})
    assert record.json() == {"category": "chair"} and workers.jobs[1].mesh == "result.stl"


def test_formats_of_several_files_need_a_zip(client: TestClient, workers: Any) -> None:
    workers.answer = lambda job: FitAnswer({job.mesh: b"", "result.mtl": b"", "result.json": b"{}"})
    answer = client.post("/fit", files=SCAN, data={"answer": "mesh", "format": "obj"})
    assert answer.status_code == 422 and "answer=files" in answer.json()["error"]


@pytest.mark.parametrize(
    "name",
    ["../../../etc/passwd", "..\\..\\x.ply", "/etc/shadow.ply", "a\x00b.ply", "", ".ply", "a.p/l/y", "x." + "y" * 400],
)
def test_names_of_uploads_lead_nowhere(name: str, client: TestClient, workers: Any, tmp_path: Path) -> None:
    answer = client.post("/fit", files={"scan": (name or "x", b"data")})
    for job in workers.jobs:
        assert Path(job.folder).parent == tmp_path and Path(job.folder, job.scan).parent == Path(job.folder)
        assert (
            job.scan in ("scan", "scan.ply")
            and "/" not in job.shown
            and "\\" not in job.shown
            and len(job.shown) <= 200
        )
    assert answer.status_code == 200
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("fields", "said"),
    [
        ({"up": "w"}, "up: "),
        ({"database": "/etc/passwd"}, "database: "),
        ({"model": "x"}, "model: "),
        ({"pose": "given:/etc/passwd"}, "pose: "),
        ({"format": ".exe"}, "unknown extension '.exe'"),
        ({"format": "/../x.glb"}, "format: "),
        ({"name": "../x"}, "plain, short file name"),
        ({"name": "a\nb"}, "plain, short file name"),
        ({"name": "x" * 300}, "plain, short file name"),
        ({"sensor": "1 2"}, "three numbers"),
        ({"floor": "nan"}, "floor: "),
        ({"density": "0"}, "density: "),
        ({"top_k": "0"}, "top_k: "),
        ({"cleaning": "{"}, "cleaning: "),
        ({"structure": '{"iterations": "many"}'}, "structure.iterations: "),
    ],
)
def test_impossible_fields_are_named(
    fields: dict[str, str], said: str, client: TestClient, workers: Any, tmp_path: Path
) -> None:
    answer = client.post("/fit", files=SCAN, data=fields)
    assert answer.status_code == 422 and said in answer.json()["error"], answer.text
    assert not workers.jobs and not list(tmp_path.iterdir())


def test_a_form_without_a_scan_is_refused(client: TestClient) -> None:
    assert client.post("/fit", data={"up": "z"}).json()["error"].startswith("scan: ")
    assert client.post("/fit", content=b"x").status_code == 422
    broken = client.post("/fit", content=b"x", headers={"content-type": "multipart/form-data; boundary=b"})
    assert broken.status_code == 400 and broken.json()["error"].endswith("data.")


@pytest.mark.parametrize(
    ("kind", "status"), [("ScanError", 422), ("TimeLimit", 504), ("WorkerDied", 500), ("Unexpected", 500)]
)
def test_errors_of_fits_are_one_sentence(kind: str, status: int, client: TestClient, workers: Any) -> None:
    workers.answer = lambda job: FitAnswer(error="chair.ply: no.", kind=kind)
    answer = client.post("/fit", files=SCAN)
    assert (answer.status_code, answer.json()) == (status, {"error": "chair.ply: no.", "kind": kind})


def test_health_and_version(client: TestClient, workers: Any) -> None:
    assert client.get("/health").json() == {"status": "ok", "workers": 1, "waiting": 0}
    assert client.get("/version").json()["kpred"] == __version__
    workers.ready = 0
    assert client.get("/health").status_code == 503


def test_every_field_and_answer_is_described(client: TestClient) -> None:
    found = client.get("/openapi.json").json()
    (name,) = (key for key in found["components"]["schemas"] if "FitForm" in key)
    assert all(field.get("description") for field in found["components"]["schemas"][name]["properties"].values())
    assert {"200", "413", "422", "503", "504"} <= set(found["paths"]["/fit"]["post"]["responses"])
    assert "model/gltf-binary" in found["paths"]["/fit"]["post"]["responses"]["200"]["content"]
    page = client.get("/").text
    assert "POST /fit" in page and "curl -F scan=@chair.ply" in page and "Up axis of the scan" in page
    assert "<script" not in page


def test_a_client_that_goes_away_takes_its_job_out_of_the_line(workers: Any, tmp_path: Path) -> None:
    workers.answer = lambda job: None
    gate = make_app(workers, tmp_path)
    body = b'--b\r\nContent-Disposition: form-data; name="scan"; filename="a.ply"\r\n\r\nply\r\n--b--\r\n'
    headers = [(b"host", b"x"), (b"content-type", b"multipart/form-data; boundary=b")]
    scope = {
        "type": "http",
        "method": "POST",
        "path": "/fit",
        "raw_path": b"/fit",
        "query_string": b"",
        "headers": headers,
    }
    messages = [{"type": "http.request", "body": body, "more_body": False}]
    left = asyncio.Event()

    async def receive() -> dict[str, Any]:
        if messages:
            return messages.pop()
        await left.wait()
        return {"type": "http.disconnect"}

    async def send(message: dict[str, Any]) -> None:
        pass

    async def talk() -> None:
        running = asyncio.create_task(gate(scope, receive, send))
        while not workers.futures:
            await asyncio.sleep(0.01)
        assert gate.inside == 1 and len(list(tmp_path.iterdir())) == 1
        left.set()
        await running

    asyncio.run(talk())
    assert workers.futures[0].cancelled() and gate.inside == 0 and not list(tmp_path.iterdir())
