"""Figs. 5 and 6: stress and settlement along the track as one freight axle passes."""

from dataclasses import dataclass, replace

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from mcsettle.railway.irregularity import to_space
from mcsettle.railway.settlement_model import SettlementModel
from mcsettle.report.figures.style import COLOURS, GREY, note, styled
from mcsettle.step_a.transfer import TransferFunctions
from mcsettle.step_b.passage import settlement_of_passage
from mcsettle.step_b.stress import deviatoric_stress
from mcsettle.units import KPA, MM


@dataclass(frozen=True)
class AxlePassage:
    """One axle over one profile.

    At ``x`` [X] m, when the axle is overhead: ``profile`` m (positive down); deviatoric stress Pa at
    one height: ``total``, of the ``dynamic`` part alone, and ``quasi_static`` (one number). At
    ``places`` [P] m: settlement m of the uppermost settling layer and of all; ``*_quasi_static``
    without a profile (one number each).
    """

    label: str
    x: np.ndarray
    profile: np.ndarray
    total: np.ndarray
    dynamic: np.ndarray
    quasi_static: float
    places: np.ndarray
    first_layer: np.ndarray
    all_layers: np.ndarray
    first_layer_quasi_static: float
    all_layers_quasi_static: float


def axle_passage(
    transfer: TransferFunctions,
    axle: int,
    amplitudes: np.ndarray,
    weights: np.ndarray,
    model: SettlementModel,
    window: float,
    label: str = "",
) -> AxlePassage:
    """Stress and settlement along the window as axle ``axle`` passes.

    Parameters
    ----------
    transfer : TransferFunctions of the train at its speed
    axle : int
    amplitudes : complex [K] m, the profile
    weights : [Z], carry stresses to the height looked at (``stress_under_train.layer_weights``)
    model : SettlementModel; the cycles are those before the first passage
    window : float, m
    """
    x = np.linspace(0.0, window, 801)
    waves = amplitudes[:, None] * np.exp(1j * np.outer(transfer.wavenumbers, x))
    dynamic = np.real((transfer.dynamic[axle] @ weights).T @ waves)  # [4, X]
    static = transfer.quasi_static[axle] @ weights
    upper = model.settling_layers[0]
    laws = tuple(law if i == upper else None for i, law in enumerate(model.laws))
    first = replace(model, laws=laws)
    cycles = np.array([1.0 if law is None else model.cycles_before(law) for law in model.laws])

    def settlement(which: SettlementModel, profile: np.ndarray) -> np.ndarray:
        return settlement_of_passage(profile, axle, transfer, which, cycles, window)

    flat = np.zeros_like(amplitudes)
    everything = settlement(model, amplitudes)
    return AxlePassage(
        label=label,
        x=x,
        profile=to_space(amplitudes[None], transfer.wavenumbers, x)[0],
        total=deviatoric_stress(*(static[:, None] + dynamic)),
        dynamic=deviatoric_stress(*dynamic),
        quasi_static=float(deviatoric_stress(*static)),
        places=window * np.arange(everything.size) / everything.size,
        first_layer=settlement(first, amplitudes),
        all_layers=everything,
        first_layer_quasi_static=float(settlement(first, flat)[0]),
        all_layers_quasi_static=float(settlement(model, flat)[0]),
    )


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
