"""From track sections to a line: what the mean over many independent sections looks like.

A price is for a line, not for one window of track. Over L km of independent sections the mean
interval and the mean cost vary less the longer the line; inputs that are uncertain are the same all
along it, so their spread does not average out. The line's price is the mean of its sections' costs,
which is not the median section's cost, nor the cost at the mean interval: cost is convex in the
interval, so the mean cost lies above the cost at the mean.

Depends on: estimate.
"""

from dataclasses import dataclass

import numpy as np

from mcsettle.estimate import LEVELS

LENGTHS_KM = (0.2, 1.0, 10.0, 100.0)
LINES = 2000  # drawn of each length
LARGEST_DRAW = 2_000_000


@dataclass(frozen=True)
class LineMean:
    """Distribution of the mean over lines of ``length_km``: values at ``LEVELS``."""

    length_km: float
    sections: int
    quantiles: tuple[float, ...]
    n: int
    n_left_out: int


def line_means(
    values: np.ndarray,
    section_m: float,
    lengths_km: tuple[float, ...] = LENGTHS_KM,
    seed: int = 0,
    set_weights: np.ndarray | None = None,
) -> list[LineMean]:
    """Distribution of the mean of ``values`` over lines of several lengths.

    Parameters
    ----------
    values : ndarray, shape [E, R]
        Interval or cost by parameter set and section; NaN (censored or failed) is left out.
    section_m : float, m
        Length of one section: the window of the profile.
    lengths_km : lengths; each is rounded to whole sections, at least one
    seed : of the resampling
    set_weights : ndarray, shape [E], optional
        Relative weights of the parameter sets (default: all alike).

    Returns
    -------
    list of LineMean
        A line takes one parameter set and draws its sections from that set's realisations.
    """
    known = ~np.isnan(values)
    some = np.any(known, axis=1)
    whole = [row[ok] for row, ok in zip(values[some], known[some], strict=True)]
    weights = np.ones(len(values)) if set_weights is None else set_weights
    n, left_out = int(np.sum(known)), int(np.sum(~known))
    if not whole:
        return []
    rows = []
    for length in lengths_km:
        count = max(1, round(1000.0 * length / section_m))
        means = _means(whole, count, np.random.default_rng([seed, count]))
        levels = tuple(float(q) for q in _weighted_quantiles(means, weights[some]))
        rows.append(LineMean(length, count, levels, n, left_out))
    return rows


def _means(whole: list[np.ndarray], count: int, rng: np.random.Generator) -> np.ndarray:
    """Means [E, n] of ``count`` sections each, drawn with replacement within one parameter set."""
    n_lines = max(200, min(LINES, LARGEST_DRAW // count))
    each = -(-n_lines // len(whole))
    return np.array([rng.choice(own, size=(each, count)).mean(axis=1) for own in whole])


def _weighted_quantiles(means: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Quantiles at ``LEVELS`` of [E, n] means whose rows are weighted by [E]."""
    if np.ptp(weights) == 0.0:
        return np.quantile(means, LEVELS)
    flat, each = means.ravel(), np.repeat(weights, means.shape[1])
    order = np.argsort(flat)
    middle = np.cumsum(each[order]) - 0.5 * each[order]
    return np.interp(LEVELS, middle / np.sum(each), flat[order])
