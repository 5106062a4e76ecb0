"""From the tables of a finished run to the numbers that answer the study's question.

Every number is an ``Estimate`` with its Monte Carlo error and its censored count. The spread
between realisations (P5 to P95) is what differs between track sections and, in a study with uncertain
inputs, between parameter sets; the standard error is what a larger sample would shrink. Where the study
has observations, the same numbers with the parameter sets weighted by them stand beside (``observed``).
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd

from mcsettle import economics
from mcsettle.estimate.crossed import CrossedSample
from mcsettle.estimate.estimate import LEVELS, Estimate, Statistic
from mcsettle.estimate.likelihood import likelihood
from mcsettle.estimate.refit import refitted_weights
from mcsettle.estimate.resampling import SetWeights, Weights, as_interval, plain_weights
from mcsettle.estimate.weighted_quantiles import weighted_quantiles
from mcsettle.storage.tables import input_column
from mcsettle.study.effects import StudyEffect
from mcsettle.study.schema.published import ReferenceTable
from mcsettle.study.study import Study
from mcsettle.summary.courses import courses
from mcsettle.summary.results import INTERVAL, Results
from mcsettle.summary.samples import (
    beside,
    effect_samples,
    floats,
    interval_sample,
    matrices,
    matrix,
)
from mcsettle.summary.spread import effect_spread, interval_spread
from mcsettle.units import DAYS_PER_YEAR

GROWTH = "sd_growth_1y_mm"
STATISTICS = ("quantile", "mean", "restricted_mean")  # of a row itself; others are of its spread
CONDITIONED = "conditioned_"  # begins the name of a statistic given the observations


@dataclass(frozen=True)
class SummaryRow:
    """One metric of one scenario in one variant, and the published value beside it.

    ``effect``, ``baseline``: name of the effect that the row is of, and what it is against; else empty.
    ``statistics``: P5, P50, P95 and a mean. ``reference_percent``: share of the realisations [%]
    below the published value, of those known; ``reference_range`` what it may be for any value of the
    others; both None without a published value. ``spread``: what
    the spread consists of and what remains of it along a line (``summary_spread``). ``conditioned``
    are the same statistics given the study's observations, their names beginning with
    ``conditioned_``; ``conditioned_percent`` is the share of the weight below the published value.
    """

    variant: str
    scenario: str
    metric: str
    unit: str
    statistics: tuple[Statistic, ...]
    reference: ReferenceTable | None = None
    reference_percent: float | None = None
    reference_range: tuple[float, float] | None = None
    spread: tuple[Statistic, ...] = ()
    conditioned: tuple[Statistic, ...] = ()
    conditioned_percent: float | None = None
    effect: str = ""
    baseline: str = ""

    @property
    def name(self) -> str:
        """Name of the effect, or of the scenario."""
        return self.effect or self.scenario

    def part(self, statistic: str) -> list[Statistic]:
        """The statistics of one kind of its spread, such as ``line_mean``."""
        return [s for s in self.spread if s.statistic == statistic]

    def at(self, level: float) -> Estimate:
        """The quantile at ``level`` (one of ``estimate.LEVELS``)."""
        return next(s.estimate for s in self.statistics if s.level == level)

    def conditioned_at(self, level: float) -> Estimate | None:
        """The quantile at ``level`` given the observations; None without."""
        fits = (s for s in self.conditioned if s.statistic == "conditioned_quantile")
        return next((s.estimate for s in fits if s.level == level), None)


def summary_rows(results: Results) -> list[SummaryRow]:
    """Every metric of every variant and scenario, in the order of the study."""
    return [
        row
        for variant in results.study.variant_names
        for weights in (set_weights(results, variant),)
        for scenario in results.study.scenario_names
        for row in _rows_of(results, variant, scenario, weights)
    ]


def _rows_of(
    results: Results, variant: str, scenario: str, weights: SetWeights | None
) -> Iterator[SummaryRow]:
    table = results.part("realisations", variant, scenario)
    if table.empty or (table["status"] == "failed").all():
        return
    row = SummaryRow(variant, scenario, INTERVAL, "d", ())
    row = _kept(results, row) or _interval_row(results, row, table, weights)
    sound = table[table["status"] != "failed"]
    # A censored interval lies above any published value.
    days = np.nan_to_num(floats(sound, INTERVAL), nan=np.inf, posinf=np.inf)
    yield _with_reference(results, row, sound, days, weights)
    yield from _growth_rows(results, variant, scenario, sound, weights)
    for effect in results.study.effects.values():
        if effect.scenario == scenario:
            yield from tonnage_rows(results, variant, effect)
            yield from _effect_rows(results, variant, effect, weights)


def _kept(results: Results, row: SummaryRow) -> SummaryRow | None:
    """The row with what the run's own table says of it; None where that has no such row."""
    kept = results.statistics(row.variant, row.scenario, row.baseline, row.metric)
    if not kept:
        return None
    conditioned = tuple(s for s in kept if s.statistic.startswith(CONDITIONED))
    statistics = tuple(s for s in kept if s.statistic in STATISTICS)
    spread = tuple(s for s in kept if s not in (*conditioned, *statistics))
    return replace(row, statistics=statistics, spread=spread, conditioned=conditioned)


def _interval_row(
    results: Results, row: SummaryRow, table: pd.DataFrame, weights: SetWeights | None
) -> SummaryRow:
    """Intervals of the rows of ``table``, what their spread consists of, and given the observations."""
    sample = interval_sample(table)

    def spread(days: CrossedSample) -> list[Statistic]:
        return interval_spread(results.study, results.members, table, days)

    if weights is None:
        return _filled(row, sample.interval_statistics(), spread(sample))
    conditioned = sample.weighted(as_interval(weights))
    given = [*conditioned.interval_statistics(), *spread(conditioned)]
    return _filled(row, sample.interval_statistics(), spread(sample), given)


def set_weights(results: Results, variant: str) -> SetWeights | None:
    """Weights of the parameter sets given the observations; None without, or if they collapse."""
    values = results.set_weights(variant)
    if values is None:
        return None
    by_scenario = courses(variant, results.realisations, results.history)
    # What the tables do not have moved the weights through the fits alone.
    observations = tuple(o for o in results.study.observations if o.is_recorded)
    if not observations:
        return SetWeights(values)
    if variant in results.study.fitted:
        return refitted_weights(observations, by_scenario, values)
    return replace(likelihood(observations, by_scenario).weights(), values=values)


def _filled(
    row: SummaryRow,
    statistics: Iterable[Statistic],
    spread: Iterable[Statistic] = (),
    given: Iterable[Statistic] = (),
) -> SummaryRow:
    """``row`` with its statistics, its spread, and both as they are ``given`` the observations."""
    conditioned = tuple(replace(s, statistic=f"{CONDITIONED}{s.statistic}") for s in given)
    return replace(row, statistics=tuple(statistics), spread=tuple(spread), conditioned=conditioned)


def _growth_rows(
    results: Results,
    variant: str,
    scenario: str,
    table: pd.DataFrame,
    weights: Weights,
) -> Iterator[SummaryRow]:
    """Growth of the SD [mm] after a year and after the days the reference gives."""
    column = input_column("limit.sd_limit_mm")  # where it differs between parameter sets
    limit = floats(table, column) if column in table else results.study.limit.sd_limit_mm
    start = floats(table, "sd_initial_mm")
    growth, to_limit = floats(table, GROWTH), limit - start
    yield _growth_row(results, (variant, scenario, GROWTH), table, (growth, to_limit), weights)
    published = _reference(results.study, INTERVAL, scenario)
    history = results.part("history", variant, scenario)
    if published is None or history.empty:
        return
    (then,) = beside(table, history[history["day"] == published.value], ["sd_mm"])
    growth = then - start
    if np.all(np.isnan(growth)):
        return
    key = (variant, scenario, f"sd_growth_{published.value:g}d_mm")
    yield _growth_row(results, key, table, (growth, to_limit), weights)


def _growth_row(
    results: Results,
    key: tuple[str, str, str],
    table: pd.DataFrame,
    numbers: tuple[np.ndarray, np.ndarray],
    weights: Weights,
) -> SummaryRow:
    """``numbers``: growth of every row of ``table``, and what was left to its limit at the start [mm]."""
    growth, to_limit = numbers
    in_a_year = key[2] == GROWTH
    early = in_a_year and results.study.limit.horizon_days < DAYS_PER_YEAR
    note = "the horizon comes before day 365" if early else "the limit comes first"
    # Where the limit came first, growth is censored at the limit.
    end = np.where(np.isnan(growth), to_limit, np.nan)
    kept = _kept(results, SummaryRow(*key, "mm", ()))
    if kept is None:
        values, ends = matrices(table, (growth, end), results.sets)
        sample = CrossedSample(values, "mm", ends)
        given = () if weights is None else _noted(sample.weighted(weights), note)
        kept = _filled(SummaryRow(*key, "mm", ()), _noted(sample, note), (), given)
    published = _reference(results.study, kept.metric, kept.scenario)
    if in_a_year and published is not None:  # growth to the limit and beyond lies above it
        growth = np.where(end > published.value, np.inf, growth)
    return _with_reference(results, kept, table, growth, weights)


def _noted(growth: CrossedSample, note: str) -> tuple[Statistic, ...]:
    """Quantiles of SD growth; ``note`` says why one is not given."""
    noted = []
    for row in growth.certain_statistics():
        why = note if row.estimate.value is None else ""
        noted.append(replace(row, estimate=replace(row.estimate, unit="mm", note=why)))
    return tuple(noted)


def tonnage_rows(results: Results, variant: str, effect: StudyEffect) -> Iterator[SummaryRow]:
    """Increase of the tonnage [%] where a published one is given: known, so it has no error."""
    metric = "mgt_increase_percent"
    published = _reference(results.study, metric, effect.scenario, effect.baseline)
    if published is None:
        return
    changes = [m.study.change(effect.name) for m in results.members]
    grown = [100.0 * (c.changed / c.base - 1.0) for c in changes if c and c.effect == "tonnage"]
    if not grown:
        return
    quantiles = weighted_quantiles(np.array(grown), np.ones(len(grown)), LEVELS)
    n, note = len(grown), "from the timetable" if len(grown) == 1 else "from the loads drawn"
    rows = tuple(
        Statistic("quantile", p, Estimate(float(v), float(v), float(v), 0.0, n, 0, "%", note))
        for p, v in zip(LEVELS, quantiles, strict=True)
    )
    row = SummaryRow(variant, effect.scenario, metric, "%", rows, published)
    yield replace(row, effect=effect.name, baseline=effect.baseline)


def _effect_rows(
    results: Results, variant: str, effect: StudyEffect, weights: Weights
) -> Iterator[SummaryRow]:
    """Paired effects against the baseline: reduction, elasticity, marginal cost."""
    if results.effects.empty:
        return
    scenario, table = effect.scenario, results.pairs(variant, effect)
    if table.empty:
        return
    table = table[~table["status"].isin(["failed", "at_limit"])]
    if table.empty:
        return
    units = {"reduction_percent": "%", "elasticity": "1", "marginal_cost": effect.change.unit}
    rows = [
        SummaryRow(variant, scenario, m, unit, (), effect=effect.name, baseline=effect.baseline)
        for m, unit in units.items()
    ]
    kept = [row for row in (_kept(results, row) for row in rows) if row is not None]
    if len(kept) < len(rows):
        kept = _computed_effects(results, rows, effect, table, weights)
    for row in kept:
        yield _with_reference(results, row, table, floats(table, row.metric), weights)


def _computed_effects(
    results: Results,
    rows: Sequence[SummaryRow],
    effect: StudyEffect,
    table: pd.DataFrame,
    weights: Weights,
) -> list[SummaryRow]:
    """Rows of the metrics of an effect, from its pairs in ``table``."""
    variant = rows[0].variant
    names = effect.baseline, effect.scenario
    sides = [results.part("realisations", variant, name) for name in names]
    samples = effect_samples(table, {row.metric: row.unit for row in rows}, results.sets)

    def spreads(effects: Mapping[str, CrossedSample]) -> dict[str, list[Statistic]]:
        return effect_spread(results.study, results.members, effect, sides, effects)

    conditioned: dict[str, CrossedSample] = {}
    if weights is not None:
        priced = as_interval(weights, cost_exponent(results.study, matrix(sides[0], INTERVAL)))
        of_metric = {"marginal_cost": priced}
        conditioned = {m: s.weighted(of_metric.get(m, weights)) for m, s in samples.items()}
    spread, given = spreads(samples), spreads(conditioned) if conditioned else {}
    filled = []
    for row in rows:
        metric, of_given = row.metric, []
        if conditioned:
            of_given = [*conditioned[metric].effect_statistics(), *given.get(metric, ())]
        statistics = samples[metric].effect_statistics()
        filled.append(_filled(row, statistics, spread.get(metric, ()), of_given))
    return filled


def cost_exponent(study: Study, baseline: np.ndarray) -> float:
    """The power of the intervals that marginal costs go as, at the median of the ``baseline`` days."""
    prices = study.economics
    if prices is None or np.all(np.isnan(baseline)):
        return 0.0
    years = float(np.nanmedian(baseline)) / DAYS_PER_YEAR
    return economics.cost_exponent(prices.discount_rate, years)


def _with_reference(
    results: Results, row: SummaryRow, table: pd.DataFrame, values: np.ndarray, weights: Weights
) -> SummaryRow:
    """The row with the published value and where it falls among ``values``, those of ``table``'s rows.

    Of a censored pair's effect nothing is known, and the share is of the others.
    """
    published = _reference(results.study, row.metric, row.scenario, row.baseline)
    row = replace(row, reference=published)
    if published is None:
        return row
    is_known = ~np.isnan(values)
    if not np.any(is_known):
        return row
    below = values[is_known] < published.value
    least = float(np.mean(is_known & (values < published.value)))
    unknown = float(np.mean(~is_known))
    row = replace(
        row,
        reference_percent=100.0 * float(np.mean(below)),
        reference_range=(100.0 * least, 100.0 * (least + unknown)),
    )
    if weights is None:
        return row
    of_sets = plain_weights(weights)
    assert of_sets is not None
    weight = of_sets[table["parameter_set"].to_numpy(dtype=int)][is_known]
    if not np.sum(weight) > 0.0:
        return row
    return replace(row, conditioned_percent=100.0 * float(weight @ below / np.sum(weight)))


def _reference(
    study: Study, metric: str, scenario: str, baseline: str = ""
) -> ReferenceTable | None:
    rows = (r for r in study.reference if r.metric == metric and r.scenario == scenario)
    return next((r for r in rows if r.baseline in (None, baseline)), None)
