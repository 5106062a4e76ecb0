"""Dynamic wheel–rail interaction of a whole train: Eq. (3) and Appendix A.

At driving frequency Ω = κv of a profile Δu(x) = Re U e^{iκx} the wheelsets meet U b_j with
b_j = e^{iκ a_j}, and the dynamic forces on the track are

    f = -(V_c + V^H + T_c)⁻¹ b                                                 Eqs. (3), (11), (12)

per metre of U, with V_c block-diagonal by car, V^H diagonal and T_c full: all cars act on each
other through the track. ``precompute`` turns a track's response and a train into the transfer
functions that are all Step B knows; ``save`` and ``load`` keep them on disk.
"""

import hashlib
import json
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcsettle.errors import check_positive
from mcsettle.railway.rail_loads import HALF, RailLoads
from mcsettle.railway.traffic import Train
from mcsettle.railway.vehicle import vehicle_compliance
from mcsettle.step_a.transfer import Spectra, TrackResponse, TransferFunctions
from mcsettle.step_a.transfer_file import load, save
from mcsettle.types import Progress, silent
from mcsettle.units import KMH

__all__ = [
    "HERTZ_STIFFNESS",
    "axle_phases",
    "compliance_between",
    "dynamic_forces",
    "load",
    "precompute",
    "save",
    "track_compliance_matrix",
    "train_compliance",
    "transfer_digest",
]

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

SAME = 9  # decimals [m] to which equal distances agree
FEW_DISTANCES = 10  # distances for each axle, below which each is taken once
HERTZ_STIFFNESS = 2 * 1.36e9  # N/m per wheelset: two crossed-cylinder contacts under 85 kN each


def train_compliance(train: Train, omega: float) -> ComplexArray:
    """Compliance of all cars at their wheelsets, [J, J] m/N, block-diagonal; Eq. (15).

    ``omega`` is the driving frequency [rad/s], not zero.
    """
    blocks = {car: vehicle_compliance(car, omega) for car in set(train.cars)}
    matrix = np.zeros((train.n_axles, train.n_axles), dtype=complex)
    first = 0
    for car in train.cars:
        last = first + car.n_axles
        matrix[first:last, first:last] = blocks[car]
        first = last
    return matrix


def track_compliance_matrix(spectra: Spectra, positions: Array) -> ComplexArray:
    """Compliance of the rail between axles, moving with the train.

    T_c,jl = (1/2π) ∫ ũ(k, Ω + kv) e^{-ik(a_j - a_l)} dk; Eq. (13) is its diagonal.

    Parameters
    ----------
    spectra
        Response at one (Ω, v).
    positions
        Axle positions a_j [m], shape [J], positive forward.

    Returns
    -------
    Shape [J, J] [m/N]: rail displacement (down) at axle j for a unit force at axle l.
    """
    return compliance_between(spectra, axle_phases(spectra.wavenumbers, positions))


@dataclass(frozen=True, eq=False)
class AxlePhases:
    """Phases of the axles, the same at every driving frequency.

    ``axles`` [J, Q]: e^{-ik a_j}; ``distances`` [U, Q]: e^{-iks} of the distances s between axles, equal
    ones once, or None where nearly all are different; ``pair`` [J, J]: which of them is a_j - a_l.
    """

    axles: ComplexArray
    distances: ComplexArray | None
    pair: NDArray[np.intp]


def axle_phases(wavenumbers: Array, positions: Array) -> AxlePhases:
    """Phases at ``wavenumbers`` [Q] rad/m of axles at ``positions`` [J] m."""
    apart = (positions[:, None] - positions).ravel()
    _, first, pair = np.unique(np.round(apart, SAME), return_index=True, return_inverse=True)
    axles = np.exp(-1j * np.outer(positions, wavenumbers))
    distances = None
    if first.size <= FEW_DISTANCES * positions.size:  # equal cars: 5 times as many as axles
        distances = np.exp(-1j * np.outer(apart[first], wavenumbers))
    return AxlePhases(axles, distances, pair.reshape(positions.size, positions.size))


def compliance_between(spectra: Spectra, phases: AxlePhases) -> ComplexArray:
    """T_c [J, J] m/N of ``track_compliance_matrix`` from ``axle_phases``."""
    scaled = spectra.weights * spectra.receptance / (2.0 * np.pi)
    if phases.distances is None:
        return np.asarray((phases.axles * scaled) @ phases.axles.conj().T, dtype=complex)
    return np.asarray((phases.distances @ scaled)[phases.pair], dtype=complex)


def dynamic_forces(
    vehicle: ComplexArray, track: ComplexArray, excitation: ComplexArray, hertz_stiffness: float
) -> ComplexArray:
    """Dynamic wheel–rail forces on the track [N], shape [J], positive down; Eqs. (3) and (14).

    ``vehicle`` and ``track`` are the compliances V_c and T_c [J, J] m/N; ``excitation`` is the
    profile under each wheelset [J] m (complex, positive down); ``hertz_stiffness`` is k_H
    [N/m per wheelset].
    """
    total = vehicle + track + np.eye(excitation.size) / hertz_stiffness
    return np.asarray(-np.linalg.solve(total, excitation), dtype=complex)


def precompute(
    train: Train,
    speed: float,
    response: TrackResponse,
    wavenumbers: Array,
    hertz_stiffness: float = HERTZ_STIFFNESS,
    progress: Progress = silent,
    whole: bool = False,
) -> TransferFunctions:
    """Transfer functions of one train at one speed on one track.

    Parameters
    ----------
    train : all of its axles act together
    speed : v [m/s]
    response : Step A of the track
    wavenumbers : κ of the profile modes [rad/m], shape [K], positive
    hertz_stiffness : of the contact [N/m per wheelset]
    progress : called with (stage, done, total) after each of the K + 1 driving frequencies
    whole : the whole load of a wheelset on each rail: receptance and stresses doubled

    Raises
    ------
    ValueError
        If the speed, the wavenumbers or the contact stiffness are not positive.
    """
    kappa = np.array(wavenumbers, dtype=float)
    _check(speed, kappa, hertz_stiffness)
    quasi_static, deflection, dynamic, force, compliance = _swept(
        train, speed, response, kappa, hertz_stiffness, progress, whole
    )
    return TransferFunctions(
        train=train.name,
        speed=speed,
        wavenumbers=kappa,
        grid=response.grid,
        quasi_static=quasi_static,
        dynamic=dynamic,
        force=force,
        track_compliance=compliance,
        geostatic=response.geostatic,
        rail_deflection=deflection,
        digest=transfer_digest(
            train, speed, kappa, hertz_stiffness, response.digest, RailLoads(whole=whole)
        ),
    )


def transfer_digest(
    train: Train,
    speed: float,
    wavenumbers: Array,
    hertz_stiffness: float,
    response_digest: str,
    loads: RailLoads = HALF,
) -> str:
    """SHA-256 hex digest of everything ``precompute`` depends on; known before it runs."""
    described = train.description
    for car in described["cars"]:
        if car["axle_loads"] is None:  # a car like any other
            del car["axle_loads"]
    description = {
        "train": described,
        "speed": float(speed),
        "wavenumbers": np.asarray(wavenumbers, dtype=float).tolist(),
        "hertz_stiffness": float(hertz_stiffness),
        "response": response_digest,
    }
    if loads.description:
        description["rail_loads"] = loads.description
    return hashlib.sha256(json.dumps(description, sort_keys=True).encode()).hexdigest()


def _swept(
    train: Train,
    speed: float,
    response: TrackResponse,
    kappa: Array,
    hertz_stiffness: float,
    progress: Progress,
    whole: bool,
) -> tuple[Array, Array, ComplexArray, ComplexArray, ComplexArray]:
    """Of the axles: stress [J, 4, Z] and deflection [J] at rest, stress [J, K, 4, Z] and force [J, K] by
    mode; the track's compliance [K] under an axle by itself.
    """
    positions = train.axle_positions
    size, modes, depths = positions.size, kappa.size, response.grid.z.size
    quasi_static, deflection = np.empty((size, 4, depths)), np.empty(size)
    dynamic = np.empty((size, modes, 4, depths), dtype=complex)
    force, compliance = np.empty((size, modes), dtype=complex), np.empty(modes, dtype=complex)
    waves, phases = np.empty(0), axle_phases(np.empty(0), positions)
    omegas = np.concatenate([[0.0], kappa * speed])
    wheels = 2.0 if whole else 1.0  # whose load one rail carries
    stage = f"Step A: {train.name} at {speed / KMH:.0f} km/h"
    for step, spectra in enumerate(response.spectra(speed, omegas)):
        if spectra.wavenumbers is not waves:
            waves, phases = spectra.wavenumbers, axle_phases(spectra.wavenumbers, positions)
        if step == 0:
            stress, rail = _under_axles(spectra, phases.axles, wheels * train.axle_forces)
            quasi_static[:], deflection[:] = stress.real, rail.real
        else:
            mode = step - 1
            excitation = np.exp(1j * kappa[mode] * positions)
            track = wheels * compliance_between(spectra, phases)
            vehicle = train_compliance(train, float(omegas[step]))
            forces = dynamic_forces(vehicle, track, excitation, hertz_stiffness)
            stress, _ = _under_axles(spectra, phases.axles, wheels * forces)
            dynamic[:, mode] = stress * excitation.conj()[:, None, None]
            force[:, mode] = forces * excitation.conj()
            compliance[mode] = track[0, 0]
        progress(stage, step + 1, omegas.size)
    return quasi_static, deflection, dynamic, force, compliance


def _under_axles(
    spectra: Spectra, axles: ComplexArray, forces: Array | ComplexArray
) -> tuple[ComplexArray, ComplexArray]:
    """Stress [J, 4, Z] Pa and rail displacement [J] m under each axle, all forces [J] acting."""
    load = (forces @ axles.conj()) * spectra.weights / (2.0 * np.pi)
    scaled = axles * load
    return spectra.stress_under(scaled), scaled @ spectra.receptance


def _check(speed: float, wavenumbers: Array, hertz_stiffness: float) -> None:
    check_positive("speed", speed, "m/s")
    check_positive("Hertz stiffness", hertz_stiffness, "N/m")
    if wavenumbers.ndim != 1 or wavenumbers.size == 0:
        raise ValueError(f"wavenumbers must be a list of at least one, shape {wavenumbers.shape}")
    if not (np.all(wavenumbers > 0.0) and np.all(np.isfinite(wavenumbers))):
        raise ValueError("wavenumbers of the profile modes must be positive and finite")
