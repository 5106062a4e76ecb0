"""SD of tracks in time on one dense grid of days, whatever days a run has kept."""

import numpy as np
import pandas as pd

from mcsettle.summary.results import KEYS

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
    sets, tracks, day, sd = (history[name].to_numpy() for name in (*KEYS, "day", "sd_mm"))
    order = np.lexsort((day, tracks, sets))
    sets, tracks, day, sd = sets[order], tracks[order], day[order], sd[order]
    starts = np.flatnonzero(np.diff(sets, prepend=-1) | np.diff(tracks, prepend=-1))
    curves = []
    for part_day, part_sd in zip(np.split(day, starts[1:]), np.split(sd, starts[1:]), strict=True):
        after = np.nan if limit is None or part_sd[-1] < limit * (1.0 - 1e-6) else limit
        curves.append(np.interp(days, part_day, part_sd, right=after))
    names = pd.MultiIndex.from_arrays([sets[starts], tracks[starts]], names=KEYS)
    return pd.DataFrame(np.array(curves).T, index=days, columns=names)
