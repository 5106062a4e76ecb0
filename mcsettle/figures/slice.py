"""Deflection of track and ground along the centreline under a train at one instant (Fig. 10).

Depends on: figures.style, units, views.slice.
"""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import QuadMesh
from matplotlib.figure import Figure

from mcsettle.figures.style import GREY, MAP, note, styled
from mcsettle.units import KN, MM
from mcsettle.views.slice import DeflectionSlice

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
