"""Running the server: port, workers, web server, and an orderly end."""

from __future__ import annotations

import os
import socket
import tempfile
from collections.abc import Callable
from contextlib import closing
from functools import partial
from pathlib import Path

from kpred.errors import ConfigError
from kpred.server.gate import Limits
from kpred.server.pool import FitPool, WorkerProcess
from kpred.server.worker import WorkerSettings

LOOPBACK = ("127.0.0.1", "localhost", "[::1]", "::1")


def check_extra() -> None:
    """Refuse to start without the libraries of the extra.

    Raises:
        ConfigError: one is not installed; the sentence names the extra.
    """
    try:
        import fastapi  # noqa: F401
        import python_multipart  # noqa: F401
        import uvicorn  # noqa: F401
    except ImportError as error:
        raise ConfigError(
            f"kpred serve needs {error.name}, which is not installed: pip install 'kpred[serve]'."
        ) from error


def bound_socket(host: str, port: int) -> socket.socket:
    """Return a socket that listens at an address; port 0 is any free one.

    Raises:
        ConfigError: the port is in use, or the host is not this machine's.
    """
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    found = socket.socket(family, socket.SOCK_STREAM)
    try:
        found.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        found.bind((host, port))
        found.listen(128)
    except (OSError, OverflowError) as error:
        found.close()
        reason = getattr(error, "strerror", None) or "the port must be a number from 0 to 65535"
        raise ConfigError(f"Fits cannot be served at {host}:{port} ({reason}); choose another --port.") from error
    return found


def serve(
    listening: socket.socket,
    settings: WorkerSettings,
    limits: Limits,
    workers: int = 1,
    ready: Callable[[], None] = lambda: None,
) -> None:
    """Serve fits until the program is stopped.

    Args:
        listening: of `bound_socket`. workers: processes that fit, which share the cores.
        ready: called when the workers are warm.

    Raises:
        ConfigError: model or database cannot be loaded.
    """
    import uvicorn

    from kpred.server.app import make_app

    host = listening.getsockname()[0]
    # Another page in the browser may lead a name of its own to this machine.
    hosts = LOOPBACK if host in LOOPBACK else ()
    start = partial(WorkerProcess, settings)
    with (
        tempfile.TemporaryDirectory(prefix="kpred-serve-") as folder,
        closing(FitPool(start, workers, limits.seconds)) as pool,
    ):
        app = make_app(pool, Path(folder), limits, hosts)
        ready()
        # Waiting connections beyond the gate's limit are answered with 503; keep-alive ones of idle clients are ended.
        config = uvicorn.Config(app, log_level="warning", lifespan="off", timeout_keep_alive=5, server_header=False)
        config.timeout_graceful_shutdown = 5
        uvicorn.Server(config).run(sockets=[listening])


def threads_each(workers: int) -> int | None:
    """Return the threads of each of several workers; None for one, which works as the command line does."""
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return None if workers == 1 else max(1, cores // workers)
