"""How near the critical speed of track and ground a train runs, where a response is at hand.

The critical speed is that of the largest quasi-static deflection (``fem25d.critical``): of the ground as
given, or as the train has softened it. From 0.8 of it on there is a remark: deflection and stresses
rise steeply there, and with them all that a modulus or a damping ratio is wrong by.
"""

from mcsettle.railway.traffic import Service
from mcsettle.step_a.transfer import TrackResponse
from mcsettle.units import KMH

NEAR_CRITICAL = 0.8  # of the critical speed, from which a train is remarked on


def critical_speed_of(response: TrackResponse) -> float:
    """Speed [m/s] of the largest quasi-static deflection; where a beam has none, that of its waves."""
    from mcsettle.step_a.fem25d.moving_load import SectionResponse

    if not isinstance(response, SectionResponse):
        return response.rayleigh_speed
    from mcsettle.step_a.fem25d.largest_deflection import critical_speed

    return critical_speed(response).speed


def lowest_critical_speed(response: TrackResponse) -> float:
    """Speed [m/s] that ``critical_speed_of`` cannot fall below; costs nothing."""
    from mcsettle.step_a.fem25d.moving_load import SectionResponse

    if not isinstance(response, SectionResponse):
        return response.rayleigh_speed
    from mcsettle.step_a.fem25d.largest_deflection import LOWEST

    return LOWEST * response.lowest_rayleigh_speed


def speed_remark(service: Service, response: TrackResponse, softened: bool) -> str | None:
    """A remark on a train that runs faster than 0.8 of the critical speed; None on a slower one.

    ``softened``: the ground is one that the train softens itself. The critical speed is sought only
    where the speed asks for it.
    """
    speed = service.speed
    if speed <= NEAR_CRITICAL * lowest_critical_speed(response):
        return None
    critical = critical_speed_of(response)
    if speed <= NEAR_CRITICAL * critical:
        return None
    ground = " on the ground it softens" if softened else ""
    return (
        f"{service.train.name}, {speed / KMH:.0f} km/h: {speed / critical:.0%} of the critical speed "
        f"of track and ground{ground} ({critical / KMH:.0f} km/h)"
    )
