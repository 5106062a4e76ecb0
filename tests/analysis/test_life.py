"""Tamping again and again: identities with Eqs. (4) to (9), recovery, addresses, the command."""

import json
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import toy
from hypothesis import given, settings
from hypothesis import strategies as st
from typer.testing import CliRunner

from mcsettle.analysis.life import lives
from mcsettle.analysis.tamping import (
    Recovery,
    TampingSequence,
    constant_cost,
    present_cost,
    present_cost_slope,
)
from mcsettle.cli.app import app
from mcsettle.economics import marginal_cost, perpetual_present_value, present_value_slope
from mcsettle.errors import InputError
from mcsettle.study.study import Study, resolved_toml

C, R = 5625.0, 0.035
PERFECT = {"recovery": "perfect", "cycles": 4}
LINEAR = {"recovery": "linear", "intercept_mm": 0.5, "slope": 0.3, "scatter_mm": 0.1, "cycles": 5}


def alike(interval: float, n: int, life: float = np.inf) -> TampingSequence:
    years = interval * np.arange(1.0, n + 1.0)[None]
    return TampingSequence(np.where(years < life - 1e-9, years, np.nan), life, np.zeros(1, bool))


@settings(max_examples=60, deadline=None)
@given(st.floats(0.05, 30.0), st.integers(1, 15), st.floats(0.001, 0.2))
def test_intervals_all_alike_cost_what_eq_4_says(interval: float, n: int, rate: float) -> None:
    expected = float(perpetual_present_value(C, rate, interval))
    for sequence in (alike(interval, n), alike(interval, n, n * interval)):
        assert present_cost(sequence, C, rate)[0] == pytest.approx(expected, rel=1e-10)
    assert constant_cost(alike(interval, n), C, rate)[0] == pytest.approx(expected, rel=1e-12)
    slope = float(present_value_slope(C, rate, interval))
    assert present_cost_slope(alike(interval, n), C, rate)[0] == pytest.approx(slope, rel=1e-9)


@settings(max_examples=40, deadline=None)
@given(st.lists(st.floats(0.2, 5.0), min_size=2, max_size=8), st.sampled_from([np.inf, 60.0]))
def test_slope_is_the_finite_difference_of_the_cost(intervals: list[float], life: float) -> None:
    def cost(first: float) -> float:
        years = np.cumsum([first, *intervals[1:]])[None]
        whole = present_cost(TampingSequence(years, life, np.zeros(1, bool)), C, R)[0]
        # In a renewed life only this life's tampings move: later lives are taken off.
        return whole * -np.expm1(-R * life) if np.isfinite(life) else whole

    step = 1e-4
    difference = (cost(intervals[0] + step) - cost(intervals[0] - step)) / (2.0 * step)
    years = np.cumsum(intervals)[None]
    slope = present_cost_slope(TampingSequence(years, life, np.zeros(1, bool)), C, R)[0]
    assert slope == pytest.approx(difference, rel=1e-6)


@pytest.mark.parametrize("life", [np.inf, 20.0])
def test_without_discounting_the_slope_is_its_limit_and_the_cost_has_no_end(life: float) -> None:
    years = np.array([[2.0, 3.5, 5.1, np.nan], [1.0, np.nan, np.nan, np.nan]])
    sequence = TampingSequence(years, life, np.zeros(2, bool))
    assert np.all(np.isinf(present_cost(sequence, C, 0.0)))
    limit = present_cost_slope(sequence, C, 1e-8)
    slope = present_cost_slope(sequence, C, 0.0)
    np.testing.assert_allclose(slope, limit, rtol=1e-6, atol=1e-3 * (life < np.inf))


def test_costs_fall_with_longer_intervals_and_count_what_is_known() -> None:
    years = np.array([[2.0, 4.0, 6.0], [2.0, 5.0, 9.0], [2.0, np.nan, np.nan], [np.nan] * 3])
    sequence = TampingSequence(years, np.inf, np.array([False, False, True, True]))
    cost = present_cost(sequence, C, R)
    assert np.all(np.diff(cost) < 0.0)
    assert cost[2] == pytest.approx(C * (1.0 + np.exp(-R * 2.0)))
    assert cost[3] == C
    assert sequence.count.tolist() == [4, 4, 2, 1]


def test_recovery_follows_its_line_with_its_scatter() -> None:
    recovery = Recovery(0.3e-3, 0.4, scatter=0.05e-3)
    before = np.full(4000, 1.5e-3)
    after = recovery.sd_after(before, 1, range(4000), 1)
    assert after.mean() == pytest.approx(0.9e-3, abs=4 * 0.05e-3 / np.sqrt(4000))
    assert after.std() == pytest.approx(0.05e-3, rel=4 / np.sqrt(2 * 4000))
    assert recovery.sd_after(before[:1], 1, [17], 1)[0] == after[17]
    second = recovery.sd_after(before, 1, range(4000), 2)
    assert abs(np.corrcoef(after, second)[0, 1]) < 4 / np.sqrt(4000)
    wild = Recovery(0.3e-3, 0.4, scatter=2e-3, floor=0.2e-3).sd_after(before, 1, range(4000), 1)
    assert wild.min() == 0.2e-3
    assert wild.max() == pytest.approx(0.95 * 1.5e-3)


@pytest.mark.parametrize(
    "wrong",
    [{"slope": 1.0}, {"scatter": -1.0}, {"floor": 0.0}, {"shape": "flat"}, {"damage": -1.0}],
)
def test_impossible_recoveries_are_refused(wrong: dict[str, Any]) -> None:
    with pytest.raises(InputError):
        Recovery(**{"intercept": 0.3e-3, "slope": 0.4, **wrong})


def study(maintenance: dict[str, Any], **changes: Any) -> Study:
    return toy.study(maintenance=maintenance, **changes)


def test_perfect_recovery_and_constant_traffic_is_eq_4_to_1e_10(fresh_cache: Path) -> None:
    base, faster = lives(study(PERFECT))
    assert base.sequence.years.shape == (4, 4)
    expected = perpetual_present_value(C, R, base.sequence.first)
    np.testing.assert_allclose(base.cost, expected, rtol=1e-10)
    np.testing.assert_allclose(base.constant, expected, rtol=1e-12)
    assert not base.sequence.open.any()
    assert np.all(np.isnan(base.marginal))
    gamma = (faster.sequence.first / base.sequence.first - 1.0) / ((225.0 - 201.0) / 201.0)
    divisor = 225.0 * 72 * 365 / 1000.0
    eq8 = marginal_cost(gamma, base.sequence.first, C, R, divisor)
    np.testing.assert_allclose(faster.marginal, eq8, rtol=1e-9)
    np.testing.assert_allclose(faster.marginal_constant, eq8, rtol=1e-9)


def test_first_interval_is_that_of_a_run_and_recovery_matters(fresh_cache: Path) -> None:
    from mcsettle.step_a.transfers import step_a
    from mcsettle.step_b.build_case import build_case
    from mcsettle.step_b.engine import engine_for

    own = study(LINEAR)
    base = lives(own)[0]
    case = build_case(own.scene("base", "v201"), step_a(own.scenes))
    outcome = engine_for(case).run(own.initial_profiles().sample(range(4)), np.zeros(0))
    np.testing.assert_allclose(base.sequence.first * 365.0, outcome.days, rtol=1e-12)
    assert np.all(np.diff(base.sequence.years, axis=1) > 0.0)
    assert base.sd_after.min() >= 0.1e-3
    assert base.sd_after.max() < 1.5e-3
    worse = lives(study(LINEAR | {"intercept_mm": 0.8}))[0]
    assert np.all(worse.cost > base.cost)
    damaged = lives(study(LINEAR | {"damage_per_tamping": 0.2}))[0]
    np.testing.assert_array_equal(damaged.sequence.first, base.sequence.first)
    assert np.all(damaged.sequence.years[:, 1:] < base.sequence.years[:, 1:])


def test_the_grounds_count_goes_on_and_the_ballasts_begins_anew(fresh_cache: Path) -> None:
    """Initial profile and SD again: with the ground renewed every interval is the first one."""
    same = {
        "recovery": "linear",
        "intercept_mm": 1.03,
        "slope": 0.0,
        "shape": "initial",
        "cycles": 3,
    }
    renewed = lives(study(same | {"ground_renewed": True}))[0].sequence.years
    np.testing.assert_allclose(np.diff(renewed, axis=1), renewed[:, :1] * [[1.0, 1.0]], rtol=1e-9)
    going_on = lives(study(same))[0].sequence.years
    assert np.all(np.diff(going_on, axis=1) > renewed[:, :1] * 1.001)  # N^b slows


@pytest.mark.parametrize("shape", ["scaled", "initial", "redrawn"])
def test_a_track_alone_is_the_track_in_the_batch(fresh_cache: Path, shape: str) -> None:
    own = study(LINEAR | {"shape": shape, "cycles": 3})
    batch = lives(own)[0].sequence.years
    alone = lives(own, realisations=2)[0].sequence.years
    np.testing.assert_array_equal(alone, batch[:2])


def test_renewal_ends_a_life(fresh_cache: Path) -> None:
    free = lives(study(LINEAR))[0].sequence
    limit = float(np.median(free.years[:, 2]))
    cut = lives(study(LINEAR | {"renewal_years": limit}))[0]
    assert np.nanmax(cut.sequence.years) < limit
    assert cut.sequence.life == pytest.approx(limit)
    inside = np.where(free.years < limit, free.years, np.nan)[:, : cut.sequence.years.shape[1]]
    np.testing.assert_allclose(cut.sequence.years, inside, rtol=1e-12)


@pytest.mark.parametrize(
    ("table", "said"),
    [
        ({"recovery": "linear", "slope": 0.3}, "maintenance.intercept_mm: is missing"),
        ({"recovery": "perfect", "slope": 0.3}, "maintenance.slope: has no meaning"),
        (LINEAR | {"intercept_mm": 1.2}, "leaves 1.65 mm; it must leave less than the limit"),
        (LINEAR | {"shape": "flat"}, "scaled"),
    ],
)
def test_a_maintenance_that_cannot_be_is_refused(table: dict[str, Any], said: str) -> None:
    with pytest.raises(InputError, match=said):
        study(table)


def test_no_mean_of_a_minority_and_none_without_an_end() -> None:
    """5 of 12 tracks have a first tamping: what is known of them is known of the fastest alone."""
    from mcsettle.analysis.life import Life
    from mcsettle.cli.life import life_data, life_lines

    years = np.full((12, 1), np.nan)
    years[:5, 0] = 1.3
    sequence = TampingSequence(years, 30.0, np.ones(12, bool))
    costs = constant = np.where(np.isnan(years[:, 0]), np.nan, 1e5)
    life = Life(
        "base", "v201", sequence, years * 0.0, np.full(12, 1e4), constant, costs, costs, "u", "EUR"
    )
    lines = "\n".join(life_lines([life]))
    assert "1.3" not in lines
    assert lines.count("(known of 5 of 12, the shortest-lived)") == 5
    rows = life_data([life])[0]["rows"]
    assert rows["first interval, years"] == {
        "n": 5, "mean": None, "standard_error": None, "p5": None, "p50": None, "p95": None,
    }  # fmt: skip
    endless = Life(
        "base", "v201", sequence, years, *([np.full(12, np.inf)] * 2), costs, costs, "u", "EUR"
    )
    assert "(without discounting it has no end)" in "\n".join(life_lines([endless]))


def test_the_command(fresh_cache: Path, tmp_path: Path) -> None:
    import pandas as pd

    path = tmp_path / "study.toml"
    path.write_text(resolved_toml(study(LINEAR)), encoding="utf-8")
    assert "maintenance" in tomllib.loads(path.read_text(encoding="utf-8"))
    runner = CliRunner()
    done = runner.invoke(app, ["life", str(path), "--out", str(tmp_path / "out")])
    assert done.exit_code == 0, done.stderr
    assert "present cost, Eq. (4)" in done.stdout
    table = pd.read_parquet(tmp_path / "out" / "lives.parquet")
    assert len(table) == 8
    assert len(pd.read_parquet(tmp_path / "out" / "tampings.parquet")) == 2 * 4 * 5
    told = json.loads(runner.invoke(app, ["life", str(path), "--json"]).stdout)
    ours = told[0]["rows"]["present cost, this sequence"]
    first = table[table["scenario"] == "v201"]["present_cost_per_track_km"]
    assert ours["mean"] == pytest.approx(first.mean())
    path.write_text(resolved_toml(toy.study()), encoding="utf-8")
    refused = runner.invoke(app, ["life", str(path)])
    assert refused.exit_code == 2
    assert "needs the tables [maintenance] and [economics]" in refused.stderr
