"""The scaling plot: making and searching a token table against the number of models."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from kpred.atomic import atomic_path
from kpred.bench.searching import Point


def save_scaling_plot(curve: Sequence[Point], file: Path) -> None:
    """Write the plot as .png or .pdf. Raises OutputError; ImportError without matplotlib."""
    import matplotlib

    matplotlib.use("agg")
    from matplotlib import pyplot

    figure, (left, right) = pyplot.subplots(1, 2, figsize=(10, 4), constrained_layout=True)
    models = [point.models for point in curve]
    left.loglog(models, [1000 * point.search for point in curve], "o-", label="search, median")
    left.loglog(models, [1000 * point.best for point in curve], "o:", label="search, best")
    left.loglog(models, [1000 * point.make for point in curve], "s--", label="making the token file")
    left.set(xlabel="models", ylabel="milliseconds", title="time")
    right.loglog(models, [point.file / 1e6 for point in curve], "s--", label="token file")
    held = [(point.models, point.resident / 1e6) for point in curve if point.resident > 0]
    if held:
        right.loglog(*zip(*held, strict=True), "o-", label="resident after searching")
    right.set(xlabel="models", ylabel="megabytes", title="space")
    for axes in (left, right):
        axes.grid(True, which="both", alpha=0.2)
        axes.legend()
    with atomic_path(file) as temporary:
        figure.savefig(temporary, dpi=150)
    pyplot.close(figure)
