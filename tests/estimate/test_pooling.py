"""Partial pooling: closed form of normal sections, shrinkage, coverage of what is recovered."""

import numpy as np
import pytest
from scipy import stats

from mcsettle.estimate.pooling import SPREADS, pooled

LOGS = np.linspace(-2.5, 2.5, 101)


def normal_history(logs: np.ndarray, measured: np.ndarray, error: np.ndarray) -> np.ndarray:
    """Log likelihood [S, F] of log factors measured with known errors."""
    return -0.5 * ((measured[:, None] - logs) / error[:, None]) ** 2


def test_sections_shrink_as_the_normal_model_says():
    """With μ and τ known well, the mean is the precision-weighted one (Gelman et al., Eq. 5.17)."""
    rng = np.random.default_rng(1)
    truth = rng.normal(0.3, 0.4, 2000)
    error = np.full(2000, 0.3)
    measured = truth + error * rng.normal(size=2000)
    found = pooled(LOGS, normal_history(LOGS, measured, error))
    tau = found.spread[1]
    step_of_middle = np.exp(0.5 * (LOGS[1] - LOGS[0]))
    assert found.middle[0] / step_of_middle < np.exp(0.3) < found.middle[2] * step_of_middle
    step = SPREADS[1] / SPREADS[0]  # of the grid of τ
    assert found.spread[0] / step < 0.4 < found.spread[2] * step
    share = tau**2 / (tau**2 + 0.3**2)
    expected = np.log(found.middle[1]) + share * (measured - np.log(found.middle[1]))
    # Off by the steps of the grids of μ and τ, and nothing else.
    assert np.abs(found.sections @ LOGS - expected).max() < 0.03


def test_a_section_without_history_takes_the_lines_distribution():
    measured, error = np.array([0.1, 0.2, 0.4, 0.5]), np.full(4, 0.05)
    history = normal_history(LOGS, measured, error)
    found = pooled(LOGS, np.vstack([history, np.zeros(len(LOGS))]))
    np.testing.assert_allclose(found.sections[-1], found.line, atol=1e-7)
    assert found.sections[0] @ LOGS < found.sections[3] @ LOGS


def test_bands_of_factors_cover_at_nominal_rates():
    rng, hits = np.random.default_rng(2), []
    for _ in range(40):
        tau = abs(rng.normal(0.0, 0.5)) + 0.05
        truth = rng.normal(0.0, tau, 50)
        error = rng.uniform(0.1, 0.6, 50)
        found = pooled(LOGS, normal_history(LOGS, truth + error * rng.normal(size=50), error))
        share = np.cumsum(found.sections, axis=1)
        at = np.array(
            [np.interp(t, LOGS + 0.025, row) for t, row in zip(truth, share, strict=True)]
        )
        hits.append(np.mean((at > 0.05) & (at < 0.95)))
    # 40 lines of 50 sections: the standard error of the mean of lines.
    assert abs(np.mean(hits) - 0.9) < 3.0 * np.std(hits) / np.sqrt(len(hits)) + 0.005


@pytest.mark.parametrize("scale", [0.05, 0.8])
def test_equal_and_unlike_sections_are_told_apart(scale):
    rng = np.random.default_rng(3)
    measured = rng.normal(0.0, scale, 200) + 0.1 * rng.normal(size=200)
    found = pooled(LOGS, normal_history(LOGS, measured, np.full(200, 0.1)))
    assert found.spread[1] == pytest.approx(scale, rel=0.35)
    assert stats.norm.ppf(0.05) < 0.0


def test_evidence_is_the_likelihood_with_everything_else_integrated_out():
    assert pooled(LOGS, np.zeros((5, len(LOGS)))).log_evidence == pytest.approx(0.0, abs=1e-9)
    measured, error = np.array([-0.4, 0.1, 0.3]), np.array([0.2, 0.3, 0.2])
    history = normal_history(LOGS, measured, error)
    found = pooled(LOGS, history)
    assert pooled(LOGS, history - 2.0).log_evidence == pytest.approx(found.log_evidence - 6.0)
    # Draws from the prior: μ flat over the grid, τ half-normal.
    rng = np.random.default_rng(4)
    mu = rng.uniform(LOGS[0], LOGS[-1], 200_000)
    tau = np.abs(rng.normal(0.0, 1.0, mu.size))
    variance = tau[:, None] ** 2 + error**2
    joint = np.exp(-0.5 * (measured - mu[:, None]) ** 2 / variance) * error / np.sqrt(variance)
    assert found.log_evidence == pytest.approx(np.log(joint.prod(axis=1).mean()), abs=0.05)
