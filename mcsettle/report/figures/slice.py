"""Deflection of track and ground along the centreline under a train at one instant (Fig. 10)."""

import math
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import QuadMesh
from matplotlib.figure import Figure

from mcsettle.railway.traffic import Train
from mcsettle.report.figures.style import GREY, MAP, note, styled
from mcsettle.step_a.fem25d.centreline_field import CentrelineField, FieldSpectra
from mcsettle.step_a.interaction import dynamic_forces, track_compliance_matrix, train_compliance
from mcsettle.units import KN, MM

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
    k, of_static, of_dynamic, forces = _loads(field, train, speed, kappa, turned, hertz_stiffness)
    waves = np.exp(-1j * np.outer(x + middle, k))
    static, dynamic = (waves @ of_static).real, (waves @ of_dynamic).real
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
        forces=forces,
    )


def _loads(
    field: CentrelineField,
    train: Train,
    speed: float,
    kappa: np.ndarray,
    turned: np.ndarray,
    hertz_stiffness: float,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Sum over the driving frequencies: all share their wavenumbers.

    Wavenumbers [Q] rad/m, displacement spectra under the train [Q, 1 + D] m·m of the static and of the
    dynamic part, dynamic forces [J] N.
    """
    axles = train.axle_positions
    spectra = field.spectra(speed, np.concatenate([[0.0], kappa * speed]))
    first = next(spectra)
    k = first.rail.wavenumbers
    phases = np.exp(1j * np.outer(axles, k))

    def loaded(response: FieldSpectra, acting: np.ndarray) -> np.ndarray:
        both = np.column_stack([response.rail.receptance, response.ground])
        load = (acting @ phases) * response.rail.weights / (2.0 * math.pi)
        return np.asarray(both * load[:, None])

    static = loaded(first, train.axle_forces.astype(complex))
    dynamic, forces = np.zeros_like(static), np.zeros(axles.size)
    for mode, response in enumerate(spectra):
        vehicle = train_compliance(train, float(kappa[mode] * speed))
        track = track_compliance_matrix(response.rail, axles)
        meets = turned[mode] * np.exp(1j * kappa[mode] * axles)
        acting = dynamic_forces(vehicle, track, meets, hertz_stiffness)
        forces += acting.real
        dynamic += loaded(response, acting)
    return k, static, dynamic, forces


def _check(field: CentrelineField, speed: float, omegas: np.ndarray) -> None:
    s, highest = field.response.settings, float(omegas.max(initial=0.0))
    if not 0.0 < speed <= s.max_speed or highest > s.max_omega:
        raise ValueError(
            f"speed is {speed:.4g} m/s and the highest driving frequency {highest:.4g} rad/s; the "
            f"bases reach {s.max_speed:.4g} m/s and {s.max_omega:.4g} rad/s"
        )


DRAWN = 0.6  # m, about, of the largest deflection in the picture
DIVERGING = "RdBu_r"  # down is red, up is blue
RAIL_HEIGHT = 0.25  # m above the sleepers, where the rail is drawn
ZOOM = 20.0  # m on either side of the train's middle


@styled
def slice_figure(view: DeflectionSlice, profile_text: str) -> Figure:
    """Quasi-static, dynamic and both together under the whole train; both around its middle.

    In colour and deformed; ``profile_text`` says which profile the train runs over.
    """
    figure = Figure(figsize=(10.0, 10.0), layout="constrained")
    static, dynamic, total, zoom = figure.subplots(4, 1)
    whole, near = np.full(view.x.size, True), np.abs(view.x) <= ZOOM
    top = max(float(view.quasi_static.max()), float(view.total.max()))
    factor = _round(DRAWN / top)
    limits = (min(0.0, float(view.total.min())), top)
    swing = max(float(np.abs(view.rail_dynamic).max()), 1e-9)
    large = _round(DRAWN / swing)
    colours = _deformed(
        static, view, view.quasi_static, view.rail_quasi_static, whole, factor, limits
    )
    moved = _deformed(dynamic, view, view.dynamic, view.rail_dynamic, whole, large, (-swing, swing))
    _deformed(total, view, view.total, view.rail, whole, factor, limits)
    _deformed(zoom, view, view.total, view.rail, near, factor, limits)
    static.set_title("(a) quasi-static: static axle forces")
    dynamic.set_title("(b) dynamic: wheel forces from the profile, by themselves; grey: profile")
    _profile(dynamic, view, large)
    total.set_title("(c) quasi-static and dynamic together")
    zoom.set_title(f"(d) as (c), {2 * ZOOM:g} m around the middle of the train")
    zoom.set_xlabel("x from the middle of the train, positive forward [m]")
    figure.colorbar(colours, ax=static, label="deflection [mm]")
    figure.colorbar(moved, ax=dynamic, label="deflection [mm]")
    figure.colorbar(colours, ax=[total, zoom], label="deflection [mm]")
    figure.suptitle(
        f"Deflection along the track centreline at one instant (Fig. 10): {view.label}",
        x=0.01, ha="left",
    )  # fmt: skip
    note(figure, _words(view, profile_text, factor, large))
    return figure


def _words(view: DeflectionSlice, profile_text: str, factor: float, large: float) -> str:
    rms = float(np.sqrt(np.mean(view.forces**2)))
    return (
        f"{profile_text}\nShape drawn {factor:g} times the true deflection, (b) {large:g} times; "
        f"line: rail (largest {view.rail_quasi_static.max() / MM:.2f} mm quasi-static, "
        f"{view.rail.max() / MM:.2f} mm in all; dynamic alone "
        f"{np.abs(view.rail_dynamic).max() / MM:.3f} mm);\ntriangles: axles, with dynamic forces "
        f"of {rms / KN:.1f} kN rms, {np.abs(view.forces).max() / KN:.1f} kN at most."
    )


def _deformed(
    axes: Axes,
    view: DeflectionSlice,
    deflection: np.ndarray,
    rail: np.ndarray,
    inside: np.ndarray,
    factor: float,
    limits: tuple[float, float],
) -> QuadMesh:
    """One panel; returns what the colour bar describes."""
    x, deflection = view.x[inside], deflection[inside]
    heights = view.z[None, :] - factor * deflection
    places = np.broadcast_to(x[:, None], heights.shape)
    colours = axes.pcolormesh(
        places, heights, deflection / MM, cmap=MAP if limits[0] > -limits[1] else DIVERGING,
        shading="gouraud", rasterized=True, vmin=limits[0] / MM, vmax=limits[1] / MM,
    )  # fmt: skip
    top = view.z[0] + RAIL_HEIGHT
    axes.plot(x, top - factor * rail[inside], color="k", linewidth=1.2)
    axles = view.axles[(view.axles >= x[0]) & (view.axles <= x[-1])]
    axes.plot(axles, np.full(axles.size, top + DRAWN + 0.1), "v", color="k", markersize=4)
    axes.set_ylabel("z [m]")
    axes.set_xlim(float(x[0]), float(x[-1]))
    axes.grid(False)
    return colours


def _profile(axes: Axes, view: DeflectionSlice, factor: float) -> None:
    """The profile the wheels meet, above the rail, drawn to the same scale as the deflections."""
    top = view.z[0] + RAIL_HEIGHT
    reach = max(float(np.abs(view.profile).max()) * factor, 1e-9)
    level = top + DRAWN + 0.6 + min(reach, 1.0)
    scale = factor * min(1.0, 1.0 / reach)
    axes.plot(view.x, level - scale * view.profile, color=GREY, linewidth=1.0)


def _round(number: float) -> float:
    """``number`` to one digit."""
    power = 10.0 ** np.floor(np.log10(number))
    return float(np.round(number / power) * power)
