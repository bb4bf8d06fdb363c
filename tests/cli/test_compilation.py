"""Compiled code: the first fit says that it compiles, once; a cache that cannot be written is named."""

from __future__ import annotations

import importlib.util
import resource
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType

import pytest

from kpred.cli.compilation import cache_problem, reported_compilation

SOURCE = """
import numba

@numba.njit(cache=True)
def first(x):
    return x + 1

@numba.njit(cache=True)
def second(x):
    return x * 2
"""


def _module(folder: Path) -> ModuleType:
    """A module of two compiled functions, not compiled yet."""
    file = folder / "compiled_module.py"
    file.write_text(SOURCE)
    spec = importlib.util.spec_from_file_location("compiled_module", file)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@contextmanager
def _files_of_at_most(size: int) -> Iterator[None]:
    """As if the disk were full: no file may grow beyond `size` bytes."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


def test_compilation_is_reported_once_and_only_when_it_happens(tmp_path: Path) -> None:
    lines: list[str] = []
    module = _module(tmp_path)
    with reported_compilation(lines.append, after=0.0):
        module.first(1)
        assert lines == []  # one function alone is not worth a line
        module.second(1)
        module.second(1.0)
        module.second(1j)
    assert len(lines) == 1
    assert "kpred compile" in lines[0]
    again = _module(tmp_path)
    with reported_compilation(lines.append, after=0.0):
        again.first(1)
        again.second(1)
        again.second(1.0)
    assert again.second.stats.cache_hits
    assert len(lines) == 1


def test_a_full_disk_names_the_cache_and_the_remedy(tmp_path: Path) -> None:
    module = _module(tmp_path)
    with pytest.raises(OSError) as raised, _files_of_at_most(64):
        module.first(1)
    text = cache_problem(raised.value)
    assert text is not None
    assert str(tmp_path / "__pycache__") in text
    assert "NUMBA_CACHE_DIR" in text


def test_no_folder_to_cache_in_names_the_remedy(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import numba.core.caching as caching

    monkeypatch.setattr(caching.CacheImpl, "_locator_classes", [])
    with pytest.raises(RuntimeError) as raised:
        _module(tmp_path)
    assert "NUMBA_CACHE_DIR" in (cache_problem(raised.value) or "")


def test_other_errors_are_not_taken_for_it(tmp_path: Path) -> None:
    with pytest.raises(OSError) as raised, _files_of_at_most(64), open(tmp_path / "file", "wb") as stream:
        stream.write(bytes(100_000))
    assert cache_problem(raised.value) is None
    assert "compiled_module" not in sys.modules
