"""Calibration: the factor found does what it was asked for, or says why it cannot."""

from dataclasses import replace

import numpy as np
import pytest
import toy

from mcsettle.analysis.calibration import calibrate
from mcsettle.errors import InputError
from mcsettle.run.factor_digest import transfer_identity
from mcsettle.step_a.transfers import step_a
from mcsettle.step_b.build_case import build_case
from mcsettle.step_b.cycle_jump import CycleJump
from mcsettle.step_b.engine import engine_for

pytestmark = pytest.mark.usefixtures("fresh_cache")
TARGET = 300.0


@pytest.fixture(scope="module")
def study():
    return toy.study(run={"realisations": 8})


@pytest.fixture(scope="module")
def told():
    return []


@pytest.fixture(scope="module")
def found(fresh_cache, study, told):
    return calibrate(study, "v201", TARGET, progress=lambda text, *_: told.append(text))


def run(study, factor, scenario="v201", variant="base", samples=()):
    case = build_case(study.scene(variant, scenario), step_a(study.scenes))
    case = replace(case, model=replace(case.model, settlement_factor=factor))
    profiles = study.initial_profiles().sample(range(study.run.realisations))
    return engine_for(case).run(profiles, np.array(samples, dtype=float))


def test_the_factor_meets_the_target(study, found):
    """The search stops at 1e-6 of the factor; days × factor is nearly constant."""
    assert found.median_days == pytest.approx(TARGET, rel=1e-5)
    days = run(study, found.factor).days
    assert np.isfinite(days).all()
    low, high = np.sort(days)[3:5]
    assert low * (1 - 1e-5) <= TARGET <= high * (1 + 1e-5)  # a median of eight lies between these
    assert 10 < found.factor < 100  # a month at a factor of 300


def test_what_it_reports(study, found, told):
    assert (found.scenario, found.variant) == ("v201", "base")
    assert (found.target_days, found.realisations, found.seed) == (TARGET, 8, study.seed)
    assert found.factor_low < found.factor < found.factor_high
    assert found.transfer_digest == step_a(study.scenes).digest
    assert found.factor_digest == transfer_identity(study.scene("base", "v201"), study.scenes)
    outcome = run(study, found.factor)
    assert found.mean_settlement_mm == pytest.approx(
        np.median(outcome.mean_settlement) * 1e3, rel=1e-9
    )
    plain = run(study, 1.0, samples=(TARGET,))
    growth = np.median(plain.history[:, 0] - plain.sd_initial) * 1e3
    assert found.uncalibrated_growth_mm == pytest.approx(growth, rel=1e-9)
    assert 0 < growth < 0.1
    assert sum("Calibration, factor" in text for text in told) == found.evaluations


def test_the_studys_own_factor_does_not_matter(found):
    other = toy.study(run={"realisations": 8}, settlement={"settlement_factor": 7.0})
    assert calibrate(other, "v201", TARGET).factor == pytest.approx(found.factor, rel=1e-12)


def test_any_scenario_and_variant_can_be_the_one():
    study = toy.study(variants=[{"name": "base"}, {"name": "total", "stress": "total"}])
    fitted = calibrate(study, "v225", TARGET, "total")
    assert (fitted.scenario, fitted.variant) == ("v225", "total")
    days = np.sort(run(study, fitted.factor, "v225", "total").days)
    assert days[1] * (1 - 1e-5) <= TARGET <= days[2] * (1 + 1e-5)


def test_a_target_below_what_any_factor_reaches_is_refused():
    with pytest.raises(InputError, match="no settlement factor between"):
        calibrate(toy.study(), "v201", 2e-3)  # 5e6 would do it


def test_a_target_above_what_any_factor_reaches_is_refused():
    """The search keeps to factors of a thousandth and more, here some 30 000 years."""
    study = toy.study(limit={"horizon_years": 1000, "sd_limit_mm": 1.03001})
    with pytest.raises(InputError, match="no settlement factor between"):
        calibrate(study, "v201", 360_000.0)


@pytest.mark.parametrize("days", [0.0, -5.0, 730.0, 1e4, float("nan")])
def test_a_target_outside_the_horizon_is_refused(days):
    with pytest.raises(InputError, match="horizon of 730 days"):
        calibrate(toy.study(), "v201", days)


def test_a_target_near_the_horizon_leaves_that_end_open():
    """Medians beyond the horizon all look alike: a search there would find the horizon."""
    study = toy.study(run={"realisations": 8})
    fitted = calibrate(study, "v201", 715.0)
    assert fitted.median_days == pytest.approx(715.0, rel=1e-4)
    assert fitted.factor_low is None  # its median would lie some days beyond day 730


def test_tracks_that_fail_are_no_censored_tracks(monkeypatch, study, found):
    """A median over the sound ones: every second track fails, and the factor hardly moves."""
    plain = CycleJump.run

    def broken(self, *arguments, **options):
        outcome = plain(self, *arguments, **options)
        failed = np.arange(len(outcome.days)) % 2 == 1
        return replace(
            outcome,
            failed=failed,
            reached=outcome.reached & ~failed,
            days=np.where(failed, np.nan, outcome.days),
        )

    monkeypatch.setattr(CycleJump, "run", broken)
    fitted = calibrate(study, "v201", TARGET)
    assert fitted.median_days == pytest.approx(TARGET, rel=1e-4)
    assert fitted.factor == pytest.approx(found.factor, rel=0.3)
    assert 0 < fitted.uncalibrated_growth_mm < 0.1


def test_a_refusal_gives_the_reach():
    with pytest.raises(InputError, match=r"they reach from .* to the horizon of 730 days"):
        calibrate(toy.study(), "v201", 2e-3)
