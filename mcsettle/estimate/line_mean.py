"""From track sections to a line: what the mean over many independent sections looks like.

A price is for a line, not for one window of track. Over L km of independent sections the mean
interval and the mean cost vary less the longer the line; inputs that are uncertain are the same all
along it, so their spread does not average out. The line's price is the mean of its sections' costs,
which is not the median section's cost, nor the cost at the mean interval: cost is convex in the
interval, so the mean cost lies above the cost at the mean.
"""

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from mcsettle.estimate.crossed import CrossedSample
from mcsettle.estimate.estimate import LEVELS, Estimate, Statistic
from mcsettle.estimate.line_mean_error import Moments, line_intervals, moments
from mcsettle.estimate.order_statistics import implied_error
from mcsettle.estimate.resampling import Resampling
from mcsettle.estimate.weighted_quantiles import smooth_quantiles

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
        return [Statistic("line_mean", level, mean, subject) for level, mean in levels]


def line_means(
    sample: CrossedSample, section_m: float, lengths_km: tuple[float, ...] = LENGTHS_KM
) -> list[LineMean]:
    """Distribution of the mean over lines of several lengths, with 95 % intervals.

    Parameters
    ----------
    sample : interval or cost by parameter set and section; what is censored or failed is left out
    section_m : float, m
        Length of one section: the window of the profile.
    lengths_km : lengths; each is rounded to whole sections, those under half a section left out

    Returns
    -------
    list of LineMean
        A line takes one parameter set and draws its sections from that set's realisations. The
        intervals are those of ``line_mean_error``; of a single section, of its own quantiles.
    """
    values = sample.values
    some = np.any(~np.isnan(values), axis=1)
    if not np.any(some & (sample.shares[:, 0] > 0.0)):
        return []
    drawn = sample.resampling.of_sets(some)
    lost = int(np.sum(np.isnan(values)))
    mean = replace(sample.section_mean(), n_censored=lost)
    of_sections = moments(values[some], drawn) if values.shape[1] > 1 else None
    rows = []
    for length in lengths_km:
        count = round(1000.0 * length / section_m)
        if count < 1:
            continue
        if count == 1:
            quantiles = sample.section_quantiles()
        else:
            quantiles = _of_lines(values[some], count, sample, drawn, of_sections)
        noted = tuple(replace(e, n_censored=lost, note=sample.note) for e in quantiles)
        rows.append(LineMean(length, count, noted, mean))
    return rows


def _of_lines(
    values: np.ndarray,
    count: int,
    sample: CrossedSample,
    drawn: Resampling,
    of_sections: Moments | None,
) -> list[Estimate]:
    """Quantiles of lines of ``count`` sections; no set is all unknown."""
    lines = _drawn_lines(values, count, sample.seed)
    weights, n = drawn.by_set[0], int(np.sum(~np.isnan(values)))
    # Lines of sets that count alike are one sample, linear between order statistics as NumPy has it.
    alike = np.ptp(weights) == 0.0
    of_lines = np.repeat(weights, lines.shape[1])
    quantiles = (
        np.quantile(lines, LEVELS) if alike else smooth_quantiles(lines.ravel(), of_lines, LEVELS)
    ).tolist()
    intervals = line_intervals(of_sections, lines, count, quantiles, drawn)
    return [
        Estimate(value, *ends, implied_error(ends, value), n, 0, sample.unit)
        for value, ends in zip(quantiles, intervals, strict=True)
    ]


def _drawn_lines(values: np.ndarray, count: int, seed: int) -> np.ndarray:
    """Means [E, n] of ``count`` sections each, drawn with replacement within one parameter set."""
    sections = [row[~np.isnan(row)] for row in values]
    rows = _drawn_rows(tuple(map(len, sections)), count, seed)
    return np.array([one[drawn].mean(axis=1) for one, drawn in zip(sections, rows, strict=True)])


@lru_cache(maxsize=len(LENGTHS_KM))
def _drawn_rows(sizes: tuple[int, ...], count: int, seed: int) -> list[np.ndarray]:
    """Places [n, count] of the sections of every line, in sets of ``sizes``; alike for all metrics."""
    rng = np.random.default_rng([seed, count])
    n_lines = max(200, min(LINES, LARGEST_DRAW // count))
    each = -(-n_lines // len(sizes))
    return [rng.integers(0, size, (each, count)) for size in sizes]
