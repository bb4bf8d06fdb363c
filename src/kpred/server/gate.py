"""The gate before the server: who may come in, how many at once, how large and how slow a request may be."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Awaitable, Callable, MutableMapping
from dataclasses import dataclass
from typing import Any

from kpred._version import __version__
from kpred.server.job import VERSION

Scope = MutableMapping[str, Any]
Message = MutableMapping[str, Any]
Receive = Callable[[], Awaitable[Message]]
Send = Callable[[Message], Awaitable[None]]
App = Callable[[Scope, Receive, Send], Awaitable[None]]

RETRY_SECONDS = 2
"""What a full server proposes to wait."""


@dataclass(frozen=True)
class Limits:
    """Limits of requests.

    Attributes:
        megabytes: of a request. seconds: to receive it, and to fit it, each. requests: worked on or waiting at once.
    """

    megabytes: float = 256.0
    seconds: float = 60.0
    requests: int = 16

    @property
    def max_bytes(self) -> int:
        """Of a request."""
        return int(self.megabytes * 1e6)


class RefusedError(Exception):
    """A request is refused: status, and one sentence why."""

    def __init__(self, status: int, sentence: str, kind: str) -> None:
        super().__init__(sentence)
        self.status, self.sentence, self.kind = status, sentence, kind


class Gate:
    """ASGI application before another: it refuses before anything is read, and cuts off while it is read.

    Args:
        app: what comes after it. hosts: names in the header `Host` that are answered; none answers all.
    """

    def __init__(self, app: App, limits: Limits, hosts: tuple[str, ...] = ()) -> None:
        self.app, self.limits, self.hosts = app, limits, hosts
        self.inside = 0

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer one request."""
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return
        try:
            headers = {key.decode("latin-1").lower(): value.decode("latin-1") for key, value in scope["headers"]}
            self._check_origin(headers)
            if scope["method"] in ("GET", "HEAD"):
                await self.app(scope, receive, send)
            else:
                await self._work(headers, scope, receive, send)
        except RefusedError as error:
            await refuse(send, error)

    async def _work(self, headers: dict[str, str], scope: Scope, receive: Receive, send: Send) -> None:
        self._check_size(headers.get("content-length"))
        if self.inside >= self.limits.requests:
            raise RefusedError(503, f"The server is busy with {self.inside} scans; try again soon.", "Busy")
        self.inside += 1
        body = _Body(receive, self.limits)
        started = False

        async def sent(message: Message) -> None:
            nonlocal started
            # What the application says of a body that was cut off is not what went wrong.
            if body.refused is not None and not started:
                raise body.refused
            started = True
            await send(message)

        try:
            await self.app(scope, body.receive, sent)
        finally:
            self.inside -= 1

    def _check_origin(self, headers: dict[str, str]) -> None:
        """Refuse what another page in the same browser may have sent."""
        host = headers.get("host", "")
        name = host.rpartition(":")[0] if host.rpartition(":")[2].isdigit() else host
        if self.hosts and name not in self.hosts:
            raise RefusedError(403, "The server answers requests to its own address only.", "Forbidden")
        if headers.get("origin", f"http://{host}") != f"http://{host}":
            raise RefusedError(403, "The server answers no pages from elsewhere.", "Forbidden")

    def _check_size(self, length: str | None) -> None:
        if length is not None and (not length.isdigit() or int(length) > self.limits.max_bytes):
            raise too_large(self.limits)


class _Body:
    """The body of a request, counted and timed while it is read."""

    def __init__(self, receive: Receive, limits: Limits) -> None:
        self._receive, self._limits = receive, limits
        self._bytes, self._whole = 0, False
        self._until = asyncio.get_running_loop().time() + limits.seconds
        self.refused: RefusedError | None = None

    async def receive(self) -> Message:
        """Return the next message; once the body is whole only the client's going away is left to wait for."""
        if self._whole:
            return await self._receive()
        try:
            async with asyncio.timeout_at(self._until):
                message = await self._receive()
        except TimeoutError:
            sentence = f"The scan was not received within {self._limits.seconds:g} s; send it again, or a smaller one."
            self.refused = RefusedError(408, sentence, "TimeLimit")
            raise self.refused from None
        self._bytes += len(message.get("body", b""))
        self._whole = not message.get("more_body", False)
        if self._bytes > self._limits.max_bytes:
            self.refused = too_large(self._limits)
            raise self.refused
        return message


def too_large(limits: Limits) -> RefusedError:
    """Return the refusal of a request that is too large."""
    sentence = f"The request is larger than {limits.megabytes:g} MB; send fewer points, or raise --max-megabytes."
    return RefusedError(413, sentence, "TooLarge")


async def refuse(send: Send, error: RefusedError) -> None:
    """Send a refusal, and end the connection: what is left of the request is not read."""
    headers = [
        (b"content-type", b"application/json"),
        (b"connection", b"close"),
        (VERSION.encode(), __version__.encode()),
    ]
    if error.status == 503:
        headers.append((b"retry-after", str(RETRY_SECONDS).encode()))
    body = json.dumps({"error": error.sentence, "kind": error.kind}).encode()
    await send({"type": "http.response.start", "status": error.status, "headers": headers})
    await send({"type": "http.response.body", "body": body})
