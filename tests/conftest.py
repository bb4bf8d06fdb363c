"""What all tests share: shape checks switched on, seeds, and the folder of development data."""

import gc
import os
import signal
import sys
from importlib import import_module
from pathlib import Path

import numba
import numpy as np
import pytest
import torch
from hypothesis import HealthCheck, settings
from jaxtyping import install_import_hook

# Bytecode is kept, whatever the environment says: checked code takes long to compile, and programs are started often.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False

# A shell ignores these signals for what it runs in the background, and so would all programs that tests stop.
for name, handler in (("SIGINT", signal.default_int_handler), ("SIGHUP", signal.SIG_DFL)):
    number = getattr(signal, name, None)  # Windows has no SIGHUP
    if number is not None and signal.getsignal(number) is signal.SIG_IGN:
        signal.signal(number, handler)

# What is imported within a hooked module is compiled from its source: libraries come before.
for library in ("scipy.optimize", "scipy.spatial", "scipy.stats", "sqlalchemy", "trimesh", "huggingface_hub", "tyro"):
    import_module(library)

SOURCE = Path(__file__).resolve().parents[1] / "src"

# Must stand before the first import of kpred: where arrays have shapes, each function then checks its arguments and
# result. mypy checks all other types, and much faster.
install_import_hook(
    [
        ".".join(file.relative_to(SOURCE).with_suffix("").parts)
        for file in SOURCE.rglob("*.py")
        if "from kpred.ops.typing import" in file.read_text(encoding="utf-8")
    ],
    "beartype.beartype",
)

from kpred.nn import Model, ModelConfig  # noqa: E402
from kpred.training.run import new_network  # noqa: E402

settings.register_profile(
    "kpred", deadline=None, derandomize=True, max_examples=25, suppress_health_check=[HealthCheck.too_slow]
)
settings.load_profile("kpred")

# Libraries make many objects and no garbage: they are searched for cycles less often.
gc.set_threshold(100_000, 50, 1000)

if "PYTEST_XDIST_WORKER" in os.environ:
    # The workers already fill the cores.
    torch.set_num_threads(1)
    numba.set_num_threads(1)


@pytest.fixture
def seed() -> int:
    """The one seed of a test; global random state is set from it as well."""
    torch.manual_seed(0)
    return 0


@pytest.fixture
def generator(seed: int) -> torch.Generator:
    return torch.Generator().manual_seed(seed)


@pytest.fixture
def rng(seed: int) -> np.random.Generator:
    return np.random.default_rng(seed)


@pytest.fixture(scope="session")
def untrained() -> Model:
    """Small untrained networks for chairs and tables."""
    networks = {}
    for category in ("chair", "table"):
        config = ModelConfig(category=category, width=16, token_size=8, region_points=16, stages=1)
        networks[category] = new_network(config, seed=0).eval().requires_grad_(False)
    return Model("untrained", networks)


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """The folder of development data: KPRED_SHARED_DATA, else ../shared/data beside the repository."""
    named = os.environ.get("KPRED_SHARED_DATA")
    folder = Path(named) if named else Path(__file__).resolve().parents[2] / "shared" / "data"
    if not folder.is_dir():
        pytest.skip(f"no development data at {folder} (set KPRED_SHARED_DATA)")
    return folder


def pytest_collection_finish() -> None:
    """Leave what is loaded by now out of all searches for cycles."""
    gc.freeze()


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    if torch.cuda.is_available():
        return
    for item in items:
        if "gpu" in item.keywords:
            item.add_marker(pytest.mark.skip(reason="no CUDA device"))


STARTED = pytest.StashKey[float]()
SECONDS: dict[str, float] = {}
"""Processor seconds of each test, its fixtures and the processes that it started."""


def processor_seconds() -> float:
    times = os.times()
    return times.user + times.system + times.children_user + times.children_system


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item: pytest.Item) -> None:
    item.stash[STARTED] = processor_seconds()


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_makereport(item: pytest.Item, call: pytest.CallInfo[None]) -> None:
    if call.when == "teardown":
        item.user_properties.append(("processor_seconds", processor_seconds() - item.stash[STARTED]))


def pytest_runtest_logreport(report: pytest.TestReport) -> None:
    if report.when == "teardown":
        SECONDS[report.nodeid] = float(str(dict(report.user_properties)["processor_seconds"]))


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Print what takes most; unlike durations, processor seconds say the same on a busy machine."""
    slowest = sorted(SECONDS.items(), key=lambda item: -item[1])[:10]
    terminalreporter.section(f"slowest 10 of {sum(SECONDS.values()):.0f} processor seconds")
    for name, seconds in slowest:
        terminalreporter.line(f"{seconds:6.1f} s  {name}")
