"""From the tables of a run to samples of parameter sets × realisations (``estimate.crossed``)."""

import numpy as np
import pandas as pd

from mcsettle.estimate.crossed import CrossedSample
from mcsettle.summary.results import CENSORED, INTERVAL


def sets_of(table: pd.DataFrame) -> np.ndarray:
    """The parameter sets [E] of a table, rising."""
    return np.unique(table["parameter_set"].to_numpy(dtype=int))


def matrix(table: pd.DataFrame, column: str, own: pd.DataFrame | None = None) -> np.ndarray:
    """A column as [E, R], parameter sets × realisations; NaN where empty or missing.

    ``own``: rows that have all sets of the run; a table from which failed rows are gone may lack some.
    """
    sets, row = np.unique(table["parameter_set"].to_numpy(dtype=int), return_inverse=True)
    tracks, track = np.unique(table["realisation"].to_numpy(dtype=int), return_inverse=True)
    if own is not None:
        complete = sets_of(own)
        sets, row = complete, np.searchsorted(complete, sets)[row]
    wide = np.full((len(sets), len(tracks)), np.nan)
    wide[row, track] = table[column].to_numpy(dtype=float, na_value=np.nan)
    return wide


def interval_sample(table: pd.DataFrame) -> CrossedSample:
    """Tamping intervals [days] of one variant and scenario, censored at the horizon."""
    return CrossedSample(matrix(table, INTERVAL), "d", matrix(table, CENSORED))


def effect_sample(table: pd.DataFrame, metric: str, unit: str, own: pd.DataFrame) -> CrossedSample:
    """A paired effect; of a pair with a censored interval nothing is known.

    ``table`` has the pairs of which neither failed; ``own`` all rows.
    """
    values = matrix(table, metric, own)
    paired = ~np.isnan(matrix(table.assign(paired=1.0), "paired", own))
    return CrossedSample(values, unit, np.where(paired & np.isnan(values), -np.inf, np.nan))
