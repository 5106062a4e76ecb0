"""Rail receptance over wavenumber and frequency, with the lines trains excite."""

from dataclasses import dataclass

import numpy as np
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from matplotlib.patheffects import withStroke
from matplotlib.ticker import LogFormatter, ScalarFormatter

from mcsettle.report.figures.style import COLOURS, DASHES, MAP, note, styled
from mcsettle.step_a.beam import BeamResponse
from mcsettle.step_a.fem25d import SectionResponse
from mcsettle.step_a.transfer import TrackResponse
from mcsettle.units import KMH


@dataclass(frozen=True)
class ReceptanceMap:
    """``receptance`` [K, W] m/(N/m), modulus of ũ(k, ω), over k [K] rad/m and ω [W] rad/s.

    Rail displacement for a unit load per wheelset, waves e^{i(ωt - kx)}. ``lines``: label and speed
    [m/s] of the lines ω = k v worth drawing; ``ground_speed`` [m/s] and what it is called.
    """

    wavenumbers: np.ndarray
    omegas: np.ndarray
    receptance: np.ndarray
    lines: tuple[tuple[str, float], ...]
    ground_speed: float
    ground_label: str


def receptance_map(
    response: TrackResponse,
    wavenumbers: np.ndarray,
    omegas: np.ndarray,
    lines: tuple[tuple[str, float], ...],
) -> ReceptanceMap:
    """|ũ(k, ω)| of a section or a beam track for k > 0 and ω ≥ 0.

    Raises
    ------
    TypeError
        If the response is neither.
    """
    if isinstance(response, SectionResponse):
        rows = [response.at(k, omegas)[:, 0] for k in wavenumbers.tolist()]
        speed, label = response.lowest_rayleigh_speed, "Rayleigh wave of the ground"
    elif isinstance(response, BeamResponse):
        rows = [_beam(response, k, omegas) for k in wavenumbers.tolist()]
        speed, label = response.rayleigh_speed, "critical speed of the beam"
    else:
        raise TypeError(f"no receptance of a {type(response).__name__}")
    return ReceptanceMap(wavenumbers, omegas, np.abs(np.array(rows)), lines, speed, label)


def _beam(response: BeamResponse, wavenumber: float, omegas: np.ndarray) -> np.ndarray:
    """ũ(k, ω) = 1 / 2[EI k⁴ (1 + iη_r) - m ω² + s (1 + iη)] at ω > 0."""
    rail, track = response.track.rail, response.track
    bending = rail.bending_stiffness * wavenumber**4 * (1.0 + 1j * rail.damping)
    support = track.support_stiffness * (1.0 + 1j * track.support_damping)
    return np.asarray(0.5 / (bending - rail.mass_per_length * omegas**2 + support))


OUTLINE = [withStroke(linewidth=3.0, foreground="#222222")]  # lines stand out on any colour


@styled
def receptance_figure(view: ReceptanceMap, title: str) -> Figure:
    """|ũ(k, ω)| in colour; the lines ω = k v of the trains and of the ground's waves."""
    figure = Figure(figsize=(8.0, 5.2), layout="constrained")
    axes = figure.add_subplot()
    axes.grid(False)
    values = view.receptance.T * 1e9
    norm = LogNorm(vmin=float(values.min()), vmax=float(values.max()))
    picture = axes.pcolormesh(
        view.wavenumbers, view.omegas, values, norm=norm, cmap=MAP, shading="gouraud",
        rasterized=True,
    )  # fmt: skip
    bar = figure.colorbar(picture, ax=axes, label="modulus of the rail receptance [m/(GN/m)]")
    bar.ax.yaxis.set_major_formatter(ScalarFormatter())
    bar.ax.yaxis.set_minor_formatter(LogFormatter(minor_thresholds=(2.0, 0.6)))
    axes.set_facecolor("#777777")
    k = np.array([0.0, float(view.wavenumbers[-1])])
    for index, (label, speed) in enumerate(view.lines):
        axes.plot(
            k, k * speed, color="w", linestyle=DASHES[index % len(DASHES)], label=label,
            path_effects=OUTLINE,
        )  # fmt: skip
    if np.isfinite(view.ground_speed):
        label = f"{view.ground_label}, {view.ground_speed / KMH:.0f} km/h"
        axes.plot(k, k * view.ground_speed, color=COLOURS[1], linewidth=2.0, label=label,
                  path_effects=OUTLINE)  # fmt: skip
    axes.set(xlabel="wavenumber k [rad/m]", ylabel="angular frequency ω [rad/s]")
    axes.set_xlim(0.0, float(view.wavenumbers[-1]))
    axes.set_ylim(0.0, float(view.omegas[-1]))
    axes.set_title(title)
    legend = axes.legend(
        loc="upper left", frameon=True, facecolor="#333333", framealpha=1.0, fontsize=8
    )
    for text in legend.get_texts():
        text.set_color("w")
    note(
        figure,
        "Lines ω = k v: what a constant load moving at v excites. An oscillating load excites the "
        "same line shifted up by its own frequency.",
    )
    return figure
