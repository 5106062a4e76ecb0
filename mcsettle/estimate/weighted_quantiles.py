"""Quantiles of weighted values: the first to reach a share of the weight, or smooth between them.

A quantile of a sample is one of its values; one of lines that are drawn from it (``line_mean``) lies
between two of them. (``numpy.quantile`` takes weights too, of one sample, and takes the rounding of
their sum for weight.)
"""

from collections.abc import Sequence

import numpy as np

ROUNDING = 1e-12  # of a sum of weights, relative


def weighted_quantiles(
    values: np.ndarray, weights: np.ndarray, levels: Sequence[float]
) -> np.ndarray:
    """Quantiles [L]: the first value to reach each level of the weight; all NaN without any weight.

    Parameters
    ----------
    values : ndarray, any shape; NaN is left out
    weights : ndarray, shape as ``values``, none negative
    levels : between 0 and 1

    Examples
    --------
    >>> weighted_quantiles(np.array([3.0, 1.0, 2.0]), np.array([1.0, 1.0, 8.0]), (0.1, 0.5, 0.95))
    array([1., 2., 3.])
    """
    some = ~np.isnan(values) & (weights > 0.0)
    if not np.any(some):
        return np.full(len(levels), np.nan)
    sample = values[some]
    order = np.argsort(sample, kind="stable")
    return first_to_reach(sample[order], weights[some][None, order], levels)[:, 0]


def first_to_reach(rising: np.ndarray, weights: np.ndarray, levels: Sequence[float]) -> np.ndarray:
    """Quantiles [L, B] of ``rising`` values [n], n ≥ 1, with weights [B, n]; NaN without any weight.

    Works in place: ``weights`` are their sums afterwards.
    """
    reached = np.empty((len(levels), len(weights)))
    np.cumsum(weights, axis=1, out=weights)
    total = weights[:, -1]
    for k, level in enumerate(levels):
        aim = level * total * (1.0 - ROUNDING)
        at = [np.searchsorted(row, x) for row, x in zip(weights, aim, strict=True)]
        reached[k] = np.where(total > 0.0, rising[np.minimum(at, len(rising) - 1)], np.nan)
    return reached


def smooth_quantiles(
    values: np.ndarray, weights: np.ndarray, levels: Sequence[float]
) -> np.ndarray:
    """Quantiles [L], linear between the middles of the values' weights; all NaN without any weight.

    Parameters
    ----------
    values : ndarray, shape [n]; NaN is left out
    weights : ndarray, shape [n], none negative
    levels : between 0 and 1
    """
    known = ~np.isnan(values)
    sample, of_sample = values[known], weights[known]
    total = np.sum(of_sample)
    if not total > 0.0:
        return np.full(len(levels), np.nan)
    order = np.argsort(sample, kind="stable")
    middle = (np.cumsum(of_sample[order]) - 0.5 * of_sample[order]) / total
    return np.interp(levels, middle, sample[order])
