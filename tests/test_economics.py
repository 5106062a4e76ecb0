"""The economics reproduce the paper's Tables 7 and 8 from its days, and obey their own calculus."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mcsettle.economics import (
    Change,
    elasticity,
    marginal_cost,
    paired_effects,
    perpetual_present_value,
    present_value_slope,
    speed_change,
    tonnage_change,
)
from mcsettle.errors import InputError

COST, RATE = 5625.0, 0.035
NOT_CENSORED = np.array([np.nan])

# days, speed [km/h], elasticity, marginal cost: Tables 3 and 7, baseline 697 days at 201 km/h
# and 19.58 MGT a year in trains of 748 t.
TABLE_7 = [(620, 209, "-2.78", "1.445"), (585, 217, "-2.02", "1.012"), (568, 225, "-1.55", "0.750")]

# days, added MGT a day, new MGT a year, elasticity, marginal cost: Tables 5, 6 and 8, baseline
# 579 days with 0.054 MGT a day.
TABLE_8 = [
    (573, 0.00075, 19.5875, "-0.75", "0.131"),
    (539, 0.004, 21.04, "-0.93", "0.153"),
    (504, 0.008, 22.50, "-0.87", "0.134"),
]

intervals = st.floats(0.05, 80.0)
rates = st.floats(1e-4, 0.2)


def one_pair(base_days, days, change):
    effects = paired_effects(
        np.array([base_days]), np.array([days]), NOT_CENSORED, NOT_CENSORED, change, COST, RATE
    )
    return float(effects.elasticity[0]), float(effects.marginal_cost[0])


@pytest.mark.parametrize(("days", "speed", "gamma", "cost"), TABLE_7)
def test_table_7_to_every_printed_digit(days, speed, gamma, cost):
    change = speed_change(201.0, speed, 19.58e6 / 748.0 / 1e3)
    got_gamma, got_cost = one_pair(697.0, days, change)
    assert f"{got_gamma:.2f}" == gamma
    assert f"{got_cost:.3f}" == cost


@pytest.mark.parametrize(("days", "added", "per_year", "gamma", "cost"), TABLE_8)
def test_table_8_to_every_printed_digit(days, added, per_year, gamma, cost):
    change = tonnage_change(0.054, 0.054 + added, per_year)
    got_gamma, got_cost = one_pair(579.0, days, change)
    assert f"{got_gamma:.2f}" == gamma
    assert f"{got_cost:.3f}" == cost


def test_caption_of_table_7_is_not_the_base_speed():
    # 200 km/h, as the caption says, misses the printed elasticity.
    assert f"{float(elasticity(697.0, 620.0, 200.0, 209.0)):.2f}" != "-2.78"


def present_value(cost, rate, first, later, observed=0.0):
    """Eq. (5): at ``observed``, of tamping at ``first`` and at intervals ``later`` after it, years."""
    return np.exp(-rate * (first - observed)) * perpetual_present_value(cost, rate, later)


def test_present_value_is_the_sum_of_the_series():
    times = 1.9 + 2.1 * np.arange(2000)
    series = np.sum(COST * np.exp(-RATE * (times - 0.4)))
    # The tail beyond 4200 years is e^{-147}.
    assert present_value(COST, RATE, 1.9, 2.1, 0.4) == pytest.approx(series, rel=1e-12)
    assert perpetual_present_value(COST, RATE, 2.1) == pytest.approx(
        COST + present_value(COST, RATE, 2.1, 2.1), rel=1e-14
    )


@given(interval=intervals, rate=rates, observed=st.floats(0.0, 1.0))
def test_slope_is_the_finite_difference_of_the_present_value(interval, rate, observed):
    step = 1e-4 * interval

    def value(first):
        return float(present_value(COST, rate, first, interval, observed * interval))

    difference = (value(interval + step) - value(interval - step)) / (2.0 * step)
    slope = float(present_value_slope(COST, rate, interval, observed * interval))
    # Central difference: relative truncation (r·step)²/6 < 5e-7; rounding of the two values
    # 1e-16/(r·step), at most 2e-7 for the smallest rT of 5e-6.
    assert difference == pytest.approx(slope, rel=2e-6)


@given(base=intervals, interval=intervals, change=st.floats(0.01, 3.0))
def test_marginal_cost_is_the_chain_rule(base, interval, change):
    gamma = float(elasticity(base, interval, 1.0, 1.0 + change))
    cost = float(marginal_cost(gamma, base, COST, RATE, 20.0))
    assert cost == pytest.approx(
        float(present_value_slope(COST, RATE, base)) * gamma / 20.0, rel=1e-14
    )


@given(base=intervals, share=st.floats(0.01, 0.99), change=st.floats(0.01, 3.0), rate=rates)
def test_a_shorter_interval_costs_money(base, share, change, rate):
    gamma = elasticity(base, share * base, 1.0, 1.0 + change)
    assert gamma < 0.0
    assert marginal_cost(gamma, base, COST, rate, 1.0) > 0.0
    assert marginal_cost(-gamma, base, COST, rate, 1.0) < 0.0


@given(base=intervals, rate=rates)
def test_discounting_lowers_the_cost(base, rate):
    # r/(e^{rT} − 1) < 1/T, and it falls with r.
    costs = [float(marginal_cost(-1.0, base, COST, r, 1.0)) for r in (0.0, rate, 2.0 * rate)]
    assert costs[0] > costs[1] > costs[2]


def test_no_discounting_is_the_limit_of_little():
    assert float(present_value_slope(COST, 0.0, 2.0)) == -COST / 2.0
    # Next term of the series is −rT/2.
    assert present_value_slope(COST, 1e-9, 2.0) == pytest.approx(-COST / 2.0, rel=2e-9)


def test_for_ever_without_discounting_has_no_present_value():
    assert perpetual_present_value(COST, 0.0, 2.0) == np.inf
    assert np.isnan(perpetual_present_value(COST, 0.0, np.nan))


@given(base=intervals, extra=st.floats(0.001, 2.0))
def test_more_of_the_same_trains_is_an_identity(base, extra):
    # T·q constant: elasticity −1/(1 + Δq/q). Relative error grows as rounding / extra.
    gamma = elasticity(base, base / (1.0 + extra), 1.0, 1.0 + extra)
    assert gamma == pytest.approx(-1.0 / (1.0 + extra), rel=1e-12)


def test_one_train_more_of_72_has_elasticity_of_0_986():
    assert f"{float(elasticity(579.0, 579.0 * 72 / 73, 72.0, 73.0)):.3f}" == "-0.986"


def test_yearly_tonnage_defaults_to_365_days():
    assert tonnage_change(0.05, 0.06).divisor == pytest.approx(1e3 * 365.0 * 0.06, rel=1e-15)


def test_arrays_are_the_scalars_one_by_one():
    base, changed = np.array([600.0, 700.0, 800.0]), np.array([590.0, 600.0, 810.0])
    none = np.full(3, np.nan)
    change = speed_change(201.0, 209.0, 26.0)
    rate = np.array([0.0, 0.02, 0.035])
    together = paired_effects(base, changed, none, none, change, COST, rate)
    for r in range(3):
        alone = paired_effects(
            base[[r]], changed[[r]], none[[r]], none[[r]], change, COST, rate[[r]]
        )
        assert alone.marginal_cost[0] == together.marginal_cost[r]
        assert alone.reduction_percent[0] == together.reduction_percent[r]
    np.testing.assert_allclose(together.reduction_percent, 100.0 * (1.0 - changed / base))


def test_censored_pairs_have_no_value():
    nan = np.nan
    effects = paired_effects(
        np.array([500.0, nan, 500.0, nan, nan]),
        np.array([400.0, 900.0, nan, nan, 300.0]),
        np.array([nan, 1000.0, nan, 1000.0, nan]),
        np.array([nan, nan, 1000.0, 1000.0, nan]),
        speed_change(201.0, 209.0, 26.0),
    )
    assert effects.status.tolist() == ["paired", "censored", "censored", "censored", "failed"]
    unknown = [False, True, True, True, True]
    for values in (effects.reduction_percent, effects.elasticity, effects.marginal_cost):
        assert np.isnan(values).tolist() == unknown


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: speed_change(201.0, 201.0, 26.0), "both scenarios have 201.0"),
        (lambda: tonnage_change(0.0, 0.1), "base is 0.0"),
        (lambda: Change("speed", 1.0, 2.0, np.inf, "GBP"), "divisor is inf"),
        (
            lambda: paired_effects(
                np.ones(2), np.ones(3), np.ones(2), np.ones(2), speed_change(1.0, 2.0, 1.0)
            ),
            "equal length",
        ),
        (
            lambda: paired_effects(
                -np.ones(1), np.ones(1), NOT_CENSORED, NOT_CENSORED, speed_change(1.0, 2.0, 1.0)
            ),
            "none negative",
        ),
    ],
)
def test_refusals_say_why(call, words):
    with pytest.raises(InputError, match=words):
        call()


def test_a_track_at_its_limit_before_any_traffic_is_not_paired():
    days, later = np.array([0.0, 500.0]), np.array([0.0, 400.0])
    none = np.full(2, np.nan)
    effects = paired_effects(days, later, none, none, speed_change(200.0, 210.0, 26.0))
    assert effects.status.tolist() == ["at_limit", "paired"]
    assert np.isnan(effects.elasticity[0])
    assert np.isnan(effects.marginal_cost[0])
    assert np.isfinite(effects.elasticity[1])
