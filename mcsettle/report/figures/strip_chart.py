"""A line as a strip: SD now and its limit along the chainage, and below when each section is due."""

from datetime import date, timedelta

import numpy as np
from matplotlib.figure import Figure

from mcsettle.railway.line_history import LineHistory
from mcsettle.report.figures.style import COLOURS, GREY, note, styled
from mcsettle.units import DAYS_PER_YEAR, MM


@styled
def strip_chart(
    history: LineHistory, quantiles: np.ndarray, rows: np.ndarray, horizon: float
) -> Figure:
    """SD of the last run above, P5 to P95 of the date of tamping below.

    ``quantiles`` [P, 3] days from the last run to the limit of the sections ``rows`` [P], inf beyond
    ``horizon`` [days].
    """
    figure = Figure(figsize=(11.0, 5.6), layout="constrained")
    upper, lower = figure.subplots(2, 1, sharex=True)
    middle = 0.5 * (history.chainage_from + history.chainage_to) / 1000.0
    width = (history.chainage_to - history.chainage_from) / 1000.0
    beyond = history.last_sd >= history.sd_limit
    colour = np.where(beyond, COLOURS[1], COLOURS[0])
    upper.bar(middle, history.last_sd / MM, width, color=colour, edgecolor="white", linewidth=0.3)
    edges = np.append(history.chainage_from, history.chainage_to[-1]) / 1000.0
    upper.stairs(history.sd_limit / MM, edges, color=GREY, baseline=None, label="limit")
    out = history.excluded != ""
    for axes in (upper, lower):
        for low, high in zip(history.chainage_from[out], history.chainage_to[out], strict=True):
            axes.axvspan(low / 1000.0, high / 1000.0, color="#EEEEEE", zorder=0)
    upper.set(ylabel="SD, last run [mm]")
    upper.set_title(f"SD on {history.dates[-1]}; above its limit in orange")
    upper.legend(loc="upper right")
    last, years = history.dates[-1], horizon / DAYS_PER_YEAR
    capped = np.minimum(quantiles, horizon) / DAYS_PER_YEAR
    x = middle[rows]
    lower.vlines(x, capped[:, 0], capped[:, 2], color=COLOURS[0], linewidth=2.2, alpha=0.55)
    known = np.isfinite(quantiles[:, 1])
    lower.plot(x[known], capped[known, 1], "o", color=COLOURS[0], markersize=3)
    open_ended = ~np.isfinite(quantiles[:, 2])
    lower.plot(x[open_ended], np.full(open_ended.sum(), years), "^", color=GREY, markersize=4)
    ticks = np.arange(0.0, years + 0.5, max(1.0, np.ceil(years / 8.0)))
    lower.set_yticks(ticks, [_year(last, tick) for tick in ticks])
    lower.set(ylabel="limit reached", xlabel="chainage [km]", ylim=(-0.02 * years, 1.04 * years))
    lower.set_title("date at which the limit is reached: P5 to P95, dot: P50, triangle: P95 later")
    note(
        figure,
        "Grey: left out. From the last run on, each section at its own rate, pooled over the line.",
    )
    return figure


def _year(start: date, years: float) -> str:
    return (start + timedelta(days=years * DAYS_PER_YEAR)).strftime("%Y-%m")
