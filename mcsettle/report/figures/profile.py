"""A measured record: level and its band along the track, spectrum against published ones, SDs."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from mcsettle.analysis.profile import EN_CLASSES, ProfileReport
from mcsettle.railway.spectra import GERMAN_ROUGHNESS, fra, german, spectrum
from mcsettle.report.figures.style import (
    COLOURS,
    GREY,
    legend_outside,
    log_labels,
    look,
    note,
    styled,
)

MOST_POINTS = 4000  # drawn of a record


@styled
def profile_figure(report: ProfileReport, title: str) -> Figure:
    """Three panels: along the track, over wavelength, by section."""
    figure = Figure(figsize=(9.5, 9.0), layout="constrained")
    along, over, by_section = figure.subplots(3, 1, height_ratios=(1.0, 1.4, 1.0))
    _level(along, report)
    _spectrum(over, report)
    _sections(by_section, report)
    figure.suptitle(title)
    return figure


def _level(axes: Axes, report: ProfileReport) -> None:
    parts = report.sections
    every = max(1, len(parts.chainage) // MOST_POINTS)
    x = parts.chainage[::every]
    axes.plot(x, (parts.level - parts.level.mean())[::every] * 1e3, color=GREY, linewidth=0.7,
              label="as recorded, mean off")  # fmt: skip
    band = f"{report.band.shortest:g}–{report.band.longest:g} m"
    axes.plot(x, parts.passed[::every] * 1e3, color=COLOURS[0], linewidth=0.9, label=band)
    axes.invert_yaxis()
    axes.set(xlabel="chainage [m]", ylabel="level, positive down [mm]", title="Level")
    legend_outside(axes)


def _spectrum(axes: Axes, report: ProfileReport) -> None:
    k = report.wavenumbers
    wavelength = 2.0 * np.pi / k
    for number in range(1, 7):
        axes.loglog(wavelength, spectrum("fra", number)(k), color="#BBBBBB", linewidth=0.9)
        axes.annotate(f"FRA {number}", (wavelength[0], spectrum("fra", number)(k)[0]), fontsize=7,
                      color=GREY, xytext=(3, 0), textcoords="offset points", va="center")  # fmt: skip
    for index, (name, roughness) in enumerate(GERMAN_ROUGHNESS.items()):
        label = name.replace("german_", "German, ")
        axes.loglog(wavelength, german(k, roughness), label=label, **look(index + 2))
    axes.loglog(wavelength, report.power, color=COLOURS[0], marker=".", linewidth=0.8,
                label=f"measured, mean of {len(report.sd)} sections")  # fmt: skip
    best = next(fit for fit in report.fits if fit.shape == "fra")
    axes.loglog(wavelength, fra(k, best.roughness), label="FRA shape, fitted", **look(1))
    log_labels(axes.xaxis)
    log_labels(axes.yaxis)
    axes.set(xlabel="wavelength [m]", ylabel="one-sided spectrum [m²/(rad/m)]", title="Spectrum")
    legend_outside(axes)


def _sections(axes: Axes, report: ProfileReport) -> None:
    parts = report.sections
    middle = 0.5 * (parts.chainage_from + parts.chainage_to)
    width = 0.4 * report.window
    axes.bar(middle - 0.5 * width, report.sd * 1e3, width, color=COLOURS[0],
             label=f"{report.band.shortest:g}–{report.band.longest:g} m")  # fmt: skip
    axes.bar(middle + 0.5 * width, report.sd_d1 * 1e3, width, color=COLOURS[4],
             label="D1 (3–25 m)")  # fmt: skip
    if report.speed_kmh is not None:
        limits = next((EN_CLASSES[v] for v in EN_CLASSES if report.speed_kmh <= v), ())
        for name, limit in zip("ABCD", limits, strict=False):
            axes.axhline(limit * 1e3, color=GREY, linewidth=0.8, linestyle=":")
            axes.annotate(f"{name}", (1.0, limit * 1e3), xycoords=("axes fraction", "data"),
                          fontsize=7, color=GREY, va="top", ha="right")  # fmt: skip
    axes.set(xlabel="chainage [m]", ylabel="SD [mm]", title=f"SD of {report.window:g} m sections")
    legend_outside(axes)
    if report.speed_kmh is not None:
        note(axes.figure, "Dotted: upper bounds of D1 of the classes A to D commonly quoted for "  # type: ignore[arg-type]
             f"EN 13848-6 at {report.speed_kmh:g} km/h.")  # fmt: skip
