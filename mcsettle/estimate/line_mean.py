"""From track sections to a line: what the mean over many independent sections looks like.

A price is for a line, not for one window of track. Over L km of independent sections the mean
interval and the mean cost vary less the longer the line; inputs that are uncertain are the same all
along it, so their spread does not average out. The line's price is the mean of its sections' costs,
which is not the median section's cost, nor the cost at the mean interval: cost is convex in the
interval, so the mean cost lies above the cost at the mean.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from mcsettle.estimate.crossed import crossed_mean, crossed_quantiles
from mcsettle.estimate.estimate import LEVELS, Estimate, Statistic
from mcsettle.estimate.line_mean_error import Moments, line_intervals, section_moments
from mcsettle.estimate.order_statistics import implied_error
from mcsettle.estimate.resampling import Resampling, Weights, plain_weights
from mcsettle.estimate.sample import mean, quantile

LENGTHS_KM = (0.2, 1.0, 10.0, 100.0)
LINES = 2000  # drawn of each length
LARGEST_DRAW = 2_000_000


@dataclass(frozen=True)
class LineMean:
    """Distribution of the mean over lines of ``length_km``: estimates at ``LEVELS``, and the mean."""

    length_km: float
    sections: int
    quantiles: tuple[Estimate, ...]
    mean: Estimate

    @property
    def statistics(self) -> list[Statistic]:
        """``line_mean`` at each level; without one it is the mean over all such lines."""
        subject = f"{self.length_km:g} km"
        levels = zip((*LEVELS, None), (*self.quantiles, self.mean), strict=True)
        return [Statistic("line_mean", level, found, subject) for level, found in levels]


def line_means(
    values: np.ndarray,
    section_m: float,
    lengths_km: tuple[float, ...] = LENGTHS_KM,
    seed: int = 0,
    set_weights: Weights = None,
    unit: str = "1",
    note: str = "",
) -> list[LineMean]:
    """Distribution of the mean of ``values`` over lines of several lengths, with 95 % intervals.

    Parameters
    ----------
    values : ndarray, shape [E, R]
        Interval or cost by parameter set and section; NaN (unknown or failed) is left out.
    section_m : float, m
        Length of one section: the window of the profile.
    lengths_km : lengths; each is rounded to whole sections, those under half a section left out
    seed : of the resampling
    set_weights : relative weights of the parameter sets, optional (default: all alike)
    unit, note : of the estimates

    Returns
    -------
    list of LineMean
        A line takes one parameter set and draws its sections from that set's realisations. The
        intervals are those of ``line_error``; of a single section, of its own quantiles.
    """
    some = np.any(~np.isnan(values), axis=1)
    if not np.any(some):
        return []
    plain = plain_weights(set_weights)
    if plain is not None and not np.sum(plain[some]) > 0.0:
        return []
    drawn = Resampling(values.shape, seed, set_weights).of_sets(some)
    lost = int(np.sum(np.isnan(values)))
    whole = _mean(values, unit, note, set_weights)
    of_sections = section_moments(values[some], drawn)
    rows = []
    for length in lengths_km:
        count = round(1000.0 * length / section_m)
        if count < 1:
            continue
        if count == 1:
            found = _of_sections(values, unit, note, set_weights)
        else:
            found = _of_lines(values[some], count, seed, drawn, of_sections, (lost, unit, note))
        rows.append(LineMean(length, count, found, whole))
    return rows


def _mean(values: np.ndarray, unit: str, note: str, weights: Weights) -> Estimate:
    """Mean of all sections, that of lines of any length."""
    known = values[~np.isnan(values)]
    lost = values.size - len(known)
    if len(values) > 1:
        found = crossed_mean(values, unit, note, set_weights=weights)
    else:
        found = mean(known, unit)
    return Estimate(
        found.value, found.lower, found.upper, found.standard_error, found.n, lost, unit,
        note or found.note,
    )  # fmt: skip


def _of_sections(
    values: np.ndarray, unit: str, note: str, weights: Weights
) -> tuple[Estimate, ...]:
    """Quantiles of a line of one section: of the sections themselves."""
    known = values[~np.isnan(values)]
    lost = values.size - len(known)
    if len(values) > 1:
        found = crossed_quantiles(values, values, LEVELS, unit, set_weights=weights)
    else:
        found = [quantile(known, level, unit) for level in LEVELS]
    return tuple(
        Estimate(e.value, e.lower, e.upper, e.standard_error, e.n, lost, unit, note) for e in found
    )


def _of_lines(
    values: np.ndarray,
    count: int,
    seed: int,
    drawn: Resampling,
    of_sections: Moments | None,
    about: tuple[int, str, str],
) -> tuple[Estimate, ...]:
    """Quantiles of lines of ``count`` sections; no set is all unknown."""
    lost, unit, note = about
    lines = _drawn_lines(values, count, seed)
    n = int(np.sum(~np.isnan(values)))
    at = [float(q) for q in _weighted_quantiles(lines, drawn.by_set[0])]
    found = []
    for value, ends in zip(
        at, line_intervals(of_sections, lines, count, LEVELS, at, drawn), strict=True
    ):
        found.append(Estimate(value, *ends, implied_error(ends, value), n, lost, unit, note))
    return tuple(found)


def _drawn_lines(values: np.ndarray, count: int, seed: int) -> np.ndarray:
    """Means [E, n] of ``count`` sections each, drawn with replacement within one parameter set."""
    sections = [row[~np.isnan(row)] for row in values]
    rows = _drawn_rows(tuple(map(len, sections)), count, seed)
    return np.array([own[drawn].mean(axis=1) for own, drawn in zip(sections, rows, strict=True)])


@lru_cache(maxsize=len(LENGTHS_KM))
def _drawn_rows(sizes: tuple[int, ...], count: int, seed: int) -> list[np.ndarray]:
    """Places [n, count] of the sections of every line, in sets of ``sizes``; alike for all metrics."""
    rng = np.random.default_rng([seed, count])
    n_lines = max(200, min(LINES, LARGEST_DRAW // count))
    each = -(-n_lines // len(sizes))
    return [rng.integers(0, size, (each, count)) for size in sizes]


def _weighted_quantiles(means: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Quantiles at ``LEVELS`` of [E, n] means whose rows are weighted by [E]."""
    if np.ptp(weights) == 0.0:
        return np.quantile(means, LEVELS)
    flat, each = means.ravel(), np.repeat(weights, means.shape[1])
    order = np.argsort(flat)
    middle = np.cumsum(each[order]) - 0.5 * each[order]
    return np.interp(LEVELS, middle / np.sum(each), flat[order])
