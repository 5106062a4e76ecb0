"""Rail vehicles as multi-body descriptions: Table 1 of the paper, and their compliance.

A ``Vehicle`` is one car on two bogies of two wheelsets, or of one (a two-axle wagon, whose suspension
is the secondary one), three (Co-Co) or four; or an articulated unit of several bodies, neighbours of
which share a bogie. ``model`` says how much of it moves
dynamically: "complete" (car body, bogies, wheelsets), "bogies" (bogies and wheelsets) or
"wheelsets"; a simplified model leaves out the bodies above *and* the springs that carry them. The
static axle load is an input of its own: it need not equal the sum of the masses.

Degrees of freedom, in this order: car bodies (displacement, pitch) and then bogies (displacement,
pitch), both from the leading one, wheelsets from the leading one. Displacements are positive down; a
pitch is positive when it lowers the front. A freight bogie carries its wheelsets rigidly; a bogie of
one wheelset has no pitch.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcsettle.errors import check_positive
from mcsettle.units import TONNE

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

VEHICLE_MODELS = ("complete", "bogies", "wheelsets")
_LEVELS = {"complete": ("secondary", "primary"), "bogies": ("primary",), "wheelsets": ()}
_POSITIVE_FIELDS = {
    "length": "m",
    "bogie_spacing": "m",
    "axle_spacing": "m",
    "body_mass": "kg",
    "body_inertia": "kg·m²",
    "bogie_mass": "kg",
    "bogie_inertia": "kg·m²",
    "wheelset_mass": "kg",
    "axle_load": "kg",
}
_OF_SEVERAL_AXLES = ("axle_spacing", "bogie_mass", "bogie_inertia")  # may be 0 with one a bogie
MOST_AXLES, MOST_BODIES = 4, 20  # of a bogie, of a unit


@dataclass(frozen=True)
class Suspension:
    """One suspension stage per spring: stiffness [N/m] and viscous damping [N·s/m] in parallel."""

    stiffness: float
    damping: float

    def __post_init__(self) -> None:
        check_positive("suspension stiffness", self.stiffness, "N/m")
        if not 0.0 <= self.damping < math.inf:
            raise ValueError(f"suspension damping is {self.damping}; it must be 0 or more N·s/m")

    def dynamic_stiffness(self, omega: float) -> complex:
        """Complex stiffness k + iΩc [N/m] at Ω [rad/s], Eqs. (22) and (23)."""
        return self.stiffness + 1j * omega * self.damping


@dataclass(frozen=True)
class Vehicle:
    """One car. Lengths [m], masses [kg], pitching inertias [kg·m²], axle load [kg per wheelset].

    ``primary`` is None for freight vehicles, whose wheelsets are rigidly part of the bogie.
    ``axle_loads``, leading wheelset first, replaces ``axle_load`` where the wheelsets differ.
    ``axles_per_bogie`` at equal spacings: with 1 the spacing of the bogies is the wheelbase, and spacing
    of the axles, mass and inertia of the bogies may be 0. With several ``bodies`` the car is an
    articulated unit: its length is that of all, mass and inertia those of one body, and each end of a
    body rests on its bogie with a secondary suspension of its own.
    """

    name: str
    length: float
    bogie_spacing: float
    axle_spacing: float
    body_mass: float
    body_inertia: float
    bogie_mass: float
    bogie_inertia: float
    wheelset_mass: float
    secondary: Suspension
    primary: Suspension | None
    axle_load: float
    model: str = "complete"
    axle_loads: tuple[float, ...] | None = None
    axles_per_bogie: int = 2
    bodies: int = 1

    def __post_init__(self) -> None:
        for field, unit in _POSITIVE_FIELDS.items():
            if not (self.axles_per_bogie == 1 and field in _OF_SEVERAL_AXLES):
                check_positive(f"{field} of vehicle '{self.name}'", getattr(self, field), unit)
        for load in self.axle_loads or ():
            check_positive(f"axle load of vehicle '{self.name}'", load, "kg")
        self._check_arrangement()
        if self.model not in VEHICLE_MODELS:
            raise ValueError(
                f"model of vehicle '{self.name}' is '{self.model}'; "
                f"choose one of {', '.join(VEHICLE_MODELS)}"
            )
        if self.model == "wheelsets" and self.primary is None:
            raise ValueError(
                f"vehicle '{self.name}' has no primary suspension: its wheelsets are rigidly part "
                "of the bogies and cannot move alone; choose the model 'bogies'"
            )

    def _check_arrangement(self) -> None:
        """Refuse numbers of axles and bodies, and lengths, that do not go together."""
        for what, number, most in (
            ("axles_per_bogie", self.axles_per_bogie, MOST_AXLES),
            ("bodies", self.bodies, MOST_BODIES),
        ):
            if not 1 <= number <= most:
                raise ValueError(
                    f"vehicle '{self.name}' has {what} {number}; this model takes 1 to {most}"
                )
        if self.axle_loads is not None and len(self.axle_loads) != self.n_axles:
            raise ValueError(
                f"vehicle '{self.name}' has {self.n_axles} axles and {len(self.axle_loads)} axle loads"
            )
        wheelbase = (self.axles_per_bogie - 1) * self.axle_spacing
        outermost = self.bodies * self.bogie_spacing + wheelbase
        if wheelbase >= self.bogie_spacing or outermost >= self.length:
            raise ValueError(
                f"vehicle '{self.name}': axle spacing {self.axle_spacing} m, bogie spacing "
                f"{self.bogie_spacing} m and length {self.length} m do not fit; the axle spacing "
                "must be less than the bogie spacing, and both together less than the length"
            )

    @property
    def n_bogies(self) -> int:
        """Number of bogies: neighbouring bodies share one."""
        return self.bodies + 1

    @property
    def n_axles(self) -> int:
        """Number of wheelsets."""
        return self.n_bogies * self.axles_per_bogie

    @property
    def loads(self) -> tuple[float, ...]:
        """Static load of each wheelset [kg], leading first."""
        return self.axle_loads or (self.axle_load,) * self.n_axles

    @property
    def arms(self) -> tuple[float, ...]:
        """Positions of the wheelsets of a bogie from its centre, positive forward, leading first [m]."""
        n = self.axles_per_bogie
        return tuple(self.axle_spacing * (0.5 * (n - 1) - i) for i in range(n))

    @property
    def axle_offsets(self) -> tuple[float, ...]:
        """Positions of the wheelsets from the car's centre, positive forward, leading first [m]."""
        bogies = [self.bogie_spacing * (0.5 * self.bodies - b) for b in range(self.n_bogies)]
        return tuple(bogie + arm for bogie in bogies for arm in self.arms)

    @property
    def moving_mass(self) -> float:
        """Mass [kg] of bodies, bogies and wheelsets: what the dynamics know of it."""
        of_bogies = self.n_bogies * self.bogie_mass + self.n_axles * self.wheelset_mass
        return self.bodies * self.body_mass + of_bogies


def mass_matrix(vehicle: Vehicle) -> Array:
    """Mass matrix M^v [kg, kg·m²], shape [D, D], Eqs. (17) and (20)."""
    v = vehicle
    wheels = 0.0 if v.primary is not None else v.wheelset_mass
    turning = wheels * sum(arm**2 for arm in v.arms)
    bogie = [v.bogie_mass + v.axles_per_bogie * wheels, v.bogie_inertia + turning]
    diagonal = [v.body_mass, v.body_inertia] * v.bodies + bogie * v.n_bogies
    if v.primary is not None:
        diagonal += [v.wheelset_mass] * v.n_axles
    return np.diag(diagonal)[np.ix_(_kept(v), _kept(v))]


def stiffness_matrix(vehicle: Vehicle, omega: float) -> ComplexArray:
    """Complex stiffness matrix K^v(Ω) [N/m, N, N·m], shape [D, D], of the suspension.

    Built from the energy of each spring, K^v = Σ (k + iΩc) v vᵀ with v the spring's elongation for
    unit displacements; Eqs. (18) and (21) are the result.
    """
    size = _size(vehicle)
    matrix = np.zeros((size, size), dtype=complex)
    for level, suspension, elongation in _springs(vehicle, size):
        if level in _LEVELS[vehicle.model]:
            matrix += suspension.dynamic_stiffness(omega) * np.outer(elongation, elongation)
    return matrix[np.ix_(_kept(vehicle), _kept(vehicle))]


def connection_matrix(vehicle: Vehicle) -> Array:
    """Matrix Z, shape [J, D] for J wheelsets: their displacements from the degrees of freedom.

    Eqs. (16) and (19), the last row of the latter put right: 0 0 0 0 1 -lw.
    """
    first, n = 2 * vehicle.bodies, vehicle.n_axles
    if vehicle.primary is not None:
        matrix = np.hstack([np.zeros((n, _size(vehicle) - n)), np.eye(n)])
    else:
        matrix = np.zeros((n, _size(vehicle)))
        for wheel in range(n):
            bogie, place = divmod(wheel, vehicle.axles_per_bogie)
            matrix[wheel, first + 2 * bogie] = 1.0
            matrix[wheel, first + 2 * bogie + 1] = vehicle.arms[place]
    return matrix[:, _kept(vehicle)]


def vehicle_compliance(vehicle: Vehicle, omega: float) -> ComplexArray:
    """Compliance of one car at its wheelsets, V_c = Z (K^v - Ω² M^v)⁻¹ Zᵀ, Eq. (15).

    Parameters
    ----------
    vehicle
        The car; its ``model`` says which bodies take part.
    omega
        Driving frequency Ω [rad/s], not zero.

    Returns
    -------
    Shape [J, J] [m/N]: displacement of one wheelset for a force on another, both down, leading
    wheelset first.

    Raises
    ------
    ValueError
        If Ω is zero: a car free to move has no static compliance.
    """
    if omega == 0.0 or not math.isfinite(omega):
        raise ValueError(f"driving frequency is {omega} rad/s; it must be finite and not zero")
    connection = connection_matrix(vehicle)
    dynamic = stiffness_matrix(vehicle, omega) - omega**2 * mass_matrix(vehicle)
    return np.asarray(connection @ np.linalg.solve(dynamic, connection.T), dtype=complex)


def natural_frequencies(vehicle: Vehicle, wheels: str = "fixed") -> Array:
    """Undamped natural frequencies [Hz], rising.

    ``wheels`` is "fixed" (wheelsets held: the suspended modes) or "free" (nothing held: the first
    four are the rigid motions at 0 Hz).

    Raises
    ------
    ValueError
        If ``wheels`` is neither, or nothing is left to move.
    """
    stiffness, mass = stiffness_matrix(vehicle, 0.0).real, mass_matrix(vehicle)
    if wheels not in ("fixed", "free"):
        raise ValueError(f"wheels is '{wheels}'; choose 'fixed' or 'free'")
    if wheels == "fixed":
        from scipy.linalg import null_space

        basis = null_space(connection_matrix(vehicle))
        if basis.shape[1] == 0:
            raise ValueError(f"vehicle '{vehicle.name}' has nothing left to move on fixed wheels")
        stiffness, mass = basis.T @ stiffness @ basis, basis.T @ mass @ basis
    from scipy.linalg import eigh

    squares = eigh(stiffness, mass, eigvals_only=True)
    return np.sqrt(np.maximum(squares, 0.0)) / (2.0 * math.pi)


def _springs(vehicle: Vehicle, size: int) -> list[tuple[str, Suspension, Array]]:
    """Each spring of one car: its level, its suspension, its elongation vector [size]."""
    arm, first = vehicle.bogie_spacing / 2.0, 2 * vehicle.bodies
    springs = []
    for body in range(vehicle.bodies):
        for bogie, lever in ((body, arm), (body + 1, -arm)):
            elongation = np.zeros(size)
            elongation[[2 * body, 2 * body + 1, first + 2 * bogie]] = (1.0, lever, -1.0)
            springs.append(("secondary", vehicle.secondary, elongation))
    if vehicle.primary is not None:
        wheels = first + 2 * vehicle.n_bogies
        for wheel in range(vehicle.n_axles):
            bogie, place = divmod(wheel, vehicle.axles_per_bogie)
            under = first + 2 * bogie
            elongation = np.zeros(size)
            elongation[[under, under + 1, wheels + wheel]] = (1.0, vehicle.arms[place], -1.0)
            springs.append(("primary", vehicle.primary, elongation))
    return springs


def _size(vehicle: Vehicle) -> int:
    """Degrees of freedom of the complete model, the pitch of every bogie included."""
    wheels = 0 if vehicle.primary is None else vehicle.n_axles
    return 2 * vehicle.bodies + 2 * vehicle.n_bogies + wheels


def _kept(vehicle: Vehicle) -> list[int]:
    """Degrees of freedom that take part in the vehicle's model."""
    bogies = 2 * vehicle.bodies
    wheels = bogies + 2 * vehicle.n_bogies
    first = {"complete": 0, "bogies": bogies, "wheelsets": wheels}[vehicle.model]
    # A bogie of one wheelset stands on a point: nothing turns it.
    turning = range(bogies + 1, wheels, 2) if vehicle.axles_per_bogie == 1 else ()
    return [i for i in range(first, _size(vehicle)) if i not in turning]


PASSENGER = Vehicle(
    name="passenger",
    length=25.9,
    bogie_spacing=19.0,
    axle_spacing=2.9,
    body_mass=329e2,
    body_inertia=208e4,
    bogie_mass=4932.0,
    bogie_inertia=5150.0,
    wheelset_mass=1538.0,
    secondary=Suspension(1320e3, 360e2),
    primary=Suspension(3420e3, 360e2),
    axle_load=17.0 * TONNE,
)
FREIGHT = Vehicle(
    name="freight",
    length=13.9,
    bogie_spacing=9.7,
    axle_spacing=1.7,
    body_mass=864e2,
    body_inertia=102e4,
    bogie_mass=2800.0,
    bogie_inertia=2020.0,
    wheelset_mass=2000.0,
    secondary=Suspension(2660e3, 25e2),
    primary=None,
    axle_load=25.0 * TONNE,
)
VEHICLES = {"passenger": PASSENGER, "freight": FREIGHT}
