"""The few numbers of the first page: line prices, bounds where sections are censored, signs."""

from pathlib import Path

import made_run
import numpy as np
import pandas as pd
import pytest

from mcsettle.economics import highest_costs, paired_effects, tonnage_change
from mcsettle.estimate.resampling import SetWeights
from mcsettle.summary.answers import _interval, answers, counted_forms
from mcsettle.summary.results import read_results
from mcsettle.summary.samples import interval_sample

DAYS = np.linspace(500.0, 900.0, 41)


def answered(folder: Path, days, **changes):
    made = made_run.tonnage_study(**changes)
    return answers(read_results(made_run.write(folder, made, days)))


def test_a_line_pays_the_mean_of_its_sections(tmp_path: Path) -> None:
    found = answered(tmp_path / "run", {"A": DAYS, "C": 0.95 * DAYS})
    made = made_run.tonnage_study()
    nothing = np.full(41, np.nan)
    costs = paired_effects(DAYS, 0.95 * DAYS, nothing, nothing, made.change("C")).marginal_cost
    effect = found.effect("C")
    assert effect.price.value == pytest.approx(costs.mean(), rel=1e-12)
    assert effect.price.lower < costs.mean() < effect.price.upper
    assert effect.sections[1] == pytest.approx(np.median(costs))
    assert effect.reduction == pytest.approx(5.0)
    assert effect.shortens == (1.0, 1.0)
    interval = found.intervals["base", "A"]
    assert interval.half == (600.0, 800.0)
    assert interval.median.value == 700.0


def test_uncalibrated_variants_are_no_forms(tmp_path: Path) -> None:
    variants = [{"name": "plain", "settlement_factor": 1.0}, {"name": "fitted"}, {"name": "other"}]
    made = made_run.tonnage_study(variants=variants)
    assert counted_forms(made) == ("fitted", "other")
    found = answered(tmp_path / "run", {"A": DAYS, "C": 0.9 * DAYS}, variants=variants)
    assert (found.form, found.forms) == ("fitted", ("fitted", "other"))
    assert found.summaries["C"].verdict == "yes"


def test_most_sections_censored_give_a_bound(tmp_path: Path) -> None:
    later = np.where(np.arange(41) < 15, 0.9 * DAYS, np.nan)
    days = {"A": np.where(np.arange(41) < 18, DAYS, np.nan), "C": later}
    limit = {"sd_limit_mm": 1.5, "horizon_years": 3.0}
    found = answered(tmp_path / "run", days, limit=limit)
    effect = found.effect("C")
    assert effect.price.value is None
    assert (effect.price.n, effect.price.n_censored) == (41, 26)
    assert effect.sections == (None, None, None)
    assert effect.at_most is not None
    assert found.summaries["C"].verdict == "no"
    assert found.horizon_wanted is not None
    # Three sections are known to live longer with the freight train, 15 shorter.
    assert effect.shortens == pytest.approx((15 / 41, 38 / 41))


def test_bound_holds_whatever_the_censored_intervals_are() -> None:
    """Against brute force: no pair of intervals beyond the horizon costs more."""
    change = tonnage_change(0.05, 0.06)
    end = 600.0
    first = np.array([500.0, np.nan, np.nan])
    second = np.array([np.nan, 550.0, np.nan])
    ends = np.where(np.isnan(first), end, np.nan), np.where(np.isnan(second), end, np.nan)
    bounds = highest_costs(first, second, *ends, change)
    grid = np.geomspace(end, 50.0 * end, 400)
    for i, bound in enumerate(bounds):
        base = grid if np.isnan(first[i]) else np.full(1, first[i])
        days = grid if np.isnan(second[i]) else np.full(1, second[i])
        one, other = (a.ravel() for a in np.meshgrid(base, days))
        nothing = np.full(one.shape, np.nan)
        costs = paired_effects(one, other, nothing, nothing, change).marginal_cost
        assert costs.max() <= bound * (1.0 + 1e-9) or costs.max() <= bound + 1e-4
        assert costs.max() == pytest.approx(bound, rel=0.01)
    known = highest_costs(*(np.array([v]) for v in (500.0, 450.0, np.nan, np.nan)), change)
    nothing = np.full(1, np.nan)
    exact = paired_effects(np.array([500.0]), np.array([450.0]), nothing, nothing, change)
    assert known == pytest.approx(exact.marginal_cost, rel=1e-12)


def test_a_set_that_failed_altogether_takes_no_weight_from_the_others() -> None:
    """Of three sets the middle one has no results: the weights stay those of the first and the last."""
    keys = pd.MultiIndex.from_product([range(3), range(4)], names=["parameter_set", "realisation"])
    table = keys.to_frame(index=False).assign(
        status=["reached"] * 4 + ["failed"] * 4 + ["reached"] * 4,
        tamping_interval_days=[
            100.0,
            110.0,
            120.0,
            130.0,
            *[np.nan] * 4,
            500.0,
            510.0,
            520.0,
            530.0,
        ],
        censored_at_days=np.nan,
        mean_settlement_mm=1.0,
    )
    found = _interval(table, interval_sample(table), SetWeights(np.array([0.0, 0.5, 0.5])))
    assert found.median.value == 510.0
    assert found.half == (500.0, 520.0)
