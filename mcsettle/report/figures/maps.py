"""Maps: dynamic force by axle and wavelength, quasi-static stress around a car by depth."""

from collections.abc import Sequence

import numpy as np
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator, NullFormatter

from mcsettle.analysis.stress_under_train import StressAlong
from mcsettle.report.figures.results import WIDTH, frame
from mcsettle.report.figures.style import GREY, MAP, LogTicks, styled
from mcsettle.units import KN, KPA, MM


@styled
def force_figure(forces: Sequence[tuple[str, np.ndarray]], wavelengths: np.ndarray) -> Figure:
    """|F| [J, K] N/m of every axle over the wavelength [K] m of the profile, one panel a train."""
    figure = Figure(figsize=(WIDTH, 0.7 + 2.0 * len(forces)), layout="constrained")
    panels = figure.subplots(len(forces), 1, sharex=True, squeeze=False)[:, 0]
    for axes, (label, force) in zip(panels, forces, strict=True):
        values = np.abs(force) * MM / KN
        axes.grid(False)
        low = max(float(values.min()), 1e-3 * float(values.max()))
        picture = axes.pcolormesh(
            wavelengths, np.arange(1, len(values) + 1), values, cmap=MAP, rasterized=True,
            shading="nearest", norm=LogNorm(low, float(values.max())),
        )  # fmt: skip
        bar = figure.colorbar(picture, ax=axes, label="kN per mm", ticks=LogTicks(), format="%g")
        bar.ax.yaxis.set_minor_formatter(NullFormatter())
        axes.set(ylabel="axle, from the front")
        axes.yaxis.set_major_locator(MaxNLocator(4, integer=True))
        axes.set_title(label)
    panels[-1].set_xlabel("wavelength of the profile [m]")
    return figure


@styled
def stress_map_figure(view: StressAlong, tops: Sequence[tuple[str, float]]) -> Figure:
    """Quasi-static deviatoric stress around the middle car, over x and depth."""
    figure, axes = frame(3.0)
    axes.grid(False)
    order = np.argsort(view.heights)
    picture = axes.pcolormesh(
        view.x, view.heights[order], view.sigma[order] / KPA, cmap=MAP, rasterized=True,
        shading="nearest",
    )  # fmt: skip
    figure.colorbar(picture, ax=axes, label="deviatoric stress [kPa]")
    for _, top in tops:
        axes.axhline(top, color="w", linewidth=0.7)
    axes.plot(view.axles, np.full(len(view.axles), view.heights.max()), "v", color="k",
              clip_on=False)  # fmt: skip
    axes.set(xlabel="x from the middle of the car [m]", ylabel="z above the subgrade [m]")
    axes.tick_params(color=GREY)
    return figure
