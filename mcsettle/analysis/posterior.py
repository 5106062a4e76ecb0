"""The settlement factor from observed SDs of one section: least squares and a posterior.

The section's own track is unknown: it may be any of the study's realisations. For every factor of a
grid and every realisation the model gives the SD on the days observed; the likelihood of the
observations is Gaussian with their stated errors, and the posterior of the factor is its average over
the realisations, by importance weights on the ensemble, under a prior uniform in log(factor). What the
study conditions on (the initial SD, its traffic) is conditioned on here.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import minimize_scalar

from mcsettle.errors import InputError
from mcsettle.estimate.observation import Observation
from mcsettle.step_a.transfers import step_a
from mcsettle.step_b.case import Case, build_case
from mcsettle.step_b.cycle_jump import CycleJump
from mcsettle.study.study import Study
from mcsettle.types import Progress
from mcsettle.units import MM

LOWEST, HIGHEST = 1e-3, 1e6
COARSE, FINE = 10, 25  # factors of the two grids: a decade apart, and across the posterior
FAR = 8.0  # standard errors above every observation a track is followed no further
FIRST_REACH = 0.5  # in log(factor), on each side of the least squares
FEW = 20.0  # effective realisations below which the posterior is a matter of chance
MISFIT = 3.0  # standard errors from the nearest realisation that is still called a fit
LEVELS = (0.05, 0.5, 0.95)


@dataclass(frozen=True)
class Posterior:
    """What the observations say of the settlement factor.

    ``least_squares`` fits the mean SD of all tracks; ``quantiles`` are P5, P50, P95 of the posterior
    and ``median``, ``log_sd`` its lognormal summary. ``effective`` is how many realisations carry the
    weight, ``misfit`` the root mean square residual of the best one in standard errors.
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
    observations: tuple[Observation, ...],
    variant: str | None = None,
    progress: Progress | None = None,
    processes: int = 1,
) -> Posterior:
    """Posterior of the settlement factor of ``scenario`` (and first ``variant``).

    Raises
    ------
    InputError
        The observations ask for a factor outside [LOWEST, HIGHEST]; the message gives the reach.
    """
    variant = variant or study.variant_names[0]
    ensemble = Ensemble(study, scenario, variant, observations, progress, processes)
    centre = least_squares(ensemble)
    logs, weights, misfit = posterior_grid(ensemble, centre, FIRST_REACH)
    by_factor = weights.sum(axis=1)
    mean = float(by_factor @ logs)
    sd = float(np.sqrt(by_factor @ (logs - mean) ** 2))
    by_track = weights.sum(axis=0)
    return Posterior(
        scenario=scenario,
        variant=variant,
        observations=observations,
        least_squares=float(np.exp(centre)),
        quantiles=tuple(float(np.exp(_quantile(logs, by_factor, p))) for p in LEVELS),  # type: ignore[arg-type]
        median=float(np.exp(mean)),
        log_sd=sd,
        effective=float(1.0 / np.sum(by_track**2)),
        misfit=misfit,
        realisations=len(by_track),
        seed=study.seed,
    )


class Ensemble:
    """SDs of every realisation on the days observed, for any factor."""

    def __init__(
        self,
        study: Study,
        scenario: str,
        variant: str,
        observations: tuple[Observation, ...],
        progress: Progress | None,
        processes: int,
    ) -> None:
        prepared = step_a(study.scenes, progress, processes)
        case: Case = build_case(study.scene(variant, scenario), prepared)
        observed = [observation.day or 0.0 for observation in observations]
        self.days, self.place = np.unique(observed, return_inverse=True)
        self.sd = np.array([o.value for o in observations]) * MM
        self.error = np.array([o.error for o in observations]) * MM
        horizon = float(max(self.days[-1] * 1.001, 1.0))
        model = replace(case.model, settlement_factor=1.0)
        limit = max(case.sd_limit, float(np.max(self.sd + FAR * self.error)))
        self.case = replace(case, model=model, horizon=horizon, sd_limit=limit)
        self.machine = CycleJump(self.case)
        self.profiles = study.initial_profiles(variant).sample(range(study.run.realisations))
        self.progress, self.done = progress, 0

    def on(self, logs: np.ndarray) -> np.ndarray:
        """SD [F, R, O] m for log factors [F]; inf where the track was beyond all observed before."""
        return np.stack([self._one(float(np.exp(x))) for x in logs])

    def _one(self, factor: float) -> np.ndarray:
        self.done += 1
        if self.progress is not None:
            self.progress("Observations, factors tried", min(self.done, 100), 100)
        factors = np.full(len(self.profiles), factor)
        history = self.machine.run(self.profiles, self.days, factors).history
        return np.where(np.isnan(history), np.inf, history)[:, self.place]

    def reach(self, logs: np.ndarray) -> str:
        """Why no factor will do: the SDs that the ends of the range give on the last day."""
        low, high = (float(np.median(sd[:, -1])) / MM for sd in self.on(logs[[0, -1]]))
        shown = f"{high:.3g} mm" if np.isfinite(high) else "far above the limit"
        return (
            f"the observations ask for a settlement factor outside {LOWEST:g} … {HIGHEST:g}: on day "
            f"{self.days[-1]:g} these give SDs from {low:.3g} mm to {shown}, and "
            f"{self.sd[-1] / MM:.3g} mm is observed; check profile.sd_mm, days and units"
        )

    def residuals(self, sd: np.ndarray) -> np.ndarray:
        """(model − observed) / error, bounded so that runaway tracks weigh nothing."""
        return np.asarray(np.clip((sd - self.sd) / self.error, -1e6, 1e6))


def least_squares(ensemble: Ensemble) -> float:
    """Log factor whose median SD fits best: the nearest decade, then a bounded search."""
    coarse = np.linspace(np.log(LOWEST), np.log(HIGHEST), COARSE)

    def cost(log_factor: float) -> float:
        middle = np.median(ensemble.on(np.array([log_factor]))[0], axis=0)
        return float(np.sum(ensemble.residuals(middle) ** 2))

    costs = [cost(x) for x in coarse]
    best = int(np.argmin(costs))
    if best in (0, COARSE - 1):
        raise InputError(ensemble.reach(coarse))
    step = coarse[1] - coarse[0]
    ends = (coarse[best] - step, coarse[best] + step)
    return float(minimize_scalar(cost, bounds=ends, method="bounded", options={"xatol": 1e-3}).x)


def posterior_grid(
    ensemble: Ensemble, centre: float, reach: float
) -> tuple[np.ndarray, np.ndarray, float]:
    """Log factors [F], weights [F, R] that add up to 1, and the best track's misfit.

    The grid is widened until its ends carry nothing, and narrowed until it resolves the posterior.
    """
    for _ in range(8):
        logs = np.linspace(centre - reach, centre + reach, FINE)
        square = np.sum(ensemble.residuals(ensemble.on(logs)) ** 2, axis=2)
        weights = np.exp(-0.5 * (square - np.min(square)))
        weights /= np.sum(weights)
        ends = float(np.sum(weights[[0, 1, -2, -1]]))
        mean = float(weights.sum(axis=1) @ logs)
        sd = float(np.sqrt(weights.sum(axis=1) @ (logs - mean) ** 2))
        if ends < 1e-3 and (sd > 1.2 * (logs[1] - logs[0]) or reach < 1e-3):
            break
        centre, reach = (mean, 2.5 * reach) if ends >= 1e-3 else (mean, max(6.0 * sd, reach / 5.0))
    misfit = float(np.sqrt(np.min(square) / len(ensemble.sd)))
    return logs, weights, misfit


def _quantile(logs: np.ndarray, weights: np.ndarray, level: float) -> float:
    """Quantile of a density on a grid, linear between the middles of its cells."""
    middle = np.cumsum(weights) - 0.5 * weights
    return float(np.interp(level, middle, logs))
