"""Find the settlement factor that puts a scenario's median tamping interval at a given day.

The factor multiplies every settlement increment. Published inputs taken literally settle much more
slowly than the case studies report, so a factor is needed to speak of the same intervals; what it was
fitted to, and on how many tracks, belongs to the result.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import brentq

from mcsettle.errors import InputError, NumericalError
from mcsettle.estimate.estimate import Estimate
from mcsettle.estimate.sample import interval_quantile
from mcsettle.run.factor_digest import transfer_identity
from mcsettle.step_a.transfers import step_a
from mcsettle.step_b.build_case import build_case
from mcsettle.step_b.case import ALIKE, Case, Outcome, Support, support_of
from mcsettle.step_b.cycle_jump import CycleJump
from mcsettle.study.study import Study
from mcsettle.types import Progress, silent

LOWEST, HIGHEST = 1e-3, 1e6
JUMP = 1e-3  # of the logarithm of the median: more is no rounding


@dataclass(frozen=True)
class Calibration:
    """What was found and from what.

    ``factor`` makes the median of ``scenario`` equal ``target_days`` over ``realisations`` tracks;
    ``factor_low`` and ``factor_high`` do so at the ends of the median's 95 % Monte Carlo interval,
    and are None where that end is open or its median would lie beyond the horizon;
    ``factor_digest`` names the transfer functions it belongs to (``factor_origin``);
    ``uncalibrated_growth_mm`` is the median SD growth within the target days at factor 1.
    """

    scenario: str
    variant: str
    target_days: float
    factor: float
    factor_low: float | None
    factor_high: float | None
    median_days: float
    realisations: int
    seed: int
    uncalibrated_growth_mm: float
    mean_settlement_mm: float
    evaluations: int
    transfer_digest: str
    factor_digest: str


def calibrate(
    study: Study,
    scenario: str,
    median_days: float,
    variant: str | None = None,
    progress: Progress = silent,
    processes: int = 1,
) -> Calibration:
    """Settlement factor for a median of ``median_days`` in ``scenario`` (and first ``variant``).

    Raises
    ------
    InputError
        The target is at or beyond the horizon, or no factor in [LOWEST, HIGHEST] reaches it.
    NumericalError
        Every track failed.
    """
    variant = variant or study.variant_names[0]
    if not 0.0 < median_days < study.limit.horizon_days:
        raise InputError(
            f"the target is {median_days:g} days; it must lie between 0 and the horizon of "
            f"{study.limit.horizon_days:g} days ([limit] horizon_years)"
        )
    prepared = step_a(study.scenes, progress, processes)
    scene = study.scene(variant, scenario)
    case = build_case(scene, prepared)
    case = replace(case, model=replace(case.model, settlement_factor=1.0))
    profiles = scene.profiles.sample(range(study.run.realisations))
    support = support_of(scene, range(len(profiles)), profiles)
    search = Search(case, profiles, progress, support)
    factor, low, high, outcome = search.interval(median_days)
    median = _median(outcome, case.horizon)
    plain = search.outcome(1.0, np.array([0.0, median_days]))
    sound = ~plain.failed
    late = np.isnan(plain.history[sound, 1])  # these have reached their limit before
    grown = np.where(late, np.inf, plain.history[sound, 1]) - plain.sd_initial[sound]
    return Calibration(
        scenario=scenario,
        variant=variant,
        target_days=median_days,
        factor=factor,
        factor_low=low,
        factor_high=high,
        median_days=median_days if median.value is None else median.value,
        realisations=len(profiles),
        seed=study.seed,
        uncalibrated_growth_mm=float(np.median(grown)) * 1e3,
        mean_settlement_mm=float(np.median(outcome.mean_settlement[~outcome.failed])) * 1e3,
        evaluations=search.evaluations,
        transfer_digest=prepared.digest,
        factor_digest=transfer_identity(scene, study.scenes),
    )


def _median(outcome: Outcome, horizon: float) -> Estimate:
    """Kaplan–Meier median of the intervals, days; tracks that failed are left out."""
    if np.all(outcome.failed):
        raise NumericalError("every realisation of the calibration overflowed; lower the factor")
    return interval_quantile(*outcome.intervals(horizon), 0.5)


class Search:
    """Median days as a function of the factor, on fixed profiles (common random numbers)."""

    def __init__(
        self, case: Case, profiles: np.ndarray, progress: Progress, support: Support = ALIKE
    ) -> None:
        self.case, self.profiles, self.progress = case, profiles, progress
        self.support = support
        self.machine = CycleJump(case)
        self.known: dict[float, float] = {}
        self.evaluations = 0

    def outcome(self, factor: float, days: np.ndarray | None = None) -> Outcome:
        """Every track with this factor, its SD recorded on ``days``."""
        self.evaluations += 1
        self.progress(f"Calibration, factor {factor:.6g}", self.evaluations, 40)
        samples = np.zeros(0) if days is None else days
        factors = np.full(len(self.profiles), factor)
        return self.machine.run(self.profiles, samples, factors, support=self.support)

    def median(self, factor: float) -> float:
        """Median days with this factor; twice the horizon where it is not reached."""
        if factor not in self.known:
            median = _median(self.outcome(factor), self.case.horizon).value
            self.known[factor] = 2.0 * self.case.horizon if median is None else median
        return self.known[factor]

    def interval(self, target: float) -> tuple[float, float | None, float | None, Outcome]:
        """Factor for a median of ``target`` days, its 95 % limits, and the outcome at the factor."""
        factor = self.solve(target)
        outcome = self.outcome(factor)
        median = _median(outcome, self.case.horizon)
        # A median that came out low by chance asks for a larger factor, and the other way round.
        low, high = (self.mirrored(target, end) for end in (median.lower, median.upper))
        return factor, low, high, outcome

    def mirrored(self, target: float, end: float | None) -> float | None:
        """Factor for the median that lies from ``target`` as far as ``target`` from ``end``.

        None where the end is open, or that median lies beyond the horizon: there every median
        looks alike, and a search would stop at the horizon and not at the median.
        """
        if end is None or not target**2 / end < self.case.horizon:
            return None
        return self.solve(target**2 / end)

    def _reach(self) -> str:
        """The medians that factors can give, in words."""
        ends = [self.median(factor) for factor in (HIGHEST, LOWEST)]
        shown = [
            f"{day:.4g}" if day < self.case.horizon else f"the horizon of {self.case.horizon:g}"
            for day in ends
        ]
        return f"they reach from {shown[0]} to {shown[1]} days"

    def solve(self, target: float) -> float:
        """Factor whose median is ``target`` days."""

        def miss(log_factor: float) -> float:
            return float(np.log(max(self.median(float(np.exp(log_factor))), 1e-9) / target))

        low, high = 0.0, np.log(30.0)
        while miss(low) < 0.0 and low > np.log(LOWEST):
            low = max(low - np.log(30.0), np.log(LOWEST))
        while miss(high) > 0.0 and high < np.log(HIGHEST):
            high = min(high + np.log(30.0), np.log(HIGHEST))
        if miss(low) < 0.0 or miss(high) > 0.0:
            raise InputError(
                f"no settlement factor between {LOWEST:g} and {HIGHEST:g} gives a median of "
                f"{target:g} days; {self._reach()}"
            )
        factor = float(np.exp(brentq(miss, low, high, xtol=1e-7)))
        if abs(miss(float(np.log(factor)))) > JUMP:
            raise InputError(
                f"the median of {len(self.profiles)} realisations jumps past {target:g} days "
                "at a factor of "
                f"{factor:.6g}, from below it to beyond the horizon of {self.case.horizon:g} days; "
                "set a later horizon ([limit] horizon_years) or take more realisations"
            )
        return factor
