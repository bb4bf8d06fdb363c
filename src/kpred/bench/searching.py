"""Exact search and its memory against database size, beside brute force, SciPy and FAISS on the same tokens."""

from __future__ import annotations

import shutil
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
import torch

from kpred.bench.figure import Figure, load, seconds, timed_figure
from kpred.database import Database
from kpred.database.search import SearchResult, as_result, exact_distances, nearest
from kpred.database.token_file import make_table, open_table
from kpred.database.token_table import TableKey, TokenTable
from kpred.errors import ConfigError

LIMITS = {100_000: 15.0, 1_000_000: 150.0}
_PART = 4000
_CATEGORIES = 25
"""Categories that a million models are also spread over, and searched in all."""

_BRUTE_MODELS = 100_000
"""Brute force takes 6 kB a model: of more models so many are searched, and the time is scaled up."""


@dataclass(frozen=True)
class Point:
    """One size of the scaling curve; seconds and bytes."""

    models: int
    make: float
    search: float
    best: float
    resident: int
    file: int


def synthetic_tokens(base: np.ndarray, count: int, rng: np.random.Generator) -> np.ndarray:
    """Draw tokens (count, K, C) float16 distributed like real ones: near lines between models of `base` (M, K, C)."""
    a, b = rng.integers(0, len(base), (2, count))
    fraction = rng.uniform(size=(count, 1, 1)).astype(np.float32)
    beside = 0.02 * rng.standard_normal((count, *base.shape[1:]), dtype=np.float32)
    return (base[a] * fraction + base[b] * (1 - fraction) + beside).astype(np.float16)


def base_tokens(database: Database) -> np.ndarray:
    """Return the tokens (M, K, C) of the database's largest category."""
    categories = database.info()["categories"]
    category = max(categories, key=lambda name: int(categories[name]["models"]))
    return np.stack([database.entry(name).tokens for name in database.model_ids(category)[:120]])


def search_figures(
    database: Database,
    work: Path,
    sizes: list[int],
    curve: list[Point],
    report: Callable[[int, int], None],
    queries: int = 20,
) -> Iterator[Figure]:
    """Measure the search of each size; appends points of the scaling curve to `curve`."""
    base = base_tokens(database)
    for models in sorted(sizes):
        _check_room(work, models, base)
        file = work / f"{models}.tokens"
        started = time.perf_counter()
        shape = (models, *base.shape[1:])
        making = partial(_report_of, report, 2 * models)
        made = make_table(file, TableKey("", "", "", models), shape, _rows(base, models, models), making)
        make = time.perf_counter() - started
        del made
        before = _resident()
        table = open_table(file)
        assert table is not None
        wanted = synthetic_tokens(base, queries, np.random.default_rng(1)).astype(np.float32)
        table.search(wanted[0])
        times = [seconds(partial(table.search, query), 1, warm=0)[0] for query in wanted]
        resident = _resident() - before
        curve.append(Point(models, make, float(np.median(times)), min(times), resident, file.stat().st_size))
        yield timed_figure(
            f"exact search, {models} models", times, LIMITS.get(models), *_brute_force(table, wanted[0], models)
        )
        if models == 1_000_000:
            held = resident / 1e9
            name = "resident memory for the tokens of 1000000 models"
            plain = 4 * float(np.prod(shape)) / 1e9
            yield Figure(name, held, "GB", 2.0, 1, held, "float32 tokens in memory", plain, load())
        if models == 100_000:
            yield from _peers(table, wanted)
        del table
        file.unlink()
        if models == 1_000_000:
            yield _together(work, base, models, wanted, times)


def _rows(base: np.ndarray, models: int, seed: int) -> Iterator[tuple[list[str], np.ndarray]]:
    """Yield ids and tokens of `models` models, some thousand at a time."""
    rng = np.random.default_rng(seed)
    for at in range(0, models, _PART):
        many = min(_PART, models - at)
        yield [f"m{i:09d}" for i in range(at, at + many)], synthetic_tokens(base, many, rng)


def _together(work: Path, base: np.ndarray, models: int, wanted: np.ndarray, one_table: list[float]) -> Figure:
    """Measure the search of as many models in `_CATEGORIES` tables, all of them for each query, one after the other."""
    folder, each = work / "categories", models // _CATEGORIES
    folder.mkdir(exist_ok=True)
    tables = []
    for row in range(_CATEGORIES):
        file = folder / f"{row}.tokens"
        make_table(file, TableKey("", "", "", each), (each, *base.shape[1:]), _rows(base, each, row + 1))
        table = open_table(file)
        assert table is not None
        tables.append(table)

    def search(query: np.ndarray) -> list[SearchResult]:
        return [table.search(query) for table in tables]

    search(wanted[0])
    times = [seconds(partial(search, query), 1, warm=0)[0] for query in wanted]
    del tables
    shutil.rmtree(folder)
    name = f"exact search, {models} models in {_CATEGORIES} categories"
    return timed_figure(name, times, LIMITS.get(models), "the same number in one category", one_table)


def _report_of(report: Callable[[int, int], None], total: int, done: int) -> None:
    report(done, total)


def _brute_force(table: TokenTable, query: np.ndarray, models: int) -> tuple[str, list[float]]:
    """Measure the exact search in one pass over float32 tokens, and check that it finds the same."""
    max_models = min(models, _BRUTE_MODELS)
    tokens = torch.from_numpy(table.half[:max_models].astype(np.float32)).flatten(1)
    flat = torch.from_numpy(query).flatten()[None]
    times = seconds(lambda: torch.cdist(flat, tokens, p=1.0)[0].topk(min(10, max_models), largest=False), 3)
    if max_models == models:
        distances = exact_distances(table.half[:], query, np.ones(len(query)))
        ids = [f"m{i:09d}" for i in range(models)]
        wanted = as_result(nearest(ids, distances, 10))
        found = table.search(query)
        if found.model_ids != wanted.model_ids or not np.array_equal(found.distances, wanted.distances):
            raise AssertionError("the search does not find what the reference finds")
    name = "torch.cdist" if max_models == models else f"torch.cdist of {max_models} models, scaled"
    return name, [t * models / max_models for t in times]


def _peers(table: TokenTable, queries: np.ndarray) -> Iterator[Figure]:
    """Measure the same search by SciPy, and by FAISS where it is installed."""
    from scipy.spatial.distance import cdist

    tokens = table.half[:].astype(np.float32).reshape(len(table), -1)
    flat = queries.reshape(len(queries), -1)
    own = seconds(lambda: table.search(queries[1]), 5)
    name = f"exact search, {len(table)} models"
    few = tokens[: len(tokens) // 10]
    scipy = [10 * t for t in seconds(lambda: cdist(flat[1:2], few, "cityblock"), 3)]
    yield timed_figure(name, own, None, "SciPy cdist (of a tenth, scaled)", scipy)
    try:
        import faiss
    except ImportError:
        return
    index = faiss.IndexFlat(tokens.shape[1], faiss.METRIC_L1)
    index.add(tokens)
    yield timed_figure(name, own, None, "FAISS IndexFlat, L1", seconds(lambda: index.search(flat[1:2], 10), 5))


def _resident() -> int:
    """Return the bytes of this process that are in memory."""
    try:
        with open("/proc/self/statm", encoding="ascii") as file:
            return int(file.read().split()[1]) * 4096
    except OSError:
        return 0


def _check_room(work: Path, models: int, base: np.ndarray) -> None:
    wanted = models * 3 * int(np.prod(base.shape[1:])) + 10**8
    if shutil.disk_usage(work).free < wanted:
        raise ConfigError(
            f"{work}: {models} models need {wanted / 1e9:.1f} GB there; free some, or leave that size out."
        )
