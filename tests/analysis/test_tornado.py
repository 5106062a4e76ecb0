"""Tornado: each end is the study run with that value, on the same tracks."""

import numpy as np
import pytest
import toy
from scipy import stats
from toy import COST, LOAD, N0, uncertain

from mcsettle.analysis.tornado import tornado
from mcsettle.step_a.transfers import step_a
from mcsettle.step_b.build_case import build_case
from mcsettle.step_b.engine import engine_for

pytestmark = pytest.mark.usefixtures("fresh_cache")


@pytest.fixture(scope="module")
def bars(fresh_cache):
    return tornado(uncertain(N0, LOAD, COST), realisations=4)


def days(study):
    case = build_case(study.scene("base", "v201"), step_a(study.scenes))
    return engine_for(case).run(study.initial_profiles().sample(range(4)), np.zeros(0)).days


def test_ends_and_centre(bars):
    (bar,) = (
        b for b in bars if b.input == LOAD["input"] and b.scenario == "v201" and b.unit == "d"
    )
    assert bar.low == pytest.approx(stats.norm(17, 0.85).ppf(0.1))
    heavy = toy.study(
        trains={"passenger": {"vehicle": "passenger", "cars": 3, "axle_load_t": bar.high}}
    )
    assert bar.at_high == pytest.approx(np.median(days(heavy)), rel=1e-6)
    assert bar.central == pytest.approx(np.median(days(toy.study())), rel=1e-6)
    assert bar.at_high < bar.central < bar.at_low


def test_the_widest_stands_first_and_money_moves_no_days(bars):
    own = [b for b in bars if b.scenario == "v201" and b.metric == "tamping_interval_days"]
    assert [b.input for b in own] == [N0["input"], LOAD["input"], COST["input"]]
    assert own[-1].swing == 0.0
    cost = [b for b in bars if b.scenario == "v225" and b.metric == "marginal_cost"]
    money = next(b for b in cost if b.input == COST["input"])
    assert money.at_high / money.at_low == pytest.approx(money.high / money.low)
    assert {b.metric for b in bars if b.scenario == "v201"} == {"tamping_interval_days"}


def test_no_cost_of_a_minority():
    """Where most tracks outlive the horizon the known pairs are the short-lived: no median of theirs."""
    study, tracks = toy.study(), 8
    case = build_case(study.scene("base", "v201"), step_a(study.scenes))
    found = engine_for(case).run(study.initial_profiles().sample(range(tracks)), np.zeros(0)).days
    limit = {"horizon_years": float(np.sort(found)[2]) / 365.0}
    bars = tornado(uncertain(LOAD, limit=limit), realisations=tracks)
    costs = [bar for bar in bars if bar.metric in ("marginal_cost", "reduction_percent")]
    assert costs
    # Heavier trains (the high end) bring more of them to the limit in time.
    assert all(value is None for bar in costs for value in (bar.at_low, bar.central))
