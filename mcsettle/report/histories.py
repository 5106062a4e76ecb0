"""SD of tracks in time on one dense grid of days, whatever days a run has kept."""

import numpy as np
import pandas as pd

POINTS = 161  # days of the grid


def day_grid(last: float) -> np.ndarray:
    """Days [D] from 0 to the ``last`` day of any track."""
    return np.linspace(0.0, last, POINTS)


def on_grid(history: pd.DataFrame, days: np.ndarray, limit: float | None) -> pd.DataFrame:
    """SD [mm] of every track (columns) on ``days`` (rows): straight between the days that are kept.

    Parameters
    ----------
    history : rows of one variant and scenario; the last of every track is its tamping, or the horizon
    days : ndarray, shape [D], days
    limit : mm, kept after a tamping; None: nothing is known after the last day
    """
    keys = ["parameter_set", "realisation"]
    columns = (history[name].to_numpy() for name in (*keys, "day", "sd_mm"))
    sets, tracks, day, sd = columns
    order = np.lexsort((day, tracks, sets))
    sets, tracks, day, sd = sets[order], tracks[order], day[order], sd[order]
    starts = np.flatnonzero(np.diff(sets, prepend=-1) | np.diff(tracks, prepend=-1))
    curves = []
    for own_day, own_sd in zip(np.split(day, starts[1:]), np.split(sd, starts[1:]), strict=True):
        after = np.nan if limit is None or own_sd[-1] < limit * (1.0 - 1e-6) else limit
        curves.append(np.interp(days, own_day, own_sd, right=after))
    names = pd.MultiIndex.from_arrays([sets[starts], tracks[starts]], names=keys)
    return pd.DataFrame(np.array(curves).T, index=days, columns=names)
