"""Figs. 5 and 6: stress and settlement along the track as one freight axle passes.

Depends on: figures.style, units, views.passage.
"""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from mcsettle.figures.style import COLOURS, GREY, note, styled
from mcsettle.units import KPA, MM
from mcsettle.views.passage import AxlePassage

NM = 1e-9  # m
BLUE, RED, GREEN = COLOURS[:3]


@styled
def passage_figure(view: AxlePassage, height_text: str, layer: str, profile_text: str) -> Figure:
    """Stress and profile on the left, settlement on the right.

    ``height_text``: where the stress is taken; ``layer``: name of the uppermost settling layer.
    """
    figure = Figure(figsize=(11.0, 6.4), layout="constrained")
    (stress, upper), (profile, everything) = figure.subplots(2, 2, sharex=True)
    _stress(stress, view)
    stress.set_title(f"Fig. 5: {height_text}")
    _settlement(upper, view.places, view.first_layer, view.first_layer_quasi_static)
    upper.set_title(f"Fig. 6: {layer.replace('_', '-')} settlement of one axle passage")
    _settlement(everything, view.places, view.all_layers, view.all_layers_quasi_static)
    everything.set_title("settlement of all layers, one axle passage")
    profile.plot(view.x, view.profile / MM, color=GREY)
    profile.set(ylabel="profile [mm], positive down")
    profile.set_title("profile the train meets")
    for axes in (profile, everything):
        axes.set_xlabel("x along the track [m]")
    profile.set_xlim(0.0, float(view.x[-1]))
    figure.suptitle(view.label, x=0.01, ha="left")
    note(figure, profile_text)
    return figure


def _stress(axes: Axes, view: AxlePassage) -> None:
    axes.plot(view.x, view.total / KPA, color=GREEN, label="both together")
    axes.axhline(view.quasi_static / KPA, color=BLUE, linestyle="--", label="quasi-static")
    axes.plot(view.x, view.dynamic / KPA, color=RED, linestyle="-.", label="dynamic")
    axes.set_ylabel("deviatoric stress [kPa]")
    axes.set_ylim(0.0, 1.25 * float(view.total.max()) / KPA)
    axes.legend(loc="upper left", ncols=3)


def _settlement(axes: Axes, x: np.ndarray, settlement: np.ndarray, static: float) -> None:
    axes.axhline(static / NM, color=BLUE, linestyle="--", label="quasi-static")
    axes.plot(x, (settlement - static) / NM, color=RED, linestyle="-.", label="dynamic")
    low, high = axes.get_ylim()
    axes.set_ylim(low, high + 0.2 * (high - low))
    axes.set_ylabel("settlement, positive down [nm]")
    axes.legend(loc="upper left", ncols=2)
