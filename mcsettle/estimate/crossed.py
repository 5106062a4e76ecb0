"""Estimates from parameter sets crossed with realisations: a matrix [E, R], the same tracks in every set.

The rows of such a table are not independent: all R rows of a set share its inputs and all E rows of a
realisation its track. Errors come from resampling sets and realisations separately (the pigeonhole
bootstrap), which is right for means up to the share of the interaction and a little too wide where
that is large; a Sobol sequence fills the inputs more evenly than chance, and the errors do not take
credit for it. (``scipy.stats.bootstrap`` resamples one index, with neither crossed nor weighted sets.)

Sets may be weighted (``conditioning``: by the likelihood of what was observed); the tails of a percentile
interval are then those of as many sets as carry the weight, 1/Σp².
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy import special

from mcsettle.estimate import sample as plain
from mcsettle.estimate.estimate import LEVELS, Estimate, Statistic, finite
from mcsettle.estimate.order_statistics import order_positions, worth
from mcsettle.estimate.resampling import Resampling, Weights, plain_weights
from mcsettle.estimate.weighted_quantiles import first_to_reach

CHUNK = 4_000_000  # cumulative weights held at a time


@dataclass(frozen=True)
class CrossedSample:
    """One number of every parameter set and realisation [E, R], as a run has sampled it.

    A run with one parameter set is a sample of independent tracks, and is estimated as one (``sample``).

    Parameters
    ----------
    values : ndarray, shape [E, R]
        NaN where censored or failed.
    unit : str
    at_least : ndarray, shape [E, R], or float
        What a censored value exceeds (−inf: it may be anything); NaN where nothing is censored.
        NaN in both is a failure, left out.
    weights : relative weights [E] of the parameter sets, optional (default: all alike)
    note : of its means
    seed : of the resampling
    """

    values: np.ndarray
    unit: str
    at_least: np.ndarray | float = np.nan
    weights: Weights = None
    note: str = ""
    seed: int = 0

    @cached_property
    def resampling(self) -> Resampling:
        """Of the sets and tracks; every number of the sample resamples alike."""
        return Resampling(self.values.shape, self.seed, self.weights)

    @cached_property
    def censored(self) -> np.ndarray:
        """Whether only a bound is known [E, R]."""
        return np.isnan(self.values) & ~np.isnan(self.at_least)

    @property
    def valid(self) -> np.ndarray:
        """Whether the realisation did not fail [E, R]."""
        return ~np.isnan(self.values) | self.censored

    @property
    def mostly_known(self) -> bool:
        """Whether no more than half of what did not fail is censored."""
        return bool(2 * np.sum(self.censored) <= np.sum(self.valid))

    @property
    def lowest(self) -> np.ndarray:
        """The least that each value can be [E, R]; NaN where failed."""
        return np.where(self.censored, self.at_least, self.values)

    @property
    def highest(self) -> np.ndarray:
        """The most that each value can be [E, R], inf where censored; NaN where failed."""
        return np.where(self.censored, np.inf, self.values)

    @property
    def shares(self) -> np.ndarray:
        """Weight [E, R] of every value."""
        of_sets = plain_weights(self.weights)
        column = np.ones(len(self.values)) if of_sets is None else of_sets
        return np.broadcast_to(column[:, None], self.values.shape)

    def weighted(self, weights: Weights) -> "CrossedSample":
        """The same sample with its parameter sets weighted."""
        return replace(self, weights=weights)

    def restricted(self) -> "CrossedSample":
        """Intervals restricted to the horizon: one that outlasts it counts with it, in every mean."""
        if not np.any(self.censored):
            return self
        horizon = float(np.min(self.lowest[self.censored]))
        return replace(
            self,
            values=np.where(self.censored, horizon, np.minimum(self.values, horizon)),
            at_least=np.nan,
            note=f"restricted to day {horizon:g}",
        )

    def quantiles(self, levels: Sequence[float] = LEVELS) -> list[Estimate]:
        """Quantiles over all sets and realisations, exact where the censored values cannot move them.

        Otherwise over the known ones, if they are the most and the bounds allow that; the interval
        covers whatever the unknown ones are.
        """
        drawn, lowest, highest = self.resampling, self.lowest, self.highest
        below = _quantiles(lowest, levels, drawn)
        above = _quantiles(highest, levels, drawn) if np.any(self.censored) else below
        n, n_unknown = int(np.sum(self.valid)), int(np.sum(self.censored))
        estimates = []
        for k in range(len(levels)):
            lower = _limits(lowest, levels[k], below[k, 0], drawn)[0]
            upper = _limits(highest, levels[k], above[k, 0], drawn)[1]
            if below[k, 0] == above[k, 0]:
                certain = np.isfinite(below[k, 1:]) & (below[k, 1:] == above[k, 1:])
                error = float(np.std(below[k, 1:], ddof=1)) if np.all(certain) else None
                value = finite(below[k, 0])
                estimates.append(Estimate(value, lower, upper, error, n, n_unknown, self.unit))
                continue
            known = float(_quantiles(self.values, levels, drawn, 1)[k, 0])
            worst = float(below[k, 0]), float(above[k, 0])
            estimates.append(plain.bounded(known, worst, (lower, upper), n, n_unknown, self.unit))
        return estimates

    def interval_quantiles(self, levels: Sequence[float] = LEVELS) -> list[Estimate]:
        """Quantiles of intervals [days]: the first day by which that share of the sample is reached.

        None where it is beyond the horizon.
        """
        if len(self.values) == 1:
            return plain.interval_quantiles(self.values[0], self._ends[0], levels)
        drawn, values = self.resampling, self.highest
        n, n_censored = int(np.sum(self.valid)), int(np.sum(self.censored))
        estimates = []
        for level, resampled in zip(levels, _quantiles(values, levels, drawn), strict=True):
            value, error, note = finite(resampled[0]), None, ""
            if np.isinf(resampled[0]):
                note = f"not reached by day {np.nanmax(self.at_least):g}"
            elif np.all(np.isfinite(resampled[1:])):
                error = float(np.std(resampled[1:], ddof=1))
            limits = _limits(values, level, resampled[0], drawn)
            estimates.append(Estimate(value, *limits, error, n, n_censored, self.unit, note))
        return estimates

    def interval_statistics(self) -> list[Statistic]:
        """Quantiles and restricted mean of intervals [days]."""
        if len(self.values) == 1:
            return plain.summarise_intervals(self.values[0], self._ends[0])
        mean = Statistic("restricted_mean", None, self.restricted().mean())
        return [*plain.at_levels(self.interval_quantiles()), mean]

    def effect_statistics(self) -> list[Statistic]:
        """Quantiles of a paired effect; its mean too if none is censored."""
        if len(self.values) == 1:
            return plain.summarise_effects(self.values[self.valid], self.unit)
        rows = plain.at_levels(self.quantiles())
        return rows if np.any(self.censored) else [*rows, Statistic("mean", None, self.mean())]

    def certain_statistics(self) -> list[Statistic]:
        """Quantiles; one that the censored values could move is not given."""
        if len(self.values) == 1:
            return plain.at_levels(self.interval_quantiles())
        return plain.at_levels(
            replace(e, value=None, standard_error=None) if e.note else e for e in self.quantiles()
        )

    def mean(self) -> Estimate:
        """Mean over all known values; its error is that of sets and tracks resampled."""
        drawn = self.resampling
        known = ~np.isnan(self.values)
        filled = np.where(known, self.values, 0.0)
        total = _summed(filled, drawn)
        count = _counted(known, drawn)
        with np.errstate(invalid="ignore", divide="ignore"):
            means = drawn.factors * total / count
        others = means[1:][np.isfinite(means[1:])]
        levels = _corrected(self.values, float(means[0]), others, drawn)
        ends = np.quantile(others, levels) if len(others) else (None, None)
        error = float(np.std(others, ddof=1)) if len(others) > 1 else None
        n = int(np.sum(known))
        limits = finite(ends[0]), finite(ends[1])
        return Estimate(finite(means[0]), *limits, error, n, 0, self.unit, self.note)

    def section_mean(self) -> Estimate:
        """``mean``, of one parameter set that of independent tracks."""
        if len(self.values) > 1:
            return self.mean()
        known = self.values[~np.isnan(self.values)]
        mean = plain.mean(known, self.unit)
        return replace(mean, note=self.note or mean.note)

    def section_quantiles(self) -> list[Estimate]:
        """``quantiles`` of the known values, of one parameter set those of independent tracks."""
        if len(self.values) > 1:
            return replace(self, at_least=np.nan).quantiles()
        known = self.values[~np.isnan(self.values)]
        return [plain.quantile(known, level, self.unit) for level in LEVELS]

    @property
    def _ends(self) -> np.ndarray:
        return np.broadcast_to(self.at_least, self.values.shape)


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
    reached = np.full((len(levels), n_rows), np.nan)
    if n == 0:
        return reached
    of_set, of_track = np.unravel_index(order, values.shape)
    step = max(1, CHUNK // n)
    for first in range(0, n_rows, step):
        part = slice(first, min(first + step, n_rows))
        weights = drawn.by_set[part].take(of_set, axis=1)
        weights *= drawn.by_track[part].take(drawn.blocks[of_track], axis=1)
        reached[:, part] = drawn.factors[part] * first_to_reach(flat[order], weights, levels)
    return reached


def _corrected(
    values: np.ndarray, mean: float, others: np.ndarray, drawn: Resampling
) -> tuple[float, float]:
    """Levels of the resampled means that bound a mean: bias and skewness corrected (BCa).

    The acceleration is that of the sum of the sets' and the tracks' influences.
    """
    if not np.isfinite(mean) or len(others) < 2 or np.ptp(others) <= 1e-12 * abs(mean):
        return drawn.alpha, 1.0 - drawn.alpha
    off = np.where(np.isnan(values), 0.0, values - mean)
    of_blocks = drawn.by_block(off)
    of_sets = drawn.by_set[0] * (of_blocks @ drawn.by_track[0])
    influence = np.concatenate([of_sets, drawn.by_set[0] @ of_blocks])
    cubes, squares = np.sum(influence**3), np.sum(influence**2)
    skew = float(cubes / (6.0 * squares**1.5)) if squares > 0.0 else 0.0
    below = np.mean(others < mean) + 0.5 * np.mean(others == mean)
    bias = float(special.ndtri(np.clip(below, 1.0 / len(others), 1.0 - 1.0 / len(others))))
    least = max(drawn.alpha, 1e-9)  # of two sets or tracks the tails are beyond any resample
    z = bias + np.asarray(special.ndtri([least, 1.0 - least]))
    ends = special.ndtr(bias + z / np.maximum(1.0 - skew * z, 1e-3))
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
        end = None if position is None else _quantiles(values, (position,), drawn, 1)[0, 0]
        ends.append(finite(end))
    return ends[0], ends[1]


def _counted(chosen: np.ndarray, drawn: Resampling) -> np.ndarray:
    """Weight [B] of the rows ``chosen`` [E, R]."""
    return _summed(chosen.astype(float), drawn)


def _summed(values: np.ndarray, drawn: Resampling) -> np.ndarray:
    """Weighted sum [B] of values [E, R]."""
    return np.einsum("br,br->b", drawn.by_set @ drawn.by_block(values), drawn.by_track)


def _weight_below(values: np.ndarray, bounds: np.ndarray, drawn: Resampling) -> np.ndarray:
    """Weight [B] of the rows [E, R] up to the bound [B] of each resample."""
    known = np.isfinite(values)
    parts = zip(drawn.by_set, bounds, drawn.by_track, strict=True)
    return np.array(
        [sets @ (known & (values <= x)) @ tracks[drawn.blocks] for sets, x, tracks in parts]
    )
