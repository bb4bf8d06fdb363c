"""What a table is made of: one value for each target and series, and cells with means and intervals over the targets.

A series is one way to measure: a model (or none), a method, a protocol with its occlusion, and a metric. Its values
belong to the targets one by one, so that two series can be compared in pairs.
"""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from kpred.atomic import check_place, write_together
from kpred.errors import OutputError, PackError
from kpred.evaluation.metrics.intervals import Interval, fraction_interval, mean_interval, percentile_95, ratio_interval
from kpred.evaluation.metrics.metric import FRACTION, Metric
from kpred.evaluation.tables.former_table import series_of_version_1
from kpred.json_output import json_text, plain

ALL = "all"
"""Category of a data set's targets taken together."""

VERSION = 2


@dataclass(frozen=True, order=True)
class Subject:
    """One target: the folder and category of its pack, and its id."""

    dataset: str
    category: str
    model_id: str


@dataclass(frozen=True)
class Series:
    """One way to measure.

    Attributes:
        model: name of the model or method in this table; empty for what needs none.
        method: what was done, as `refined`; see `kpred.evaluation.methods` and `kpred.evaluation.tables.scorer`.
        protocol: `full` or `partial`; occlusion: fraction of the target's points that were hidden.
        metric: what was measured.
    """

    model: str
    method: str
    protocol: str
    occlusion: float
    metric: Metric

    @property
    def is_error(self) -> bool:
        """Whether the values are distances of results from targets, unit box squared."""
        return self.metric.is_error

    def to_json(self) -> dict[str, Any]:
        """Return plain values; those of the metric stand beside the others, its name as `metric`."""
        values = {key: value for key, value in asdict(self).items() if key != "metric"}
        metric = asdict(self.metric)
        return {**values, "metric": metric.pop("name"), **metric}

    @classmethod
    def from_json(cls, values: Mapping[str, Any]) -> Series:
        """Undo `to_json`."""
        metric = Metric(values["metric"], values["surface"], values["unit"], values["top_k"])
        return cls(values["model"], values["method"], values["protocol"], values["occlusion"], metric)


@dataclass(frozen=True)
class Cell:
    """Mean of a series over the targets of one data set and category (`all`: of all of them), with its 95 % interval.

    `low` and `high` are None for a single target; see `kpred.evaluation.metrics.intervals`. `percentile_95` is that
    of the targets' own values.
    """

    series: Series
    dataset: str
    category: str
    value: float
    low: float | None
    high: float | None
    percentile_95: float
    n: int


@dataclass(frozen=True, eq=False)
class Table:
    """Everything that was measured for one table.

    Attributes:
        header: what it was made by, as plain values.
        values: of every series, by target; a target without a value was not measured by that series.
    """

    header: dict[str, Any]
    values: dict[Series, dict[Subject, float]] = field(default_factory=dict)

    def add(self, series: Series, subject: Subject, value: float) -> None:
        """Put in one value."""
        self.values.setdefault(series, {})[subject] = value

    def subjects(self) -> list[Subject]:
        """List all targets, in the order they came in."""
        return list(dict.fromkeys(subject for values in self.values.values() for subject in values))

    def datasets(self) -> list[str]:
        """Names of the data sets, in the order they came in."""
        return list(dict.fromkeys(subject.dataset for subject in self.subjects()))

    def categories(self, dataset: str) -> list[str]:
        """Categories of a data set, in the order they came in, then `all` where there are several."""
        found = list(dict.fromkeys(subject.category for subject in self.subjects() if subject.dataset == dataset))
        return [*found, ALL] if len(found) > 1 else found

    def series(self, dataset: str) -> list[Series]:
        """Series that have a value in this data set, a model's together, in the order they came in."""
        found = [one for one, values in self.values.items() if any(subject.dataset == dataset for subject in values)]
        models = list(dict.fromkeys(one.model for one in found))
        return sorted(found, key=lambda one: models.index(one.model))

    def cell(self, series: Series, dataset: str, category: str) -> Cell | None:
        """Mean and interval; None where nothing was measured. `all` means every category, and none if one lacks."""
        values = self.values.get(series, {})
        chosen = {s: v for s, v in values.items() if s.dataset == dataset and category in (s.category, ALL)}
        if category == ALL and {s.category for s in chosen} != set(self.categories(dataset)) - {ALL}:
            return None
        if not chosen:
            return None
        every = list(chosen.values())
        found = _interval(series, every, int(self.header.get("seed", 0)))
        return Cell(series, dataset, category, found.value, found.low, found.high, percentile_95(every), len(chosen))

    def ratio(self, above: Series, below: Series, dataset: str, category: str) -> Interval | None:
        """Ratio of the means of two series over the targets that both have, which are drawn together; None for none."""
        over, under = self.values.get(above, {}), self.values.get(below, {})
        shared = [s for s in over if s in under and s.dataset == dataset and category in (s.category, ALL)]
        if not shared:
            return None
        seed = int(self.header.get("seed", 0))
        return ratio_interval([over[s] for s in shared], [under[s] for s in shared], seed)

    def cells(self) -> Iterator[Cell]:
        """Yield all cells, data set after data set, series after series."""
        for dataset in self.datasets():
            for series in self.series(dataset):
                for category in self.categories(dataset):
                    cell = self.cell(series, dataset, category)
                    if cell is not None:
                        yield cell

    def to_json(self) -> dict[str, Any]:
        """Return plain values: header, rows (cells), targets, and the values of each series, target by target."""
        subjects = self.subjects()
        return plain(
            {
                "version": VERSION,
                "header": self.header,
                "rows": [_flat(cell) for cell in self.cells()],
                "targets": [asdict(subject) for subject in subjects],
                "series": [
                    {**series.to_json(), "values": [values.get(subject) for subject in subjects]}
                    for series, values in self.values.items()
                ],
            }
        )


def read_table(path: str | Path) -> Table:
    """Read a table that `write_table` wrote.

    Raises:
        PackError: the file is missing, damaged or no table.
    """
    file = Path(path)
    try:
        read = json.loads(file.read_text(encoding="utf-8"))
    except OSError as error:
        raise PackError(f"{file}: it cannot be read ({error.strerror or error}); give a table's .json file.") from error
    except ValueError as error:
        raise PackError(f"{file}: it is not valid JSON (damaged or cut short); make the table again.") from error
    try:
        if read["version"] not in (1, VERSION):
            raise PackError(f"{file}: it is a table of another version of kpred; make it again with this one.")
        subjects = [Subject(**item) for item in read["targets"]]
        table = Table(dict(read["header"]))
        for item in read["series"]:
            values = item.pop("values")
            series = Series.from_json(item if read["version"] == VERSION else series_of_version_1(item))
            for subject, value in zip(subjects, values, strict=True):
                if value is not None:
                    table.add(series, subject, float(value))
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise PackError(
            f"{file}: it is not a table of `kpred evaluate table`; give the .json that its -o wrote."
        ) from error
    return table


def table_files(path: str | Path) -> tuple[Path, Path, Path]:
    """List a table's files: all (.json), its cells (.csv), its values target by target (.targets.csv).

    Raises:
        OutputError: the extension is not .json or .csv, or a file cannot be written there.
    """
    file = Path(path)
    if file.suffix.lower() not in (".json", ".csv"):
        raise OutputError(f"Cannot write {file}: tables are .json with a .csv beside them; give it that extension.")
    files = file.with_suffix(".json"), file.with_suffix(".csv"), file.with_suffix(".targets.csv")
    for each in files:
        check_place(each)
    return files


def write_table(table: Table, path: str | Path) -> tuple[Path, ...]:
    """Write a table as JSON and CSV, all files or none; returns what was written.

    Raises:
        OutputError: a file cannot be written there.
    """
    whole, cells, targets = table_files(path)
    value = table.to_json()
    by_target = [
        {**asdict(subject), **series.to_json(), "value": one}
        for series, values in table.values.items()
        for subject, one in values.items()
    ]
    texts = {
        whole: json_text(value, indent=1),
        cells: _csv(value["rows"]),
        targets: _csv(plain(by_target)),
    }
    write_together({file: _writer(text) for file, text in texts.items()})
    return tuple(texts)


def merged(tables: Iterable[Table], header: Mapping[str, Any]) -> Table:
    """Join the values of several tables under another header."""
    whole = Table(dict(header))
    for table in tables:
        for series, values in table.values.items():
            whole.values.setdefault(series, {}).update(values)
    return whole


def _interval(series: Series, values: Sequence[float], seed: int) -> Interval:
    finite_values = [value for value in values if math.isfinite(value)]
    if len(finite_values) < len(values):
        return Interval(math.inf, None, None)
    return (
        fraction_interval([value > 0 for value in values])
        if series.metric.unit == FRACTION
        else mean_interval(values, seed)
    )


def _flat(cell: Cell) -> dict[str, Any]:
    found = {key: value for key, value in asdict(cell).items() if key != "series"}
    return {"dataset": cell.dataset, "category": cell.category, **cell.series.to_json(), **found}


def _csv(rows: Sequence[Mapping[str, Any]]) -> str:
    stream = io.StringIO()
    if rows:
        writer = csv.DictWriter(stream, list(rows[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
    return stream.getvalue()


def _writer(text: str) -> Any:
    return lambda temporary: temporary.write_text(text, encoding="utf-8")
