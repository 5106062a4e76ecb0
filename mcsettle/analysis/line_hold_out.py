"""How good forecasts of a line are: its last run predicted from those before, beside two baselines.

The baselines are what is done by hand: a straight line through each section's own SDs since its last
tamping, and the section's last SD carried on at the line's mean rate (which also stands in for the
straight line of a section with a single run).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import stats

from mcsettle.analysis.described_growth import Growth
from mcsettle.analysis.line_forecast import FormOfGrowth, line_forecast
from mcsettle.errors import InputError
from mcsettle.railway.line_history import LineHistory
from mcsettle.types import Progress, silent


@dataclass(frozen=True, eq=False)
class HoldOut:
    """Predictions of the last run for the sections not tamped just before it.

    ``rows`` [P] sections of the history; ``measured`` and the predictions ``forecast`` (its mean),
    ``straight`` and ``mean_rate`` [P] m; ``share`` [P] of the predictive distribution, measurement error
    included, below what was measured: uniform where the bands are right. ``forms`` of growth as the runs
    before the last weigh them.
    """

    rows: np.ndarray
    measured: np.ndarray
    forecast: np.ndarray
    straight: np.ndarray
    mean_rate: np.ndarray
    share: np.ndarray
    forms: tuple[FormOfGrowth, ...]

    @property
    def coverage(self) -> float:
        """Share of the sections inside their P5 to P95."""
        return float(np.mean((self.share > 0.05) & (self.share < 0.95)))

    def mean_absolute_error(self) -> dict[str, float]:
        """Mean |predicted − measured| [m] of the forecast and of the baselines."""
        parts = {
            "forecast": self.forecast,
            "straight line": self.straight,
            "mean rate": self.mean_rate,
        }
        return {name: float(np.mean(np.abs(v - self.measured))) for name, v in parts.items()}


def hold_out(
    growths: Callable[[LineHistory], Sequence[Growth]],
    history: LineHistory,
    progress: Progress = silent,
) -> HoldOut:
    """Predict the last run of ``history`` from those before it, by the forms ``growths`` of such a line.

    Raises
    ------
    InputError
        There are too few runs, or every section was tamped just before the last one.
    """
    if len(history.dates) < 2:
        raise InputError("holding out the last run takes at least two dated runs")
    before, days = history.before_last(), history.days
    horizon = float(days[-1] - days[-2]) + 1.0
    forecast = line_forecast(growths(before), before, horizon, progress, float(days[-1]))
    rows = forecast.rows
    scored = np.isnan(history.tamped_on[rows, -1]) & ~np.isnan(history.sd[rows, -1])
    if not scored.any():
        raise InputError("every section was tamped between the last two runs: nothing to predict")
    straight, mean_rate = _baselines(before, rows, float(days[-1]))
    measured = history.sd[rows, -1]
    predicted, weights, error = forecast.predicted, forecast.weights, history.sd_error
    with np.errstate(invalid="ignore"):
        below = stats.norm.cdf((measured[:, None, None] - predicted) / error)
    highest = np.where(np.isfinite(predicted), predicted, 2.0 * np.nanmax(history.sd))
    return HoldOut(
        rows[scored],
        measured[scored],
        np.sum(weights * highest, axis=(1, 2))[scored],
        straight[scored],
        mean_rate[scored],
        np.sum(weights * below, axis=(1, 2))[scored],
        forecast.forms,
    )


def _baselines(history: LineHistory, rows: np.ndarray, day: float) -> tuple[np.ndarray, np.ndarray]:
    """SD [P] m on ``day`` by each section's own straight line, and by the line's mean rate."""
    days, spans = history.days, history.spans
    last, slopes, since = np.zeros(len(rows)), np.full(len(rows), np.nan), np.zeros(len(rows))
    for place, row in enumerate(rows):
        used = (spans[row] == spans[row, -1]) & ~np.isnan(history.sd[row])
        if not used.any():
            used = ~np.isnan(history.sd[row])
        x, y = days[used], history.sd[row, used]
        last[place], since[place] = y[-1], day - x[-1]
        if len(x) > 1:
            slopes[place] = np.polyfit(x, y, 1)[0]
    mean = float(np.nanmean(slopes)) if np.isfinite(slopes).any() else 0.0
    rates = np.where(np.isnan(slopes), mean, slopes)
    return last + rates * since, last + mean * since
