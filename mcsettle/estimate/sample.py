"""Estimates from one sample: quantiles, means and effects of censored days, each with its interval."""

import warnings
from collections.abc import Iterable, Sequence
from functools import lru_cache
from typing import Any

import numpy as np
from scipy import special

from mcsettle.errors import InputError
from mcsettle.estimate.estimate import CONFIDENCE, LEVELS, Estimate, Statistic, finite
from mcsettle.estimate.order_statistics import TAIL, implied_error

CHUNK, LARGEST_KEPT = 50_000, 4_000_000  # rows drawn at a time, kept for the next sample as large
RESAMPLES = 1999  # of a mean


def quantile(values: np.ndarray, level: float, unit: str) -> Estimate:
    """Quantile of an uncensored sample, with the distribution-free interval of order statistics.

    Parameters
    ----------
    values : ndarray, shape [R]
    level : float, 0 to 1
    unit : str

    Returns
    -------
    Estimate
        Linear between order statistics, as NumPy and pandas have it.

    Raises
    ------
    InputError
        If the sample is empty or not finite, or the level is not between 0 and 1.
    """
    sample = _checked(values, level)
    lower, upper = _order_statistics(sample, level)
    n = len(sample)
    error = _quantile_error(np.sort(sample), np.arange(1, n + 1) / n, level, n)
    return Estimate(float(np.quantile(sample, level)), lower, upper, error, n, 0, unit)


def interval_quantile(days: np.ndarray, censored_at: np.ndarray, level: float) -> Estimate:
    """One of ``interval_quantiles``."""
    return interval_quantiles(days, censored_at, (level,))[0]


def interval_quantiles(
    days: np.ndarray, censored_at: np.ndarray, levels: Sequence[float] = LEVELS
) -> list[Estimate]:
    """Quantiles of tamping intervals, some of them censored, in days.

    Parameters
    ----------
    days : ndarray, shape [R], days
        NaN where the limit was not reached.
    censored_at : ndarray, shape [R], days
        Horizon where the limit was not reached, else NaN; NaN in both marks a failure, left out.
    levels : sequence of float, 0 to 1

    Returns
    -------
    list of Estimate
        With censored rows: the day by which the Kaplan–Meier curve reaches each level, with the
        interval from inverting its log-log confidence band; None when it does not reach it.

    Raises
    ------
    InputError
        If nothing is left, or a level is not between 0 and 1.
    """
    events, horizons = _split(days, censored_at)
    if len(horizons) == 0:
        return [quantile(events, level, "d") for level in levels]
    for level in levels:
        _checked(np.append(events, horizons), level)
    from scipy import stats  # takes longer to import than all the rest

    curve = stats.ecdf(stats.CensoredData(uncensored=events, right=horizons))
    times, reached = curve.cdf.quantiles, curve.cdf.probabilities
    with warnings.catch_warnings():
        # Where the curve is 0 or 1 the band is undefined, and gives no limit.
        warnings.filterwarnings("ignore", message="The confidence interval is undefined")
        band: Any = curve.sf.confidence_interval(CONFIDENCE, method="log-log")
    n, estimates = len(events) + len(horizons), []
    for level in levels:
        value = _first_day(times, reached, level)
        lower = _first_day(times, 1.0 - band.low.probabilities, level)
        upper = _first_day(times, 1.0 - band.high.probabilities, level)
        note = "" if value is not None else f"not reached by day {np.max(horizons):g}"
        error = _quantile_error(times, reached, level, n)
        if value is not None and error is None:
            error = implied_error((lower, upper), value)
        error = None if value is None else error
        estimates.append(Estimate(value, lower, upper, error, n, len(horizons), "d", note))
    return estimates


def restricted_mean(days: np.ndarray, censored_at: np.ndarray) -> Estimate:
    """Mean of the tamping interval cut at a horizon, E min(T, H) = ∫₀ᴴ S(t) dt, in days.

    Parameters
    ----------
    days, censored_at : ndarray, shape [R], days
        As in ``interval_quantile``.

    Returns
    -------
    Estimate
        H is the first censoring, and the note names it; without censoring the mean is a plain one.

    Raises
    ------
    InputError
        If nothing is left.
    """
    events, horizons = _split(days, censored_at)
    n = len(events) + len(horizons)
    if n == 0:
        raise InputError("the restricted mean of 0 intervals; it needs one or more")
    limit = float(np.min(horizons, initial=np.inf))
    # Without censoring before H the Kaplan–Meier integral is the mean of min(T, H), and Greenwood's
    # variance is that of a sample mean.
    cut = np.append(np.minimum(events, limit), np.full(len(horizons), limit))
    value = float(np.mean(cut))
    error = float(np.std(cut, ddof=1) / np.sqrt(n)) if n > 1 else None
    reach = float(special.stdtrit(n - 1, 1.0 - TAIL)) * error if error else error
    reach = np.nan if reach is None else reach
    note = f"restricted to day {limit:g}" if np.isfinite(limit) else ""
    lower, upper = finite(value - reach), finite(value + reach)
    return Estimate(value, lower, upper, error, n, len(horizons), "d", note)


def effect_quantile(
    values: np.ndarray,
    level: float,
    unit: str,
    bound_lower: np.ndarray | None = None,
    bound_upper: np.ndarray | None = None,
) -> Estimate:
    """Quantile of a paired effect where pairs with a censored member have no value.

    Parameters
    ----------
    values : ndarray, shape [R]
        NaN in censored pairs; leave failed pairs out.
    level : float, 0 to 1
    unit : str
    bound_lower, bound_upper : ndarray, shape [R], optional
        What is known of every pair; by default nothing about a censored one.

    Returns
    -------
    Estimate
        Where the censored pairs cannot move the quantile, it is exact. Otherwise ``value`` is over
        the pairs with both intervals, or None if most pairs are censored or the bounds contradict
        it; the note gives the worst-case bounds, and the interval covers the quantile of all pairs
        whatever the censored ones are.

    Raises
    ------
    InputError
        If no pair is left, or the level is not between 0 and 1.
    """
    effects = np.asarray(values, dtype=float)
    unknown = np.isnan(effects)
    if not np.any(unknown):
        return quantile(effects, level, unit)
    low = np.where(unknown, -np.inf if bound_lower is None else bound_lower, effects)
    high = np.where(unknown, np.inf if bound_upper is None else bound_upper, effects)
    worst = _interpolated(low, level), _interpolated(high, level)
    limits = _order_statistics(low, level)[0], _order_statistics(high, level)[1]
    n, n_censored = len(effects), int(np.sum(unknown))
    if worst[0] == worst[1]:
        error = implied_error(limits, worst[0])
        return Estimate(worst[0], *limits, error, n, n_censored, unit)
    known = effects[~unknown]
    value = float(np.quantile(known, level)) if len(known) else np.nan
    return bounded(value, worst, limits, n, n_censored, unit)


def bounded(
    value: float,
    worst: tuple[float, float],
    limits: tuple[float | None, float | None],
    n: int,
    n_unknown: int,
    unit: str,
) -> Estimate:
    """Estimate of a quantile that the unknown values could move between ``worst``; its note says so.

    ``value`` is over the known ones (NaN: there are none); not given if most are unknown or the bounds
    contradict it.
    """
    note = f"worst case {worst[0]:.4g} to {worst[1]:.4g}"
    if 2 * n_unknown > n or not worst[0] <= value <= worst[1]:
        return Estimate(None, *limits, None, n, n_unknown, unit, note)
    note = f"over {n - n_unknown} uncensored pairs; {note}"
    return Estimate(value, *limits, implied_error(limits, value), n, n_unknown, unit, note)


def mean(values: np.ndarray, unit: str) -> Estimate:
    """Mean of a sample [R] with its studentised bootstrap interval, of a fixed seed.

    Of 30 or 100 exponential values it covers at its rate; bias-corrected percentiles (BCa) fall
    short by three hundredths there (``studies/interval_coverage.py``).

    Raises
    ------
    InputError
        If the sample is empty or not finite.
    """
    sample = _checked(values, 0.5)
    value, n = float(np.mean(sample)), len(sample)
    if n == 1:
        return Estimate(value, None, None, None, 1, 0, unit, "one realisation has no error")
    error = float(np.std(sample, ddof=1) / np.sqrt(n))
    # An identity (all values alike up to rounding) leaves nothing to resample.
    if error <= 1e-12 * abs(value):
        return Estimate(value, value, value, 0.0, n, 0, unit)
    low, high = np.quantile(_scores(sample - value), [TAIL, 1.0 - TAIL])
    ends = finite(value - high * error), finite(value - low * error)
    return Estimate(value, *ends, error, n, 0, unit)


def summarise_intervals(days: np.ndarray, censored_at: np.ndarray) -> list[Statistic]:
    """Quantiles and restricted mean of tamping intervals [days] (``interval_quantile``)."""
    rows = at_levels(interval_quantiles(days, censored_at))
    return [*rows, Statistic("restricted_mean", None, restricted_mean(days, censored_at))]


def summarise_effects(values: np.ndarray, unit: str) -> list[Statistic]:
    """Quantiles of a paired effect (``effect_quantile``); its mean too if none is censored."""
    rows = at_levels(effect_quantile(values, p, unit) for p in LEVELS)
    if not np.any(np.isnan(values)):
        rows.append(Statistic("mean", None, mean(values, unit)))
    return rows


def at_levels(estimates: Iterable[Estimate]) -> list[Statistic]:
    """Estimates at ``LEVELS`` as quantiles."""
    return [Statistic("quantile", p, e) for p, e in zip(LEVELS, estimates, strict=True)]


def _checked(values: np.ndarray, level: float) -> np.ndarray:
    """The sample as floats, or a refusal."""
    sample = np.asarray(values, dtype=float)
    if not 0.0 < level < 1.0:
        raise InputError(f"level is {level}; a quantile needs one between 0 and 1")
    if len(sample) == 0 or not np.all(np.isfinite(sample)):
        raise InputError(f"a sample of {len(sample)} values; it needs one or more, all finite")
    return sample


def _split(days: np.ndarray, censored_at: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Days of the events, and horizons of the censored rows; failed rows are in neither."""
    known = np.asarray(days, dtype=float)
    limits = np.asarray(censored_at, dtype=float)
    if known.shape != limits.shape:
        raise InputError(f"{len(known)} intervals with {len(limits)} censorings; they must pair up")
    reached = ~np.isnan(known)
    return known[reached], limits[~reached & ~np.isnan(limits)]


def _first_day(times: np.ndarray, probability: np.ndarray, level: float) -> float | None:
    """First time at which a rising curve reaches the level; where undefined it does not."""
    # The margin absorbs the rounding of the curve's running product.
    hits = np.flatnonzero(probability >= level - 1e-12)
    return float(times[hits[0]]) if len(hits) else None


def _order_statistics(sample: np.ndarray, level: float) -> tuple[float | None, float | None]:
    """Binomial confidence interval of a quantile, two-sided; None where the sample gives none."""
    ordered = np.sort(sample)
    low, high = _binomial_ends(len(ordered), level)
    return (
        finite(ordered[low]) if low >= 0 else None,
        finite(ordered[high]) if high < len(ordered) else None,
    )


@lru_cache(maxsize=256)
def _binomial_ends(n: int, level: float) -> tuple[int, int]:
    """Places of the order statistics of n values between which a quantile lies (Conover 1999, 3.2)."""
    counts, slack = np.arange(n + 1), 1.0 + 1e-12  # where a share falls on the tail itself
    low = np.argmax(special.bdtr(counts, n, level) * slack >= TAIL)
    high = np.argmax(special.bdtrc(counts, n, level) <= TAIL * slack)
    return int(low) - 1, int(high)


def _interpolated(sample: np.ndarray, level: float) -> float:
    """Quantile, linear between order statistics of which some may be infinite."""
    ordered = np.sort(sample)
    position = level * (len(ordered) - 1)
    below, share = int(position), position - int(position)
    if share == 0.0 or ordered[below] == ordered[below + 1] or np.isinf(ordered[below]):
        return float(ordered[below])
    return float(ordered[below] + share * (ordered[below + 1] - ordered[below]))


def _quantile_error(times: np.ndarray, reached: np.ndarray, level: float, n: int) -> float | None:
    """Maritz–Jarrett standard error from a curve's rising values; None for want of sample."""
    cumulative = special.betainc(level * (n + 1), (1.0 - level) * (n + 1), reached)
    # The steps must hold the distribution of the quantile, but for a tail too thin to matter.
    if n < 2 or cumulative[-1] < 0.99:
        return None
    weights = np.diff(cumulative, prepend=0.0) / cumulative[-1]
    centre = np.sum(weights * times)
    return float(np.sqrt(np.sum(weights * (times - centre) ** 2)))


def _scores(centred: np.ndarray) -> np.ndarray:
    """Resampled t statistics of values about their mean: right for skew and small samples alike."""
    n, scores = len(centred), []
    for counts in _resampled_counts(n):
        off = counts @ centred / n
        spread = np.maximum(counts @ centred**2 - n * off**2, 0.0)
        errors = np.sqrt(spread / ((n - 1) * n))
        scores.append(np.divide(off, errors, out=np.zeros_like(off), where=errors > 0.0))
    return np.concatenate(scores)


def _resampled_counts(n: int) -> Iterable[np.ndarray]:
    """How often each value is there in samples drawn with replacement, [b, n] at a time."""
    if n * RESAMPLES <= LARGEST_KEPT:
        return (_kept_counts(n),)
    rng, step = np.random.default_rng(0), max(1, CHUNK // n)
    firsts = range(0, RESAMPLES, step)
    return (_counts(rng, n, min(step, RESAMPLES - first)) for first in firsts)


@lru_cache(maxsize=2)
def _kept_counts(n: int) -> np.ndarray:
    return _counts(np.random.default_rng(0), n, RESAMPLES)


def _counts(rng: np.random.Generator, n: int, n_resamples: int) -> np.ndarray:
    """Counts [n_resamples, n] of values drawn ``n`` at a time."""
    rows = rng.integers(0, n, (n_resamples, n)) + n * np.arange(n_resamples)[:, None]
    counts = np.bincount(rows.ravel(), minlength=n * n_resamples).astype(float)
    return counts.reshape(n_resamples, n)
