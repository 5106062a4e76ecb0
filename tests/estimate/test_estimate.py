"""Estimates hit known distributions within their own errors, censored or not."""

import numpy as np
import pytest
from scipy.special import ndtri

from mcsettle.errors import InputError
from mcsettle.estimate.estimate import Estimate
from mcsettle.estimate.sample import (
    effect_quantile,
    interval_quantile,
    mean,
    quantile,
    restricted_mean,
    summarise_effects,
    summarise_intervals,
)

MEDIAN, SPREAD = 650.0, 0.35  # lognormal intervals: a factor of three from P5 to P95


def true_quantile(level):
    return MEDIAN * np.exp(SPREAD * ndtri(level))


def intervals(seed, n, horizon=np.inf):
    """Lognormal intervals, censored beyond the horizon."""
    days = MEDIAN * np.exp(SPREAD * np.random.default_rng(seed).standard_normal(n))
    late = days > horizon
    return np.where(late, np.nan, days), np.where(late, horizon, np.nan)


HORIZON = true_quantile(0.9)  # one in ten is censored


@pytest.mark.parametrize("horizon", [np.inf, HORIZON])
@pytest.mark.parametrize("level", [0.05, 0.5, 0.75])
def test_interval_quantile_covers_the_truth(level, horizon):
    truth = true_quantile(level)
    estimates = [interval_quantile(*intervals(s, 200, horizon), level) for s in range(300)]
    covered = np.mean([_covers(e, truth) for e in estimates])
    # 300 experiments: standard error of a coverage of 95 % is 1.3 %; the interval of order
    # statistics is a little conservative by construction.
    assert 0.95 - 4.0 * 0.013 < covered <= 0.995
    values = np.array([e.value for e in estimates])
    assert abs(np.mean(values) - truth) < 4.0 * np.std(values) / np.sqrt(300) + 0.003 * truth
    # The error printed is the error made, on average over experiments within 15 %.
    printed = np.mean([e.standard_error for e in estimates])
    assert printed == pytest.approx(np.std(values), rel=0.15)


def _covers(estimate, truth):
    low = -np.inf if estimate.lower is None else estimate.lower
    high = np.inf if estimate.upper is None else estimate.upper
    return low <= truth <= high


def test_dropping_or_capping_censored_rows_biases_and_the_curve_does_not():
    days, censored_at = intervals(1, 20_000, HORIZON)
    kept = interval_quantile(days, censored_at, 0.75)
    dropped = quantile(days[~np.isnan(days)], 0.75, "d")
    assert abs(kept.value - true_quantile(0.75)) < 4.0 * kept.standard_error
    assert abs(dropped.value - true_quantile(0.75)) > 10.0 * dropped.standard_error
    whole_mean = MEDIAN * np.exp(SPREAD**2 / 2.0)
    plain = mean(days[~np.isnan(days)], "d")
    capped = restricted_mean(days, censored_at)
    assert plain.value < whole_mean - 10.0 * plain.standard_error
    # A mean cut at the horizon is a different number, and says so.
    assert capped.value < whole_mean - 4.0 * capped.standard_error
    assert capped.note == f"restricted to day {HORIZON:g}"


def test_restricted_mean_against_quadrature():
    days, censored_at = intervals(2, 20_000, HORIZON)
    # E min(T, H) = ∫₀¹ min(F⁻¹(p), H) dp, midpoint rule.
    p = (np.arange(100_000) + 0.5) / 100_000
    truth = np.mean(np.minimum(true_quantile(p), HORIZON))
    estimate = restricted_mean(days, censored_at)
    assert abs(estimate.value - truth) < 4.0 * estimate.standard_error
    assert estimate.lower < truth < estimate.upper
    assert (estimate.n, estimate.n_censored) == (20_000, int(np.sum(~np.isnan(censored_at))))


def test_restricted_mean_is_the_integral_of_the_curve():
    days = np.array([100.0, 300.0, np.nan, 200.0])
    censored_at = np.array([np.nan, np.nan, 400.0, np.nan])
    # Survival 1, 3/4, 1/2, 1/4 over four spans of 100 d.
    assert restricted_mean(days, censored_at).value == pytest.approx(250.0)


def test_quantile_beyond_the_last_event_is_not_reached():
    days = np.concatenate([np.arange(1.0, 41.0), np.full(60, np.nan)])
    censored_at = np.where(np.isnan(days), 18_250.0, np.nan)
    estimate = interval_quantile(days, censored_at, 0.5)
    assert (estimate.value, estimate.upper, estimate.standard_error) == (None, None, None)
    assert estimate.note == "not reached by day 18250"
    assert str(estimate) == ("not identified (n = 100, 60 censored; not reached by day 18250)")
    assert interval_quantile(days, censored_at, 0.4).value == 40.0


def test_everything_censored_is_not_reached():
    estimate = interval_quantile(np.full(5, np.nan), np.full(5, 100.0), 0.5)
    assert (estimate.value, estimate.lower, estimate.upper) == (None, None, None)
    assert (estimate.n, estimate.n_censored) == (5, 5)


def test_staggered_censoring_keeps_its_place():
    # Textbook Kaplan–Meier: events 1, 3, 4 with 2 censored: survival 3/4, 3/8, 0.
    days, censored_at = np.array([1.0, np.nan, 3.0, 4.0]), np.array([np.nan, 2.0, np.nan, np.nan])
    assert interval_quantile(days, censored_at, 0.25).value == 1.0
    assert interval_quantile(days, censored_at, 0.5).value == 3.0
    assert interval_quantile(days, censored_at, 0.7).value == 4.0


def test_failed_rows_are_left_out():
    days, censored_at = np.array([1.0, np.nan, 3.0]), np.full(3, np.nan)
    assert interval_quantile(days, censored_at, 0.5).n == 2


def test_small_samples_leave_an_open_side():
    estimate = quantile(np.arange(20.0), 0.05, "%")
    assert estimate.lower is None
    assert estimate.upper is not None
    assert quantile(np.array([3.0]), 0.5, "d").standard_error is None


def test_effect_quantile_without_censoring_is_the_plain_one():
    values = np.random.default_rng(3).normal(11.0, 3.0, 200)
    estimate = effect_quantile(values, 0.5, "%")
    assert estimate == quantile(values, 0.5, "%")
    assert estimate.value == np.median(values)


def test_censored_pairs_widen_the_bounds_and_say_so():
    whole = np.random.default_rng(4).normal(11.0, 3.0, 400)
    values = np.where(whole < np.quantile(whole, 0.1), np.nan, whole)  # not at random
    estimate = effect_quantile(values, 0.5, "%")
    assert estimate.n_censored == 40
    assert estimate.value > np.median(whole)  # biased, as it must be: over the known pairs
    assert "360 uncensored pairs" in estimate.note
    assert estimate.lower < np.median(whole) < estimate.upper
    # Knowing that the censored pairs lie below the median identifies it.
    bounded = effect_quantile(values, 0.5, "%", bound_upper=np.full(400, 7.5))
    assert bounded.value == pytest.approx(np.median(whole))
    assert bounded.note == ""


def test_effect_that_bounds_contradict_is_not_identified():
    values = np.array([1.0, 2.0, 3.0, np.nan, np.nan, np.nan, np.nan])
    estimate = effect_quantile(values, 0.5, "%", bound_lower=np.full(7, 50.0))
    assert estimate.value is None
    assert estimate.note == "worst case 50 to inf"
    alone = effect_quantile(np.full(3, np.nan), 0.5, "%")
    assert (alone.value, alone.n, alone.n_censored) == (None, 3, 3)


def test_mean_covers_the_truth_of_a_skewed_sample():
    rng = np.random.default_rng(5)
    estimates = [mean(rng.exponential(2.0, 100), "GBP") for _ in range(150)]
    covered = np.mean([e.lower < 2.0 < e.upper for e in estimates])
    # 150 experiments: standard error 1.8 %; BCa of 100 skewed values falls short by 1–2 %.
    assert covered > 0.95 - 0.02 - 4.0 * 0.018
    assert np.mean([e.standard_error for e in estimates]) == pytest.approx(0.2, rel=0.1)


def test_mean_is_deterministic_and_an_identity_has_no_error():
    sample = np.random.default_rng(6).normal(size=50)
    assert mean(sample, "%") == mean(sample, "%")
    identity = mean(np.full(50, -0.986), "1")
    assert identity.value == pytest.approx(-0.986, rel=1e-15)
    assert (identity.lower, identity.upper, identity.standard_error) == (*[identity.value] * 2, 0.0)


def test_summaries_name_what_they_hold():
    rows = summarise_intervals(*intervals(7, 100, HORIZON))
    assert [(r.statistic, r.level) for r in rows] == [
        ("quantile", 0.05),
        ("quantile", 0.5),
        ("quantile", 0.95),
        ("restricted_mean", None),
    ]
    assert rows[2].estimate.upper is None  # P95 of a sample cut at its P90
    effects = np.random.default_rng(8).normal(size=30)
    assert [r.statistic for r in summarise_effects(effects, "%")][-1] == "mean"
    effects[0] = np.nan
    assert [r.statistic for r in summarise_effects(effects, "%")][-1] == "quantile"


@pytest.mark.parametrize(
    ("estimate", "text"),
    [
        (Estimate(671.83, 650.1, 694.2, 11.24, 200, 20, "d"), "672 ± 11 d (n = 200, 20 censored)"),
        (Estimate(0.13136, 0.1, 0.2, 0.00213, 50, 0, "GBP"), "0.1314 ± 0.0021 GBP (n = 50)"),
        (Estimate(-0.98630137, None, None, 0.0, 5, 0, "1"), "-0.986301 ± 0 1 (n = 5)"),
        (Estimate(3.0, None, None, None, 1, 0, "d", "alone"), "3 d (n = 1; alone)"),
    ],
)
def test_printing_rounds_to_the_error(estimate, text):
    assert str(estimate) == text


def test_relative_error():
    assert Estimate(200.0, None, None, 4.0, 9, 0, "d").relative_error == 0.02
    assert Estimate(None, None, None, None, 9, 9, "d").relative_error is None


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: quantile(np.array([]), 0.5, "d"), "0 values"),
        (lambda: quantile(np.array([1.0, np.nan]), 0.5, "d"), "all finite"),
        (lambda: quantile(np.ones(3), 1.0, "d"), "level is 1.0"),
        (lambda: interval_quantile(np.ones(3), np.ones(2), 0.5), "pair up"),
        (lambda: restricted_mean(np.array([np.nan]), np.array([np.nan])), "one or more"),
        (lambda: effect_quantile(np.array([]), 0.5, "%"), "0 values"),
    ],
)
def test_refusals_say_why(call, words):
    with pytest.raises(InputError, match=words):
        call()


def test_an_interval_has_the_digits_of_its_error():
    known = Estimate(12.3456, 11.234, None, 0.5, 10, 0, "d")
    assert known.with_interval() == "12.35 [11.23, open]"
    assert Estimate(None, None, None, None, 10, 10, "d").with_interval("\n") == "–"
    assert (
        Estimate(12.3456, 11.234, 13.0, None, 10, 0, "d").with_interval("\n")
        == "12.3\n[11.2, 13.0]"
    )
