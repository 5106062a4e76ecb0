"""A settlement factor from observations: the one grid on which its posterior is integrated.

With the other inputs as they are,

    p(f | observed) ∝ π(f) L(f),        evidence  Z = ∫ π(f) L(f) df,

on cells of log(f). A model is computed at few factors and taken as linear in log(f) between them, track
by track; every pass narrows the cells to where the posterior is.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from mcsettle.estimate.likelihood import Likelihood

CELLS = 400  # of the grid on which the posterior is integrated

# likelihood(logs [F], wanted [W], n_tracks): at the log factors ``wanted``, from a model at ``logs``.
OfFactors = Callable[[np.ndarray, np.ndarray, int], Likelihood]


class Prior(Protocol):
    """A proper distribution of the factor."""

    @property
    def ends(self) -> tuple[float, float]:
        """Lowest and highest value."""

    def share_below(self, value: np.ndarray | float) -> np.ndarray:
        """Cumulative probability at ``value``, any shape."""


@dataclass(frozen=True)
class FactorPosterior:
    """What observations leave of a factor.

    ``edges`` [C + 1] of the cells of log(f), ``reached`` [C + 1] the posterior below them;
    ``log_evidence``, and the ``likelihood`` at the cells' middles.
    """

    edges: np.ndarray
    reached: np.ndarray
    log_evidence: float
    likelihood: Likelihood

    def factor_at(self, share: float) -> float:
        """Quantile of the factor."""
        return float(np.exp(np.interp(share, self.reached, self.edges)))

    @property
    def middles(self) -> np.ndarray:
        """Log factors [C] at the middles of the cells."""
        return 0.5 * (self.edges[1:] + self.edges[:-1])

    @property
    def track_weights(self) -> np.ndarray:
        """Joint weights [C, R], adding up to 1, of factors and tracks of the one section observed."""
        (logs,) = self.likelihood.sections
        share = np.nan_to_num(np.exp(logs - np.nanmax(logs, axis=1, keepdims=True)))
        return np.asarray(np.diff(self.reached)[:, None] * share / share.sum(axis=1, keepdims=True))


def factor_posterior(
    likelihood: OfFactors, prior: Prior, passes: Sequence[tuple[int, int]], negligible: float = 1e-5
) -> FactorPosterior | None:
    """Posterior of the factor; None where no factor makes the observations possible.

    Parameters
    ----------
    likelihood : of factors
    prior : Prior
    passes : (factors, tracks) that the model is computed at, the first over the whole prior
    negligible : share of the posterior left out at each end of the next pass
    """
    low, high = (float(np.log(end)) for end in prior.ends)
    found: FactorPosterior | None = None
    for n_factors, n_tracks in passes:
        edges = np.linspace(low, high, CELLS + 1)
        of_cells = likelihood(
            np.linspace(low, high, n_factors), 0.5 * (edges[1:] + edges[:-1]), n_tracks
        )
        logs = of_cells.plain()
        highest = float(np.max(logs))
        if not np.isfinite(highest):
            return None
        density = np.diff(prior.share_below(np.exp(edges))) * np.exp(logs - highest)
        total = float(np.sum(density))
        if not total > 0.0:
            return None
        reached = np.append(0.0, np.cumsum(density) / total)
        found = FactorPosterior(edges, reached, highest + float(np.log(total)), of_cells)
        step = (high - low) / (n_factors - 1)
        ends = np.interp([negligible, 1.0 - negligible], reached, edges)
        low, high = max(low, ends[0] - step), min(high, ends[1] + step)
    return found
