"""Quantiles of weighted values: the first to reach a level, and smooth ones."""

import numpy as np
import pytest

from mcsettle.estimate.estimate import LEVELS
from mcsettle.estimate.weighted_quantiles import smooth_quantiles, weighted_quantiles


def test_the_first_value_to_reach_each_level():
    values = np.arange(100.0)
    assert weighted_quantiles(values, np.ones(100), LEVELS).tolist() == [4.0, 49.0, 94.0]
    later = np.where(values < 50, 0.0, 1.0)
    assert weighted_quantiles(values, later, LEVELS).tolist() == [52.0, 74.0, 97.0]


@pytest.mark.parametrize("n", [20, 60, 180])
@pytest.mark.parametrize("weight", [0.1, 1.0, 1.0 / 3.0])
def test_the_rounding_of_the_weights_moves_no_quantile(n, weight):
    """The levels fall on whole values: no sum of weights may come out above or below by rounding."""
    at = weighted_quantiles(np.arange(n, dtype=float), np.full(n, weight), LEVELS)
    assert at.tolist() == [0.05 * n - 1, 0.5 * n - 1, 0.95 * n - 1]


def test_what_is_unknown_or_has_no_weight_is_left_out():
    values, weights = np.array([np.nan, 5.0, 1.0, np.inf]), np.array([9.0, 1.0, 0.0, 1.0])
    assert weighted_quantiles(values, weights, (0.0, 0.5, 1.0)).tolist() == [5.0, 5.0, np.inf]
    assert smooth_quantiles(values[:2], weights[:2], (0.5,)).tolist() == [5.0]
    for of in (weighted_quantiles, smooth_quantiles):
        assert np.isnan(of(values, np.zeros(4), LEVELS)).all()


def test_smooth_quantiles_are_linear_between_the_middles_of_the_weights():
    values, weights = np.array([2.0, 1.0, 4.0]), np.array([1.0, 2.0, 1.0])
    found = smooth_quantiles(values, weights, (0.1, 0.25, 0.4375, 0.625, 1.0))
    assert found.tolist() == [1.0, 1.0, 1.5, 2.0, 4.0]
    repeated = smooth_quantiles(np.arange(5.0), np.ones(5), (0.5,))
    assert repeated.tolist() == [2.0]
