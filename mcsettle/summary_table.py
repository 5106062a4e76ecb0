"""The ``summary`` table: every number of the summary with its Monte Carlo error, one row each.

Depends on: estimate, summary.
"""

from typing import Any

from mcsettle.summary import SummaryRow


def summary_columns(rows: list[SummaryRow]) -> dict[str, list[Any]]:
    """Columns of the ``summary`` table, in the order of ``rows``."""
    flat = [
        (row, statistic)
        for row in rows
        for statistic in (*row.statistics, *row.spread, *row.conditioned)
    ]
    columns: dict[str, list[Any]] = {
        "variant": [row.variant for row, _ in flat],
        "scenario": [row.scenario for row, _ in flat],
        "metric": [row.metric for row, _ in flat],
        "statistic": [s.statistic for _, s in flat],
        "subject": [s.subject for _, s in flat],
        "level": [s.level for _, s in flat],
    }
    names = {"lower": "lo", "upper": "hi"}
    for key in ("value", "lower", "upper", "standard_error", "n", "n_censored", "unit", "note"):
        columns[names.get(key, key)] = [getattr(s.estimate, key) for _, s in flat]
    return columns
