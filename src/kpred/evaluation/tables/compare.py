"""Two tables compared target by target: is the difference more than chance?

For each series that both have, and each category: the ratio of the means with its paired bootstrap interval, and the
Wilcoxon signed-rank test of the differences (two-sided; exact zeros are left out). Values pair up only if targets,
their points and the protocol are the same, so that tables of another protocol, data or seed are refused.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
from scipy.stats import wilcoxon

from kpred.errors import ConfigError
from kpred.evaluation.methods.method import NO_MODEL
from kpred.evaluation.metrics.intervals import ratio_interval
from kpred.evaluation.tables.table import ALL, Series, Subject, Table


@dataclass(frozen=True)
class Comparison:
    """One series of B against the same of A.

    Attributes:
        dataset, category: of the targets; series: what was measured, without the model's name; n: number of targets.
        first, second: means of A and B; unit as in `series`.
        ratio, low, high: mean of B / mean of A, 95 % interval by paired bootstrap (None for a single target).
        better: fraction of the targets where B is lower; ties count half.
        p_value: of the Wilcoxon signed-rank test; 1 where all differences are zero, None for a single target.
    """

    dataset: str
    category: str
    series: Series
    n: int
    first: float
    second: float
    ratio: float
    low: float | None
    high: float | None
    better: float
    p_value: float | None

    def to_json(self) -> dict[str, Any]:
        """Return plain values."""
        series = {key: value for key, value in self.series.to_json().items() if key != "model"}
        return {**series, **{key: value for key, value in asdict(self).items() if key != "series"}}


def compare(first: Table, second: Table, a: str | None = None, b: str | None = None) -> list[Comparison]:
    """Compare model `b` of the second table with model `a` of the first.

    Args:
        first, second: tables of one protocol on the same data; they may be the same table.
        a, b: names of the models; a table with a single model needs none. Series without a model are left out.

    Raises:
        ConfigError: the tables were made by other protocols, data or seeds, have other targets, or do not have the
            model.
    """
    check_comparable(first, second)
    name_a, name_b = _model(first, a, "first"), _model(second, b, "second")
    mine, theirs = _series_of(first, name_a), _series_of(second, name_b)
    found = []
    for key in mine:
        if key not in theirs:
            continue
        above, below = theirs[key], mine[key]
        for dataset, category in _groups(first):
            one = compare_series(key, dataset, category, below, above, int(first.header.get("seed", 0)))
            if one is not None:
                found.append(one)
    if not found:
        raise ConfigError(f"The tables have no series in common that {name_a} and {name_b} both measured.")
    return found


def check_comparable(first: Table, second: Table) -> None:
    """Refuse tables whose values do not pair up.

    Raises:
        ConfigError: one sentence that names what differs.
    """
    for key, what in (("table", "kinds of tables"), ("data", "data"), ("protocol", "protocols")):
        one, other = first.header.get(key), second.header.get(key)
        if one != other:
            raise ConfigError(
                f"The tables are of different {what} ({_difference(one, other)}), so that their values do not pair "
                "up; make both by the same command with nothing but the models changed."
            )
    one_targets, other_targets = set(first.subjects()), set(second.subjects())
    if one_targets != other_targets:
        odd = sorted(one_targets ^ other_targets)[0]
        raise ConfigError(
            f"The tables have different targets ({len(one_targets)} and {len(other_targets)}; {odd.model_id} is in one "
            "alone); make both by the same command with nothing but the models changed."
        )


def settings_changed(first: Table, second: Table, a: str | None = None, b: str | None = None) -> list[str]:
    """List settings in which the networks of two models differ; none if one is another method."""
    one, other = (
        table.header["models"][_model(table, name, which)].get("settings", {})
        for table, name, which in ((first, a, "first"), (second, b, "second"))
    )
    lines: dict[str, list[str]] = {}
    for category in sorted(set(one) & set(other) & {subject.category for subject in first.subjects()}):
        settings, others = one[category], other[category]
        for key in dict.fromkeys([*settings, *others]):
            if settings.get(key) != others.get(key):
                lines.setdefault(f"{key}: {settings.get(key)} and {others.get(key)}", []).append(category)
    return [f"{line} ({', '.join(categories)})" for line, categories in lines.items()]


def _model(table: Table, name: str | None, which: str) -> str:
    models = [str(model) for model in table.header.get("models", {})]
    if name is None and len(models) == 1:
        return models[0]
    if name is None:
        raise ConfigError(f"The {which} table has the models {', '.join(models)}; say which one to compare.")
    if name not in models:
        raise ConfigError(f"The {which} table has no model '{name}'; it has {', '.join(models)}.")
    return name


def _series_of(table: Table, model: str) -> dict[Series, dict[Subject, float]]:
    return {replace(s, model=NO_MODEL): values for s, values in table.values.items() if s.model == model}


def _groups(table: Table) -> list[tuple[str, str]]:
    return [(dataset, category) for dataset in table.datasets() for category in table.categories(dataset)]


def compare_series(
    series: Series,
    dataset: str,
    category: str,
    first: Mapping[Subject, float],
    second: Mapping[Subject, float],
    seed: int,
) -> Comparison | None:
    """Compare two series over the targets of one category (or `all`) that both have.

    None where they have none in common.
    """
    shared = [s for s in first if s in second and s.dataset == dataset and category in (s.category, ALL)]
    if not shared:
        return None
    a, b = (np.array([values[subject] for subject in shared]) for values in (first, second))
    ratio = ratio_interval(b.tolist(), a.tolist(), seed)
    difference = b - a
    p_value: float | None = None
    if len(shared) > 1:
        p_value = float(wilcoxon(difference).pvalue) if difference.any() else 1.0
    better = float((difference < 0).mean() + 0.5 * (difference == 0).mean())
    return Comparison(
        dataset,
        category,
        series,
        len(shared),
        float(a.mean()),
        float(b.mean()),
        ratio.value,
        ratio.low,
        ratio.high,
        better,
        p_value,
    )


def _difference(one: Any, other: Any) -> str:
    """Describe what differs in a few words."""
    if isinstance(one, Mapping) and isinstance(other, Mapping):
        keys = [key for key in dict.fromkeys([*one, *other]) if one.get(key) != other.get(key)]
        return ", ".join(f"{key}: {_brief(one.get(key))} and {_brief(other.get(key))}" for key in keys[:3])
    if isinstance(one, list) and isinstance(other, list):
        pairs = [(x, y) for x, y in zip(one, other, strict=False) if x != y]
        return _difference(*pairs[0]) if pairs else f"{len(one)} and {len(other)} packs"
    return f"{_brief(one)} and {_brief(other)}"


def _brief(value: Any) -> str:
    text = value if isinstance(value, str) else json.dumps(value)
    return text if len(text) <= 40 else text[:37] + "..."
