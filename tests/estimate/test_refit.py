"""Errors of ensembles whose sets have fitted their factors: how far each fit moves with the tracks."""

import numpy as np
import pytest

from mcsettle.economics import cost_exponent, present_value_slope
from mcsettle.estimate.crossed import CrossedSample
from mcsettle.estimate.likelihood import Likelihood, log_of
from mcsettle.estimate.line_mean import line_means
from mcsettle.estimate.observation import Course, Observation
from mcsettle.estimate.refit import weights_of_fits
from mcsettle.estimate.resampling import Resampling, as_interval

SETS, TRACKS = 24, 32
MEDIAN = Observation(None, 700.0, 7.0, sections=1_000_000)
ONE = Observation(None, 700.0, 30.0)


def fitted_days(seed=3, spread=0.4):
    """Days [E, R] of sets that have fitted their median to 700 days: tracks alike in all of them."""
    rng = np.random.default_rng(seed)
    track, both = rng.normal(size=TRACKS), 0.05 * rng.normal(size=(SETS, TRACKS))
    days = np.exp(spread * track + both)
    return 700.0 * days / np.sort(days, axis=1)[:, TRACKS // 2, None]


def by_median(days):
    return lambda stretch: Likelihood((), ((MEDIAN, np.exp(stretch)[:, None] * days),))


def by_section(days):
    return lambda stretch: Likelihood((log_of(ONE, np.exp(stretch)[:, None] * days),), ())


def only(tracks):
    """Counts [1, R] of a resample that holds these tracks alone."""
    counts = np.zeros((1, TRACKS))
    counts[0, tracks] = TRACKS / len(tracks)
    return counts


@pytest.mark.parametrize("at", [by_median, by_section])
def test_the_fit_moves_as_far_as_the_tracks_last_longer(at):
    """Tracks exactly 1.1 times as long as the others: a fit to them shortens all days by as much."""
    days = 700.0 * np.repeat([[1.0] * 16 + [1.1] * 16], SETS, axis=0)
    days *= np.linspace(0.7, 1.3, 16)[np.arange(TRACKS) % 16]
    found = weights_of_fits(at(days), np.ones(SETS), TRACKS)
    short, long = (found.shift_of(only(range(a, a + 16)))[0] for a in (0, 16))
    np.testing.assert_allclose(short - long, np.log(1.1), atol=2e-3)
    as_they_are = found.shift_of(np.ones((1, TRACKS)))
    np.testing.assert_array_equal(as_they_are, np.zeros((1, SETS)))
    np.testing.assert_array_equal(found.given(np.ones((1, TRACKS)))[0], np.ones(SETS))


def test_evidence_moves_the_weights():
    """One set's tracks contradict each other; without the odd half its evidence rises."""
    days = np.full((SETS, TRACKS), 700.0) * np.linspace(0.99, 1.01, TRACKS)
    days[0, 16:] *= 30.0
    found = weights_of_fits(by_section(days), np.ones(SETS), TRACKS)
    weights = found.given(only(range(16)))[0]
    assert weights[0] == pytest.approx(2.0, rel=0.02)
    np.testing.assert_allclose(weights[1:], 1.0, rtol=0.02)


def test_a_set_that_cannot_be_stays_as_it_is():
    days = fitted_days()
    days[5] = np.inf
    found = weights_of_fits(by_median(days), np.where(np.arange(SETS) == 5, 0.0, 1.0), TRACKS)
    counts = Resampling(days.shape).by_track
    assert np.all(np.isfinite(found.shift_of(counts)))
    np.testing.assert_array_equal(found.shift_of(counts)[:, 5], 0.0)
    assert np.all(found.given(counts)[:, 5] == 0.0)


def test_intervals_forget_what_the_fit_takes_away():
    """With the factors refitted the tracks hardly move the median; with them kept they do."""
    days, weights = fitted_days(), np.ones(SETS)
    refitted = as_interval(weights_of_fits(by_median(days), weights, TRACKS))
    sample, sample_kept = (CrossedSample(days, "d", weights=w) for w in (refitted, weights))
    (found,), (kept,) = sample.quantiles((0.5,)), sample_kept.quantiles((0.5,))
    assert found.value == kept.value
    assert found.standard_error < 0.4 * kept.standard_error
    assert found.upper - found.lower < 0.35 * (kept.upper - kept.lower)
    (interval,) = sample.interval_quantiles((0.5,))
    assert interval.standard_error == pytest.approx(found.standard_error)
    mean, mean_kept = sample.mean(), sample_kept.mean()
    assert mean.value == mean_kept.value
    assert mean.standard_error < 0.85 * mean_kept.standard_error


def test_lines_forget_it_too():
    days, weights = fitted_days(spread=0.2), np.ones(SETS)
    refitted = as_interval(weights_of_fits(by_median(days), weights, TRACKS))
    found, kept = (
        line_means(CrossedSample(days, "d", weights=w), 200.0, (10.0,))[0]
        for w in (refitted, weights)
    )
    assert found.quantiles[1].value == pytest.approx(kept.quantiles[1].value, rel=1e-9)
    assert found.quantiles[1].standard_error < 0.7 * kept.quantiles[1].standard_error


def test_what_does_not_go_with_the_intervals_is_left_alone():
    days = fitted_days()
    refitted = weights_of_fits(by_median(days), np.ones(SETS), TRACKS)
    assert np.ptp(Resampling(days.shape, 0, refitted).factors) == 0.0
    doubled = Resampling(days.shape, 0, as_interval(refitted, 2.0)).factors
    once = Resampling(days.shape, 0, as_interval(refitted)).factors
    np.testing.assert_allclose(doubled, once**2)
    assert once[0] == 1.0


def test_sds_are_read_on_a_day_of_each_set():
    days = np.array([[[0.0, 10.0]], [[0.0, 10.0]]])
    course = Course(np.full((2, 1), np.inf), days, np.array([[[1.0, 2.0]], [[1.0, 3.0]]]))
    stretch = np.log([1.0, 2.0])
    sd = course.predicted(Observation(5.0, 1.0, 0.1), stretch)
    np.testing.assert_allclose(sd, [[1.5], [1.5]])


@pytest.mark.parametrize(("rate", "years"), [(0.0, 2.0), (0.04, 1.9), (0.3, 10.0)])
def test_the_power_of_the_intervals_that_costs_go_as(rate, years):
    step = 1e-5
    ends = [np.log(-present_value_slope(1.0, rate, years * np.exp(s))) for s in (-step, step)]
    assert cost_exponent(rate, years) == pytest.approx((ends[1] - ends[0]) / (2 * step), rel=1e-6)
