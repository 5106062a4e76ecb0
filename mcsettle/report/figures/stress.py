"""Deviatoric stress against depth and along the track (Figs. 15 and 16), and Table 4 as points."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from mcsettle.analysis.stress_under_train import DepthCurve, StressAlong
from mcsettle.analysis.table4 import DEFINITIONS, REALISATIONS, Increase
from mcsettle.report.figures.style import COLOURS, GREY, MARKERS, look, note, styled
from mcsettle.units import KMH, KPA


@styled
def depth_figure(
    curves: list[DepthCurve], interfaces: list[tuple[str, float]], sd_text: str, title: str
) -> Figure:
    """Quasi-static and dynamic stress against depth, one line a train and speed.

    ``interfaces``: name and top [m] of each layer; ``sd_text`` says for which profile.
    """
    figure = Figure(figsize=(9.6, 5.2), layout="constrained")
    left, right = figure.subplots(1, 2, sharey=True)
    for index, curve in enumerate(curves):
        style = look(index) | {"marker": MARKERS[index % len(MARKERS)], "markersize": 3.5}
        for layer in np.unique(curve.layer):  # no line across an interface: σ_d jumps there
            here = curve.layer == layer
            label = curve.label if layer == curve.layer[0] else None
            left.plot(curve.quasi_static[here] / KPA, curve.z[here], label=label, **style)
            right.plot(curve.dynamic[here] / KPA, curve.z[here], **style)
    left.set_xlabel("quasi-static deviatoric stress [kPa]\naxle overhead, mean over the axles\n")
    right.set_xlabel(f"dynamic deviatoric stress [kPa]\nrms over profile and axles\n{sd_text}")
    left.set_ylabel("z above the subgrade surface [m]")
    for axes in (left, right):
        axes.set_xlim(0.0, 1.18 * axes.get_xlim()[1])  # room for the layers' names
        _layers(axes, interfaces)
    left.legend(loc="lower right")
    figure.suptitle(title, x=0.01, ha="left")
    note(
        figure,
        "Eq. (10) on the track centreline, without geostatic stress; markers are the depths of the "
        "quadrature. Dynamic: the dynamic stress alone.",
    )
    return figure


def _layers(axes: Axes, interfaces: list[tuple[str, float]]) -> None:
    for name, top in interfaces:
        axes.axhline(top, color=GREY, linewidth=0.8)
        axes.annotate(
            name.replace("_", "-"), (0.99, top), xycoords=("axes fraction", "data"), ha="right",
            va="top", fontsize=7.5, color=GREY, xytext=(0, -2), textcoords="offset points",
        )  # fmt: skip


@styled
def along_figure(view: StressAlong, names: list[str], title: str) -> Figure:
    """Quasi-static stress around the middle car of a train, one line a height."""
    figure = Figure(figsize=(8.6, 4.4), layout="constrained")
    axes = figure.add_subplot()
    for index, (row, name) in enumerate(zip(view.sigma, names, strict=True)):
        axes.plot(view.x, row / KPA, label=name, **look(index))
    axes.plot(
        view.axles, np.zeros_like(view.axles), "^", color="k", clip_on=False, zorder=5,
        label="axles",
    )  # fmt: skip
    axes.set(
        xlabel="x from the middle of the car, positive forward [m]",
        ylabel="quasi-static deviatoric stress [kPa]",
    )
    axes.set_xlim(float(view.x[0]), float(view.x[-1]))
    axes.set_ylim(0.0, 1.3 * float(view.sigma.max()) / KPA)
    axes.set_title(title)
    axes.legend(loc="upper center", ncols=3)
    note(figure, "Middle car of the train, all of whose axles act. Eq. (10), no geostatic stress.")
    return figure


@styled
def table4_figure(rows: list[Increase], profile_text: str) -> Figure:
    """Increase of the stress at the subgrade surface over the speed: ours and published."""
    figure = Figure(figsize=(9.4, 5.0), layout="constrained")
    panels = dict(zip(("quasi-static", "dynamic"), figure.subplots(1, 2), strict=True))
    for index, definition in enumerate(DEFINITIONS):
        kind, name = definition.split(", ")
        increases = [row for row in rows if row.definition == definition]
        percent = np.array([row.percent for row in increases])
        reach = np.array([[row.percent - row.low, row.high - row.percent] for row in increases]).T
        speeds = np.array([row.speed / KMH for row in increases])
        style = look(index) | {"marker": MARKERS[index], "markersize": 5}
        shift = 0.25 * (2 * (index % 2) - 1) if reach.any() else 0.0
        panels[kind].errorbar(
            speeds + shift, percent, yerr=np.abs(reach) if reach.any() else None, capsize=3,
            elinewidth=1.0, label=f"mcsettle: {name}", **style,
        )  # fmt: skip
    for kind, axes in panels.items():
        _published(axes, [row for row in rows if row.definition.startswith(kind)])
        axes.set(xlabel="speed [km/h]", ylabel=f"increase of {kind} stress [%]")
        axes.legend(loc="upper left")
    figure.suptitle("Deviatoric stress at the subgrade surface (Table 4)", x=0.01, ha="left")
    meanings = [f"{name.split(', ')[1]}: {text}" for name, text in DEFINITIONS.items()]
    note(
        figure,
        "\n".join(meanings)
        + f"\nDynamic: {profile_text}; bars: P5 to P95 over {REALISATIONS} realisations.",
    )
    return figure


def _published(axes: Axes, rows: list[Increase]) -> None:
    published = {row.speed / KMH: row.published for row in rows if row.published is not None}
    if published:
        axes.plot(
            list(published), list(published.values()), "*", color=COLOURS[6], markersize=11,
            label="published", zorder=5,
        )  # fmt: skip
