"""Pictures of a finished run: SD in time, survival of the interval, spreads of the effects.

Narrow figures, so that their text stays legible on a telephone and in print.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from textwrap import fill
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from mcsettle.report.figures.style import COLOURS, GREY, look, styled


@dataclass(frozen=True)
class Fan:
    """SD in time of one scenario: ``days`` [D]; ``quantiles`` [5, D] mm at P5, P25, P50, P75, P95.

    A tamped track stays at the limit. ``mgt_per_day`` turns days into tonnage; ``tint`` numbers the
    scenario's colour; ``difference`` [3, D] mm at P25, P50, P75 is from the baseline on the same tracks.
    """

    label: str
    days: np.ndarray
    quantiles: np.ndarray
    mgt_per_day: float
    tint: int = 0
    difference: np.ndarray | None = None


@dataclass(frozen=True)
class Survival:
    """Share of tracks not yet tamped: steps at ``days`` [n] to ``share`` [n] with its 95 % band.

    ``end`` [days] is how far the tracks were followed; ``published`` [days] an interval to set beside.
    """

    label: str
    days: np.ndarray
    share: np.ndarray
    low: np.ndarray
    high: np.ndarray
    end: float
    tint: int = 0
    published: float | None = None


@dataclass(frozen=True)
class Spread:
    """Quantiles of one quantity in one scenario: P5, P25, P50, P75, P95 (None: nothing known).

    An infinite one is beyond what is known. ``dots`` [n]: values that stand for equal shares.
    """

    label: str
    quantiles: tuple[float, ...] | None
    tint: int = 0
    published: float | None = None
    dots: np.ndarray | None = None


@dataclass(frozen=True)
class Rate:
    """Rate of change of the SD of one scenario in time: ``days`` [D], ``rate`` [3, D] mm/year."""

    label: str
    days: np.ndarray
    rate: np.ndarray
    tint: int = 0


@dataclass(frozen=True)
class Profile:
    """One track along ``x`` [X] m: ``initial`` and ``final`` [X] mm in the band, ``days`` it took."""

    label: str
    x: np.ndarray
    initial: np.ndarray
    final: np.ndarray
    days: float | None


@dataclass(frozen=True)
class MixedDays:
    """SD of one track within a few days of mixed traffic, and which train ran when.

    ``days`` [D], ``sd`` [D] mm; ``blocks``: name, first and last day of every run of one service.
    """

    days: np.ndarray
    sd: np.ndarray
    blocks: tuple[tuple[str, float, float], ...]


@dataclass(frozen=True)
class Convergence:
    """A median with its 95 % interval as the sample grows: all [n]."""

    label: str
    counts: np.ndarray
    value: np.ndarray
    low: np.ndarray
    high: np.ndarray
    tint: int = 0


@dataclass(frozen=True)
class Swing:
    """What one input does to one number: ``low`` and ``high`` end, or a share with its ``error``."""

    label: str
    low: float
    high: float
    error: float = 0.0


WIDTH = 4.6  # inches: 442 px in a browser
HEIGHT = 3.3
LABEL = 40  # characters of a scenario's title that a picture shows
BAND: Any = {"linewidth": 0}


@styled
def fan_figure(fans: Sequence[Fan], limit: float) -> Figure:
    """SD against time and tonnage, and below it what each scenario adds on the same tracks."""
    paired = [fan for fan in fans if fan.difference is not None]
    if not paired:
        figure, axes = frame()
    else:
        figure = Figure(figsize=(WIDTH, HEIGHT + 1.6), layout="constrained")
        axes, below = figure.subplots(2, 1, sharex=True, height_ratios=(2.2, 1.0))
        _draw_differences(below, paired)
    draw_fans(axes, fans, limit)
    if fans:
        per_day = fans[0].mgt_per_day
        to_tonnage = (lambda days: days * per_day, lambda tonnage: tonnage / per_day)
        upper = axes.secondary_xaxis("top", functions=to_tonnage)
        upper.set_xlabel(f"traffic of {short(fans[0].label, 30)} [MGT]")
        upper.spines["top"].set_visible(True)
    if paired:
        axes.set_xlabel("")
        axes.tick_params(labelbottom=True)
    return figure


def _draw_differences(axes: Axes, fans: Sequence[Fan]) -> None:
    """SD above the baseline's on the same track: medians and the middle half."""
    for fan in fans:
        assert fan.difference is not None
        low, middle, high = fan.difference
        style = look(fan.tint)
        axes.fill_between(fan.days, low, high, color=style["color"], alpha=0.13, **BAND)
        axes.plot(fan.days, middle, **style)
    axes.axhline(0.0, color=GREY, linewidth=0.8)
    axes.yaxis.set_major_locator(MaxNLocator(4))
    axes.set(xlabel="days of traffic", ylabel="above the\nbaseline [mm]")


@styled
def survival_figure(curves: Sequence[Survival]) -> Figure:
    """Share of tracks not yet tamped against time, with its 95 % confidence band."""
    figure, axes = frame()
    draw_survival(axes, curves)
    return figure


@styled
def spreads_figure(spreads: Sequence[Spread], label: str) -> Figure:
    """P5–P95, quartiles and median of each scenario; the distribution above it where it has dots."""
    dotted = any(spread.dots is not None for spread in spreads)
    tall = 1.2 + (0.75 if dotted else 0.5) * max(len(spreads), 1)
    figure, axes = frame(max(tall, 1.9))
    draw_spreads(axes, spreads, label)
    return figure


@styled
def rates_figure(rates: Sequence[Rate], window: float) -> Figure:
    """Moving average of the rate of change of the SD: medians, and the first scenario's band."""
    figure, axes = frame()
    for index, rate in enumerate(rates):
        low, middle, high = rate.rate
        style = look(rate.tint)
        if index == 0:
            axes.fill_between(rate.days, low, high, color=style["color"], alpha=0.15, **BAND)
        axes.plot(rate.days, middle, label=short(rate.label), **style)
    axes.set(xlabel="days of traffic", ylabel=f"SD change, mean of {window:g} days\n[mm/year]")
    finish(axes)
    return figure


@styled
def overview_figure(
    fans: Sequence[Fan],
    limit: float,
    curves: Sequence[Survival],
    spreads: Sequence[Spread],
    label: str,
    title: str,
) -> Figure:
    """The results on one wide picture: SD in time, survival, and a spread if there is one."""
    figure = Figure(figsize=(12.0 if spreads else 8.4, 4.2), layout="constrained")
    panels = figure.subplots(1, 3 if spreads else 2)
    draw_fans(panels[0], fans, limit)
    draw_survival(panels[1], curves)
    if spreads:
        draw_spreads(panels[2], spreads, label)
    _one_legend(figure, panels)
    figure.suptitle(short(title, 150), x=0.01, ha="left")
    return figure


def _one_legend(figure: Figure, panels: Sequence[Axes]) -> None:
    """Every name once, below all panels: within them two legends would hide the curves."""
    for legend in (*figure.legends, *(axes.get_legend() for axes in panels)):
        if legend is not None:
            legend.remove()
    named: dict[str, Any] = {}
    for axes in panels:
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True):
            named.setdefault(label, handle)
    if named:
        columns = min(len(named), 5 if len(panels) > 2 else 3)
        figure.legend(named.values(), named, loc="outside lower center", ncols=columns)


@styled
def convergence_figure(curves: Sequence[Convergence], label: str) -> Figure:
    """Medians with their 95 % intervals against the number of tracks."""
    figure, axes = frame()
    for index, curve in enumerate(curves):
        shift = 1.0 + 0.02 * (index - (len(curves) - 1) / 2.0)
        below = np.nan_to_num(curve.value - curve.low)
        above = np.nan_to_num(curve.high - curve.value)
        axes.errorbar(
            curve.counts * shift, curve.value, yerr=np.abs([below, above]), marker="o",
            markersize=3, capsize=2, elinewidth=0.9, label=short(curve.label), **look(curve.tint),
        )  # fmt: skip
    axes.set_xscale("log", base=2)
    counts = sorted({int(n) for curve in curves for n in curve.counts})
    axes.set_xticks(counts, [str(n) for n in counts])
    axes.minorticks_off()
    axes.set(xlabel="realisations", ylabel=label)
    finish(axes)
    return figure


def draw_fans(axes: Axes, fans: Sequence[Fan], limit: float) -> None:
    """Medians of all, P5–P95 and quartiles of the first."""
    for index, fan in enumerate(fans):
        p5, p25, p50, p75, p95 = fan.quantiles
        style = look(fan.tint)
        if index == 0:
            axes.fill_between(fan.days, p5, p95, color=style["color"], alpha=0.14, **BAND)
            axes.fill_between(fan.days, p25, p75, color=style["color"], alpha=0.2, **BAND)
        axes.plot(fan.days, p50, label=short(fan.label), **style)
    if _far_off(fans, limit):  # it would press the curves together
        axes.annotate(
            f"limit: {limit:g} mm, above", (0.01, 0.99), xycoords="axes fraction", va="top"
        )
    else:
        axes.axhline(limit, color=GREY, linestyle=(0, (4, 2)), linewidth=1.0)
        axes.annotate(
            "limit", (0.99, limit), xycoords=("axes fraction", "data"), ha="right", va="bottom",
            xytext=(0, 2), textcoords="offset points",
        )  # fmt: skip
    axes.margins(y=0.12)
    axes.set(xlabel="days of traffic", ylabel="SD of the profile [mm]")
    finish(axes, "lower right")


def _far_off(fans: Sequence[Fan], limit: float) -> bool:
    """Whether no track comes half the way from its first SD to the limit."""
    upper = [fan.quantiles[[2, 4]].ravel() for fan in fans]
    values = np.concatenate(upper) if upper else np.empty(0)
    values = values[np.isfinite(values)]
    return values.size > 0 and bool(np.ptp(values) < 0.5 * (limit - values.min()))


def draw_survival(axes: Axes, curves: Sequence[Survival]) -> None:
    """Steps of each curve; a dot on the median line where a value is published."""
    far = max((float(c.days[-1]) for c in curves if len(c.days)), default=0.0)
    for curve in curves:
        end = min(curve.end, 1.05 * far) if far else curve.end
        days = np.concatenate([[0.0], curve.days, [max(end, *curve.days[-1:], 1.0)]])
        parts = [np.concatenate([[1.0], y, y[-1:]]) if len(y) else np.ones(2)
                 for y in (curve.share, curve.low, curve.high)]  # fmt: skip
        style = look(curve.tint)
        axes.step(days, parts[0], where="post", label=short(curve.label), **style)
        axes.fill_between(days, parts[1], parts[2], step="post", color=style["color"], alpha=0.12,
                          **BAND)  # fmt: skip
        if curve.published is not None:
            axes.plot(
                curve.published, 0.5, "o", color=style["color"], markeredgecolor="k", zorder=3
            )
    axes.axhline(0.5, color=GREY, linewidth=0.6)
    axes.set(
        xlabel="days of traffic", ylabel="share of realisations not yet tamped", ylim=(0.0, 1.02)
    )
    axes.set_xlim(left=0.0)
    if any(c.published is not None for c in curves):
        axes.plot([], [], "o", color="w", markeredgecolor="k", label="published")
    finish(axes, "upper right")


def draw_spreads(axes: Axes, spreads: Sequence[Spread], label: str) -> None:
    """One row a scenario."""
    for row, spread in enumerate(spreads):
        colour = COLOURS[spread.tint % len(COLOURS)]
        if spread.dots is not None:
            heights = _stacked(spread.dots, spreads)
            axes.plot(spread.dots, row - 0.16 - 0.085 * heights, "o", color=colour, markersize=3.2,
                      alpha=0.75, markeredgewidth=0)  # fmt: skip
        if spread.quantiles is not None:
            _draw_quantiles(axes, row, spread.quantiles, colour)
        else:
            axes.annotate("not known", (0.5, row), xycoords=("axes fraction", "data"),
                          ha="center", va="center", color=GREY)  # fmt: skip
        if spread.published is not None:
            axes.plot(spread.published, row, "o", color=colour, markeredgecolor="k", zorder=3)
    axes.axvline(0.0, color=GREY, linewidth=0.8)
    axes.set(yticks=range(len(spreads)), ylim=(len(spreads) - 0.4, -0.9), xlabel=label)
    axes.set_yticklabels([fill(short(s.label), 17) for s in spreads])
    axes.xaxis.set_major_locator(MaxNLocator(5))
    if any(s.published is not None for s in spreads):
        axes.plot([], [], "o", color="w", markeredgecolor="k", label="published")
        axes.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), borderaxespad=0.1)


def _draw_quantiles(axes: Axes, row: int, quantiles: tuple[float, ...], colour: str) -> None:
    """Line P5 to P95, bar of the middle half, mark of the median; an arrow where an end is not known."""
    finite = [q for q in quantiles if np.isfinite(q)]
    ends = [q if np.isfinite(q) else finite[-1] for q in quantiles]
    p5, p25, p50, p75, p95 = ends
    axes.plot([p5, p95], [row, row], color=colour, linewidth=1.5, solid_capstyle="butt")
    axes.plot([p25, p75], [row, row], color=colour, linewidth=6.5, alpha=0.5,
              solid_capstyle="butt")  # fmt: skip
    if np.isfinite(quantiles[2]):
        axes.plot(p50, row, "|", color=colour, markersize=13, markeredgewidth=2.2)
    if len(finite) < len(quantiles):
        axes.annotate("", xytext=(finite[-1], row), xy=(1.0, row), color=colour,
                      xycoords=("axes fraction", "data"), textcoords="data",
                      arrowprops={"arrowstyle": "->", "color": colour, "linestyle": ":"})  # fmt: skip


def _stacked(dots: np.ndarray, spreads: Sequence[Spread]) -> np.ndarray:
    """How many dots [n] of a row lie below each, where they would lie upon one another."""
    every = np.concatenate([s.dots for s in spreads if s.dots is not None])
    width = max(float(np.ptp(every)) / 55.0, 1e-300)
    heights = np.zeros(len(dots))
    for i in range(1, len(dots)):
        near = dots[i] - dots[:i] < width
        heights[i] = 0.0 if not near.any() else heights[:i][near].max() + 1.0
    return heights


def frame(height: float = HEIGHT) -> tuple[Figure, Axes]:
    """A narrow figure with one pair of axes."""
    figure = Figure(figsize=(WIDTH, height), layout="constrained")
    axes = figure.add_subplot()
    axes.xaxis.set_major_locator(MaxNLocator(6))
    return figure, axes


def finish(axes: Axes, place: Any = "best") -> None:
    """The legend, if there is anything to tell apart."""
    handles, _ = axes.get_legend_handles_labels()
    if len(handles) > 6:
        axes.figure.legend(loc="outside lower center", ncols=2)
    elif handles:
        axes.legend(loc=place)


def short(text: str, length: int = LABEL) -> str:
    """A title cut to what a picture has room for, without line breaks."""
    printable = "".join(c if c.isprintable() else " " for c in text)
    words = " ".join(printable.split()) or "–"
    return words if len(words) <= length else words[: length - 2].rstrip() + " …"
