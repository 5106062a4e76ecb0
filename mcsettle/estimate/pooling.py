"""Factors of the sections of a line, partially pooled.

The logarithm of a section's factor is normal about the line's, log f_s ~ N(μ, τ²); what was measured of
the section adds its likelihood L_s(log f). μ is flat over the grid, τ half-normal of ``WIDEST``: both are
estimated from all sections together, so a section with a long history keeps its own rate and one with
little history takes the line's. Everything is a sum over grids: no sampling.

Gelman et al., Bayesian Data Analysis, ch. 5 (hierarchical models); the grids replace its draws.
"""

from dataclasses import dataclass

import numpy as np
from scipy import special, stats

from mcsettle.estimate.estimate import LEVELS
from mcsettle.estimate.weighted_quantiles import weighted_quantiles

WIDEST = 1.0  # scale of the prior of τ: sections differ by a factor of e
SPREADS = np.geomspace(0.02, 2.0, 60)  # τ
AT_A_TIME = 250  # pairs (μ, τ): bounds the memory


@dataclass(frozen=True, eq=False)
class Pooled:
    """Posterior of a line's sections on the grid ``logs`` [F] of log factors.

    ``sections`` [S, F] weights of each section's, and ``line`` [F] of a section without history, each
    adding up to 1; ``likelihood`` [S, F], the largest of a row 1. ``hyper`` [H] weights of the pairs
    (μ, τ) and ``given`` [H, F] what each says of a section. ``middle`` and ``spread``: P5, P50, P95 of
    exp(μ) and of τ. ``log_evidence``: log of the likelihood of everything measured, μ and τ integrated
    out.
    """

    logs: np.ndarray
    sections: np.ndarray
    line: np.ndarray
    likelihood: np.ndarray
    hyper: np.ndarray
    given: np.ndarray
    middle: tuple[float, ...]
    spread: tuple[float, ...]
    log_evidence: float


def pooled(logs: np.ndarray, log_likelihood: np.ndarray) -> Pooled:
    """Factors of S sections from their log likelihoods [S, F] at equally spaced log factors [F].

    A section without history has a row of zeros.
    """
    middles = np.linspace(logs[0], logs[-1], 2 * len(logs) - 1)
    mu, tau = (grid.ravel() for grid in np.meshgrid(middles, SPREADS, indexing="ij"))
    given = _mass(logs, mu, tau)
    scaled = np.exp(log_likelihood - log_likelihood.max(axis=1, keepdims=True))
    with np.errstate(divide="ignore"):
        evidence = np.concatenate(
            [
                np.log(given[first : first + AT_A_TIME] @ scaled.T).sum(axis=1)
                for first in range(0, len(given), AT_A_TIME)
            ]
        )
    # Equal steps of log τ stand for a density in τ: the prior of each is τ times the half-normal.
    prior = stats.halfnorm.logpdf(tau, scale=WIDEST) + np.log(tau)
    logs_of_hyper = evidence + prior - special.logsumexp(prior)
    total = special.logsumexp(logs_of_hyper)
    hyper = np.exp(logs_of_hyper - total)
    # Σ_h w_h L_s p_h / (L_s · p_h), section by section: products of matrices.
    shares, kept = np.zeros_like(scaled), np.flatnonzero(hyper > 1e-12)
    for first in range(0, len(kept), AT_A_TIME):
        pairs = kept[first : first + AT_A_TIME]
        shares += (hyper[pairs, None] / (given[pairs] @ scaled.T)).T @ given[pairs]
    sections = scaled * shares
    return Pooled(
        logs,
        sections / sections.sum(axis=1, keepdims=True),
        hyper @ given,
        scaled,
        hyper,
        given,
        tuple(float(np.exp(v)) for v in weighted_quantiles(mu, hyper, LEVELS)),
        tuple(float(v) for v in weighted_quantiles(tau, hyper, LEVELS)),
        float(total + log_likelihood.max(axis=1).sum()),
    )


def _mass(logs: np.ndarray, mu: np.ndarray, tau: np.ndarray) -> np.ndarray:
    """Weights [H, F] of the cells about ``logs`` under N(μ, τ²); the ends take the tails."""
    edges = np.concatenate([[-np.inf], 0.5 * (logs[1:] + logs[:-1]), [np.inf]])
    below = stats.norm.cdf((edges[None, :] - mu[:, None]) / tau[:, None])
    return np.asarray(np.diff(below, axis=1))
