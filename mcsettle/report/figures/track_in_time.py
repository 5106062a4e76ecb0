"""Single tracks in time: profiles at the limit, two days of mixed traffic, tamping as a saw-tooth."""

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from mcsettle.report.figures.results import WIDTH, MixedDays, Profile, Swing, finish, frame, short
from mcsettle.report.figures.style import COLOURS, GREY, look, styled


@styled
def profiles_figure(profiles: Sequence[Profile]) -> Figure:
    """The same track in every scenario when it reaches its limit, one panel each (Fig. 11)."""
    figure = Figure(figsize=(WIDTH, 0.9 + 1.25 * len(profiles)), layout="constrained")
    panels = figure.subplots(len(profiles), 1, sharex=True, sharey=True, squeeze=False)[:, 0]
    for index, (axes, profile) in enumerate(zip(panels, profiles, strict=True)):
        axes.plot(profile.x, profile.initial, color=GREY, linewidth=0.8, label="before traffic")
        axes.plot(profile.x, profile.final, color=COLOURS[index % len(COLOURS)], label="at the end")
        when = "limit not reached" if profile.days is None else f"limit on day {profile.days:.0f}"
        axes.set_title(f"{short(profile.label, 30)}: {when}")
        axes.yaxis.set_major_locator(MaxNLocator(4))
    panels[0].legend(loc="upper right", ncols=2, fontsize=8)
    panels[0].invert_yaxis()  # positive down, as the track lies
    panels[-1].set_xlabel("x along the track [m]")
    figure.supylabel("profile, positive down [mm]", fontsize=9)
    return figure


@styled
def mixed_figure(view: MixedDays) -> Figure:
    """SD within a few days of traffic, each train's hours shaded (Fig. 18)."""
    figure, axes = frame()
    names = list(dict.fromkeys(name for name, _, _ in view.blocks))
    for name, first, last in view.blocks:
        place = names.index(name)
        axes.axvspan(first, last, color=COLOURS[place % len(COLOURS)], alpha=0.18, linewidth=0)
    for place, name in enumerate(names):
        axes.fill_between([], [], [], color=COLOURS[place % len(COLOURS)], alpha=0.3,
                          label=short(name))  # fmt: skip
    axes.plot(view.days, view.sd, color="k", linewidth=1.1, label="SD of the track")
    axes.set(xlabel="days of traffic", ylabel="SD of the profile [mm]")
    axes.set_xlim(float(view.days[0]), float(view.days[-1]))
    axes.ticklabel_format(useOffset=False)
    finish(axes, "upper left")
    return figure


@styled
def concept_figure(
    label: str, base: tuple[float, float], other: tuple[float, float], sd: float, limit: float
) -> Figure:
    """Two first intervals and equal later ones (Fig. 9): ``base`` and ``other`` (first, later) days."""
    figure, axes = frame(2.9)
    for index, (first, later) in enumerate((base, other)):
        days = [0.0, first, first, first + later, first + later, first + 1.4 * later]
        growth = limit - sd
        levels = [sd, limit, sd, limit, sd, sd + 0.4 * growth]
        name = "baseline" if index == 0 else short(label)
        axes.plot(days, levels, label=f"{name}: T = {first:.0f} d", **look(index))
    axes.axhline(limit, color=GREY, linestyle=(0, (4, 2)), linewidth=1.0)
    axes.annotate("limit", (0.01, limit), xycoords=("axes fraction", "data"), va="bottom",
                  xytext=(0, 2), textcoords="offset points")  # fmt: skip
    axes.set(xlabel="days", ylabel="SD of the profile [mm]", ylim=(sd, limit + 0.45 * (limit - sd)))
    axes.set_xlim(left=0.0)
    finish(axes, "upper right")
    return figure


@styled
def swings_figure(swings: Sequence[Swing], centre: float | None, label: str) -> Figure:
    """Bars from the low to the high end about ``centre`` (tornado), or shares from 0 (None)."""
    figure, axes = frame(1.1 + 0.36 * max(len(swings), 1))
    for row, swing in enumerate(swings):
        if centre is None:
            axes.barh(row, swing.high, color=COLOURS[0], alpha=0.75, height=0.6)
            axes.errorbar(swing.high, row, xerr=swing.error, color="k", capsize=2.5, linewidth=1.0)
            continue
        for place, value in enumerate((swing.low, swing.high)):
            axes.barh(row, value - centre, left=centre, height=0.6, color=COLOURS[place], alpha=0.8)
    if centre is not None:
        for place, name in enumerate(("input at P10", "input at P90")):
            axes.barh([np.nan], [np.nan], color=COLOURS[place], alpha=0.8, label=name)
        axes.axvline(centre, color="k", linewidth=0.8)
        axes.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2, borderaxespad=0.1)
    axes.set(yticks=range(len(swings)), ylim=(len(swings) - 0.4, -0.6), xlabel=label)
    axes.set_yticklabels([short(s.label, 26) for s in swings])
    axes.xaxis.set_major_locator(MaxNLocator(5))
    return figure
