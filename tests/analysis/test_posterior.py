"""Posterior of the settlement factor: what was put in comes out, as often as it should."""

from dataclasses import replace

import numpy as np
import pytest
import toy

from mcsettle.analysis.forecast import forecast
from mcsettle.analysis.posterior import infer_factor, sd_model
from mcsettle.cli.observations import read_observations
from mcsettle.errors import InputError
from mcsettle.estimate.estimate import LEVELS
from mcsettle.estimate.observation import Observation
from mcsettle.estimate.resampling import effective
from mcsettle.step_a.transfers import step_a
from mcsettle.step_b.build_case import build_case
from mcsettle.step_b.engine import engine_for
from mcsettle.types import silent

pytestmark = pytest.mark.usefixtures("fresh_cache")
DAYS, ERROR, TRUTH = np.array([5.0, 15.0, 25.0]), 0.02, 250.0


@pytest.fixture(scope="module")
def study():
    return toy.study(profile={"shortest_m": 3.0}, run={"realisations": 64})


def observed(study, factor, realisation, rng=None) -> tuple[Observation, ...]:
    """SDs of one track outside the ensemble, with or without errors of observation."""
    case = build_case(study.scene("base", "v201"), step_a(study.scenes))
    model = replace(case.model, settlement_factor=factor)
    case = replace(case, model=model, sd_limit=1.0)
    profiles = study.initial_profiles().sample(range(realisation, realisation + 1))
    sd = engine_for(case).run(profiles, DAYS).history[0] * 1e3
    sd = sd + (0.0 if rng is None else ERROR * rng.normal(size=len(sd)))
    return tuple(Observation(float(d), float(s), ERROR) for d, s in zip(DAYS, sd, strict=True))


@pytest.fixture(scope="module")
def rows(fresh_cache, study):
    return observed(study, TRUTH, 1000)


@pytest.fixture(scope="module")
def told():
    """What the fit below has said of its progress."""
    return []


@pytest.fixture(scope="module")
def fit(study, rows, told):
    return infer_factor(study, "v201", rows, progress=lambda *one: told.append(one))


def test_the_posterior_is_that_of_every_factor_and_track_computed(study, rows, fit):
    found = fit
    logs = np.linspace(np.log(20.0), np.log(600.0), 160)
    model = sd_model(study.scene("base", "v201"), rows, silent, 1)
    (of_tracks,) = model.likelihood(logs, logs, 64).sections
    weights = np.exp(of_tracks - of_tracks.max())
    weights /= weights.sum()
    by_factor = weights.sum(axis=1)
    exact = np.interp(LEVELS, np.cumsum(by_factor) - 0.5 * by_factor, logs)
    np.testing.assert_allclose(np.log(found.quantiles), exact, atol=0.015)
    assert found.effective == pytest.approx(effective(weights.sum(axis=0)), rel=0.02)
    low, middle, high = found.quantiles
    assert low < found.least_squares < high
    assert found.median == middle
    assert np.exp(1.645 * found.log_sd) == pytest.approx(np.sqrt(high / low), rel=0.01)
    assert found.effective > 20
    assert not found.few
    assert found.misfit < 1.0


@pytest.mark.slow
def test_it_covers_at_its_rate(study):
    """P5 to P95 of 30 other sections: 27 expected, 22 is three standard errors off."""
    rng = np.random.default_rng(1)
    hits = 0
    for r in range(30):
        low, _, high = infer_factor(study, "v201", observed(study, TRUTH, 2000 + r, rng)).quantiles
        hits += low <= TRUTH <= high
    assert 22 <= hits <= 30


def test_smaller_errors_and_more_days_narrow_it(study, rows, fit):
    narrow = infer_factor(study, "v201", tuple(replace(o, error=0.01) for o in rows))
    assert narrow.log_sd < fit.log_sd
    # That sections differ stays, however exactly one of them is measured.
    exact = infer_factor(study, "v201", tuple(replace(o, error=0.005) for o in rows))
    assert exact.log_sd > 0.2 * narrow.log_sd


def test_the_studys_own_factor_does_not_matter(rows, fit):
    other = toy.study(
        profile={"shortest_m": 3.0}, run={"realisations": 64}, settlement={"settlement_factor": 7.0}
    )
    assert infer_factor(other, "v201", rows) == fit


def test_what_no_factor_gives_is_refused_with_the_reach(study):
    with pytest.raises(InputError, match=r"give SDs from 1.03 mm to .*, and 0.5 mm is observed"):
        infer_factor(study, "v201", (Observation(20.0, 0.5, 0.01),))


def test_observations_that_do_not_constrain_the_factor_are_refused(study):
    """Growth within the errors: any small factor explains it, down to the prior's end."""
    for sd, off in ((1.05, r"0\.\d+"), (1.02, "0")):  # an SD that has fallen: no growth is the best
        rows = Observation(0.0, 1.03, 0.05), Observation(20.0, sd, 0.05)
        with pytest.raises(
            InputError, match=f"from below: no growth is only {off} standard errors off"
        ):
            infer_factor(study, "v201", rows)
        with pytest.raises(InputError, match="do not constrain"):
            forecast(study, "v201", [*rows, Observation(30.0, 1.1, 0.05)], 1)


def test_days_beyond_the_horizon_are_refused_all_at_once(study):
    rows = [Observation(day, 1.1, 0.05) for day in (1.0, 2e4, 3e4)]
    for ask in (
        lambda: infer_factor(study, "v201", rows),
        lambda: forecast(study, "v201", rows, 1),
    ):
        with pytest.raises(InputError, match=r"day 20000.*\n.*day 30000"):
            ask()


@pytest.mark.usefixtures("fit")
def test_a_posterior_tells_its_progress_on_one_stage(told):
    last = [stage for stage, done, total in told if done == total and "fit" in stage]
    assert len(last) == 1


def test_what_the_model_cannot_do_is_told(study):
    """An SD that rises, falls and rises again: no factor does that."""
    rows = tuple(Observation(d, s, 0.01) for d, s in zip(DAYS, (1.3, 1.1, 1.5), strict=True))
    assert infer_factor(study, "v201", rows).misfit > 3


def test_reading(tmp_path):
    text = "sd_mm, day ,sd_error_mm\n1.2,365,0.05\n1.03,0,0.05\n"
    path = tmp_path / "observed.csv"
    path.write_text(text, encoding="utf-8")
    expected = (Observation(0.0, 1.03, 0.05), Observation(365.0, 1.2, 0.05))
    assert read_observations(str(path)) == expected
    assert read_observations("365:1.2:0.05, 0:1.03:0.05") == expected


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("nothing.csv", "cannot be read"),
        ("0:1.03", "three numbers"),
        ("0:much:0.1", "three numbers"),
        ("0:1.03:0", "must be positive"),
        ("-1:1.03:0.1", "must not be negative"),
        (":", "three numbers"),
    ],
)
def test_what_is_no_observation(text, said):
    with pytest.raises(InputError, match=said):
        read_observations(text)


def test_a_file_without_the_columns(tmp_path):
    path = tmp_path / "observed.csv"
    path.write_text("day,sd\n1,2\n", encoding="utf-8")
    with pytest.raises(InputError, match="it needs"):
        read_observations(str(path))
    path.write_text("day,sd_mm,sd_error_mm\n", encoding="utf-8")
    with pytest.raises(InputError, match="no observation"):
        read_observations(str(path))
