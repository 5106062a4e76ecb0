"""How well a finite sample knows the quantiles of a line's mean: sets and tracks taken apart.

The mean over n sections is, given a parameter set, a sum of n independent draws. Its distribution under
resampled tracks needs no lines to be drawn: the set's mean, variance and skewness give it, as a Pearson
type III curve in Wilson and Hilferty's form. Two errors are found on their own and joined as
independent ones, on each side by itself (the method of variance estimates recovery):

* tracks: they shift and widen the curves. Of one parameter set the interval is studentised, of several
  a percentile one;
* sets: the quantile of a mixture over E sets has order statistics for limits (``order``); where the sets
  are too few to give one, that side is open.

References: Wilson and Hilferty (1931), PNAS 17, 684–688; Zou and Donner (2008), Statistics in Medicine
27, 1693–1702.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import special

from mcsettle.estimate.estimate import LEVELS
from mcsettle.estimate.order_statistics import TAIL, order_positions, worth
from mcsettle.estimate.resampling import Resampling
from mcsettle.estimate.weighted_quantiles import smooth_quantiles

POINTS = 1000  # of the mixture over all sets


@dataclass(frozen=True)
class Moments:
    """Mean, standard deviation, skewness and fourth central moment [B, E] of single sections."""

    mean: np.ndarray
    sd: np.ndarray
    skew: np.ndarray
    fourth: np.ndarray


def moments(values: np.ndarray, drawn: Resampling) -> Moments:
    """Moments of every set's sections [E, R], one or more known in every set, in each resample."""
    known = ~np.isnan(values)
    centre = np.nanmean(values, axis=1)
    off = np.where(known, values - centre[:, None], 0.0)
    with np.errstate(invalid="ignore", divide="ignore"):
        count = drawn.by_track @ drawn.by_block(known.astype(float)).T
        first, second, third, fourth = (
            drawn.by_track @ drawn.by_block(off**k).T / count for k in (1, 2, 3, 4)
        )
        variance = np.maximum(second - first**2, 0.0)
        sd = np.sqrt(variance)
        cube = third - 3.0 * first * second + 2.0 * first**3
        skew = np.where(sd > 0.0, cube / np.where(sd > 0.0, sd, 1.0) ** 3, 0.0)
    high = fourth - 4.0 * first * third + 6.0 * first**2 * second - 3.0 * first**4
    factor = drawn.factors[:, None]
    return Moments(factor * (centre + first), factor * sd, skew, factor**4 * high)


def curve(level: float | np.ndarray, skew: np.ndarray) -> np.ndarray:
    """Quantile of a standardised Pearson type III distribution."""
    z = special.ndtri(level)
    safe = np.where(np.abs(skew) < 1e-6, 1e-6, skew)
    return np.asarray(
        2.0 / safe * (np.maximum(1.0 + safe * z / 6.0 - safe**2 / 36.0, 0.0) ** 3 - 1.0)
    )


def line_intervals(
    of_sections: Moments | None,
    lines: np.ndarray,
    count: int,
    quantiles: Sequence[float],
    drawn: Resampling,
) -> list[tuple[float | None, float | None]]:
    """95 % intervals of ``quantiles``, those at ``LEVELS`` of the mean over ``count`` sections.

    Parameters
    ----------
    of_sections : ``moments``; None where there is but one track
    lines : ndarray, shape [E, n], means over lines of every set
    count : sections of a line, at least 2
    quantiles : shape [L]
    drawn : of the sets and tracks

    Returns
    -------
    list of (low, high)
        None where that side is open.
    """
    intervals = []
    of_tracks = _tracks(of_sections, count, drawn)
    for level, value, reaches in zip(LEVELS, quantiles, of_tracks, strict=True):
        ends = []
        of_sets = _sets(lines, level, value, drawn.by_set[0])
        for track, end, sign in zip(reaches, of_sets, (-1.0, 1.0), strict=True):
            reach = np.hypot(track, np.inf if end is None else max(sign * (end - value), 0.0))
            ends.append(float(value + sign * reach) if np.isfinite(reach) else None)
        intervals.append((ends[0], ends[1]))
    return intervals


def _tracks(
    of_sections: Moments | None, count: int, drawn: Resampling
) -> list[tuple[float, float]]:
    """How far the quantiles reach down and up for want of tracks; infinite where unknown."""
    if of_sections is None:
        return [(np.inf, np.inf) for _ in LEVELS]
    if of_sections.mean.shape[1] == 1:
        n_tracks = len(drawn.blocks)
        return [_one_set(of_sections, count, level, n_tracks) for level in LEVELS]
    reaches = []
    for resampled in _mixed(of_sections, count, drawn.sets_kept):
        others = resampled[1:][np.isfinite(resampled[1:])]
        if len(others) < 2:
            reaches.append((np.inf, np.inf))
            continue
        low, high = np.quantile(others, [drawn.alpha, 1.0 - drawn.alpha])
        reaches.append((max(float(resampled[0] - low), 0.0), max(float(high - resampled[0]), 0.0)))
    return reaches


def _one_set(of_sections: Moments, count: int, level: float, n_tracks: int) -> tuple[float, float]:
    """Studentised: the quantile's error by its influence function in every resample."""
    # The quantile is mean + lean · sd, and both move with the tracks: its variance is that of the mean,
    # of the sd and their covariance (the skewness). Each resample's miss is measured in its own error,
    # so that one that came out narrow by chance does not pass for precise.
    root = np.sqrt(count)
    mean, sd = of_sections.mean[:, 0], of_sections.sd[:, 0]
    at = curve(level, of_sections.skew[:, 0] / root)
    quantile, lean = mean + sd * at / root, at / root
    with np.errstate(invalid="ignore", divide="ignore"):
        square = (
            sd**2 + lean * of_sections.skew[:, 0] * sd**2
            + lean**2 * (of_sections.fourth[:, 0] - sd**4) / (4.0 * sd**2)
        )  # fmt: skip
        error = np.sqrt(np.maximum(square, 0.0) / (n_tracks - 1.0))
        scores = (quantile[1:] - quantile[0]) / error[1:]
    scores = scores[np.isfinite(scores)]
    if error[0] == 0.0 or len(scores) < 2:
        return 0.0, 0.0
    low, high = np.quantile(scores, [TAIL, 1.0 - TAIL])
    return max(float(high * error[0]), 0.0), max(float(-low * error[0]), 0.0)


def _mixed(of_sections: Moments, count: int, by_set: np.ndarray) -> np.ndarray:
    """Quantiles [L, B] over the mixture of the sets' curves, weighted by ``by_set`` [B, E]."""
    each = max(11, POINTS // by_set.shape[1])
    shares = (np.arange(each) + 0.5) / each
    root = np.sqrt(count)
    points = of_sections.mean[:, :, None] + of_sections.sd[:, :, None] / root * curve(
        shares, of_sections.skew[:, :, None] / root
    )
    weights = np.repeat(by_set, each, axis=1)
    rows = zip(points.reshape(len(by_set), -1), weights, strict=True)
    return np.array([smooth_quantiles(row, of_row, LEVELS) for row, of_row in rows]).T


def _sets(
    lines: np.ndarray, level: float, value: float, weights: np.ndarray
) -> tuple[float | None, float | None]:
    """Interval of the quantile for want of sets, from order statistics; None where it is open."""
    n_sets = len(lines)
    if n_sets == 1:
        return value, value
    shares = weights / np.sum(weights)
    below = np.mean(lines <= value, axis=1)
    crowd = float(np.sum(shares**2))
    if crowd >= 1.0:
        return None, None
    variance = float(np.sum(shares**2 * (below - level) ** 2)) / (1.0 - crowd)
    positions = order_positions(worth(level, variance, (1.0 / crowd,)), level)
    flat, each = lines.ravel(), np.repeat(shares, lines.shape[1])
    low, high = (
        None if p is None else float(smooth_quantiles(flat, each, (p,))[0]) for p in positions
    )
    return low, high
