"""Distributions of inputs: quantiles against closed forms, ends, truncation, refusals."""

import numpy as np
import pytest
from scipy import stats

from mcsettle.errors import InputError
from mcsettle.study.distributions import TAIL, distribution

SHARES = np.array([0.05, 0.25, 0.5, 0.75, 0.95])
CASES = {
    "normal": ({"mean": 17.0, "sd": 0.85}, stats.norm(17.0, 0.85)),
    "lognormal": ({"median": 5600.0, "log_sd": 0.395}, stats.lognorm(0.395, scale=5600.0)),
    "uniform": ({"low": 1.4, "high": 1.6}, stats.uniform(1.4, 0.2)),
    "log_uniform": ({"low": 3e4, "high": 1e6}, stats.loguniform(3e4, 1e6)),
    "triangular": (
        {"low": 0.2, "mode": 0.3, "high": 0.4},
        stats.triang(0.5, 0.2, 0.2),
    ),
    # PERT: a beta with mean (low + 4 mode + high) / 6
    "pert": ({"low": 0.0, "mode": 0.25, "high": 1.0}, stats.beta(2.0, 4.0)),
    "beta": ({"low": 1.0, "high": 3.0, "alpha": 2.0, "beta": 5.0}, stats.beta(2.0, 5.0, 1.0, 2.0)),
}


@pytest.mark.parametrize("kind", CASES)
def test_quantiles(kind):
    parameters, expected = CASES[kind]
    np.testing.assert_allclose(
        distribution(kind, parameters).quantile(SHARES), expected.ppf(SHARES), rtol=1e-9
    )


def test_a_coefficient_of_variation_is_sd_over_mean():
    drawn = distribution("lognormal", {"median": 250e3, "cov": 0.3})
    sample = drawn.quantile((np.arange(200_000) + 0.5) / 200_000)
    assert np.std(sample) / np.mean(sample) == pytest.approx(0.3, rel=1e-3)
    assert float(drawn.quantile(0.5)) == pytest.approx(250e3)


def test_discrete_values_have_their_weights():
    drawn = distribution("discrete", {"values": (4.0, 1.0, 2.0), "weights": (1.0, 2.0, 1.0)})
    values, counts = np.unique(drawn.quantile((np.arange(1000) + 0.5) / 1000), return_counts=True)
    assert values.tolist() == [1.0, 2.0, 4.0]
    assert counts.tolist() == [500, 250, 250]
    assert drawn.quantile(np.array([0.0, 1.0])).tolist() == [1.0, 4.0]


def test_truncation_cuts_and_keeps_the_shape():
    cut = distribution("normal", {"mean": 0.0, "sd": 1.0}, -1.0, 2.0)
    np.testing.assert_allclose(cut.quantile(SHARES), stats.truncnorm(-1, 2).ppf(SHARES), rtol=1e-9)
    np.testing.assert_allclose(cut.ends, (-1.0, 2.0), rtol=1e-9)


def test_bounds_any_number_of_deviations_away():
    cut = distribution("normal", {"mean": 0.0, "sd": 1e-12}, -1.0, 1.0)
    assert (cut.from_, cut.to) == (0.0, 1.0)
    assert float(cut.share_below(5.0)) == 1.0


def test_ends():
    """Of a bounded distribution the bounds; of an endless side what one draw in a million passes."""
    assert distribution("log_uniform", {"low": 3e4, "high": 1e6}).ends == (3e4, 1e6)
    low, high = distribution("lognormal", {"median": 1.0, "log_sd": 1.0}).ends
    assert low == pytest.approx(stats.lognorm(1.0).ppf(TAIL))
    assert high == pytest.approx(1.0 / low)
    low, high = distribution("normal", {"mean": 0.0, "sd": 1.0}, at_most=1.0).ends
    assert high == pytest.approx(1.0)
    assert low < -4.0


@pytest.mark.parametrize(
    ("kind", "parameters", "cut", "said"),
    [
        ("normal", {"mean": 1.0}, (), "needs sd"),
        ("normal", {"mean": 1.0, "sd": -1.0}, (), "must be positive"),
        ("normal", {"mean": 17.0, "sd": 1e-308}, (), "rounding loses beside 17"),
        ("lognormal", {"median": 3.0, "log_sd": 1e-17}, (), "rounding loses"),
        ("normal", {"mean": 1.0, "sd": 1.0, "mode": 1.0}, (), "mode has no meaning"),
        ("lognormal", {"median": 1.0}, (), "cov or log_sd"),
        ("lognormal", {"median": 1.0, "cov": 0.1, "log_sd": 0.1}, (), "cov or log_sd"),
        ("uniform", {"low": 1.0, "high": 1.0}, (), "low must be below high"),
        ("log_uniform", {"low": 0.0, "high": 1.0}, (), "must be positive"),
        ("pert", {"low": 0.0, "mode": 2.0, "high": 1.0}, (), "lies outside"),
        ("discrete", {"values": (1.0, 1.0)}, (), "must differ"),
        ("discrete", {"values": (1.0,), "weights": (1.0, 2.0)}, (), "1 values with 2 weights"),
        ("discrete", {"values": (1.0, 2.0)}, (1.0,), "not truncated"),
        ("normal", {"mean": 0.0, "sd": 1.0}, (9.0,), "leaves 0"),
        ("uniform", {"low": 0.0, "high": 1.0}, (0.8, 0.2), "leaves 0"),
    ],
)
def test_impossible_ones_are_refused(kind, parameters, cut, said):
    with pytest.raises(InputError, match=said):
        distribution(kind, parameters, *cut)
