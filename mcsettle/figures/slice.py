"""Deflection of track and ground along the centreline under a train (Fig. 10).

Depends on: figures.style, units, views.slice.
"""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import QuadMesh
from matplotlib.figure import Figure

from mcsettle.figures.style import MAP, note, styled
from mcsettle.units import MM
from mcsettle.views.slice import DeflectionSlice

DRAWN = 0.6  # m, about, of the largest deflection in the picture
RAIL_HEIGHT = 0.25  # m above the sleepers, where the rail is drawn
ZOOM = 20.0  # m on either side of the train's middle


@styled
def slice_figure(view: DeflectionSlice) -> Figure:
    """The whole train above, its middle 40 m below, in colour and deformed."""
    figure = Figure(figsize=(10.0, 6.2), layout="constrained")
    whole, zoom = figure.subplots(2, 1)
    factor = _round(DRAWN / float(view.rail.max()))
    colours = _deformed(whole, view, np.full(view.x.size, True), factor)
    _deformed(zoom, view, np.abs(view.x) <= ZOOM, factor)
    whole.set_title("(a) whole train")
    zoom.set_title("(b) around the middle of the train")
    zoom.set_xlabel("x from the middle of the train, positive forward [m]")
    figure.colorbar(colours, ax=[whole, zoom], label="deflection of track and ground [mm]")
    figure.suptitle(
        f"Quasi-static deflection along the track centreline (Fig. 10): {view.label}",
        x=0.01, ha="left",
    )  # fmt: skip
    note(
        figure,
        f"Shape drawn {factor:g} times the true deflection; line: rail (largest "
        f"{view.rail.max() / MM:.2f} mm); triangles: axles. Dynamic part not included.",
    )
    return figure


def _deformed(axes: Axes, view: DeflectionSlice, inside: np.ndarray, factor: float) -> QuadMesh:
    """One panel; returns what the colour bar describes."""
    x, deflection = view.x[inside], view.deflection[inside] / MM
    heights = view.z[None, :] - factor * view.deflection[inside]
    places = np.broadcast_to(x[:, None], heights.shape)
    colours = axes.pcolormesh(
        places, heights, deflection, cmap=MAP, shading="gouraud", rasterized=True,
        vmin=0.0, vmax=float(view.deflection.max()) / MM,
    )  # fmt: skip
    top = view.z[0] + RAIL_HEIGHT
    axes.plot(x, top - factor * view.rail[inside], color="k", linewidth=1.2)
    axles = view.axles[(view.axles >= x[0]) & (view.axles <= x[-1])]
    axes.plot(axles, np.full(axles.size, top + 0.25), "v", color="k", markersize=4)
    axes.set_ylabel("z [m]")
    axes.set_xlim(float(x[0]), float(x[-1]))
    axes.grid(False)
    return colours


def _round(number: float) -> float:
    """``number`` to one digit."""
    power = 10.0 ** np.floor(np.log10(number))
    return float(np.round(number / power) * power)
