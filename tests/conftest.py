"""What all tests share: shape checks switched on, seeds, and the folder of development data."""

import sys
from importlib.util import find_spec, module_from_spec, spec_from_file_location
from pathlib import Path

from jaxtyping import install_import_hook


def _import_unchecked(name: str) -> None:
    """Import one module of kpred, and not the packages it lies in, before the hook wraps its functions."""
    package = find_spec("kpred")
    assert package is not None
    assert package.submodule_search_locations
    path = Path(package.submodule_search_locations[0]).joinpath(*name.split(".")[1:]).with_suffix(".py")
    spec = spec_from_file_location(name, path)
    assert spec is not None
    assert spec.loader is not None
    sys.modules[name] = module_from_spec(spec)
    spec.loader.exec_module(sys.modules[name])


# Numba compiles and caches the function that stands there, which must not be a wrapper.
_import_unchecked("kpred.ops.nearest_cpu")

# Must stand before the first import of kpred: every annotated function then checks its arguments and result.
install_import_hook("kpred", "beartype.beartype")

import os  # noqa: E402

import numpy as np  # noqa: E402
import pytest  # noqa: E402
import torch  # noqa: E402
from hypothesis import HealthCheck, settings  # noqa: E402

settings.register_profile(
    "kpred", deadline=None, derandomize=True, max_examples=25, suppress_health_check=[HealthCheck.too_slow]
)
settings.load_profile("kpred")

if "PYTEST_XDIST_WORKER" in os.environ:
    torch.set_num_threads(1)  # the workers already fill the cores


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
def shared_data() -> Path:
    """The folder of development data: KPRED_SHARED_DATA, else ../shared/data beside the repository."""
    named = os.environ.get("KPRED_SHARED_DATA")
    folder = Path(named) if named else Path(__file__).resolve().parents[2] / "shared" / "data"
    if not folder.is_dir():
        pytest.skip(f"no development data at {folder} (set KPRED_SHARED_DATA)")
    return folder


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    if torch.cuda.is_available():
        return
    for item in items:
        if "gpu" in item.keywords:
            item.add_marker(pytest.mark.skip(reason="no CUDA device"))
