"""The web server of studio: on this machine alone, for its own page alone, one session a tab."""

from __future__ import annotations

import io
import socket
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, redirect_stdout
from http import HTTPStatus
from typing import Any

from kpred.errors import ConfigError

LOOPBACK = ("127.0.0.1", "localhost", "::1")
WILDCARDS = ("0.0.0.0", "::", "")

Answer = Callable[[Any, Any], Any]
"""From a connection and its request to a response, or None where it becomes a websocket."""


def free_port(host: str, port: int) -> int:
    """Return the port, or any free one for 0.

    Raises:
        ConfigError: it is in use, or the host is not this machine's.
    """
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    with socket.socket(family, socket.SOCK_STREAM) as probe:
        # On Windows this option would allow a port that is in use.
        if sys.platform != "win32":
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((host, port))
        except OverflowError as error:
            raise ConfigError(f"The port must be a number from 0 to 65535, but is {port}.") from error
        except OSError as error:
            raise ConfigError(
                f"The page cannot be served at {host}:{port} ({error.strerror}); choose another --port, or end the "
                "program that uses it."
            ) from error
        return int(probe.getsockname()[1])


def start_server(host: str, port: int) -> Any:
    """Start viser's server, guarded, and return it.

    Raises:
        ConfigError: viser is not installed, or the port is in use.
    """
    try:
        import viser
    except ImportError as error:
        raise ConfigError("kpred studio needs viser, which is not installed: pip install 'kpred[studio]'.") from error
    chosen = free_port(host, port)
    # viser prints a banner, and goes to the next port if another program was quicker.
    with guarded(host, chosen), redirect_stdout(io.StringIO()):
        server = viser.ViserServer(host=host, port=chosen, label="kpred studio", verbose=False)
    if server.get_port() != chosen:
        server.stop()
        raise ConfigError(f"The port {chosen} is in use; choose another with --port.")
    # viser offers its pages to the internet by a tunnel; what is opened here stays on this machine.
    server.request_share_url = lambda *_, **__: None
    return server


@contextmanager
def guarded(host: str, port: int) -> Iterator[None]:
    """Guard the server that viser starts meanwhile: viser has no place for this of its own."""
    from websockets.asyncio import server

    serve = server.serve

    def guarded_serve(*arguments: Any, process_request: Answer | None = None, **options: Any) -> Any:
        return serve(*arguments, process_request=guard(process_request, host, port), **options)

    server.serve = guarded_serve
    try:
        yield
    finally:
        server.serve = serve


def guard(answer: Answer | None, host: str, port: int) -> Answer:
    """Refuse requests that do not come from the page itself, or that name files outside of it."""

    def guarded_answer(connection: Any, request: Any) -> Any:
        hosts, origins = request.headers.get_all("Host"), request.headers.get_all("Origin")
        if not is_own(hosts, origins, host, port):
            return connection.respond(HTTPStatus.FORBIDDEN, "kpred studio answers its own page only.\n")
        if not is_plain(request.path):
            return connection.respond(HTTPStatus.NOT_FOUND, "There is no such page.\n")
        response = None if answer is None else answer(connection, request)
        if response is not None:
            response.headers["Content-Security-Policy"] = policy(hosts[0])
        return response

    return guarded_answer


def policy(host: str) -> str:
    """Make the policy that keeps the page from loading or sending anything elsewhere: viser's page counts visits."""
    own = "'self' 'unsafe-inline' 'unsafe-eval' data: blob:"
    return f"default-src {own}; connect-src 'self' ws://{host} data: blob:; frame-ancestors 'none'"


def is_own(hosts: list[str], origins: list[str], host: str, port: int) -> bool:
    """Return whether a request came from studio's own page: other pages in the same browser could send some, too.

    Args:
        hosts, origins: headers `Host` and `Origin`; host, port: where the page is served.
    """
    if len(hosts) != 1 or len(origins) > 1:
        return False
    if host not in WILDCARDS:
        names = {host, *(LOOPBACK if host in LOOPBACK else ())}
        if hosts[0] not in {f"[{name}]:{port}" if ":" in name else f"{name}:{port}" for name in names}:
            return False
    return not origins or origins[0] == f"http://{hosts[0]}"


def is_plain(path: str) -> bool:
    """Return whether a path stays within the folder of the page: `/a/b`, without `..`, `//` or a backslash."""
    path = path.partition("?")[0]
    return path.startswith("/") and "//" not in path and "\\" not in path and ".." not in path.split("/")
