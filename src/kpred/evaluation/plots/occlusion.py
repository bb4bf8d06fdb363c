"""Occlusion curves (the paper's figure of partial shapes): UCD against the fraction that is hidden, with 95 % bands."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

from kpred.errors import ConfigError
from kpred.evaluation.metrics.metric import SEEN, WHOLE
from kpred.evaluation.plots.figure import COLORS, new_figure
from kpred.evaluation.tables.scorer import PARTIAL
from kpred.evaluation.tables.table import Series, Table

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def occlusion_figure(tables: Sequence[Table], methods: Sequence[str], whole: bool) -> Figure:
    """Draw one row of axes for each data set, one column for each category.

    Args:
        tables: of the kind `partial`, or ablations.
        methods: which curves, as `refined` or `feed_forward`; `whole`: measured from the whole surface, not only
            from what is seen.

    Raises:
        ConfigError: no table has such curves.
    """
    surface = WHOLE if whole else SEEN

    def is_curve(series: Series) -> bool:
        from_surface = series.is_error and series.metric.surface == surface
        return from_surface and series.protocol == PARTIAL and series.method in methods

    places = {
        place: table
        for table in tables
        for place in _places(table)
        if any(is_curve(series) for series in table.series(place[0]))
    }
    if not places:
        raise ConfigError(
            f"The tables have no curves of {', '.join(methods)}; give tables of `kpred evaluate table partial`."
        )
    datasets = list(dict.fromkeys(dataset for dataset, _ in places))
    categories = list(dict.fromkeys(category for _, category in places))
    figure = new_figure(1.0 + 2.7 * len(categories), 0.8 + 2.4 * len(datasets))
    grid: Any = figure.subplots(len(datasets), len(categories), squeeze=False, sharex=True)
    handles: dict[str, Any] = {}
    for r, dataset in enumerate(datasets):
        for c, category in enumerate(categories):
            axes = grid[r, c]
            found = [table for table in tables if (dataset, category) in _places(table)]
            if not found:
                axes.set_visible(False)
                continue
            _draw(axes, found, dataset, category, is_curve, handles)
            axes.set_title(category if len(datasets) == 1 else f"{dataset}, {category}", fontsize=9)
            if r == len(datasets) - 1:
                axes.set_xlabel("hidden (%)", fontsize=8)
            if c == 0:
                axes.set_ylabel(f"UCD{', whole surface' if whole else ''} (unit box²)", fontsize=8)
    figure.legend(handles.values(), handles.keys(), loc="outside lower center", ncols=3, fontsize=8, frameon=False)
    return figure


def _places(table: Table) -> list[tuple[str, str]]:
    return [(dataset, category) for dataset in table.datasets() for category in table.categories(dataset)]


def _draw(
    axes: Any,
    tables: Sequence[Table],
    dataset: str,
    category: str,
    is_curve: Callable[[Series], bool],
    handles: dict[str, Any],
) -> None:
    curves: dict[str, list[tuple[float, float, float, float]]] = {}
    for table in tables:
        for series in table.series(dataset):
            if not is_curve(series):
                continue
            cell = table.cell(series, dataset, category)
            if cell is not None:
                low, high = (cell.value if end is None else end for end in (cell.low, cell.high))
                curves.setdefault(_name(series), []).append((100 * series.occlusion, cell.value, low, high))
    for name, points in curves.items():
        number = list(handles).index(name) if name in handles else len(handles)
        color, style = COLORS[number % len(COLORS)], "--" if number >= len(COLORS) else "-"
        x, y, lowest, highest = zip(*sorted(points), strict=True)
        (handles[name],) = axes.plot(x, y, style, marker="o", markersize=3.5, linewidth=1.4, color=color)
        axes.fill_between(x, lowest, highest, color=color, alpha=0.15, linewidth=0)
    axes.set_ylim(bottom=0)
    axes.grid(color="#dddddd", linewidth=0.5)
    axes.tick_params(labelsize=7)


def _name(series: Series) -> str:
    method = series.method.replace("_", " ")
    return f"{series.model}, {method}" if series.model else method
