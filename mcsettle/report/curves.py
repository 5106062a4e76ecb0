"""From the tables of a run to what its pictures show."""

import warnings
from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd

from mcsettle.estimate.sample import interval_quantile
from mcsettle.report.figures.results import Convergence, Fan, Rate, Spread, Survival
from mcsettle.report.histories import day_grid, on_grid
from mcsettle.report.material import Material
from mcsettle.report.words import mostly_known
from mcsettle.summary.results import CENSORED, INTERVAL
from mcsettle.summary.samples import floats
from mcsettle.units import DAYS_PER_YEAR

LEVELS = (0.05, 0.25, 0.5, 0.75, 0.95)
MOVING = 100.0  # days of the moving average
DOTS = 20  # each of them stands for a twentieth of the sections
LEAST_FOR_DOTS = 30


def fans(material: Material) -> list[Fan]:
    """SD in time of every scenario of the answer's variant that has a history."""
    grids = _histories(material, at_limit=True)
    until_tamped = _histories(material, at_limit=False)
    baselines = {e.scenario: e.baseline for e in reversed(list(material.study.effects.values()))}
    shown = []
    for scenario, grid in grids.items():
        difference, baseline = None, baselines.get(scenario)
        if baseline in grids:
            difference = _by_day(until_tamped[scenario] - until_tamped[baseline], LEVELS[1:-1])
        shown.append(
            Fan(
                material.title(scenario), grid.index.to_numpy(float), _by_day(grid, LEVELS),
                material.study.mgt_per_day(scenario), material.tint(scenario), difference,
            )
        )  # fmt: skip
    return _cut(shown, material.study.limit.sd_limit_mm)


def _by_day(grid: pd.DataFrame, levels: tuple[float, ...]) -> np.ndarray:
    """Quantiles [L, D] over the tracks of a grid; NaN where fewer than half of them are known."""
    values = grid.to_numpy(dtype=float)
    few = np.mean(np.isfinite(values), axis=1) < 0.5
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="All-NaN slice encountered")
        quantiles = np.nanquantile(values, levels, axis=1)
    quantiles[:, few] = np.nan
    return quantiles


def rates(material: Material) -> list[Rate]:
    """Change of the SD over the last ``MOVING`` days, per year, by scenario.

    A track that was tamped in between counts until then no more.
    """
    curves = []
    for scenario, grid in _histories(material, at_limit=False).items():
        days, sd = grid.index.to_numpy(float), grid.to_numpy(float)
        steps = []
        for last in np.flatnonzero(days > days[0] + 0.5 * MOVING):
            start = np.argmin(np.abs(days[:last] - (days[last] - MOVING)))
            change = sd[last] - sd[start]
            per_year = DAYS_PER_YEAR / (days[last] - days[start])
            changes = change[np.isfinite(change)] * per_year
            # Once half of the tracks are tamped the rest is no sample of them all.
            if changes.size >= max(3, 0.5 * sd.shape[1]):
                steps.append((days[last], *np.quantile(changes, (0.05, 0.5, 0.95))))
        if len(steps) > 1:
            at, *rate = np.array(steps).T
            curves.append(
                Rate(material.title(scenario), at, np.array(rate), material.tint(scenario))
            )
    return curves


def survivals(material: Material) -> list[Survival]:
    """Kaplan–Meier curve of every scenario of the answer's variant."""
    curves = []
    for scenario in material.study.scenario_names:
        table = material.tracks(scenario)
        if table.empty:
            continue
        days, ends = (floats(table, column) for column in (INTERVAL, CENSORED))
        events, horizons = days[np.isfinite(days)], ends[np.isnan(days) & np.isfinite(ends)]
        curves.append(
            Survival(
                material.title(scenario),
                *_kaplan_meier(events, horizons),
                float(np.max([*events, *horizons])),
                material.tint(scenario),
                material.published(scenario, INTERVAL),
            )
        )
    return curves


def spreads(material: Material, metric: str, dots: bool = False) -> list[Spread]:
    """Quantiles of a paired effect in every compared scenario of the answer's variant.

    ``dots``: with values that stand for equal shares of the sections.
    """
    bands = []
    for name in material.compared:
        table, row = material.effects(name), material.row(name, metric)
        values = np.zeros(0) if table.empty else floats(table, metric)
        values = values[np.isfinite(values)]
        quantiles = shown_dots = None
        if len(values) and row is not None and row.at(0.5).value is not None and mostly_known(row):
            quantiles = tuple(np.quantile(values, LEVELS).tolist())
            if dots and len(values) >= LEAST_FOR_DOTS:
                shown_dots = np.quantile(values, (np.arange(DOTS) + 0.5) / DOTS)
        title, published = material.title(name), material.published(name, metric)
        bands.append(Spread(title, quantiles, material.tint(name), published, shown_dots))
    return bands


def growths(material: Material, metric: str) -> list[Spread]:
    """Quantiles of a column of ``realisations`` in every scenario, where all of them are known."""
    bands = []
    for scenario in material.study.scenario_names:
        table = material.tracks(scenario)
        if material.row(scenario, metric) is None or table.empty:
            continue
        values = floats(table, metric)
        gaps = np.isnan(values)
        quantiles = None
        if gaps.mean() < 0.5:
            # Tracks tamped before have grown more: how much more is not known.
            filled = np.where(gaps, np.inf, values)
            quantiles = tuple(np.quantile(filled, LEVELS, method="inverted_cdf").tolist())
        title, published = material.title(scenario), material.published(scenario, metric)
        bands.append(Spread(title, quantiles, material.tint(scenario), published))
    return bands


def convergence(material: Material) -> list[Convergence]:
    """Median interval with its 95 % interval for the first n tracks, n doubling up to all."""
    if material.n_sets > 1:
        return []
    sizes = [material.n_tracks]
    while sizes[-1] >= 16 and len(sizes) < 8:
        sizes.append(-(-sizes[-1] // 2))
    curves = []
    for scenario in material.study.scenario_names:
        table = material.tracks(scenario)
        points = []
        for size in reversed(sizes):
            part = table[table["realisation"] < size]
            if part.empty:
                continue
            median = interval_quantile(floats(part, INTERVAL), floats(part, CENSORED), 0.5)
            if median.value is not None:
                points.append((size, median.value, median.lower, median.upper))
        if points:
            counts, value, low, high = np.array(points, float).T  # NaN where a limit is open
            title, tint = material.title(scenario), material.tint(scenario)
            curves.append(Convergence(title, counts, value, low, high, tint))
    return curves


def _histories(material: Material, at_limit: bool) -> dict[str, pd.DataFrame]:
    """SD by day (rows) and track (columns) of every scenario that has a history, on the same days.

    ``at_limit``: a tamped track stays at its limit; else it is known no more.
    """
    study = material.study
    parts = {name: material.history(name) for name in study.scenario_names}
    parts = {name: history for name, history in parts.items() if not history.empty}
    if not parts:
        return {}
    days = day_grid(max(float(history["day"].max()) for history in parts.values()))
    limit = study.limit.sd_limit_mm if at_limit else None
    return {name: on_grid(history, days, limit) for name, history in parts.items()}


def _cut(shown: list[Fan], limit: float) -> list[Fan]:
    """Fans up to the day by which most tracks of every scenario are at the limit."""
    ends = []
    for fan in shown:
        full = np.flatnonzero(fan.quantiles[0] >= limit * (1.0 - 1e-9))
        ends.append(fan.days[full[0]] if len(full) else fan.days[-1])
    cut = []
    for fan in shown:
        keep = fan.days <= max(ends)
        difference = None if fan.difference is None else fan.difference[:, keep]
        days, quantiles = fan.days[keep], fan.quantiles[:, keep]
        cut.append(replace(fan, days=days, quantiles=quantiles, difference=difference))
    return cut


def _kaplan_meier(
    events: np.ndarray, horizons: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Days, share surviving, and the 95 % band, at the events."""
    if not len(events):
        return (np.zeros(0),) * 4
    from scipy import stats

    curve = stats.ecdf(stats.CensoredData(uncensored=events, right=horizons)).sf
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="The confidence interval is undefined")
        band: Any = curve.confidence_interval(0.95, method="log-log")
    days, share = curve.quantiles, curve.probabilities
    # Where the curve is 0 or 1 the band is undefined: drawn as the curve itself.
    low = np.where(np.isfinite(band.low.probabilities), band.low.probabilities, share)
    high = np.where(np.isfinite(band.high.probabilities), band.high.probabilities, share)
    return days, share, low, high
