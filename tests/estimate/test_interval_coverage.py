"""Every reported interval covers at its rate on ensembles of known truth; wrong estimators do not.

The experiments are those of ``studies/interval_coverage.py``, whose table stands in docs/uncertainty.md.
"""

import importlib.util
import sys
from pathlib import Path

import pytest

PATH = Path(__file__).resolve().parents[2] / "studies" / "interval_coverage.py"
SPEC = importlib.util.spec_from_file_location("coverage_study", PATH)
coverage = importlib.util.module_from_spec(SPEC)
sys.modules["coverage_study"] = coverage
SPEC.loader.exec_module(coverage)
QUICK = (
    *("Kaplan", "restricted", "paired", "P50, 40", "mean, 20", "shares"),
    *("of calibrate", "10 km, P50, 100"),
)


@pytest.mark.parametrize(
    "experiment",
    [e for e in coverage.EXPERIMENTS if any(word in e.name for word in QUICK)],
    ids=lambda e: e.name,
)
def test_intervals_cover(experiment):
    assert coverage.passes(experiment, 60)


@pytest.mark.slow
@pytest.mark.parametrize("experiment", coverage.EXPERIMENTS, ids=lambda e: e.name)
def test_intervals_cover_at_full_rigour(experiment):
    assert coverage.passes(experiment, 400)


@pytest.mark.parametrize("experiment", coverage.WRONG, ids=lambda e: e.name)
def test_wrong_estimators_do_not(experiment):
    assert not coverage.passes(experiment, 40)
