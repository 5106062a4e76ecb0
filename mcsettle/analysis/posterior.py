"""The settlement factor from observed SDs of one section: least squares and a posterior.

The section's own track is unknown: it may be any of the study's realisations. For every factor and every
realisation the model gives the SD on the days observed; the likelihood of the observations is Gaussian
with their stated errors, and the posterior of the factor is its average over the realisations, under a
prior uniform in log(factor) between ``LOWEST`` and ``HIGHEST``. What the study conditions on (the initial
SD, its traffic) is conditioned on here.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import ndtri

from mcsettle.analysis.calibration import HIGHEST, LOWEST
from mcsettle.errors import InputError
from mcsettle.estimate.conditioning import FEW
from mcsettle.estimate.estimate import LEVELS
from mcsettle.estimate.factor_posterior import FactorPosterior, factor_posterior
from mcsettle.estimate.likelihood import Likelihood, likelihood_of
from mcsettle.estimate.observation import Observation
from mcsettle.estimate.resampling import effective
from mcsettle.railway.scene import Scene
from mcsettle.run.factor_model import FactorModel
from mcsettle.step_a.transfers import step_a
from mcsettle.study.distributions import distribution
from mcsettle.study.study import Study
from mcsettle.types import Progress, silent

FACTORS = (25, 13, 25)  # that the model is computed at, pass by pass
FEW_TRACKS = 16  # of the first pass
MISFIT = 3.0  # standard errors from the nearest realisation that is still called a fit
NEGLIGIBLE = 1e-3  # share of the posterior at each end that is not resolved
AT_END = 1e-4  # share within a factor e of an end of the prior: more, and the prior decides
PRIOR = distribution("log_uniform", {"low": LOWEST, "high": HIGHEST})
STAGE = "Factors that fit the observations"


@dataclass(frozen=True)
class Posterior:
    """What the observations say of the settlement factor.

    ``least_squares`` fits the median SD of all tracks; ``quantiles`` are P5, P50, P95 of the posterior
    and ``median``, ``log_sd`` the lognormal distribution through them. ``effective`` is how many
    realisations carry the weight, ``misfit`` the root mean square residual of the best one in standard
    errors.
    """

    scenario: str
    variant: str
    observations: tuple[Observation, ...]
    least_squares: float
    quantiles: tuple[float, float, float]
    median: float
    log_sd: float
    effective: float
    misfit: float
    realisations: int
    seed: int

    @property
    def few(self) -> bool:
        """Whether too few realisations carry the weight."""
        return self.effective < FEW


def infer_factor(
    study: Study,
    scenario: str,
    observations: Sequence[Observation],
    variant: str | None = None,
    progress: Progress = silent,
    processes: int = 1,
) -> Posterior:
    """Posterior of the settlement factor of ``scenario`` (and first ``variant``).

    Raises
    ------
    InputError
        An observation lies beyond the horizon; no factor in [LOWEST, HIGHEST] comes near the
        observations; or they do not constrain it.
    """
    variant = variant or study.variant_names[0]
    model = sd_model(study.scene(variant, scenario), observations, progress, processes)
    progress(STAGE, 0, 2)
    of_tracks = fitted(model, study.run.realisations)
    progress(STAGE, 1, 2)
    least_squares = _least_squares(model, study.run.realisations)
    progress(STAGE, 2, 2)
    low, middle, high = (of_tracks.factor_at(level) for level in LEVELS)
    return Posterior(
        scenario=scenario,
        variant=variant,
        observations=tuple(observations),
        least_squares=least_squares,
        quantiles=(low, middle, high),
        median=middle,
        log_sd=float(np.log(high / low) / (ndtri(LEVELS[2]) - ndtri(LEVELS[0]))),
        effective=effective(of_tracks.track_weights.sum(axis=0)),
        misfit=_misfit(model, of_tracks),
        realisations=study.run.realisations,
        seed=study.seed,
    )


def sd_model(
    scene: Scene, observations: Sequence[Observation], progress: Progress, processes: int
) -> FactorModel:
    """SDs of every realisation on the days observed, at any factor.

    Raises
    ------
    InputError
        Days lie beyond the horizon; all of them are named.
    """
    reasons = (o.beyond(scene.horizon) for o in observations)
    if late := [reason for reason in reasons if reason]:
        raise InputError("\n".join(late))
    rows = [replace(o, scenario=scene.scenario) for o in observations]
    return FactorModel([scene], step_a([scene], progress, processes), rows)


def fitted(model: FactorModel, n_tracks: int) -> FactorPosterior:
    """Posterior of the factor of one section, whose track is any of ``n_tracks``.

    Raises
    ------
    InputError
        No factor in the prior comes near the observations, or they do not constrain it.
    """
    posterior = factor_posterior(model.likelihood, PRIOR, _passes(n_tracks), NEGLIGIBLE)
    if posterior is None:
        raise InputError(
            "every realisation failed at every settlement factor; check the study's inputs"
        )
    inner = np.log(LOWEST) + 1.0, np.log(HIGHEST) - 1.0
    below, up_to = np.interp(inner, posterior.edges, posterior.reached)
    if max(below, 1.0 - up_to) > AT_END:
        if _misfit(model, posterior) > MISFIT:
            raise InputError(_out_of_reach(model, n_tracks))
        raise InputError(_unconstrained(posterior, below > AT_END))
    return posterior


def _unconstrained(posterior: FactorPosterior, from_below: bool) -> str:
    """Why the prior would decide: how near to the observations the factors at its end come."""
    logs = posterior.likelihood.plain()
    off = float(np.sqrt(2.0 * (np.max(logs) - logs[0 if from_below else -1])))
    side, growth = ("below", "no growth") if from_below else ("above", "the fastest growth")
    return (
        f"the observations do not constrain the settlement factor from {side}: {growth} is only "
        f"{off:.2g} standard errors off, and 4.5 are needed. Observe until the SD has grown further, "
        "fit to a median tamping interval, or give the factor a distribution "
        "([[uncertain]], fitted = true) and the SDs as [[observed]] entries"
    )


def _passes(n_tracks: int) -> list[tuple[int, int]]:
    """Factors and tracks of every pass."""
    return list(zip(FACTORS, (min(FEW_TRACKS, n_tracks), n_tracks, n_tracks), strict=True))


def _least_squares(model: FactorModel, n_tracks: int) -> float:
    """Factor whose median SD over the tracks fits best."""

    def of_median(logs: np.ndarray, wanted: np.ndarray, n: int) -> Likelihood:
        medians = [np.nanmedian(sd, axis=1)[:, None] for sd in model.predicted(logs, wanted, n)]
        values = dict(zip(model.observations, medians, strict=True))
        return likelihood_of(model.observations, values.__getitem__)

    posterior = factor_posterior(of_median, PRIOR, _passes(n_tracks), NEGLIGIBLE)
    assert posterior is not None  # some track did not fail
    return float(np.exp(posterior.middles[np.argmax(posterior.likelihood.plain())]))


def _misfit(model: FactorModel, posterior: FactorPosterior) -> float:
    """Root mean square residual of the best track at its best factor, in standard errors."""
    (logs,) = posterior.likelihood.sections
    return float(np.sqrt(-2.0 * np.nanmax(logs) / len(model.observations)))


def _out_of_reach(model: FactorModel, n_tracks: int) -> str:
    """Why no factor will do: the SDs that the ends of the prior give on the last day."""
    last = max(model.observations, key=lambda o: o.day or 0.0)
    ends = np.log([LOWEST, HIGHEST])
    sd = model.predicted(ends, ends, min(FEW_TRACKS, n_tracks))
    low, high = np.nanmedian(sd[model.observations.index(last)], axis=1)
    return (
        f"the observations ask for a settlement factor outside {LOWEST:g} … {HIGHEST:g}: on day "
        f"{last.day:g} these give SDs from {low:.3g} mm to {high:.3g} mm or more, and "
        f"{last.value:.3g} mm is observed; check profile.sd_mm, days and units"
    )
