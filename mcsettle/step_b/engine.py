"""Step B for thousands of realisations: advance the profiles until they reach the SD limit.

Three steppings of one right-hand side: "every_axle" updates the profile after each axle passage, in
timetable order; "every_train" freezes it over each train; "cycle_jump" integrates over many days at
once. Two right-hand sides of one meaning: "spectral", the second-order form (exact where m = 2), and
"pointwise", every x and depth (not with "every_train"; slower, for checking).
"""

from collections.abc import Callable

import numpy as np

from mcsettle.step_b.case import Case, Outcome
from mcsettle.step_b.cycle_jump import Growth, cycle_jump, exact_growth, spectral_growth
from mcsettle.step_b.passage import mode_numbers
from mcsettle.step_b.sd_map import roughness
from mcsettle.step_b.spectral import mode_pairs
from mcsettle.step_b.stepwise import (
    Loads,
    Marching,
    PointwiseLoads,
    day_loads,
    march,
    pointwise_day_loads,
)

STEPPINGS = ("cycle_jump", "every_axle", "every_train")
RIGHT_HAND_SIDES = ("spectral", "pointwise")
PRECISIONS = ("f64", "f32")
TOLERANCE = 1e-6
FORESEEN = 1e-4  # tolerance of the days that progress is counted in


class Engine:
    """One case made ready: coefficients folded once, then any number of batches.

    Parameters
    ----------
    case : Case
    stepping : one of ``STEPPINGS``
    right_hand_side : one of ``RIGHT_HAND_SIDES``
    tolerance : of the cycle jump, relative to the amplitudes, per step
    precision : of the arithmetic of updates passage by passage or train by train, one of
        ``PRECISIONS``; the state is in double precision always
    threads : Taichi threads (None: all cores)

    Raises
    ------
    ValueError : an unknown name, or a combination that does not exist.
    """

    def __init__(
        self,
        case: Case,
        stepping: str = "cycle_jump",
        right_hand_side: str = "spectral",
        tolerance: float = TOLERANCE,
        threads: int | None = None,
        precision: str = "f64",
    ) -> None:
        if stepping not in STEPPINGS or right_hand_side not in RIGHT_HAND_SIDES:
            raise ValueError(
                f"stepping '{stepping}' with right-hand side '{right_hand_side}'; "
                f"choose from {STEPPINGS} and {RIGHT_HAND_SIDES}"
            )
        if precision not in PRECISIONS:
            raise ValueError(f"precision '{precision}'; choose from {PRECISIONS}")
        if precision != "f64" and stepping == "cycle_jump":
            raise ValueError(
                f"precision '{precision}' takes stepping 'every_axle' or 'every_train'"
            )
        from mcsettle.kernels import runtime

        runtime.start(threads)
        wavenumbers = case.transfers[0].wavenumbers
        self.pairs = mode_pairs(mode_numbers(wavenumbers, case.window))
        self.case, self.tolerance = case, tolerance
        self.measure = roughness(wavenumbers, case.window)
        self.law: Growth | None = None
        self.loads: Loads | PointwiseLoads | None = None
        if stepping == "cycle_jump":
            exact = right_hand_side == "pointwise"
            self.law = exact_growth(case) if exact else spectral_growth(case, self.pairs)
        elif self.measure.basis is not None:
            raise ValueError(
                "updating passage by passage takes a window below 400 m; use stepping 'cycle_jump'"
            )
        elif right_hand_side == "pointwise":
            if stepping != "every_axle":
                raise ValueError(
                    "updating train by train takes the spectral right-hand side; "
                    "use stepping 'every_axle' or 'cycle_jump'"
                )
            self.loads = pointwise_day_loads(case, precision)
        else:
            self.loads = day_loads(case, self.pairs, stepping == "every_train", precision)

    def run(
        self,
        amplitudes: np.ndarray,
        sample_days: np.ndarray,
        factor: np.ndarray | None = None,
        tick: Callable[[int, int], None] | None = None,
        ground_days: np.ndarray | None = None,
        begun: Marching | None = None,
        keep: Callable[[Callable[[], Marching]], None] | None = None,
    ) -> Outcome:
        """Run realisations until they reach the limit or the horizon.

        Parameters
        ----------
        amplitudes : complex [R, K], initial profile amplitudes, m
        sample_days : [H] rising days at which the SD is recorded
        factor : [R] multiplies ``settlement_factor`` (cycle jump only); default 1
        tick : called with the axle passages done and foreseen (not by the cycle jump)
        ground_days : [R] days of this traffic that sub-ballast and ground have had before day 0, while
            the ballast begins anew (cycle jump only); default 0
        begun, keep : go on from a march, and what is shown the march after each launch
            (``march.march``; not by the cycle jump)

        Returns
        -------
        Outcome
        """
        days = np.asarray(sample_days, dtype=float)
        if self.law is not None:
            return cycle_jump(
                self.case, amplitudes, days, self.law, self.measure, self.tolerance, factor,
                ground_days,
            )  # fmt: skip
        if factor is not None or ground_days is not None or self.loads is None:
            raise ValueError(
                "a factor or days of the ground for each realisation need stepping 'cycle_jump'"
            )
        by_day = None if tick is None else self._counted(amplitudes, tick)
        return march(self.case, amplitudes, days, self.loads, self.measure, by_day, begun, keep)

    def _counted(
        self, amplitudes: np.ndarray, tick: Callable[[int, int], None]
    ) -> Callable[[float], None]:
        """``tick`` as a function of the day, by the days that a cycle jump foresees."""
        case, law = self.case, spectral_growth(self.case, self.pairs)
        outcome = cycle_jump(case, amplitudes, np.zeros(0), law, self.measure, FORESEEN)
        last = np.where(outcome.reached, outcome.days, case.horizon)
        total = int(last.sum() * case.timetable.passages_per_day)

        def by_day(day: float) -> None:
            done = int(np.minimum(last, day).sum() * case.timetable.passages_per_day)
            tick(done, max(done, total))

        return by_day
