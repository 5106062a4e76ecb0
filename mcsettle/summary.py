"""From the tables of a finished run to the numbers that answer the study's question.

Every number is an ``Estimate`` with its Monte Carlo error and its censored count. The spread
between realisations (P5 to P95) is what differs between track sections and, in a study with uncertain
inputs, between parameter sets; the standard error is what a larger sample would shrink.

Depends on: errors, estimate, key_paths, nested, place, store, study, study_schema, summary_spread.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd

from mcsettle import store
from mcsettle.errors import InputError
from mcsettle.estimate import Estimate, Statistic, summarise_effects, summarise_intervals
from mcsettle.key_paths import input_column
from mcsettle.nested import crossed_bounded, crossed_effects, crossed_intervals
from mcsettle.place import Folder, Place, Where, place
from mcsettle.study import Study, study_from_text
from mcsettle.study_schema import ReferenceTable
from mcsettle.summary_spread import effect_spread, interval_spread, matrix

STUDY_FILE = "study.toml"
INTERVAL = "tamping_interval_days"
GROWTH = "sd_growth_1y_mm"


@dataclass(frozen=True)
class Results:
    """A finished run: its study and its tables (``history`` and ``effects`` may be empty)."""

    study: Study
    realisations: pd.DataFrame
    history: pd.DataFrame
    effects: pd.DataFrame


@dataclass(frozen=True)
class SummaryRow:
    """One metric of one scenario in one variant, and the published value beside it.

    ``statistics``: P5, P50, P95 and a mean. ``reference_percent``: share of the realisations [%]
    below the published value (a censored one counts as above it), None without one. ``spread``: what
    the spread consists of and what remains of it along a line (``summary_spread``).
    """

    variant: str
    scenario: str
    metric: str
    unit: str
    statistics: tuple[Statistic, ...]
    reference: ReferenceTable | None = None
    reference_percent: float | None = None
    spread: tuple[Statistic, ...] = ()

    def at(self, level: float) -> Estimate:
        """The quantile at ``level`` (one of ``estimate.LEVELS``)."""
        return next(s.estimate for s in self.statistics if s.level == level)


def read_results(folder: Where, finished: bool = True) -> Results:
    """Read the tables that a run has left in ``folder`` (a path or a URL).

    A run that is not finished is refused, unless ``finished`` is False.

    Raises
    ------
    InputError
        The folder does not exist, holds no finished run, or a file of it is damaged or missing.
    """
    at = place(folder)
    if not at.exists():
        raise InputError(f"{at} is no folder; 'mcsettle run STUDY --out {at}' makes one")
    names = set(at.names())
    if STUDY_FILE not in names or not any(name.startswith("realisations/") for name in names):
        raise InputError(
            f"{at} holds no finished run (realisations/ and {STUDY_FILE}); "
            f"'mcsettle run STUDY --out {at}' makes one"
        )
    if finished and store.MANIFEST not in names:
        raise InputError(
            f"{at} holds a run that is not finished; 'mcsettle status {at}' says what is missing, "
            "and the same run command goes on with it"
        )
    tables = (_table(at, name, names) for name in ("realisations", "history", "effects"))
    return Results(study_of(at), *tables)


def study_of(folder: Where) -> Study:
    """The study that a results folder is of.

    Raises
    ------
    InputError
        There is none, or it cannot be read.
    """
    at = place(folder)
    text = store.read_file(at, STUDY_FILE)
    own = at.path.absolute() if isinstance(at, Folder) else None
    return study_from_text(text, f"{at}/{STUDY_FILE}", own)


def summary_rows(results: Results) -> list[SummaryRow]:
    """Every metric of every variant and scenario, in the order of the study."""
    return [
        row
        for variant in results.study.variant_names
        for scenario in results.study.scenario_names
        for row in _rows_of(results, variant, scenario)
    ]


def _rows_of(results: Results, variant: str, scenario: str) -> Iterator[SummaryRow]:
    table = _part(results.realisations, variant, scenario)
    if table.empty or (table["status"] == "failed").all():
        return
    days = table[INTERVAL].to_numpy(dtype=float, na_value=np.nan)
    failed = (table["status"] == "failed").to_numpy()
    intervals = tuple(_intervals(table, INTERVAL, "censored_at_days"))
    row = _with_reference(results, variant, scenario, INTERVAL, intervals, days[~failed])
    yield replace(row, spread=tuple(interval_spread(results.study, table)))
    yield from _growth_rows(results, variant, scenario, table[~failed])
    yield from _effect_rows(results, variant, scenario)


def _intervals(table: pd.DataFrame, column: str, ends: str) -> list[Statistic]:
    """Statistics of a column with its censorings, crossed if there are several parameter sets."""
    if table["parameter_set"].nunique() > 1:
        return crossed_intervals(matrix(table, column), matrix(table, ends))
    values, limits = (table[c].to_numpy(dtype=float, na_value=np.nan) for c in (column, ends))
    return summarise_intervals(values, limits)


def _growth_rows(
    results: Results, variant: str, scenario: str, table: pd.DataFrame
) -> Iterator[SummaryRow]:
    """Growth of the SD [mm] after a year and after the days the reference gives."""
    own = input_column("limit.sd_limit_mm")  # where it differs between parameter sets
    limit = table.get(own, results.study.limit.sd_limit_mm)
    table = table.assign(to_limit=(limit - table["sd_initial_mm"]).astype(float))
    year = table[GROWTH].to_numpy(dtype=float, na_value=np.nan)
    yield _with_reference(results, variant, scenario, GROWTH, _growth(table, GROWTH), year)
    published = _reference(results.study, INTERVAL, scenario)
    history = _part(results.history, variant, scenario)
    if published is None or history.empty:
        return
    keys = ["parameter_set", "realisation"]
    then = history[history["day"] == published.value].set_index(keys)["sd_mm"]
    start = table.set_index(keys)["sd_initial_mm"]
    growth = (then.reindex(start.index) - start).to_numpy(dtype=float)
    if np.all(np.isnan(growth)):
        return
    metric = f"sd_growth_{published.value:g}d_mm"
    table = table.assign(growth=growth)
    yield SummaryRow(variant, scenario, metric, "mm", _growth(table, "growth"))


def _growth(table: pd.DataFrame, column: str) -> tuple[Statistic, ...]:
    """Quantiles of SD growth; where the limit came first, growth is censored at the limit."""
    table = table.assign(end=table["to_limit"].where(table[column].isna(), np.nan))
    if table["parameter_set"].nunique() > 1:
        found = crossed_bounded(matrix(table, column), matrix(table, "end"), "mm")
    else:
        found = _intervals(table, column, "end")
    rows = []
    for row in found:
        if row.level is not None:
            note = "the limit comes first" if row.estimate.value is None else ""
            rows.append(replace(row, estimate=replace(row.estimate, unit="mm", note=note)))
    return tuple(rows)


def _effect_rows(results: Results, variant: str, scenario: str) -> Iterator[SummaryRow]:
    """Paired effects against the baseline: reduction, elasticity, marginal cost."""
    if results.effects.empty:
        return
    change = results.study.change(scenario)
    table = _part(results.effects, variant, scenario)
    if table.empty or change is None:
        return
    table = table[~table["status"].isin(["failed", "at_limit"])]
    if table.empty:
        return
    nested = table["parameter_set"].nunique() > 1
    spreads = effect_spread(results.study, variant, scenario, results.realisations, table)
    units = {"reduction_percent": "%", "elasticity": "1", "marginal_cost": change.unit}
    for metric, unit in units.items():
        values = table[metric].to_numpy(dtype=float, na_value=np.nan)
        if nested:
            of_sets = matrix(table, metric)
            failed = np.isnan(matrix(table.assign(known=1.0), "known"))
            statistics = tuple(crossed_effects(of_sets, failed, unit))
        else:
            statistics = tuple(summarise_effects(values, unit))
        row = _with_reference(results, variant, scenario, metric, statistics, values)
        yield replace(row, spread=tuple(spreads.get(metric, ())))


def _with_reference(
    results: Results,
    variant: str,
    scenario: str,
    metric: str,
    statistics: tuple[Statistic, ...],
    values: np.ndarray,
) -> SummaryRow:
    """The row of ``metric`` with the published value; NaN among ``values`` lies above it."""
    unit = statistics[0].estimate.unit
    row = SummaryRow(variant, scenario, metric, unit, statistics)
    published = _reference(results.study, metric, scenario)
    unknown = metric != INTERVAL and np.all(np.isnan(values))
    if published is None or not len(values) or unknown:
        return replace(row, reference=published)
    percent = 100.0 * float(np.mean(values < published.value))
    return replace(row, reference=published, reference_percent=percent)


def _reference(study: Study, metric: str, scenario: str) -> ReferenceTable | None:
    rows = (r for r in study.reference if r.metric == metric and r.scenario == scenario)
    return next(rows, None)


def _part(table: pd.DataFrame, variant: str, scenario: str) -> pd.DataFrame:
    """Rows of one variant and scenario."""
    if table.empty:
        return table
    return table[(table["variant"] == variant) & (table["scenario"] == scenario)]


def _table(at: Place, name: str, names: set[str]) -> pd.DataFrame:
    """The table ``name`` of a run, empty where it was not written."""
    if not any(held.startswith(f"{name}/") for held in names) and not store.lists(at, name):
        return pd.DataFrame()
    table: pd.DataFrame = store.read(at, name).to_pandas()
    return table
