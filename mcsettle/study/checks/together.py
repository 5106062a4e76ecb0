"""Every check of the tables of a study read together, and the remarks on a study that will run."""

from mcsettle.step_a.critical_speed import NEAR_CRITICAL
from mcsettle.study.checks import economics, forms, names, profile, run, track, traffic
from mcsettle.study.checks.parts import Parts
from mcsettle.study.faults import Fault
from mcsettle.units import KMH

CHECKS = (
    names.name_faults,
    track.track_faults,
    track.variant_faults,
    traffic.train_faults,
    profile.profile_faults,
    economics.economics_faults,
    economics.currency_faults,
    economics.maintenance_faults,
    traffic.speed_faults,
    run.stepping_faults,
    forms.variability_faults,
    forms.counting_faults,
    forms.load_faults,
)


def faults_between(parts: Parts) -> list[Fault]:
    """Every fault that shows only when tables are read together."""
    return [fault for check in CHECKS for fault in check(parts)]


def warnings_of(parts: Parts) -> list[str]:
    """Remarks on a study that will run: vehicles at odds with themselves, speeds near a wave speed."""
    remarks = list(traffic.vehicle_remarks_of(parts))
    for path, speed, name, limit, _ in traffic.speed_limits(parts):
        if speed > NEAR_CRITICAL * limit:
            relation = "above" if speed > limit else f"above {NEAR_CRITICAL:.0%} of"
            remarks.append(
                f"{path}: {speed / KMH:g} km/h is {relation} the Rayleigh speed of '{name}' "
                f"({limit / KMH:.0f} km/h)"
            )
    return remarks
