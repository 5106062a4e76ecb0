"""What of a vehicle does not agree with itself: inputs that are given apart and belong together.

Published vehicles are of one rail as often as of both, and in kN as often as in N: a factor of two or
a thousand between numbers that physics ties together is remarked on, and never changed.
"""

import math
from collections.abc import Iterator

from mcsettle.railway.vehicle import Vehicle

HALF, DOUBLE = (0.4, 0.6), (1.7, 2.5)  # masses over static load: one rail, or both of them twice
SLENDER = (0.3, 3.0)  # pitching inertia over that of a uniform body of the car's length
DAMPED = (1e-3, 2.0)  # damping ratio of the bounce of the body


def vehicle_remarks(vehicle: Vehicle) -> Iterator[str]:
    """What of ``vehicle`` does not agree with itself, in words."""
    mass = vehicle.moving_mass
    static = sum(vehicle.loads)
    ratio = mass / static
    if HALF[0] <= ratio <= HALF[1]:
        yield (
            f"its masses add up to {mass / 1e3:.4g} t, about half of the {static / 1e3:.4g} t that its "
            "axle loads are: masses, inertias, stiffnesses and damping are of both rails; where yours "
            "are of one rail, double them"
        )
    elif DOUBLE[0] <= ratio <= DOUBLE[1]:
        yield (
            f"its masses add up to {mass / 1e3:.4g} t, about twice the {static / 1e3:.4g} t that its "
            "axle loads are: an axle load is of a wheelset, both wheels; is yours that of one wheel?"
        )
    inertia = vehicle.body_inertia / (
        vehicle.body_mass * (vehicle.length / vehicle.bodies) ** 2 / 12.0
    )
    if not SLENDER[0] <= inertia <= SLENDER[1]:
        yield (
            f"the pitching inertia of its body is {inertia:.3g} times that of a uniform body of its mass "
            "and length (m L²/12): check body_inertia and its unit"
        )
    stiffness, damping = 2.0 * vehicle.secondary.stiffness, 2.0 * vehicle.secondary.damping
    ratio = damping / (2.0 * math.sqrt(stiffness * vehicle.body_mass))
    if damping > 0.0 and not DAMPED[0] <= ratio <= DAMPED[1]:
        yield (
            f"the bounce of its body has {ratio:.3g} of critical damping: check stiffness and damping "
            "of the secondary suspension and their units"
        )
