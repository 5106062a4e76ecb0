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
from mcsettle.units import DAYS_PER_YEAR

LEVELS = (0.05, 0.25, 0.5, 0.75, 0.95)
MOVING = 100.0  # days of the moving average
DOTS = 20  # each of them stands for a twentieth of the sections
LEAST_FOR_DOTS = 30


def fans(material: Material) -> list[Fan]:
    """SD in time of every scenario of the answer's variant that has a history."""
    grids = _histories(material, at_limit=True)
    known = _histories(material, at_limit=False)
    baselines = {e.scenario: e.baseline for e in reversed(list(material.study.effects.values()))}
    found = []
    for scenario, grid in grids.items():
        quantiles = _by_day(grid, LEVELS)
        per_day = material.study.mgt_per_day(scenario)
        difference = None
        baseline = baselines.get(scenario)
        if baseline in grids:
            difference = _by_day(known[scenario] - known[baseline], LEVELS[1:-1])
        found.append(
            Fan(
                material.title(scenario), grid.index.to_numpy(float), quantiles, per_day,
                material.tint(scenario), difference,
            )
        )  # fmt: skip
    return _cut(found, material.study.limit.sd_limit_mm)


def _by_day(grid: pd.DataFrame, levels: tuple[float, ...]) -> np.ndarray:
    """Quantiles [L, D] over the tracks of a grid; NaN where fewer than half of them are known."""
    values = grid.to_numpy(dtype=float)
    few = np.mean(np.isfinite(values), axis=1) < 0.5
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="All-NaN slice encountered")
        quantiles = np.nanquantile(values, levels, axis=1)
    quantiles[:, few] = np.nan
    return quantiles


def rates(material: Material, window: float = MOVING) -> list[Rate]:
    """Change of the SD over the last ``window`` days, per year, by scenario.

    A track that was tamped in between counts until then no more.
    """
    found = []
    for scenario, grid in _histories(material, at_limit=False).items():
        days, sd = grid.index.to_numpy(float), grid.to_numpy(float)
        steps = []
        for last in np.flatnonzero(days > days[0] + 0.5 * window):
            start = np.argmin(np.abs(days[:last] - (days[last] - window)))
            change = sd[last] - sd[start]
            per_year = DAYS_PER_YEAR / (days[last] - days[start])
            known = change[np.isfinite(change)] * per_year
            # Once half of the tracks are tamped the rest is no sample of them all.
            if known.size >= max(3, 0.5 * sd.shape[1]):
                steps.append((days[last], *np.quantile(known, (0.05, 0.5, 0.95))))
        if len(steps) > 1:
            table = np.array(steps).T
            tint = material.tint(scenario)
            found.append(Rate(material.title(scenario), table[0], table[1:], tint))
    return found


def survivals(material: Material) -> list[Survival]:
    """Kaplan–Meier curve of every scenario of the answer's variant."""
    found = []
    for scenario in material.study.scenario_names:
        table = material.tracks(scenario)
        if table.empty:
            continue
        days, ends = (_floats(table, c) for c in (INTERVAL, CENSORED))
        events, horizons = days[np.isfinite(days)], ends[np.isnan(days) & np.isfinite(ends)]
        row = material.row(scenario, INTERVAL)
        published = row.reference.value if row is not None and row.reference else None
        end = float(np.max([*events, *horizons]))
        curve = _kaplan_meier(events, horizons)
        tint = material.tint(scenario)
        found.append(Survival(material.title(scenario), *curve, end, tint, published))
    return found


def spreads(material: Material, metric: str, dots: bool = False) -> list[Spread]:
    """Quantiles of a paired effect in every compared scenario of the answer's variant.

    ``dots``: with values that stand for equal shares of the sections.
    """
    found = []
    for scenario in material.compared:
        table = material.effects(scenario)
        row = material.row(scenario, metric)
        values = _floats(table, metric) if not table.empty else np.zeros(0)
        values = values[np.isfinite(values)]
        quantiles = None
        shown = row is not None and row.at(0.5).value is not None and mostly_known(row)
        if len(values) and shown:
            quantiles = tuple(float(q) for q in np.quantile(values, LEVELS))
        published = row.reference.value if row is not None and row.reference else None
        shares = (np.arange(DOTS) + 0.5) / DOTS
        some = dots and quantiles is not None and len(values) >= LEAST_FOR_DOTS
        shown_dots = np.quantile(values, shares) if some else None
        found.append(
            Spread(
                material.title(scenario), quantiles, material.tint(scenario), published, shown_dots
            )
        )
    return found


def growths(material: Material, metric: str) -> list[Spread]:
    """Quantiles of a column of ``realisations`` in every scenario, where all of them are known."""
    found = []
    for scenario in material.study.scenario_names:
        row, table = material.row(scenario, metric), material.tracks(scenario)
        if row is None or table.empty:
            continue
        values = _floats(table, metric)
        gaps = np.isnan(values)
        quantiles = None
        if not gaps.all() and gaps.mean() < 0.5:
            # Tracks tamped before have grown more: how much more is not known.
            filled = np.where(gaps, np.inf, values)
            found_at = np.quantile(filled, LEVELS, method="inverted_cdf")
            quantiles = tuple(float(q) for q in found_at)
        published = row.reference.value if row.reference else None
        found.append(
            Spread(material.title(scenario), quantiles, material.tint(scenario), published)
        )
    return found


def convergence(material: Material) -> list[Convergence]:
    """Median interval with its 95 % interval for the first n tracks, n doubling up to all."""
    found = []
    n = material.n_tracks
    counts = [n]
    while counts[-1] >= 16 and len(counts) < 8:
        counts.append(-(-counts[-1] // 2))
    for scenario in material.study.scenario_names:
        table = material.tracks(scenario)
        points = []
        for count in sorted(counts):
            part = table[table["realisation"] < count]
            if part.empty or material.n_sets > 1:
                continue
            found_at = interval_quantile(_floats(part, INTERVAL), _floats(part, CENSORED), 0.5)
            if found_at.value is not None:
                limits = (found_at.lower, found_at.upper)
                points.append((count, found_at.value, *(_or_nan(v) for v in limits)))
        if points:
            counts, value, low, high = np.array(points, float).T
            found.append(
                Convergence(
                    material.title(scenario), counts, value, low, high, material.tint(scenario)
                )
            )
    return found


def _or_nan(value: float | None) -> float:
    return np.nan if value is None else value


def _floats(table: pd.DataFrame, column: str) -> np.ndarray:
    return table[column].to_numpy(dtype=float, na_value=np.nan)


def _histories(material: Material, at_limit: bool) -> dict[str, pd.DataFrame]:
    """SD by day (rows) and track (columns) of every scenario that has a history, on the same days.

    ``at_limit``: a tamped track stays at its limit; else it is known no more.
    """
    study = material.study
    parts = {n: material.history(n) for n in study.scenario_names}
    parts = {name: own for name, own in parts.items() if not own.empty}
    if not parts:
        return {}
    days = day_grid(max(float(own["day"].max()) for own in parts.values()))
    limit = study.limit.sd_limit_mm if at_limit else None
    return {name: on_grid(own, days, limit) for name, own in parts.items()}


def _cut(found: list[Fan], limit: float) -> list[Fan]:
    """Fans up to the day by which most tracks of every scenario are at the limit."""
    if not found:
        return found
    ends = []
    for fan in found:
        full = np.flatnonzero(fan.quantiles[0] >= limit * (1.0 - 1e-9))
        ends.append(fan.days[full[0]] if len(full) else fan.days[-1])
    last = max(ends)
    kept = [fan.days <= last for fan in found]
    return [
        replace(
            fan,
            days=fan.days[keep],
            quantiles=fan.quantiles[:, keep],
            difference=None if fan.difference is None else fan.difference[:, keep],
        )
        for fan, keep in zip(found, kept, strict=True)
    ]


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
