"""What single precision, and updating passage by passage, do not do."""

from collections.abc import Iterator

from mcsettle.study.checks.parts import Parts
from mcsettle.study.faults import Fault

LONG_WINDOW = 400.0  # m, from which the SD is that of a section of the window


def stepping_faults(parts: Parts) -> Iterator[Fault]:
    """What single precision, and updating passage by passage, do not do."""
    if parts.run is None:
        return
    run = parts.run
    if run.precision != "f64" and run.stepping == "cycle_jump":
        yield Fault(
            "run.precision",
            f"received '{run.precision}'; takes stepping 'every_axle' or 'every_train'",
        )
    if run.stepping == "cycle_jump":
        return
    given = f"received '{parts.run.stepping}'"
    if parts.profile is not None and parts.profile.window_m >= LONG_WINDOW:
        yield Fault(
            "run.stepping",
            f"{given}; windows of {LONG_WINDOW:g} m and more (profile.window_m = "
            f"{parts.profile.window_m:g}) take 'cycle_jump'",
        )
    if parts.run.right_hand_side == "pointwise" and parts.run.stepping == "every_train":
        yield Fault(
            "run.stepping",
            f"{given}; right_hand_side = 'pointwise' takes 'every_axle' or 'cycle_jump'",
        )
