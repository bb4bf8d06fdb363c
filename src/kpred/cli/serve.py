"""`kpred serve`: a server of fits, so that the seconds of start-up are paid once."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from tyro.conf import arg

from kpred.cli.command import Command, NetworkCommand
from kpred.cli.output import Output
from kpred.cli.usage import UsageError
from kpred.server.job import PORT


@dataclass(frozen=True, kw_only=True)
class ServeCommand(NetworkCommand):
    """Serve fits over HTTP: POST a scan, get its CAD mesh and record.

    Needs the extra: pip install 'kpred[serve]'. Model and database are loaded once. It is served on this machine alone,
    until Ctrl-C. The page at the address describes it, /openapi.json does so for programs.

    examples:
      kpred serve
      kpred serve --port 9000 --database mine.kpred --workers 2
      kpred fit chair.ply -o chair.glb --server http://127.0.0.1:8765
    """

    host: Annotated[str, arg(metavar="ADDRESS")] = "127.0.0.1"
    """Address to serve at; any other than this one lets everybody on the network send scans"""
    port: Annotated[int, arg(metavar="N")] = PORT
    """Port to serve at; 0 is any free one"""
    database: Annotated[str | None, arg(metavar="FILE_OR_URL")] = None
    """CAD database: a file (.kpred) or postgresql://...; without it, the bundled one"""
    workers: Annotated[int, arg(metavar="N")] = 1
    """Processes that fit; several share the cores, and the last bits may then differ from those of kpred fit"""
    max_megabytes: Annotated[float, arg(metavar="MB")] = 256.0
    """Size of a request beyond which it is refused"""
    time_limit: Annotated[float, arg(metavar="SECONDS")] = 60.0
    """Time to receive a scan, and time to fit it, each, after which it is given up"""
    max_requests: Annotated[int, arg(metavar="N")] = 16
    """Scans that are received, wait or are fitted at once; more are answered with 503 and Retry-After"""

    def run(self, output: Output) -> None:
        """Load, serve, and wait for Ctrl-C."""
        from kpred.server.gate import Limits
        from kpred.server.run import bound_socket, check_extra, serve, threads_each
        from kpred.server.worker import WorkerSettings

        if self.workers < 1 or self.max_requests < 1:
            raise UsageError("--workers and --max-requests must be at least 1.")
        if not (0 < self.max_megabytes < 1e6 and 0 < self.time_limit < 1e6):
            raise UsageError("--max-megabytes and --time-limit must be numbers above 0.")
        check_extra()
        # Before the work: a port in use is known at once.
        with bound_socket(self.host, self.port) as listening:
            port = listening.getsockname()[1]
            address = f"http://[{self.host}]:{port}" if ":" in self.host else f"http://{self.host}:{port}"
            output.note("loading model and database ...")

            def ready() -> None:
                output.result({"address": address})
                output.note(f"kpred serves fits at {address} (Ctrl-C ends it)")

            settings = WorkerSettings(self.model, self.database, threads_each(self.workers))
            limits = Limits(self.max_megabytes, self.time_limit, self.max_requests)
            serve(listening, settings, limits, self.workers, ready)


COMMAND: type[Command] = ServeCommand
