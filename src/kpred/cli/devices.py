"""Where training runs: the device by its name, and how many CPU threads."""

from __future__ import annotations

from kpred.errors import ConfigError


def limit_threads(number: int) -> None:
    """Limit the threads of torch and of compiled kernels: those beyond the free cores spin while they wait.

    Raises:
        ConfigError: if it is below 1.
    """
    import torch

    if number < 1:
        raise ConfigError(f"Training needs at least 1 thread, but --threads is {number}.")
    torch.set_num_threads(number)


def found_device(name: str) -> str:
    """Return the device of this name; `auto` is CUDA where there is one.

    Raises:
        ConfigError: if it is not there.
    """
    import torch

    if name == "auto":
        return "cuda" if torch.cuda.is_available() else "cpu"
    try:
        torch.empty(0, device=name)
    except (RuntimeError, AssertionError) as error:
        raise ConfigError(f"The device {name} is not there or unknown; use --device cpu, or auto.") from error
    return name
