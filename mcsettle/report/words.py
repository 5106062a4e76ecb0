"""Numbers and names in words: rounded to what is known, signs and empty values readable."""

import math
import re
import unicodedata

from mcsettle.estimate.estimate import Estimate
from mcsettle.summary.summary import SummaryRow

NOT_REACHED = "not reached"
DAYS = "tamping_interval_days"
METRICS = {
    DAYS: "tamping interval",
    "sd_growth_1y_mm": "SD growth in a year",
    "reduction_percent": "reduction of the interval",
    "elasticity": "elasticity",
    "marginal_cost": "marginal cost",
    "mgt_increase_percent": "increase of tonnage",
    "quasi_static_stress_increase_percent": "increase of the quasi-static stress",
    "dynamic_stress_increase_percent": "increase of the dynamic stress",
}
MARKS = {DAYS: "days", "1": "", "d": "days"}


def plain(text: str) -> str:
    """``text`` on one line, without control characters."""
    kept = (" " if c in "\n\t\r" else c for c in text)
    return "".join(c if unicodedata.category(c) not in ("Cc", "Cs") else "\ufffd" for c in kept)


def cut(text: str, length: int = 160) -> str:
    """``text`` on one line of at most ``length`` characters."""
    words = " ".join(plain(text).split())
    return words if len(words) <= length else words[: length - 2].rstrip() + " …"


def number(value: float | None, places: int | None = None, empty: str = NOT_REACHED) -> str:
    """A number with ``places`` decimals (None: three significant digits).

    >>> number(-0.12345), number(1234.5), number(0.5, 1), number(None)
    ('−0.123', '1230', '0.5', 'not reached')
    """
    if value is None or math.isnan(value):
        return empty
    if places is None:
        places = 0 if value == 0.0 else max(2 - math.floor(math.log10(abs(value))), -12)
    rounded = round(value, places)
    if rounded == 0.0:
        rounded = 0.0
    return f"{rounded:.{max(places, 0)}f}".replace("-", "−")


def places_of(row: SummaryRow) -> int | None:
    """Decimals for the quantiles of ``row``: two digits of the Monte Carlo error of the median."""
    middle = row.at(0.5)
    error = middle.standard_error
    if middle.value is None or not error or error <= 1e-9 * abs(middle.value):
        return None
    return min(max(1 - math.floor(math.log10(error)), 0), 6)


def level(row: SummaryRow, at: float, factor: float = 1.0) -> str:
    """One quantile of ``row``, times ``factor``."""
    value = row.at(at).value
    places = places_of(row)
    if places is not None and factor != 1.0:
        places = min(max(places - round(math.log10(abs(factor))), 0), 8)
    return number(None if value is None else value * factor, places)


def mostly_known(row: SummaryRow) -> bool:
    """Whether ``row`` is of most tracks: a median over a minority says nothing of the line."""
    found = row.at(0.5)
    return 2 * found.n_censored <= found.n


def with_error(estimate: Estimate, places: int | None = None) -> str:
    """Value ± standard error, to two digits of the error."""
    error, value = estimate.standard_error, estimate.value
    if value is None or not error or error <= 1e-9 * abs(value):
        return number(value, places)
    if places is None:
        places = min(max(1 - math.floor(math.log10(error)), 0), 8)
    return f"{number(value, places)} ± {number(error, places)}"


def band(row: SummaryRow, factor: float = 1.0) -> str:
    """P5 to P95 of ``row``."""
    low, high = level(row, 0.05, factor), level(row, 0.95, factor)
    if low == high:
        return "the same on every track" if low != NOT_REACHED else NOT_REACHED
    return f"{low} to {high}"


def metric_words(metric: str) -> str:
    """A metric as it is read.

    >>> metric_words("sd_growth_697d_mm")
    'SD growth in 697 days'
    """
    grown = re.fullmatch(r"sd_growth_([0-9.e+]+)d_mm", metric)
    if grown:
        return f"SD growth in {grown[1]} days"
    return METRICS.get(metric, metric.replace("_", " "))


def as_given(value: float) -> str:
    """A published value with the digits it was given."""
    return f"{value:.12g}".replace("-", "−")


def percentile(row: SummaryRow) -> str:
    """Where the published value falls among ours."""
    share = row.reference_percent
    if share is None:
        return ""
    if 0.0 < share < 1.0 or 99.0 < share < 100.0:
        return f"P{share:.1f}"
    return f"P{share:.0f}"


def unit_words(unit: str) -> str:
    """A unit as it is read: GBP as a pound sign, days in full."""
    return MARKS.get(unit, unit).replace("GBP", "£")
