"""Increments show where they grow."""

import numpy as np
import pytest

from mcsettle.railway.increments import increment_by_wave


def test_increments_by_wave():
    """Long waves that deepen by a tenth, short ones that arise anew."""
    k = 2.0 * np.pi * np.arange(6, 67) / 200.0
    rng = np.random.default_rng(6)
    first = rng.normal(size=(50, 61)) + 1j * rng.normal(size=(50, 61))
    new = rng.normal(size=(50, 61)) + 1j * rng.normal(size=(50, 61))
    long = 2.0 * np.pi / k >= 10.0
    second = first + np.where(long, 0.1 * first, 0.2 * new)
    (_, _, grown_short, new_waves), (_, _, grown_long, old_waves) = increment_by_wave(
        first, second, k, np.array([2.9, 10.0, 36.0])
    )
    assert (grown_long, old_waves) == pytest.approx((0.1, 1.0))
    assert grown_short == pytest.approx(0.2, rel=0.1)
    assert abs(new_waves) < 0.1
