"""Estimates from parameter sets crossed with realisations: a matrix [E, R], the same tracks in every set.

The rows of such a table are not independent: all R rows of a set share its inputs and all E rows of a
realisation its track. Errors come from resampling sets and realisations separately (the pigeonhole
bootstrap), which is right for means up to the share of the interaction and a little too wide where
that is large; a Sobol sequence fills the inputs more evenly than chance, and the errors do not take
credit for it. (``scipy.stats.bootstrap`` resamples one index, with neither crossed nor weighted sets.)

Sets may be weighted (``observed``: by the likelihood of what was observed); the tails of a percentile
interval are then those of as many sets as carry the weight, 1/Σp².
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy import stats

from mcsettle.estimate.estimate import LEVELS, Estimate, Statistic
from mcsettle.estimate.order_statistics import implied_error, order_positions, worth
from mcsettle.estimate.resampling import Resampling, Weights

CHUNK = 4_000_000  # cumulative weights held at a time


def crossed_quantiles(
    lowest: np.ndarray,
    highest: np.ndarray,
    levels: Sequence[float],
    unit: str,
    seed: int = 0,
    set_weights: Weights = None,
) -> list[Estimate]:
    """Quantiles over all sets and realisations, each value known to lie in ``lowest`` … ``highest``.

    Parameters
    ----------
    lowest, highest : ndarray, shape [E, R]
        Equal where the value is known, ±inf where nothing is; NaN in both is left out (failed).
    levels : between 0 and 1
    unit : str
    seed : of the resampling
    set_weights : relative weights of the parameter sets, optional

    Returns
    -------
    list of Estimate
        Exact where the unknown values cannot move it. Otherwise over the known ones, if they are the
        most and the bounds allow that; the interval covers whatever the unknown ones are.
    """
    drawn = Resampling(lowest.shape, seed, set_weights)
    unknown = lowest < highest
    below = _quantiles(lowest, levels, drawn)
    above = _quantiles(highest, levels, drawn) if np.any(unknown) else below
    n, n_unknown = int(np.sum(~np.isnan(lowest))), int(np.sum(unknown))
    known: np.ndarray | None = None
    found = []
    for k in range(len(levels)):
        lower = _limits(lowest, levels[k], below[k, 0], drawn)[0]
        upper = _limits(highest, levels[k], above[k, 0], drawn)[1]
        if below[k, 0] == above[k, 0]:
            sound = np.isfinite(below[k, 1:]) & (below[k, 1:] == above[k, 1:])
            error = float(np.std(below[k, 1:], ddof=1)) if np.all(sound) else None
            value = _number(below[k, 0])
            found.append(Estimate(value, lower, upper, error, n, n_unknown, unit))
            continue
        if known is None:
            known = _quantiles(np.where(unknown, np.nan, lowest), levels, drawn, 1)[:, 0]
        bounds = (float(below[k, 0]), float(above[k, 0]))
        found.append(_bounded(float(known[k]), bounds, (lower, upper), n, n_unknown, unit))
    return found


def crossed_interval_quantile(
    days: np.ndarray,
    censored_at: np.ndarray,
    level: float,
    seed: int = 0,
    set_weights: Weights = None,
) -> Estimate:
    """Quantile of tamping intervals [E, R] days, censored at one horizon; not reached: None."""
    return _interval_quantiles(days, censored_at, (level,), seed, set_weights)[0]


def crossed_mean(
    values: np.ndarray,
    unit: str,
    note: str = "",
    seed: int = 0,
    set_weights: Weights = None,
) -> Estimate:
    """Mean over all sets and realisations [E, R]; NaN is left out."""
    drawn = Resampling(values.shape, seed, set_weights)
    known = ~np.isnan(values)
    filled = np.where(known, values, 0.0)
    total = np.einsum("br,br->b", drawn.by_set @ filled, drawn.by_track)
    count = np.einsum("br,br->b", drawn.by_set @ known.astype(float), drawn.by_track)
    with np.errstate(invalid="ignore", divide="ignore"):
        means = drawn.factors * total / count
    others = means[1:][np.isfinite(means[1:])]
    levels = _corrected(values, float(means[0]), others, drawn)
    ends = np.quantile(others, levels) if len(others) else (None, None)
    error = float(np.std(others, ddof=1)) if len(others) > 1 else None
    n = int(np.sum(known))
    return Estimate(_number(means[0]), _number(ends[0]), _number(ends[1]), error, n, 0, unit, note)


def crossed_intervals(
    days: np.ndarray,
    censored_at: np.ndarray,
    levels: Sequence[float] = LEVELS,
    set_weights: Weights = None,
) -> list[Statistic]:
    """Quantiles and restricted mean of tamping intervals [E, R] days."""
    found = _interval_quantiles(days, censored_at, levels, 0, set_weights)
    rows = [Statistic("quantile", p, e) for p, e in zip(levels, found, strict=True)]
    censored = np.isnan(days) & ~np.isnan(censored_at)
    horizon = float(np.nanmin(censored_at)) if np.any(censored) else np.inf
    note = f"restricted to day {horizon:g}" if np.any(censored) else ""
    cut = np.where(censored, horizon, np.minimum(days, horizon))
    return [*rows, Statistic("restricted_mean", None, crossed_mean(cut, "d", note, 0, set_weights))]


def crossed_effects(
    values: np.ndarray,
    failed: np.ndarray,
    unit: str,
    levels: Sequence[float] = LEVELS,
    set_weights: Weights = None,
) -> list[Statistic]:
    """Quantiles of a paired effect [E, R], NaN where censored; its mean too if none is."""
    unknown = np.isnan(values) & ~failed
    low = np.where(failed, np.nan, np.where(unknown, -np.inf, values))
    high = np.where(failed, np.nan, np.where(unknown, np.inf, values))
    found = crossed_quantiles(low, high, levels, unit, 0, set_weights)
    rows = [Statistic("quantile", p, e) for p, e in zip(levels, found, strict=True)]
    if not np.any(unknown):
        mean = crossed_mean(values, unit, set_weights=set_weights)
        rows.append(Statistic("mean", None, mean))
    return rows


def crossed_bounded(
    values: np.ndarray,
    at_least: np.ndarray,
    unit: str,
    levels: Sequence[float] = LEVELS,
    set_weights: Weights = None,
) -> list[Statistic]:
    """Quantiles of [E, R] values of which some are known only to exceed ``at_least``.

    One that those could move is not given.
    """
    unknown = np.isnan(values) & ~np.isnan(at_least)
    low = np.where(unknown, at_least, values)
    high = np.where(unknown, np.inf, values)
    rows = []
    found = crossed_quantiles(low, high, levels, unit, 0, set_weights)
    for p, estimate in zip(levels, found, strict=True):
        if estimate.note:
            estimate = replace(estimate, value=None, standard_error=None)
        rows.append(Statistic("quantile", p, estimate))
    return rows


def _interval_quantiles(
    days: np.ndarray,
    censored_at: np.ndarray,
    levels: Sequence[float],
    seed: int,
    set_weights: Weights,
) -> list[Estimate]:
    """Quantiles of intervals: the first day by which the share of the sample reaches the level."""
    drawn = Resampling(days.shape, seed, set_weights)
    values = np.where(np.isnan(days) & ~np.isnan(censored_at), np.inf, days)
    n, n_censored = int(np.sum(~np.isnan(values))), int(np.sum(np.isinf(values)))
    found = []
    for level, sample in zip(levels, _quantiles(values, levels, drawn), strict=True):
        lower, upper = _limits(values, level, sample[0], drawn)
        if np.isinf(sample[0]):
            note = f"not reached by day {np.nanmax(censored_at):g}"
            found.append(Estimate(None, lower, upper, None, n, n_censored, "d", note))
            continue
        error = float(np.std(sample[1:], ddof=1)) if np.all(np.isfinite(sample[1:])) else None
        found.append(Estimate(_number(sample[0]), lower, upper, error, n, n_censored, "d"))
    return found


def _bounded(
    value: float,
    worst: tuple[float, float],
    interval: tuple[float | None, float | None],
    n: int,
    n_unknown: int,
    unit: str,
) -> Estimate:
    """Estimate of a quantile that the unknown values could move between ``worst``."""
    note = f"worst case {worst[0]:.4g} to {worst[1]:.4g}"
    if 2 * n_unknown > n or not worst[0] <= value <= worst[1]:
        return Estimate(None, *interval, None, n, n_unknown, unit, note)
    note = f"over {n - n_unknown} uncensored pairs; {note}"
    return Estimate(value, *interval, implied_error(interval, value), n, n_unknown, unit, note)


def _quantiles(
    values: np.ndarray, levels: Sequence[float], drawn: Resampling, rows: int | None = None
) -> np.ndarray:
    """Weighted quantiles [L, B] of [E, R] values: the first value to reach each level.

    ``rows``: of the first so many resamples alone.
    """
    flat = values.ravel()
    order = np.argsort(flat, kind="stable")
    order = order[~np.isnan(flat[order])]
    n, n_rows = len(order), rows or len(drawn.by_set)
    found = np.full((len(levels), n_rows), np.nan)
    if n == 0:
        return found
    own_set, own_track = np.unravel_index(order, values.shape)
    rising = flat[order]
    step = max(1, CHUNK // n)
    for first in range(0, n_rows, step):
        part = slice(first, min(first + step, n_rows))
        weights = drawn.by_set[part].take(own_set, axis=1)
        weights *= drawn.by_track[part].take(own_track, axis=1)
        np.cumsum(weights, axis=1, out=weights)
        total = weights[:, -1]
        for k, level in enumerate(levels):
            aim = level * total * (1.0 - 1e-12)
            at = [np.searchsorted(row, x) for row, x in zip(weights, aim, strict=True)]
            reached = rising[np.minimum(at, n - 1)]
            found[k, part] = np.where(total > 0.0, drawn.factors[part] * reached, np.nan)
    return found


def _corrected(
    values: np.ndarray, mean: float, others: np.ndarray, drawn: Resampling
) -> tuple[float, float]:
    """Levels of the resampled means that bound a mean: bias and skewness corrected (BCa).

    The acceleration is that of the sum of the sets' and the tracks' influences.
    """
    if not np.isfinite(mean) or len(others) < 2 or np.ptp(others) <= 1e-12 * abs(mean):
        return drawn.alpha, 1.0 - drawn.alpha
    off = np.where(np.isnan(values), 0.0, values - mean)
    influence = np.concatenate([drawn.by_set[0] * (off @ drawn.by_track[0]), drawn.by_set[0] @ off])
    cubes, squares = np.sum(influence**3), np.sum(influence**2)
    skew = float(cubes / (6.0 * squares**1.5)) if squares > 0.0 else 0.0
    below = np.mean(others < mean) + 0.5 * np.mean(others == mean)
    bias = float(stats.norm.ppf(np.clip(below, 1.0 / len(others), 1.0 - 1.0 / len(others))))
    least = max(drawn.alpha, 1e-9)  # of two sets or tracks the tails are beyond any resample
    z = bias + np.asarray(stats.norm.ppf([least, 1.0 - least]))
    ends = stats.norm.cdf(bias + z / np.maximum(1.0 - skew * z, 1e-3))
    return float(ends[0]), float(ends[1])


def _limits(
    values: np.ndarray, level: float, quantile: float, drawn: Resampling
) -> tuple[float | None, float | None]:
    """95 % limits of a quantile over [E, R] values, from order statistics; None where it is open."""
    # E·R rows that share sets and tracks know less than E·R independent ones. How much less shows in
    # the share below the quantile: its variance over the resamples, against F (1 − F) / n, gives the n
    # of independent values that know as much, and that n its order statistics.
    known = ~np.isnan(values)
    if not np.any(known):
        return None, None
    below = known & (values <= quantile) & np.isfinite(values)
    if np.isneginf(quantile):  # what is unknown below it counts as such
        below = np.isneginf(values)
    total = _counted(known, drawn)
    with np.errstate(invalid="ignore", divide="ignore"):
        part = _counted(below, drawn)
        if np.ptp(drawn.factors) > 0.0 and np.isfinite(quantile):
            part = _weight_below(values, quantile / drawn.factors, drawn)
        shares = part / total
    others = shares[1:][np.isfinite(shares[1:])]
    share = float(shares[0])
    variance = float(np.var(others, ddof=1)) if len(others) > 1 else np.inf
    n = worth(share, variance, drawn.sizes)
    if not 0.0 < share < 1.0 and not np.isfinite(quantile):
        n = min(drawn.sizes)
    ends = []
    for position in order_positions(n, level):
        found = None if position is None else _quantiles(values, (position,), drawn, 1)[0, 0]
        ends.append(_number(found))
    return ends[0], ends[1]


def _counted(chosen: np.ndarray, drawn: Resampling) -> np.ndarray:
    """Weight [B] of the rows ``chosen`` [E, R]."""
    return np.einsum("br,br->b", drawn.by_set @ chosen.astype(float), drawn.by_track)


def _weight_below(values: np.ndarray, bounds: np.ndarray, drawn: Resampling) -> np.ndarray:
    """Weight [B] of the rows [E, R] up to the bound [B] of each resample."""
    known = np.isfinite(values)
    parts = zip(drawn.by_set, bounds, drawn.by_track, strict=True)
    return np.array([sets @ (known & (values <= x)) @ tracks for sets, x, tracks in parts])


def _number(value: float | None) -> float | None:
    return float(value) if value is not None and np.isfinite(value) else None
