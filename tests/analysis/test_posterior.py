"""Posterior of the settlement factor: what was put in comes out, as often as it should."""

from dataclasses import replace

import numpy as np
import pytest
import toy

from mcsettle.analysis.posterior import infer_factor
from mcsettle.cli.observations import read_observations
from mcsettle.errors import InputError
from mcsettle.estimate.observation import Observation
from mcsettle.step_a.transfers import step_a
from mcsettle.step_b.case import build_case
from mcsettle.step_b.engine import engine_for

pytestmark = pytest.mark.usefixtures("fresh_cache")
DAYS, ERROR, TRUTH = np.array([5.0, 15.0, 25.0]), 0.02, 250.0


@pytest.fixture(scope="module")
def study():
    return toy.study(run={"realisations": 64})


def observed(study, factor, realisation, rng=None) -> tuple[Observation, ...]:
    """SDs of one track outside the ensemble, with or without errors of observation."""
    case = build_case(study.scene("base", "v201"), step_a(study.scenes))
    model = replace(case.model, settlement_factor=factor)
    case = replace(case, model=model, sd_limit=1.0)
    profiles = study.initial_profiles().sample(range(realisation, realisation + 1))
    sd = engine_for(case).run(profiles, DAYS).history[0] * 1e3
    sd = sd + (0.0 if rng is None else ERROR * rng.normal(size=len(sd)))
    return tuple(Observation(float(d), float(s), ERROR) for d, s in zip(DAYS, sd, strict=True))


def test_the_factor_comes_back(study):
    found = infer_factor(study, "v201", observed(study, TRUTH, 1000))
    low, middle, high = found.quantiles
    assert low < TRUTH < high
    assert low < found.least_squares < high
    assert found.median == pytest.approx(middle, rel=0.1)
    assert np.exp(1.645 * found.log_sd) == pytest.approx(np.sqrt(high / low), rel=0.1)
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


def test_smaller_errors_and_more_days_narrow_it(study):
    rows = observed(study, TRUTH, 1000)
    wide = infer_factor(study, "v201", tuple(replace(o, error=0.1) for o in rows))
    narrow = infer_factor(study, "v201", rows)
    assert narrow.log_sd < wide.log_sd
    # That sections differ stays, however exactly one of them is measured.
    exact = infer_factor(study, "v201", tuple(replace(o, error=0.005) for o in rows))
    assert exact.log_sd > 0.2 * narrow.log_sd


def test_the_studys_own_factor_does_not_matter(study):
    rows = observed(study, TRUTH, 1000)
    other = toy.study(run={"realisations": 64}, settlement={"settlement_factor": 7.0})
    assert infer_factor(other, "v201", rows) == infer_factor(study, "v201", rows)


def test_what_no_factor_gives_is_refused_with_the_reach(study):
    with pytest.raises(InputError, match=r"give SDs from 1.03 mm to .*, and 0.5 mm is observed"):
        infer_factor(study, "v201", (Observation(20.0, 0.5, 0.01),))


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
