"""Where a line's profiles grew between two runs, by wavelength, and where Step B says that they grow.

Of each section the first and the last run of its present span that have a profile. Measured increments
hold the noise of both runs, which lowers their correlation with the first profile.
"""

import numpy as np
import pandas as pd

from mcsettle.analysis.growth_courses import SteppedGrowth
from mcsettle.analysis.line_forecast import LineForecast
from mcsettle.railway.increments import increment_by_wave
from mcsettle.railway.line_history import LineHistory

BANDS = 4  # equal in log wavelength
COLUMNS = ("shortest_m", "longest_m", "growth", "correlation")


def growth_by_wave(
    growth: SteppedGrowth, history: LineHistory, forecast: LineForecast, wavenumbers: np.ndarray
) -> pd.DataFrame | None:
    """A row for each band of wavelengths; None where no section has two profiles of one span.

    ``growth``: SD of the increment over that of the first profile, ``correlation`` of both, over all such
    sections; ``model_growth``, ``model_correlation``: of the increments by Step B from the same profiles
    over the same days, at each section's mean log factor.
    """
    factors = np.exp(forecast.factors.sections @ forecast.factors.logs)
    first, second, model = [], [], []
    for (start, end), places in _pairs(history, forecast.rows).items():
        rows = forecast.rows[places]
        days = history.days[end] - history.days[start]
        first.append(history.amplitudes[rows, start])
        second.append(history.amplitudes[rows, end])
        model.append(growth.carried(rows, start, days, factors[places]))
    if not first:
        return None
    wavelengths = 2.0 * np.pi / wavenumbers
    edges = np.geomspace(wavelengths.min(), wavelengths.max() * (1.0 + 1e-9), BANDS + 1)
    edges[0] *= 1.0 - 1e-9
    before = np.concatenate(first)
    tables = [
        pd.DataFrame(
            increment_by_wave(before, np.concatenate(after), wavenumbers, edges), columns=COLUMNS
        )
        for after in (second, model)
    ]
    return tables[0].merge(
        tables[1].rename(columns={name: f"model_{name}" for name in COLUMNS[2:]}),
        on=list(COLUMNS[:2]),
        how="left",
    )


def _pairs(history: LineHistory, rows: np.ndarray) -> dict[tuple[int, int], np.ndarray]:
    """Places among ``rows`` by first and last run with a profile in the present span."""
    known = ~np.isnan(history.amplitudes[rows]).any(axis=2)
    spans = history.spans[rows]
    known &= spans == spans[:, [-1]]
    n_runs = known.shape[1]
    first, last = np.argmax(known, axis=1), n_runs - 1 - np.argmax(known[:, ::-1], axis=1)
    two = known.sum(axis=1) >= 2
    return {
        (int(start), int(end)): np.flatnonzero(two & (first == start) & (last == end))
        for start, end in np.unique(np.stack([first[two], last[two]], axis=1), axis=0)
    }
