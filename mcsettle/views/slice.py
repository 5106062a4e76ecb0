"""Deflection of the track and ground along the centreline under a moving train (Fig. 10).

With the train's forces F_l e^{iΩt} at a_l, moving at v, the field at distance s from its origin is

    u(s, z, t) = Re Σ_Ω e^{iΩt} (1/2π) ∫ ũ(k, Ω + kv; z) Σ_l F_l e^{ik a_l} e^{-iks} dk.

The static axle forces (Ω = 0) give the quasi-static part. The dynamic part has one term for every
mode κ of the profile Re Σ U e^{iκx}: Ω = κv and F the dynamic wheel–rail forces of Eqs. (3), (11)
and (12), -(V_c + V^H + T_c)⁻¹ b U. At the instant shown the train's origin is at the place x₀ = vt
of the profile.

Depends on: fem25d, interaction, traffic.
"""

import math
from dataclasses import dataclass

import numpy as np

from mcsettle.fem25d.field import CentrelineField, FieldSpectra
from mcsettle.interaction import dynamic_forces, track_compliance_matrix, train_compliance
from mcsettle.traffic import Train

REACH = 20.0  # m shown beyond the ends of the train
STEP = 0.2  # m between places along the track


@dataclass(frozen=True)
class DeflectionSlice:
    """Deflection at one instant, positive down, around a train over a profile.

    At ``x`` [X] m from the train's middle, positive forward, and heights ``z`` [D] m:
    ``quasi_static`` and ``dynamic`` [X, D] m, of the rail ``rail_quasi_static`` and ``rail_dynamic``
    [X] m; ``profile`` [X] m at those places. ``axles`` [J] m and the dynamic ``forces`` [J] N on the
    track under them.
    """

    label: str
    x: np.ndarray
    z: np.ndarray
    quasi_static: np.ndarray
    dynamic: np.ndarray
    rail_quasi_static: np.ndarray
    rail_dynamic: np.ndarray
    profile: np.ndarray
    axles: np.ndarray
    forces: np.ndarray

    @property
    def total(self) -> np.ndarray:
        """Both parts together [X, D] m."""
        return self.quasi_static + self.dynamic

    @property
    def rail(self) -> np.ndarray:
        """Deflection of the rail, both parts [X] m."""
        return self.rail_quasi_static + self.rail_dynamic


def deflection_slice(
    field: CentrelineField,
    train: Train,
    speed: float,
    wavenumbers: np.ndarray,
    amplitudes: np.ndarray,
    place: float,
    hertz_stiffness: float,
) -> DeflectionSlice:
    """The slice y = 0 under ``train`` at ``speed`` [m/s], from the rail down to the real mesh's end.

    Parameters
    ----------
    field : CentrelineField
    train : Train
        All of its axles act.
    speed : float, m/s
    wavenumbers, amplitudes : ndarray, shape [K], rad/m and complex m
        The profile, Re Σ U e^{iκx}; zero amplitudes give the quasi-static field alone.
    place : float, m
        x of the middle of the train (half way between its outer axles) at the instant shown.
    hertz_stiffness : float, N/m per wheelset

    Raises
    ------
    ValueError
        If the speed or a driving frequency κv lies outside the settings of the field's bases.
    """
    axles = train.axle_positions
    middle = float(axles[0] + axles[-1]) / 2.0
    kept = np.flatnonzero(amplitudes)
    kappa = wavenumbers[kept]
    _check(field, speed, kappa * speed)
    turned = amplitudes[kept] * np.exp(1j * kappa * (place - middle))  # U e^{iΩt}
    half = float(axles[0] - axles[-1]) / 2.0 + REACH
    x = np.linspace(-half, half, 2 * math.ceil(half / STEP) + 1)
    loads = _loads(field, train, speed, kappa, turned, hertz_stiffness)
    waves = np.exp(-1j * np.outer(x + middle, loads.wavenumbers))
    static, dynamic = (waves @ loads.static).real, (waves @ loads.dynamic).real
    return DeflectionSlice(
        label=f"{train.name}, {speed * 3.6:.0f} km/h",
        x=x,
        z=field.z,
        quasi_static=static[:, 1:],
        dynamic=dynamic[:, 1:],
        rail_quasi_static=static[:, 0],
        rail_dynamic=dynamic[:, 0],
        profile=(np.exp(1j * np.outer(x + middle, kappa)) @ turned).real,
        axles=axles - middle,
        forces=loads.forces,
    )


@dataclass(frozen=True)
class _Loads:
    """Displacement spectra under the train [Q, 1 + D] m·m of both parts; dynamic forces [J] N."""

    wavenumbers: np.ndarray
    static: np.ndarray
    dynamic: np.ndarray
    forces: np.ndarray


def _loads(
    field: CentrelineField,
    train: Train,
    speed: float,
    kappa: np.ndarray,
    turned: np.ndarray,
    hertz_stiffness: float,
) -> _Loads:
    """Sum over the driving frequencies: all share their wavenumbers."""
    axles = train.axle_positions
    spectra = field.spectra(speed, np.concatenate([[0.0], kappa * speed]))
    first = next(spectra)
    k = first.rail.wavenumbers
    phases = np.exp(1j * np.outer(axles, k))

    def loaded(found: FieldSpectra, acting: np.ndarray) -> np.ndarray:
        both = np.column_stack([found.rail.receptance, found.ground])
        load = (acting @ phases) * found.rail.weights / (2.0 * math.pi)
        return np.asarray(both * load[:, None])

    static = loaded(first, train.axle_forces.astype(complex))
    dynamic, forces = np.zeros_like(static), np.zeros(axles.size)
    for mode, found in enumerate(spectra):
        vehicle = train_compliance(train, float(kappa[mode] * speed))
        track = track_compliance_matrix(found.rail, axles)
        meets = turned[mode] * np.exp(1j * kappa[mode] * axles)
        acting = dynamic_forces(vehicle, track, meets, hertz_stiffness)
        forces += acting.real
        dynamic += loaded(found, acting)
    return _Loads(k, static, dynamic, forces)


def _check(field: CentrelineField, speed: float, omegas: np.ndarray) -> None:
    s, highest = field.response.settings, float(omegas.max(initial=0.0))
    if not 0.0 < speed <= s.max_speed or highest > s.max_omega:
        raise ValueError(
            f"speed is {speed:.4g} m/s and the highest driving frequency {highest:.4g} rad/s; the "
            f"bases reach {s.max_speed:.4g} m/s and {s.max_omega:.4g} rad/s"
        )
