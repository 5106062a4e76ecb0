"""Fig. 4: peak dynamic rail deflection along the track for the models of each vehicle."""

import math
from dataclasses import dataclass, replace

import numpy as np
from matplotlib.figure import Figure

from mcsettle.railway.irregularity import to_space
from mcsettle.railway.track import BeamTrack
from mcsettle.railway.traffic import Train
from mcsettle.railway.vehicle import FREIGHT, PASSENGER, Vehicle
from mcsettle.report.figures.style import GREY, look, note, styled
from mcsettle.step_a.beam import CUTOFF, PERIOD, beam_spectrum
from mcsettle.step_a.interaction import (
    HERTZ_STIFFNESS,
    axle_phases,
    compliance_between,
    dynamic_forces,
    train_compliance,
)
from mcsettle.step_a.transfer import WavenumberSpectra
from mcsettle.units import KMH, MM

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
    phases = axle_phases(k, positions)
    backwards = phases.axles.conj()
    fields = {model: np.empty((wavenumbers.size, s.size), dtype=complex) for model in models}
    for mode, kappa in enumerate(wavenumbers.tolist()):
        omega = kappa * speed
        receptance, reaction = beam_spectrum(track, k, speed, omega)
        weights = np.full(k.size, k[1] - k[0])
        spectra = WavenumberSpectra(k, weights, receptance, reaction[:, None, None])
        compliance = compliance_between(spectra, phases)
        ahead = np.exp(1j * kappa * positions)
        for model, train in trains.items():
            of_vehicles = train_compliance(train, omega)
            forces = dynamic_forces(of_vehicles, compliance, ahead, contact)
            field = _field(spectra, forces @ backwards)[keep]
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


def _field(spectra: WavenumberSpectra, load: np.ndarray) -> np.ndarray:
    """D(s) [m per m of amplitude] of a load's spectrum [Q] at s = 0, PERIOD/Q, …."""
    scaled = spectra.receptance * load * spectra.weights / (2.0 * math.pi)
    return np.asarray(np.fft.fft(np.fft.ifftshift(scaled)))


@styled
def vehicles_figure(views: list[VehiclePeaks], profile_text: str, title: str) -> Figure:
    """One panel a vehicle, one line a model, the profile below."""
    figure = Figure(figsize=(9.2, 7.2), layout="constrained")
    panels = figure.subplots(
        len(views) + 1, 1, sharex=True, height_ratios=[1.0] * len(views) + [0.55]
    )
    for letter, axes, view in zip("abcdef", panels[:-1], views, strict=False):
        for index, (model, peak) in enumerate(view.peaks.items()):
            label = f"{MODEL_TITLES[model]} (largest {peak.max() / MM:.3f} mm)"
            axes.plot(view.x, peak / MM, label=label, **look(index))
        axes.set_ylabel("peak dynamic\nrail deflection [mm]")
        axes.set_title(f"({letter}) {view.vehicle}, {view.cars} cars, {view.speed / KMH:.0f} km/h")
        axes.set_ylim(0.0, 1.32 * max(float(p.max()) for p in view.peaks.values()) / MM)
        axes.legend(loc="upper left", ncols=3, fontsize=8)
    panels[-1].plot(views[0].x, views[0].profile / MM, color=GREY)
    panels[-1].set(xlabel="x along the track [m]", ylabel="profile [mm],\npositive down")
    panels[-1].set_xlim(0.0, float(views[0].x[-1]))
    figure.suptitle(title, x=0.01, ha="left")
    note(
        figure,
        "Largest modulus of the rail's dynamic displacement at each x while the whole train passes "
        "(static deflection left out).\nRails as a beam on an elastic layer. " + profile_text,
    )
    return figure
