"""Serving the page: every tab of a browser is one of its own."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

from kpred.studio.server import start_server
from kpred.studio.tabs import Tab

LOOPBACK = "127.0.0.1"
PORT = 8080


class Studio:
    """A running studio.

    Args:
        make_tab: makes a tab of viser's client (`kpred.studio.tabs`).
        host, port: where the page is served; port 0 is any free one.

    Raises:
        KpredError: the port is in use, or viser is not installed.
    """

    def __init__(self, make_tab: Callable[[Any], Tab], host: str = LOOPBACK, port: int = PORT) -> None:
        self._make_tab = make_tab
        self._tabs: dict[int, Tab] = {}
        self._lock = threading.Lock()
        self._server = start_server(host, port)
        self.url = f"http://{host}:{self._server.get_port()}"
        self._server.on_client_connect(self._connect)
        self._server.on_client_disconnect(self._disconnect)

    @property
    def tabs(self) -> tuple[Tab, ...]:
        """The tabs that are open, the oldest first."""
        with self._lock:
            return tuple(self._tabs.values())

    def wait(self) -> None:
        """Serve until the program is stopped."""
        threading.Event().wait()

    def stop(self) -> None:
        """End the server and its tabs."""
        for tab in self.tabs:
            tab.close()
        self._server.stop()

    def _connect(self, client: Any) -> None:
        tab = self._make_tab(client)
        tab.begin()
        with self._lock:
            self._tabs[client.client_id] = tab

    def _disconnect(self, client: Any) -> None:
        with self._lock:
            tab = self._tabs.pop(client.client_id, None)
        if tab is not None:
            tab.close()
