"""What was observed on the line, as weights of the parameter sets: bands conditioned on it.

A parameter set e is as likely as it makes the observations. A section's own track is unknown: it may be
any of the set's realisations r, so that with Gaussian errors

    p(observations of a section | e) = mean over r of exp(−½ Σ ((model(e, r) − observed) / error)²),

and sections are independent given the set. The median interval of n sections is taken as lognormal
about the set's own median, with the spread of a median of n and of the set's realisations. Under the
study's distributions as the prior, the posterior is the ensemble with weights w ∝ p (self-normalised
importance sampling). It speaks of *other* sections of the same line: their inputs are those that the
weights favour, their tracks are any.

``effective`` = (Σw)²/Σw² sets carry the weight. Few of them are a matter of chance.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from mcsettle.estimate.likelihood import likelihood, relative_weights
from mcsettle.estimate.observation import Course, Observation
from mcsettle.estimate.resampling import effective

FEW = 20.0  # effective sets below which conditioned numbers come with a warning
TOO_FEW = 4.0  # and below which there are none
FIT_TRACKS = 64  # realisations, the first of a run, that a set fits its factor on


@dataclass(frozen=True)
class Conditioning:
    """Weights [E] of the parameter sets of one variant, and the logarithms [E] of the likelihood."""

    variant: str
    log_likelihood: np.ndarray

    @property
    def weights(self) -> np.ndarray:
        """Weights [E] that add up to 1; all zero where no set makes the observations possible."""
        (shares,) = relative_weights(self.log_likelihood[None])
        return np.asarray(
            shares / max(np.sum(shares), 1.0)
        )  # the largest of them is 1, or all are 0

    @property
    def effective(self) -> float:
        """How many sets carry the weight."""
        return effective(self.weights)

    @property
    def usable(self) -> bool:
        """Whether enough sets carry the weight to say anything."""
        return self.effective >= min(TOO_FEW, len(self.log_likelihood))

    @property
    def remark(self) -> str:
        """What to know before the conditioned numbers are believed; empty if all is well."""
        n, n_sets = self.effective, len(self.log_likelihood)
        if not np.any(self.weights):
            return (
                "no parameter set comes near the observations: widen the inputs, or check the units"
            )
        if not self.usable:
            return (
                f"only {n:.1f} of {n_sets} parameter sets carry the weight: too few for conditioned "
                "numbers. Take more sets (parameter_sets=), or let every set fit its settlement factor "
                "(fitted = true)"
            )
        if n < FEW:
            return (
                f"{n:.1f} of {n_sets} parameter sets carry the weight (below {FEW:g}): conditioned "
                "numbers are rough; more sets (parameter_sets=) make them better"
            )
        return ""


@dataclass(frozen=True)
class InputBand:
    """P5, P50, P95 of an uncertain input as drawn, and with the sets weighted by the observations."""

    input: str
    drawn: tuple[float, ...]
    conditioned: tuple[float, ...]


def conditioned(
    variant: str, observations: Iterable[Observation], courses: Mapping[str, Course]
) -> Conditioning:
    """Weights of the parameter sets of ``variant`` by ``observations`` of its ``courses``.

    Raises
    ------
    InputError
        A scenario observed has no rows.
    """
    return Conditioning(variant, likelihood(observations, courses).plain())
