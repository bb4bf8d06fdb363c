"""Serving one scan: every tab gets a page and a session of its own, all beginning with the same state."""

from __future__ import annotations

import threading
from collections.abc import Sequence
from typing import Any

from kpred.studio.gestures import Gesture
from kpred.studio.page import Page
from kpred.studio.server import start_server
from kpred.studio.session import Session
from kpred.studio.state import State

LOOPBACK = "127.0.0.1"
PORT = 8080


class Studio:
    """A running studio.

    Args:
        start: of every session; name: of the scan's file; gestures: that every session begins with.
        host, port: where the page is served; port 0 is any free one.

    Raises:
        KpredError: the port is in use, viser is not installed, or a gesture cannot be done.
    """

    def __init__(
        self, start: State, name: str, gestures: Sequence[Gesture] = (), host: str = LOOPBACK, port: int = PORT
    ) -> None:
        self._start, self._name = start, name
        self._opened = Session.replay(start, gestures)
        self._pages: dict[int, Page] = {}
        self._lock = threading.Lock()
        self._server = start_server(host, port)
        self.url = f"http://{host}:{self._server.get_port()}"
        self._server.on_client_connect(self._connect)
        self._server.on_client_disconnect(self._disconnect)

    @property
    def pages(self) -> tuple[Page, ...]:
        """The pages of the tabs that are open, the oldest first."""
        with self._lock:
            return tuple(self._pages.values())

    def wait(self) -> None:
        """Serve until the program is stopped."""
        threading.Event().wait()

    def stop(self) -> None:
        """End the server and its pages."""
        for page in self.pages:
            page.close()
        self._server.stop()

    def _connect(self, client: Any) -> None:
        page = Page(client, self._opened.copy(), self._name)
        with self._lock:
            self._pages[client.client_id] = page

    def _disconnect(self, client: Any) -> None:
        with self._lock:
            page = self._pages.pop(client.client_id, None)
        if page is not None:
            page.close()
