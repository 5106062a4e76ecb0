"""Means over a line: quantiles and their intervals, where a side is open, what weights do."""

import numpy as np
import pytest
from scipy import stats

from mcsettle.estimate import resampling
from mcsettle.estimate.crossed import CrossedSample
from mcsettle.estimate.estimate import LEVELS
from mcsettle.estimate.likelihood import Likelihood, Median, log_of
from mcsettle.estimate.line_mean import line_means
from mcsettle.estimate.line_mean_error import curve, moments
from mcsettle.estimate.observation import Observation
from mcsettle.estimate.order_statistics import MANY, order_positions, worth
from mcsettle.estimate.resampling import Resampling, SetWeights


def days(n_sets=96, n_tracks=60, of_set=0.5, seed=0):
    rng = np.random.default_rng([5, seed])
    return 700.0 * np.exp(
        of_set * rng.normal(size=(n_sets, 1)) + 0.4 * rng.normal(size=(1, n_tracks))
    )


def lines_of(values, *args):
    return line_means(CrossedSample(values, "d"), *args)


def test_the_curve_without_lines_is_that_of_many_lines():
    values = days(1, 80)
    found = moments(values, Resampling(values.shape))
    for count in (5, 50):
        lines = np.random.default_rng(2).choice(values[0], (40_000, count)).mean(axis=1)
        for level in LEVELS:
            at = found.mean + found.sd / np.sqrt(count) * curve(level, found.skew / np.sqrt(count))
            assert at[0, 0] == pytest.approx(np.quantile(lines, level), rel=0.006)
    assert curve(0.3, np.zeros(1))[0] == pytest.approx(stats.norm.ppf(0.3), abs=1e-5)
    assert curve(0.9, np.array([0.8]))[0] == pytest.approx(stats.pearson3.ppf(0.9, 0.8), abs=5e-3)


def test_moments_of_resampled_tracks_are_those_of_the_tracks_resampled():
    values = days(3, 6)
    values[1, 2] = np.nan
    resamples = Resampling(values.shape)
    counts, found = resamples.by_track.astype(int), moments(values, resamples)
    for e, row in enumerate(values):
        drawn = np.repeat(row, counts[0])
        drawn = drawn[~np.isnan(drawn)]
        assert found.mean[0, e] == pytest.approx(drawn.mean())
        assert found.sd[0, e] == pytest.approx(drawn.std())
        assert found.skew[0, e] == pytest.approx(stats.skew(drawn))
        assert found.fourth[0, e] == pytest.approx(stats.moment(drawn, 4))


def test_very_many_tracks_are_resampled_in_blocks(monkeypatch):
    """The same numbers, and intervals as wide to the noise of 500 resamples."""
    values = days(1, 600)
    values[0, 7] = np.nan
    one_by_one = lines_of(values, 200.0)
    monkeypatch.setattr(resampling, "LARGEST", 200)
    assert Resampling(values.shape).by_track.shape[1] == 200
    for fine, coarse in zip(one_by_one, lines_of(values, 200.0), strict=True):
        for a, b in zip(
            (*fine.quantiles, fine.mean), (*coarse.quantiles, coarse.mean), strict=True
        ):
            assert a.value == b.value
            assert b.upper - b.lower == pytest.approx(a.upper - a.lower, rel=0.15)
    drawn, of_three = Resampling((1, 600)), np.arange(600.0)[None]
    blocks = of_three.reshape(1, 200, 3).sum(axis=2)
    np.testing.assert_array_equal(drawn.by_block(of_three), blocks)
    assert Resampling((2, 600)).by_track.shape[1] == 600  # sets that share tracks


def test_intervals_hold_their_value_and_narrow_with_the_sample():
    for n_sets in (1, 96):
        small, large = (lines_of(days(n_sets, n), 200.0) for n in (30, 480))
        for few, many in zip(small, large, strict=True):
            for a, b in zip((*few.quantiles, few.mean), (*many.quantiles, many.mean), strict=True):
                for e in (a, b):
                    assert e.lower is None or e.lower <= e.value
                    assert e.upper is None or e.value <= e.upper
                if n_sets == 1 and a.lower is not None and a.upper is not None:
                    assert b.upper - b.lower < 0.6 * (a.upper - a.lower)


def test_few_sets_leave_the_outer_side_open():
    few, many = (lines_of(days(n, 40, 1.5), 200.0, (100.0,))[0].quantiles for n in (24, 200))
    assert few[0].lower is None
    assert few[0].upper is not None
    assert few[2].upper is None
    assert few[1].lower is not None
    assert all(e.lower is not None and e.upper is not None for e in many)


def test_a_line_of_one_section_is_a_section_and_none_is_shorter():
    values = days(1, 50)
    short = lines_of(values, 200.0)[0]
    assert short.quantiles[1].value == pytest.approx(np.median(values))
    assert [line.length_km for line in lines_of(values, 1000.0)] == [1.0, 10.0, 100.0]
    assert [s.level for s in short.statistics] == [*LEVELS, None]
    assert {s.subject for s in short.statistics} == {"0.2 km"}


def test_one_track_tells_nothing_of_a_line():
    found = lines_of(days(40, 1), 200.0, (10.0,))[0]
    assert (found.quantiles[1].lower, found.quantiles[1].upper) == (None, None)


def test_what_independent_values_are_worth():
    n = 400
    assert worth(0.3, 0.3 * 0.7 / n, (1e6, 1e6)) == pytest.approx(n, rel=1e-3)
    assert worth(0.3, 0.3 * 0.7 / n, (20.0, 1e6)) < 0.9 * n
    assert worth(0.3, 0.0, (20.0,)) == MANY
    low, high = order_positions(100.0, 0.5)
    exact = stats.binom.ppf([0.025, 0.975], 100, 0.5)
    assert 100 * low == pytest.approx(exact[0], abs=1.0)
    assert 100 * high == pytest.approx(exact[1], abs=1.0)
    assert order_positions(5.0, 0.5) == (None, None)
    assert order_positions(MANY, 0.5) == (0.5, 0.5)


def test_renewed_weights_are_those_of_the_tracks_resampled():
    values = days(8, 12)
    one = Observation(None, 650.0, 60.0)
    several = Observation(None, 650.0, 60.0, sections=20)
    found = Likelihood((log_of(one, values),), ((several, values),))
    counts = np.vstack([np.ones(12), np.random.default_rng(1).multinomial(12, np.full(12, 1 / 12))])
    for row, logs in zip(counts, found.of_tracks(counts), strict=True):
        drawn = np.repeat(values, row.astype(int), axis=1)
        plain = (
            np.log(np.exp(log_of(one, drawn)).mean(axis=1))
            + Median.of(several, drawn).log_likelihood()
        )
        np.testing.assert_allclose(logs, plain, atol=1e-12)
    weights = found.weights()
    given = weights.given(counts)
    np.testing.assert_allclose(given[0], weights.values)
    assert not np.allclose(given[1], weights.values)
    # Where some tracks have been left out there is nothing to compute them from.
    np.testing.assert_array_equal(weights.given(counts[:, :5])[1], weights.values)
    drawn_sets = Resampling(values.shape, 0, weights)
    assert drawn_sets.sets_kept.sum(axis=1) == pytest.approx(np.full(501, 8.0))
    plain_sets = Resampling(values.shape, 0, SetWeights(weights.values))
    assert np.ptp(plain_sets.sets_kept, axis=0).max() == 0.0
