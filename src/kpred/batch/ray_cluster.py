"""The Ray cluster of a batch or a build: joined or begun, and how many workers it has room for."""

from __future__ import annotations

from typing import Any

from kpred.errors import ConfigError


class RayCluster:
    """A connection to a cluster."""

    def __init__(self, address: str, size: int | None, gpus: float = 0.0) -> None:
        """Join the cluster, or begin one.

        Args:
            address: `auto`, `local` (a cluster of its own on this machine) or the head's address.
            size: number of workers, of one CPU each; None for as many as the cluster has room for.
            gpus: fraction of a GPU that each worker takes, or a number of GPUs.

        Raises:
            ConfigError: Ray is not installed, no cluster is at that address, or it has too few GPUs.
        """
        check_gpus(gpus)
        try:
            import ray
        except ImportError as error:
            raise ConfigError("Working on a cluster needs Ray; pip install 'kpred[ray]'.") from error
        self.ray: Any = ray
        self._begun = not ray.is_initialized()
        try:
            if self._begun:
                options = {"num_cpus": size, "include_dashboard": False} if address == "local" else {}
                ray.init(address=address, logging_level="error", log_to_driver=False, **options)
        except (ConnectionError, ValueError, RuntimeError, TimeoutError) as error:
            reason = str(error).splitlines()[0] if str(error) else type(error).__name__
            raise ConfigError(
                f"No Ray cluster was found at {address!r} ({reason}); start one, or give its address."
            ) from error
        found = ray.cluster_resources()
        room = max(1, int(found.get("CPU", 1)))
        if gpus:
            room_by_gpus = _holders(found.get("GPU", 0.0), gpus)
            if room_by_gpus < (size or 1):
                self.close()
                raise ConfigError(
                    f"The Ray cluster has {found.get('GPU', 0.0):g} GPUs, too few for {size or 1} workers of {gpus:g} "
                    "each; give fewer workers, a smaller fraction, or no GPUs."
                )
            room = min(room, room_by_gpus)
        self.size = size or room
        self._options = {"num_cpus": 1, "max_restarts": -1, **({"num_gpus": gpus} if gpus else {})}

    def actors(self, kind: type, *arguments: Any) -> list[Any]:
        """Start one actor of a class per worker; Ray restarts an actor that dies."""
        remote = self.ray.remote(**self._options)(kind)
        return [remote.remote(*arguments) for _ in range(self.size)]

    def close(self) -> None:
        """Leave the cluster; one that was begun here ends."""
        if self._begun:
            self.ray.shutdown()


def check_gpus(gpus: float) -> None:
    """Refuse what Ray cannot give a worker.

    Raises:
        ConfigError: it is negative, or above 1 and no whole number.
    """
    if not gpus >= 0 or (gpus > 1 and gpus != int(gpus)):
        raise ConfigError(f"A worker takes a fraction of one GPU or a whole number of GPUs, not {gpus:g}.")


def _holders(total: float, each: float) -> int:
    """Return the number of workers that fit; a fraction of a GPU lies on one GPU."""
    return int(total) * int(1 / each + 1e-9) if each < 1 else int(total // each)
