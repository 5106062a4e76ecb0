"""SD of tracks in time on one dense grid of days, whatever days a run has kept."""

import numpy as np
import pandas as pd

POINTS = 161  # days of the grid


def day_grid(history: pd.DataFrame) -> np.ndarray:
    """Days [D] from 0 to the last day of any track in ``history``."""
    return np.linspace(0.0, float(history["day"].max()), POINTS)


def on_grid(history: pd.DataFrame, days: np.ndarray, limit: float | None) -> pd.DataFrame:
    """SD [mm] of every track (columns) on ``days`` (rows): straight between the days that are kept.

    Parameters
    ----------
    history : rows of one variant and scenario; the last of every track is its tamping, or the horizon
    days : ndarray, shape [D], days
    limit : mm, kept after a tamping; None: nothing is known after the last day
    """
    keys = ["parameter_set", "realisation"]
    columns = {}
    for key, track in history.sort_values("day").groupby(keys, sort=True):
        day, sd = track["day"].to_numpy(dtype=float), track["sd_mm"].to_numpy(dtype=float)
        after = np.nan if limit is None or sd[-1] < limit * (1.0 - 1e-6) else limit
        columns[key] = np.interp(days, day, sd, right=after)
    names = pd.MultiIndex.from_tuples(list(columns), names=keys)
    return pd.DataFrame(np.array(list(columns.values())).T, index=days, columns=names)
