"""Fig. 4: how much rail deflection each vehicle model makes on an uneven track.

On the simplified track of the paper (rails as a beam on an elastic layer) a train at v over the
profile Re U e^{iκx} moves the rail at the distance s from its leading axle by

    w(x, s) = Re U D(s) e^{-iκs} e^{iκx},   D(s) = (1/2π) ∫ ũ(k, κv + kv) Σ_l f_l e^{ika_l} e^{-iks} dk,

x being the place on the track. The peak at x is the largest |w(x, s)| over all s: over the whole
passage of the train.

Depends on: beam, interaction, track, traffic, transfer, vehicle.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from mcsettle.beam import CUTOFF, PERIOD, beam_spectrum
from mcsettle.interaction import (
    HERTZ_STIFFNESS,
    dynamic_forces,
    track_compliance_matrix,
    train_compliance,
)
from mcsettle.irregularity import to_space
from mcsettle.track import BeamTrack
from mcsettle.traffic import Train
from mcsettle.transfer import WavenumberSpectra
from mcsettle.units import KMH
from mcsettle.vehicle import FREIGHT, PASSENGER, Vehicle

REACH = 12.0  # m beyond the ends of a train in which its deflection is looked for
STEP = 0.1  # m, about, between the places s: the peak under an axle is met to half a per cent
MODELS = {
    "passenger": (PASSENGER, 11, 200.0 * KMH, ("complete", "bogies", "wheelsets")),
    "freight": (FREIGHT, 40, 97.0 * KMH, ("complete", "bogies")),
}
MODEL_TITLES = {
    "complete": "complete vehicle",
    "bogies": "bogies and wheelsets",
    "wheelsets": "wheelsets only",
}


@dataclass(frozen=True)
class VehiclePeaks:
    """Peak dynamic rail deflection [X] m along ``x`` [X] m for the models of one vehicle.

    ``profile`` [X] m, positive down, is the track the train met.
    """

    vehicle: str
    speed: float
    cars: int
    x: np.ndarray
    profile: np.ndarray
    peaks: dict[str, np.ndarray]


def vehicle_peaks(
    vehicle: Vehicle,
    cars: int,
    speed: float,
    models: tuple[str, ...],
    track: BeamTrack,
    amplitudes: np.ndarray,
    wavenumbers: np.ndarray,
    window: float,
    contact: float = HERTZ_STIFFNESS,
) -> VehiclePeaks:
    """Peak deflection along the window for several models of one vehicle.

    Parameters
    ----------
    vehicle, cars, speed
        A train of equal cars at ``speed`` [m/s].
    models
        Models of the vehicle (``vehicle.VEHICLE_MODELS``).
    track
        The simplified track.
    amplitudes, wavenumbers : ndarray, shape [K]
        Profile amplitudes [m] and wavenumbers [rad/m].
    window : float, m
    contact : float
        Hertz stiffness [N/m per wheelset].
    """
    trains = {
        model: Train(vehicle.name, (replace(vehicle, model=model),) * cars) for model in models
    }
    positions = next(iter(trains.values())).axle_positions
    k, s, keep = _places(float(positions[-1]))
    fields = {model: np.empty((wavenumbers.size, s.size), dtype=complex) for model in models}
    for mode, kappa in enumerate(wavenumbers.tolist()):
        omega = kappa * speed
        receptance, reaction = beam_spectrum(track, k, speed, omega)
        weights = np.full(k.size, k[1] - k[0])
        spectra = WavenumberSpectra(k, weights, receptance, reaction[:, None, None])
        compliance = track_compliance_matrix(spectra, positions)
        ahead = np.exp(1j * kappa * positions)
        for model, train in trains.items():
            own = train_compliance(train, omega)
            forces = dynamic_forces(own, compliance, ahead, contact)
            field = _field(spectra, positions, forces)[keep]
            fields[model][mode] = field * np.exp(-1j * kappa * s)
    x = np.linspace(0.0, window, 401)
    waves = amplitudes[:, None] * np.exp(1j * np.outer(wavenumbers, x))
    peaks = {model: np.abs((f.T @ waves).real).max(axis=0) for model, f in fields.items()}
    profile = to_space(amplitudes[None], wavenumbers, x)[0]
    return VehiclePeaks(vehicle.name, speed, cars, x, profile, peaks)


def _places(rear: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Wavenumbers [Q], places s [S] m around the train, and where they stand in the period [S]."""
    count = math.ceil(CUTOFF * PERIOD / (2.0 * math.pi))
    k = np.arange(-count, count + 1) * (2.0 * math.pi / PERIOD)
    s = np.arange(k.size) * (PERIOD / k.size)
    s = np.where(s > REACH, s - PERIOD, s)
    keep = np.flatnonzero(s >= rear - REACH)[:: max(1, round(STEP * k.size / PERIOD))]
    return k, s[keep], keep


def _field(spectra: WavenumberSpectra, positions: np.ndarray, forces: np.ndarray) -> np.ndarray:
    """D(s) [m per m of amplitude] at s = 0, PERIOD/Q, …, by one Fourier transform."""
    k = spectra.wavenumbers
    load = forces @ np.exp(1j * np.outer(positions, k))
    scaled = spectra.receptance * load * spectra.weights / (2.0 * math.pi)
    return np.asarray(np.fft.fft(np.fft.ifftshift(scaled)))
