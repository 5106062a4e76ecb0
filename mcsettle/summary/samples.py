"""From the tables of a run to samples of parameter sets × realisations (``estimate.crossed``)."""

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd

from mcsettle.estimate.crossed import CrossedSample
from mcsettle.summary.results import CENSORED, INTERVAL


def sets_of(table: pd.DataFrame) -> np.ndarray:
    """The parameter sets [E] of a table, rising."""
    return np.unique(table["parameter_set"].to_numpy(dtype=int))


def floats(table: pd.DataFrame, column: str) -> np.ndarray:
    """A column as numbers, NaN where empty."""
    return table[column].to_numpy(dtype=float, na_value=np.nan)


def beside(table: pd.DataFrame, other: pd.DataFrame, columns: Sequence[str]) -> list[np.ndarray]:
    """Columns of ``other`` as numbers for the rows of ``table``, by set and realisation.

    NaN where ``other`` has no such row.
    """
    if other.empty:
        return [np.full(len(table), np.nan) for _ in columns]
    most = 1 + max(int(t["realisation"].max()) for t in (table, other))
    wanted, others = (
        t["parameter_set"].to_numpy(dtype=int) * most + t["realisation"].to_numpy(dtype=int)
        for t in (table, other)
    )
    order = np.argsort(others, kind="stable")
    place = np.minimum(np.searchsorted(others, wanted, sorter=order), len(order) - 1)
    there = order[place]
    return [np.where(others[there] == wanted, floats(other, c)[there], np.nan) for c in columns]


def shortening(
    base: np.ndarray, days: np.ndarray, base_end: np.ndarray, end: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Whether the interval of each pair surely shortens, and whether it may.

    ``base``, ``days``: intervals of baseline and scenario [days], NaN where censored, then at
    ``base_end`` and ``end``; all of one shape. Neither of a pair that is NaN throughout.
    """
    latest, earliest = (
        np.where(np.isnan(days), np.inf, days),
        np.where(np.isnan(base), base_end, base),
    )
    shortest, longest = np.where(np.isnan(days), end, days), np.where(np.isnan(base), np.inf, base)
    return latest < earliest, shortest < longest


def matrices(
    table: pd.DataFrame, columns: Sequence[str | np.ndarray], sets: np.ndarray | None = None
) -> list[np.ndarray]:
    """Columns as [E, R] each, parameter sets × realisations; NaN where empty or missing.

    ``columns``: their names, or numbers in the order of the rows. ``sets`` [E] of the run; a table
    from which failed rows are gone may lack some.
    """
    rows, row = np.unique(table["parameter_set"].to_numpy(dtype=int), return_inverse=True)
    tracks, track = np.unique(table["realisation"].to_numpy(dtype=int), return_inverse=True)
    if sets is not None:
        rows, row = sets, np.searchsorted(sets, rows)[row]
    matrices = []
    for column in columns:
        wide = np.full((len(rows), len(tracks)), np.nan)
        wide[row, track] = floats(table, column) if isinstance(column, str) else column
        matrices.append(wide)
    return matrices


def matrix(table: pd.DataFrame, column: str, sets: np.ndarray | None = None) -> np.ndarray:
    """One column as ``matrices`` has it."""
    return matrices(table, (column,), sets)[0]


def interval_sample(table: pd.DataFrame) -> CrossedSample:
    """Tamping intervals [days] of one variant and scenario, censored at the horizon."""
    days, ends = matrices(table, (INTERVAL, CENSORED))
    return CrossedSample(days, "d", ends)


def effect_samples(
    table: pd.DataFrame, units: Mapping[str, str], sets: np.ndarray
) -> dict[str, CrossedSample]:
    """Paired effects by metric, in ``units``; of a pair with a censored interval nothing is known.

    ``table`` has the pairs of which neither failed; ``sets`` [E] are those of the run.
    """
    *effects, pairs = matrices(table, (*units, np.ones(len(table))), sets)
    paired = ~np.isnan(pairs)
    return {
        metric: CrossedSample(values, unit, np.where(paired & np.isnan(values), -np.inf, np.nan))
        for (metric, unit), values in zip(units.items(), effects, strict=True)
    }
