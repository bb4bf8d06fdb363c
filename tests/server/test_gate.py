"""The gate: refuses before it reads, cuts off while it reads, counts who is inside."""

import asyncio
import json
from typing import Any

import pytest

from kpred.server.gate import Gate, Limits

LIMITS = Limits(megabytes=0.001, seconds=0.2, requests=1)


class Client:
    """One request to a gate: its chunks, and what it was answered."""

    def __init__(self, chunks: list[bytes], headers: dict[str, str] | None = None, method: str = "POST") -> None:
        self.chunks, self.read, self.status, self.body, self.answered = list(chunks), 0, 0, b"", {}
        raw = [(key.encode(), value.encode()) for key, value in ({"host": "localhost:1"} | (headers or {})).items()]
        self.scope = {"type": "http", "method": method, "path": "/fit", "headers": raw}

    async def receive(self) -> dict[str, Any]:
        if self.read == len(self.chunks):
            await asyncio.sleep(60)
        self.read += 1
        return {"type": "http.request", "body": self.chunks[self.read - 1], "more_body": self.read < len(self.chunks)}

    async def send(self, message: dict[str, Any]) -> None:
        if message["type"] == "http.response.start":
            self.status = message["status"]
            self.answered = {key.decode(): value.decode() for key, value in message["headers"]}
        self.body += message.get("body", b"")

    @property
    def sentence(self) -> str:
        return json.loads(self.body)["error"]


async def read_all(scope: Any, receive: Any, send: Any) -> None:
    """An application that reads all, and hides what goes wrong, as frameworks do."""
    try:
        while (await receive()).get("more_body"):
            pass
    except Exception:
        await send({"type": "http.response.start", "status": 400, "headers": []})
        return
    await send({"type": "http.response.start", "status": 200, "headers": []})
    await send({"type": "http.response.body", "body": b"fine"})


def ask(client: Client, gate: Gate | None = None) -> Client:
    asyncio.run((gate or Gate(read_all, LIMITS, ("localhost",)))(client.scope, client.receive, client.send))
    return client


def test_what_fits_goes_through() -> None:
    client = ask(Client([b"a" * 400, b"b" * 600]))
    assert (client.status, client.body, client.read) == (200, b"fine", 2)


@pytest.mark.parametrize("length", ["2000000000", "1001", "-1", "many"])
def test_a_length_beyond_the_limit_is_refused_unread(length: str) -> None:
    client = ask(Client([b"a"] * 3, {"content-length": length}))
    assert (client.status, client.read) == (413, 0)
    assert "larger than 0.001 MB" in client.sentence and client.answered["connection"] == "close"


def test_chunks_are_cut_off_at_the_limit() -> None:
    client = ask(Client([b"a" * 300] * 1000))
    assert (client.status, client.read) == (413, 4)


def test_a_body_that_trickles_is_given_up() -> None:
    class Slow(Client):
        async def receive(self) -> dict[str, Any]:
            await asyncio.sleep(0.05)
            self.read += 1
            return {"type": "http.request", "body": b"a", "more_body": True}

    client = ask(Slow([]))
    assert client.status == 408 and client.read < 6


def test_no_more_than_allowed_come_in() -> None:
    entered = asyncio.Event()

    async def slow(scope: Any, receive: Any, send: Any) -> None:
        entered.set()
        await asyncio.sleep(0.1)
        await send({"type": "http.response.start", "status": 200, "headers": []})

    async def both() -> tuple[Client, Client, Client, Gate]:
        gate = Gate(slow, LIMITS)
        first, second, third = Client([b"a"]), Client([b"a"]), Client([b"a"])
        running = asyncio.create_task(gate(first.scope, first.receive, first.send))
        await entered.wait()
        await gate(second.scope, second.receive, second.send)
        await running
        await gate(third.scope, third.receive, third.send)
        return first, second, third, gate

    first, second, third, gate = asyncio.run(both())
    assert [client.status for client in (first, second, third)] == [200, 503, 200]
    assert int(second.answered["retry-after"]) >= 1 and second.read == 0 and gate.inside == 0


@pytest.mark.parametrize(
    ("headers", "status"),
    [
        ({"host": "evil.example"}, 403),
        ({"host": "evil.example:80"}, 403),
        ({"host": "localhost"}, 200),
        ({"origin": "http://evil.example"}, 403),
        ({"origin": "null"}, 403),
        ({"origin": "http://localhost:1"}, 200),
    ],
)
def test_other_pages_of_the_browser_are_refused(headers: dict[str, str], status: int) -> None:
    assert ask(Client([b"a"], headers)).status == status
    assert ask(Client([b"a"], headers, "GET")).status == status


def test_an_address_for_all_answers_every_name() -> None:
    assert ask(Client([b"a"], {"host": "robot.local"}), Gate(read_all, LIMITS)).status == 200
