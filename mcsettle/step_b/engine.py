"""Step B for thousands of realisations: advance the profiles until they reach the SD limit.

Three steppings of one right-hand side: "every_axle" updates the profile after each axle passage, in
timetable order; "every_train" freezes it over each train; "cycle_jump" integrates over many days at
once. Two right-hand sides of one meaning: "spectral", the second-order form (exact where m = 2), and
"pointwise", every x and depth (not with "every_train"; slower, for checking).
"""

from collections.abc import Callable

import numpy as np

from mcsettle.step_b.case import ALIKE, Case, Support
from mcsettle.step_b.cycle_jump import TOLERANCE, CycleJump
from mcsettle.step_b.stepwise import Stepwise

STEPPINGS = ("cycle_jump", "every_axle", "every_train")
RIGHT_HAND_SIDES = ("spectral", "pointwise")
PRECISIONS = ("f64", "f32")
Engine = CycleJump | Stepwise
FORESEEN = 1e-4  # tolerance of the days that progress is counted in


def engine_for(
    case: Case,
    stepping: str = "cycle_jump",
    right_hand_side: str = "spectral",
    tolerance: float = TOLERANCE,
    threads: int | None = None,
    precision: str = "f64",
) -> Engine:
    """The engine of a case: its coefficients folded once, then any number of batches.

    Parameters
    ----------
    case : Case
    stepping : one of ``STEPPINGS``
    right_hand_side : one of ``RIGHT_HAND_SIDES``
    tolerance : of the cycle jump
    precision : of the updates passage by passage or train by train, one of ``PRECISIONS``
    threads : Taichi threads (None: all cores)

    Raises
    ------
    ValueError : an unknown name, or a combination that does not exist.
    """
    if stepping not in STEPPINGS or right_hand_side not in RIGHT_HAND_SIDES:
        raise ValueError(
            f"stepping '{stepping}' with right-hand side '{right_hand_side}'; "
            f"choose from {STEPPINGS} and {RIGHT_HAND_SIDES}"
        )
    if precision not in PRECISIONS:
        raise ValueError(f"precision '{precision}'; choose from {PRECISIONS}")
    if precision != "f64" and stepping == "cycle_jump":
        raise ValueError(f"precision '{precision}' takes stepping 'every_axle' or 'every_train'")
    from mcsettle.kernels import runtime

    runtime.start(threads)
    if stepping == "cycle_jump":
        return CycleJump(case, right_hand_side, tolerance)
    return Stepwise(case, stepping, right_hand_side, precision)


def foreseen_passages(
    case: Case, amplitudes: np.ndarray, support: Support = ALIKE
) -> Callable[[float], tuple[int, int]]:
    """Axle passages of realisations [R, K] done by a day, and in all, as a cycle jump foresees them."""
    outcome = CycleJump(case, tolerance=FORESEEN).run(amplitudes, np.zeros(0), support=support)
    last = np.where(outcome.reached, outcome.days, case.horizon)
    total = int(last.sum() * case.timetable.passages_per_day)

    def by_day(day: float) -> tuple[int, int]:
        done = int(np.minimum(last, day).sum() * case.timetable.passages_per_day)
        return done, max(done, total)

    return by_day
