"""Estimates from parameter sets crossed with realisations: a matrix [E, R], the same tracks in every set.

The rows of such a table are not independent: all R rows of a set share its inputs and all E rows of a
realisation its track. Errors come from resampling sets and realisations separately (the pigeonhole
bootstrap), which is right for means up to the share of the interaction and a little too wide where
that is large; a Sobol sequence fills the inputs more evenly than chance, and the errors do not take
credit for it.

The variance splits by the two-way random-effects analysis of variance: with mean squares MS,

    parameters  Var E[Y | set]   = (MS_set − MS_rest) / R
    sections    Var E[Y | track] = (MS_track − MS_rest) / E
    interaction                  = MS_rest,

each unbiased for any E and R. By the law of total variance the first is what the inputs cause
(epistemic) and the other two are what differs between track sections (aleatory).

References: Owen (2007), The pigeonhole bootstrap, Annals of Applied Statistics 1, 386–411; Searle,
Casella and McCulloch (1992), Variance Components, chapter 4; Plischke (2012), Reliability Engineering
and System Safety 101, 54–60 (indices from given data).

Depends on: errors, estimate.
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
from scipy import stats

from mcsettle.errors import InputError
from mcsettle.estimate import CONFIDENCE, LEVELS, Estimate, Statistic

RESAMPLES = 500
LEAST_SETS = 32  # for first-order indices


def crossed_quantile(
    lowest: np.ndarray,
    highest: np.ndarray,
    level: float,
    unit: str,
    seed: int = 0,
) -> Estimate:
    """Quantile over all sets and realisations, each value known to lie in ``lowest`` … ``highest``.

    Parameters
    ----------
    lowest, highest : ndarray, shape [E, R]
        Equal where the value is known, ±inf where nothing is; NaN in both is left out (failed).
    level : float
    unit : str
    seed : of the resampling

    Returns
    -------
    Estimate
        Exact where the unknown values cannot move it. Otherwise over the known ones, if the bounds
        allow that; the interval covers whatever the unknown ones are.
    """
    weights = _weights(lowest.shape, seed)
    below = _Pooled(lowest).quantiles(level, weights)
    above = _Pooled(highest).quantiles(level, weights)
    alpha = _tail(lowest.shape)
    lower = _order(below[1:], alpha)
    upper = _order(above[1:], 1.0 - alpha)
    n = int(np.sum(~np.isnan(lowest)))
    n_unknown = int(np.sum(lowest < highest))
    if below[0] == above[0]:
        known = np.isfinite(below[1:]) & (below[1:] == above[1:])
        error = float(np.std(below[1:], ddof=1)) if np.all(known) else None
        return Estimate(float(below[0]), lower, upper, error, n, n_unknown, unit)
    note = f"worst case {below[0]:.4g} to {above[0]:.4g}"
    value = float(_Pooled(np.where(lowest < highest, np.nan, lowest)).quantiles(level, weights)[0])
    if not below[0] <= value <= above[0]:
        return Estimate(None, lower, upper, None, n, n_unknown, unit, note)
    note = f"over {n - n_unknown} uncensored pairs; {note}"
    sides = [abs(end - value) for end in (lower, upper) if end is not None]
    error = float(np.mean(sides)) / float(stats.norm.ppf(0.5 + 0.5 * CONFIDENCE)) if sides else None
    return Estimate(value, lower, upper, error, n, n_unknown, unit, note)


def crossed_interval_quantile(
    days: np.ndarray, censored_at: np.ndarray, level: float, seed: int = 0
) -> Estimate:
    """Quantile of tamping intervals [E, R] days, censored at one horizon; not reached: None."""
    values = np.where(np.isnan(days) & ~np.isnan(censored_at), np.inf, days)
    sample = _Pooled(values).quantiles(level, _weights(days.shape, seed))
    alpha = _tail(days.shape)
    n, n_censored = int(np.sum(~np.isnan(values))), int(np.sum(np.isinf(values)))
    lower, upper = _order(sample[1:], alpha), _order(sample[1:], 1.0 - alpha)
    if np.isinf(sample[0]):
        note = f"not reached by day {np.nanmax(censored_at):g}"
        return Estimate(None, lower, upper, None, n, n_censored, "d", note)
    error = float(np.std(sample[1:], ddof=1)) if np.all(np.isfinite(sample[1:])) else None
    return Estimate(float(sample[0]), lower, upper, error, n, n_censored, "d")


def crossed_mean(values: np.ndarray, unit: str, note: str = "", seed: int = 0) -> Estimate:
    """Mean over all sets and realisations [E, R]; NaN is left out."""
    by_set, by_track = _weights(values.shape, seed)
    known = ~np.isnan(values)
    filled = np.where(known, values, 0.0)
    total = np.einsum("be,er,br->b", by_set, filled, by_track, optimize=True)
    count = np.einsum("be,er,br->b", by_set, known.astype(float), by_track, optimize=True)
    with np.errstate(invalid="ignore", divide="ignore"):
        means = total / count
    drawn = means[1:][np.isfinite(means[1:])]
    alpha = _tail(values.shape)
    lower, upper = np.quantile(drawn, [alpha, 1.0 - alpha]) if len(drawn) else (None, None)
    error = float(np.std(drawn, ddof=1)) if len(drawn) > 1 else None
    n = int(np.sum(known))
    return Estimate(float(means[0]), _number(lower), _number(upper), error, n, 0, unit, note)


def crossed_intervals(
    days: np.ndarray, censored_at: np.ndarray, levels: Iterable[float] = LEVELS
) -> list[Statistic]:
    """Quantiles and restricted mean of tamping intervals [E, R] days."""
    rows = [
        Statistic("quantile", p, crossed_interval_quantile(days, censored_at, p)) for p in levels
    ]
    censored = np.isnan(days) & ~np.isnan(censored_at)
    horizon = float(np.nanmin(censored_at)) if np.any(censored) else np.inf
    note = f"restricted to day {horizon:g}" if np.any(censored) else ""
    mean = crossed_mean(np.where(censored, horizon, np.minimum(days, horizon)), "d", note)
    return [*rows, Statistic("restricted_mean", None, mean)]


def crossed_effects(
    values: np.ndarray, failed: np.ndarray, unit: str, levels: Iterable[float] = LEVELS
) -> list[Statistic]:
    """Quantiles of a paired effect [E, R], NaN where censored; its mean too if none is."""
    unknown = np.isnan(values) & ~failed
    low = np.where(failed, np.nan, np.where(unknown, -np.inf, values))
    high = np.where(failed, np.nan, np.where(unknown, np.inf, values))
    rows = [Statistic("quantile", p, crossed_quantile(low, high, p, unit)) for p in levels]
    if not np.any(unknown):
        rows.append(Statistic("mean", None, crossed_mean(values, unit)))
    return rows


def crossed_bounded(
    values: np.ndarray, at_least: np.ndarray, unit: str, levels: Iterable[float] = LEVELS
) -> list[Statistic]:
    """Quantiles of [E, R] values of which some are known only to exceed ``at_least``.

    One that those could move is not given.
    """
    unknown = np.isnan(values) & ~np.isnan(at_least)
    low = np.where(unknown, at_least, values)
    high = np.where(unknown, np.inf, values)
    rows = []
    for p in levels:
        found = crossed_quantile(low, high, p, unit)
        if found.note:
            found = replace(found, value=None, standard_error=None)
        rows.append(Statistic("quantile", p, found))
    return rows


@dataclass(frozen=True)
class Split:
    """Shares of the variance of ``scale``, each with its standard error (jackknife).

    ``parameters`` + ``sections`` + ``interaction`` = 1. An estimate of a small share can be negative.
    """

    scale: str
    parameters: Estimate
    sections: Estimate
    interaction: Estimate


def variance_split(scores: np.ndarray, scale: str) -> Split:
    """Split of the variance of ``scores`` [E, R] (``spread_scores``), E and R at least 2.

    Raises
    ------
    InputError
        Fewer than two sets or realisations, or values missing.
    """
    if min(scores.shape) < 2 or not np.all(np.isfinite(scores)):
        raise InputError(
            f"the variance of {scores.shape[0]} parameter sets × {scores.shape[1]} realisations "
            "cannot be split; it needs two of each, all with a result"
        )
    shares = _shares(scores)
    errors = np.sqrt(_jackknife(scores, 0) + _jackknife(scores, 1))
    n = scores.size
    parts = [
        Estimate(float(v), _number(v - 1.96 * e), _number(v + 1.96 * e), _number(e), n, 0, "1",
                 f"of the variance of the {scale}")
        for v, e in zip(shares, errors, strict=True)
    ]  # fmt: skip
    return Split(scale, *parts)


def spread_scores(values: np.ndarray, censored: np.ndarray) -> tuple[np.ndarray, str]:
    """Scores whose variance is split, and their name: logarithms if all are known, else ranks.

    A rank does not ask by how much a censored interval exceeds the horizon: all of them share the
    highest ranks. Realisations that failed in any set are left out.

    Parameters
    ----------
    values : ndarray, shape [E, R], positive; NaN where censored or failed
    censored : ndarray of bool, shape [E, R]
    """
    sound = np.all(~np.isnan(values) | censored, axis=0)
    values, censored = values[:, sound], censored[:, sound]
    if values.size and not np.any(censored):
        if np.all(values > 0.0):
            return np.log(values), "logarithm"
        return values, "value"
    filled = np.where(censored, np.inf, values)
    return stats.rankdata(filled).reshape(filled.shape) / max(filled.size, 1), "rank"


def first_order(inputs: np.ndarray, scores: np.ndarray) -> list[tuple[float, float]]:
    """First-order index of each input: the share of the whole variance its value alone explains.

    The sets are binned by the input; the variance of the bins' means beyond what the scatter within
    the bins causes is the input's, as in a one-way analysis of variance, for any shape of dependence
    that the bins resolve. Inputs that are correlated share what they explain.

    Parameters
    ----------
    inputs : ndarray, shape [E, D]
    scores : ndarray, shape [E, R]

    Returns
    -------
    list of (index, standard error) in the order of the inputs.
    """
    total = np.sum(_components(scores)) if scores.shape[1] > 1 else np.var(scores, ddof=1)
    means = np.mean(scores, axis=1)
    found = []
    for column in np.asarray(inputs, dtype=float).T:
        bins = _bins(column)
        value = _between_bins(bins, means) / total
        left = [
            _between_bins(np.delete(bins, e), np.delete(means, e)) / total
            for e in range(len(means))
        ]
        n = len(left)
        found.append((float(value), float(np.sqrt((n - 1) * np.var(left)))))
    return found


def _bins(column: np.ndarray) -> np.ndarray:
    """Bin of each set, equal counts along the rising input."""
    n_bins = max(2, round(np.sqrt(len(column)) / 1.25))
    order = stats.rankdata(column, method="ordinal") - 1
    return np.asarray(order * n_bins // len(column), dtype=int)


def _between_bins(bins: np.ndarray, means: np.ndarray) -> float:
    """Variance of the bins' means, corrected for the scatter within the bins."""
    sizes = np.bincount(bins).astype(float)
    averages = np.bincount(bins, weights=means) / sizes
    within = np.sum((means - averages[bins]) ** 2) / (len(means) - len(sizes))
    between = np.sum(sizes * (averages - np.mean(means)) ** 2) / (len(sizes) - 1)
    typical = (len(means) - np.sum(sizes**2) / len(means)) / (len(sizes) - 1)
    return float((between - within) / typical)


def _components(scores: np.ndarray) -> np.ndarray:
    """Variances (parameters, sections, interaction) of [E, R]."""
    n_sets, n_tracks = scores.shape
    grand = np.mean(scores)
    of_set, of_track = np.mean(scores, axis=1) - grand, np.mean(scores, axis=0) - grand
    rest = scores - grand - of_set[:, None] - of_track[None, :]
    ms_rest = np.sum(rest**2) / ((n_sets - 1) * (n_tracks - 1))
    ms_set = n_tracks * np.sum(of_set**2) / (n_sets - 1)
    ms_track = n_sets * np.sum(of_track**2) / (n_tracks - 1)
    return np.array([(ms_set - ms_rest) / n_tracks, (ms_track - ms_rest) / n_sets, ms_rest])


def _shares(scores: np.ndarray) -> np.ndarray:
    parts = _components(scores)
    total = np.sum(parts)
    return parts / total if total > 0.0 else np.full(3, np.nan)


def _jackknife(scores: np.ndarray, axis: int) -> np.ndarray:
    """Variance of the shares from leaving out one set (or realisation) at a time, blocks if many."""
    n = scores.shape[axis]
    if n < 3:
        return np.full(3, np.nan)
    blocks = np.array_split(np.arange(n), min(n, 200))
    left = np.array([_shares(np.delete(scores, block, axis=axis)) for block in blocks])
    return np.asarray((len(blocks) - 1) * np.var(left, axis=0))


class _Pooled:
    """All values of [E, R] in rising order, with their set and track."""

    def __init__(self, values: np.ndarray) -> None:
        flat = values.ravel()
        order = np.argsort(flat, kind="stable")
        self.order = order[~np.isnan(flat[order])]
        self.sorted = flat[self.order]
        self.set, self.track = np.unravel_index(self.order, values.shape)

    def quantiles(self, level: float, weights: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
        """Weighted quantile for every row of ``weights``: the first value to reach ``level``."""
        if not len(self.sorted):
            return np.full(len(weights[0]), np.nan)
        found = np.empty(len(weights[0]))
        for b, (by_set, by_track) in enumerate(zip(*weights, strict=True)):
            cumulative = np.cumsum(by_set[self.set] * by_track[self.track])
            at = np.searchsorted(cumulative, level * cumulative[-1] * (1.0 - 1e-12))
            found[b] = self.sorted[min(int(at), len(self.sorted) - 1)]
        return found


def _weights(shape: tuple[int, ...], seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Resampling weights of sets [B, E] and tracks [B, R]; the first row is the sample itself."""
    rng = np.random.default_rng(seed)
    parts = []
    for n in shape:
        drawn = rng.multinomial(n, np.full(n, 1.0 / n), size=RESAMPLES).astype(float)
        parts.append(np.vstack([np.ones(n), drawn]))
    return parts[0], parts[1]


def _tail(shape: tuple[int, ...]) -> float:
    """Share of the resampled values to leave out on each side, for [E, R].

    A percentile interval is too short for a small sample, as a normal one is that should be
    Student's; reading it further out mends that (Hesterberg 2015, American Statistician 69).
    """
    n = max(2, min((size for size in shape if size > 1), default=2))
    return float(
        stats.norm.cdf(stats.t.ppf(0.5 - 0.5 * CONFIDENCE, n - 1) * np.sqrt(n / (n - 1.0)))
    )


def _order(sample: np.ndarray, level: float) -> float | None:
    """Quantile of bootstrap values that may be infinite or missing: None there."""
    ordered = np.sort(sample[~np.isnan(sample)])
    if not len(ordered):
        return None
    return _number(ordered[min(int(level * len(ordered)), len(ordered) - 1)])


def _number(value: float | None) -> float | None:
    return float(value) if value is not None and np.isfinite(value) else None
