"""Tamping intervals by segment of a line, and the share of each segment that is not known."""

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from mcsettle.report.figures.style import COLOURS, GREY, log_labels, note, styled
from mcsettle.units import DAYS_PER_YEAR

if TYPE_CHECKING:
    from mcsettle.summary.segments import GroundReport


@styled
def grounds_figure(report: "GroundReport") -> Figure:
    """Three panels over the segments, sorted by median: interval, present cost, unknown share."""
    rows = sorted(report.rows, key=lambda row: (np.isnan(row.days[1]), row.days[1]))
    figure = Figure(figsize=(11.0, 8.0), layout="constrained")
    days, cost, unknown = figure.subplots(3, 1, sharex=True, height_ratios=(2.0, 1.4, 0.8))
    place = np.arange(len(rows))
    horizon = report.study.limit.horizon_years
    spread = np.array([row.days for row in rows]) / DAYS_PER_YEAR
    _bands(days, place, np.minimum(spread, horizon))
    days.axhline(report.line.days[1] / DAYS_PER_YEAR, color=COLOURS[1], linestyle="--",
                 label="median of the line")  # fmt: skip
    days.set(yscale="log", ylabel="tamping interval [years]")
    days.legend(loc="upper left")
    _bands(cost, place, np.array([row.cost for row in rows]) / 1e3)
    cost.axhline(report.line.mean_cost / 1e3, color=COLOURS[1], linestyle="--",
                 label="mean of the line")  # fmt: skip
    cost.set(yscale="log", ylabel=f"present cost, Eq. (4)\n[1000 {report.study.currency}/track-km]")
    cost.legend(loc="upper right")
    for axes in (days, cost):
        log_labels(axes.yaxis)
    unknown.bar(place, [100.0 * (1.0 - row.known) for row in rows], color=GREY, width=0.8)
    unknown.set(ylabel="not known [%]", ylim=(0.0, 100.0))
    unknown.set_xticks(place, [row.segment for row in rows], rotation=90, fontsize=6)
    unknown.set_xlabel("segment, by its median interval")
    unknown.set_xlim(-1.0, len(rows))
    figure.suptitle(f"{report.study.title}\n{report.variant}, {report.scenario}")
    note(figure, "Dots: medians; bars: P5 to P95 over grounds (by probability) and realisations. "
         "Not known: probability of grounds that failed or were not run.")  # fmt: skip
    return figure


def _bands(axes: Axes, place: np.ndarray, values: np.ndarray) -> None:
    some = ~np.isnan(values[:, 1])
    axes.vlines(place[some], values[some, 0], values[some, -1], color=COLOURS[5], linewidth=3)
    axes.plot(place[some], values[some, 1], "o", color=COLOURS[0], markersize=3.5)
