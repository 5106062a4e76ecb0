"""From the tables of a run to how its tracks went, as arrays (``estimate.observation.Course``)."""

import numpy as np
import pandas as pd

from mcsettle.estimate.observation import Course
from mcsettle.summary.results import INTERVAL, KEYS
from mcsettle.summary.samples import floats


def courses(variant: str, realisations: pd.DataFrame, history: pd.DataFrame) -> dict[str, Course]:
    """Courses of the tracks of one variant, by scenario."""
    rows = realisations[realisations["variant"] == variant]
    if not history.empty:
        history = history[history["variant"] == variant]
    return {
        str(scenario): _course(
            of_scenario, history if history.empty else history[history["scenario"] == scenario]
        )
        for scenario, of_scenario in rows.groupby("scenario", sort=False, observed=True)
    }


def _course(rows: pd.DataFrame, history: pd.DataFrame) -> Course:
    rows = rows.sort_values(KEYS)
    shape = rows["parameter_set"].nunique(), rows["realisation"].nunique()
    censored = (rows["status"] == "censored").to_numpy()
    days = np.where(censored, np.inf, floats(rows, INTERVAL)).reshape(shape)
    if history.empty:
        nothing = np.full((*shape, 1), np.nan)
        return Course(days, nothing, nothing)
    history = history.sort_values([*KEYS, "day"])
    track = pd.MultiIndex.from_frame(rows[KEYS]).get_indexer(
        pd.MultiIndex.from_frame(history[KEYS])
    )
    history, track = history[track >= 0], track[track >= 0]
    first = np.searchsorted(track, track)  # where the records of the same track begin
    place = np.arange(len(track)) - first
    recorded = np.full((2, len(rows), int(np.max(place, initial=0)) + 1), np.nan)
    recorded[:, track, place] = history["day"].to_numpy(), history["sd_mm"].to_numpy()
    return Course(days, *recorded.reshape(2, *shape, -1))
