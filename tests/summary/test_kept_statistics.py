"""What a run's own table says of a metric is what its realisations say, and is read, not computed."""

from dataclasses import replace

import pandas as pd
import pytest
import toy

from mcsettle.estimate.crossed import CrossedSample
from mcsettle.run.pipeline import run_study
from mcsettle.summary.results import read_results
from mcsettle.summary.summary import summary_rows

pytestmark = pytest.mark.usefixtures("fresh_cache", "few_resamples")


@pytest.fixture(scope="module")
def studies():
    """Effects of one set; a censored one; sets weighted by an observation."""
    observed = toy.uncertain(
        toy.N0,
        observed=[toy.INTERVAL | {"error_days": 60.0}],
        run={"realisations": 3, "parameter_sets": 16},
    )
    return [
        toy.study(run={"realisations": 4}),
        toy.study(run={"realisations": 4}, limit={"horizon_years": 1.2}),
        observed,
    ]


@pytest.mark.parametrize("number", range(3))
def test_kept_and_computed_rows_are_the_same(tmp_path, studies, number, monkeypatch):
    results = read_results(run_study(studies[number], tmp_path / "run").folder)
    computed = summary_rows(replace(results, summary=pd.DataFrame()))
    assert any(row.conditioned for row in computed) == (number == 2)
    for name in ("interval_statistics", "effect_statistics", "certain_statistics"):
        monkeypatch.setattr(CrossedSample, name, None)
    assert summary_rows(results) == computed


def test_rows_that_the_table_cannot_tell_apart_are_computed(tmp_path, studies):
    results = read_results(run_study(studies[0], tmp_path / "run").folder)
    (effect,) = results.study.effects.values()
    key = "base", effect.scenario, effect.baseline, "elasticity"
    assert results.statistics(*key)
    twice = {"one": effect, "other": effect}
    object.__setattr__(results.study, "effects", twice)
    assert not results.statistics(*key)
