"""Stopping: targets are parsed, batches double, the folder is that of a plain run."""

import pytest
import toy
from toy import everything

from mcsettle.errors import InputError
from mcsettle.estimate.estimate import Estimate, Statistic
from mcsettle.run.options import RunOptions
from mcsettle.run.pipeline import run_study
from mcsettle.run.stopping import Target, parse_target, run_until, worst_error
from mcsettle.summary.results import read_results
from mcsettle.summary.summary import SummaryRow, summary_rows

pytestmark = pytest.mark.usefixtures("fresh_cache")
MEDIAN = Target("tamping_interval_days", "median", 0.02)


@pytest.fixture(scope="module")
def study():
    return toy.study(run={"realisations": 200})


@pytest.mark.parametrize(
    ("text", "target"),
    [
        ("tamping_interval median 2%", MEDIAN),
        (" tamping_interval_days  median 2 %", MEDIAN),
        ("marginal_cost mean 0.5%", Target("marginal_cost", "mean", 0.005)),
        ("reduction p95 10%", Target("reduction_percent", "p95", 0.1)),
    ],
)
def test_targets(text, target):
    assert parse_target(text) == target


@pytest.mark.parametrize(
    "text",
    ["", "median 2%", "days median 2%", "elasticity p42 2%", "elasticity mean 0%", "elasticity mean 2",
     "elasticity mean 1.2.3%"],
)  # fmt: skip
def test_what_is_no_target(text):
    with pytest.raises(InputError, match="until= received"):
        parse_target(text)


def row(scenario, value, error, level=0.5):
    estimate = Estimate(value, None, None, error, 10, 0, "d")
    statistic = Statistic("quantile", level, estimate)
    return SummaryRow("base", scenario, "tamping_interval_days", "d", (statistic,))


def test_the_worst_scenario_decides():
    assert worst_error([row("a", 100, 1), row("b", 50, 1)], MEDIAN) == (0.02, "base b")
    assert worst_error([row("a", 100, 1), row("b", None, None)], MEDIAN) == (None, "base b")
    with pytest.raises(InputError, match="no marginal_cost"):
        worst_error([row("a", 1, 1)], Target("marginal_cost", "mean", 0.1))


def test_it_stops_when_the_target_is_met(study, tmp_path):
    """The toy's days spread by a tenth: 64 tracks know their median to some 2 %."""
    told = []
    stopped = run_until(
        study, tmp_path / "a", Target(MEDIAN.metric, "median", 0.05), tell=told.append
    )
    assert (stopped.met, stopped.late) == (True, False)
    assert [b.realisations for b in stopped.batches] == [64]
    assert told == list(stopped.batches)
    run_study(study, tmp_path / "b", RunOptions(realisations=64))
    assert everything(tmp_path / "a") == everything(tmp_path / "b")
    error, _ = worst_error(summary_rows(read_results(tmp_path / "a")), MEDIAN)
    assert told[0].error == error


def test_it_doubles_up_to_the_cap_and_says_so(study, tmp_path):
    stopped = run_until(study, tmp_path / "a", Target(MEDIAN.metric, "median", 1e-6))
    assert (stopped.met, stopped.late) == (False, False)
    assert [b.realisations for b in stopped.batches] == [64, 128, 200]
    errors = [b.error for b in stopped.batches]
    assert errors[2] < errors[0]
    run_study(study, tmp_path / "b")
    assert everything(tmp_path / "a") == everything(tmp_path / "b")
    again = run_until(study, tmp_path / "a", Target(MEDIAN.metric, "median", 1e-6))
    assert [b.realisations for b in again.batches] == [200]


def test_it_stops_before_a_batch_that_would_end_late(study, tmp_path):
    """A clock on which every batch takes a minute for each 64 tracks."""
    ticks = iter([0.0, 60.0, 120.0])
    stopped = run_until(study, tmp_path, None, max_minutes=2.5, clock=lambda: next(ticks))
    assert [(b.realisations, b.seconds) for b in stopped.batches] == [(64, 60.0), (128, 60.0)]
    assert (stopped.met, stopped.late) == (False, True)


def test_time_alone_ends_at_the_cap(study, tmp_path):
    stopped = run_until(study, tmp_path, None, options=RunOptions(realisations=70), max_minutes=1e6)
    assert [b.realisations for b in stopped.batches] == [64, 70]
    assert (stopped.met, stopped.late) == (True, False)
