"""A line as a strip: SD now and its limit along the chainage, and below when each section is due."""

from datetime import date, timedelta

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from mcsettle.railway.line_history import LineHistory
from mcsettle.report.figures.style import COLOURS, GREY, note, styled
from mcsettle.units import DAYS_PER_YEAR, MM


@styled
def strip_chart(
    history: LineHistory, quantiles: np.ndarray, rows: np.ndarray, horizon: float
) -> Figure:
    """SD of the last run above, P5 to P95 of the date of tamping below, track by track.

    ``quantiles`` [P, 3] days from the last run to the limit of the sections ``rows`` [P], inf beyond
    ``horizon`` [days].
    """
    tracks = list(dict.fromkeys(history.track))
    figure = Figure(figsize=(11.0, 5.6 * len(tracks)), layout="constrained")
    axes = figure.subplots(2 * len(tracks), 1, squeeze=False, sharex=True)[:, 0]
    for upper, lower, track in zip(axes[::2], axes[1::2], tracks, strict=True):
        _roughness(upper, history, track)
        here = history.track[rows] == track
        _dates(lower, history, quantiles[here], rows[here], horizon, track)
    note(
        figure,
        "Grey: left out. From the last run on, each section at its own rate, pooled over the line.",
    )
    return figure


def _roughness(axes: Axes, history: LineHistory, track: str) -> None:
    """SD of the last run of a track, its limit, and what is left out."""
    here = history.track == track
    middle = 0.5 * (history.chainage_from + history.chainage_to) / 1000.0
    width = history.lengths / 1000.0
    colour = np.where(history.last_sd >= history.sd_limit, COLOURS[1], COLOURS[0])
    axes.bar(
        middle[here], (history.last_sd / MM)[here], width[here], color=colour[here],
        edgecolor="white", linewidth=0.3,
    )  # fmt: skip
    label: str | None = "limit"
    for part in history.stretches:
        if history.track[part.start] == track:
            edges = np.append(history.chainage_from[part], history.chainage_to[part][-1]) / 1000.0
            axes.stairs(history.sd_limit[part] / MM, edges, color=GREY, baseline=None, label=label)
            label = None
    _left_out(axes, history, track)
    axes.set(ylabel="SD, last run [mm]")
    axes.set_title(f"{_of(track)}SD on {history.dates[-1]}; above its limit in orange")
    axes.legend(loc="upper right")


def _dates(
    axes: Axes,
    history: LineHistory,
    quantiles: np.ndarray,
    rows: np.ndarray,
    horizon: float,
    track: str,
) -> None:
    """P5 to P95 of the date of tamping of the sections ``rows`` of a track."""
    last, years = history.dates[-1], horizon / DAYS_PER_YEAR
    capped = np.minimum(quantiles, horizon) / DAYS_PER_YEAR
    x = 0.5 * (history.chainage_from + history.chainage_to)[rows] / 1000.0
    axes.vlines(x, capped[:, 0], capped[:, 2], color=COLOURS[0], linewidth=2.2, alpha=0.55)
    reached = np.isfinite(quantiles[:, 1])
    axes.plot(x[reached], capped[reached, 1], "o", color=COLOURS[0], markersize=3)
    open_ended = ~np.isfinite(quantiles[:, 2])
    axes.plot(x[open_ended], np.full(open_ended.sum(), years), "^", color=GREY, markersize=4)
    ticks = np.arange(0.0, years + 0.5, max(1.0, np.ceil(years / 8.0)))
    axes.set_yticks(ticks, [_year(last, tick) for tick in ticks])
    axes.set(ylabel="limit reached", xlabel="chainage [km]", ylim=(-0.02 * years, 1.04 * years))
    _left_out(axes, history, track)
    axes.set_title(
        f"{_of(track)}date at which the limit is reached: P5 to P95, dot: P50, triangle: P95 later"
    )


def _left_out(axes: Axes, history: LineHistory, track: str) -> None:
    out = (history.excluded != "") & (history.track == track)
    for low, high in zip(history.chainage_from[out], history.chainage_to[out], strict=True):
        axes.axvspan(low / 1000.0, high / 1000.0, color="#EEEEEE", zorder=0)


def _of(track: str) -> str:
    return f"{track}: " if track else ""


def _year(start: date, years: float) -> str:
    return (start + timedelta(days=years * DAYS_PER_YEAR)).strftime("%Y-%m")
