"""Results and names in words: quantiles, bands, metrics and units as they are read."""

import re
from collections.abc import Mapping

from mcsettle.estimate.rounding import NOT_REACHED, number
from mcsettle.report.money import SIGNS
from mcsettle.report.outgoing import plain
from mcsettle.summary.results import INTERVAL
from mcsettle.summary.summary import SummaryRow

METRICS = {
    INTERVAL: "tamping interval",
    "sd_growth_1y_mm": "SD growth in a year",
    "reduction_percent": "reduction of the interval",
    "elasticity": "elasticity",
    "marginal_cost": "marginal cost",
    "mgt_increase_percent": "increase of tonnage",
    "quasi_static_stress_increase_percent": "increase of the quasi-static stress",
    "dynamic_stress_increase_percent": "increase of the dynamic stress",
}
MARKS = {INTERVAL: "days", "1": "", "d": "days"}


def cut(text: str, length: int = 160) -> str:
    """``text`` on one line of at most ``length`` characters, cut between words: never within a number.

    >>> cut("passenger, 748 t, 200 km/h", 22)
    'passenger, 748 t …'
    """
    words = " ".join(plain(text).split())
    if len(words) <= length:
        return words
    whole = words[: length - 1].rpartition(" ")[0].rstrip(",;: ")
    return f"{whole or words[: length - 2]} …"


def unknown_of(metric: str) -> str:
    """What is said of a quantile of ``metric`` that is not known.

    The growth of the SD to a day is not known of what was tamped before.
    """
    return "tamped before" if metric.startswith("sd_growth_") else NOT_REACHED


def not_reached(unknown: Mapping[str, list[str]], separator: str = ", ") -> str:
    """One sentence on what no quantile is known of: ``unknown`` things, each with what it is of."""
    parts = [f"{name} ({separator.join(of)})" for name, of in unknown.items()]
    return f"Not reached, or not known of most sections: {'; '.join(parts)}." if parts else ""


def level(row: SummaryRow, at: float, factor: float = 1.0) -> str:
    """One quantile of ``row``, times ``factor``, with the decimals of the median and its error."""
    value, places = row.at(at).value, row.at(0.5).places(factor)
    return number(None if value is None else value * factor, places, unknown_of(row.metric))


def mostly_known(row: SummaryRow) -> bool:
    """Whether ``row`` is of most tracks: a median over a minority says nothing of the line."""
    median = row.at(0.5)
    return 2 * median.n_censored <= median.n


def band(row: SummaryRow, factor: float = 1.0) -> str:
    """P5 to P95 of ``row``."""
    low, high = level(row, 0.05, factor), level(row, 0.95, factor)
    if low == high:
        unknown = unknown_of(row.metric)
        return "the same in every realisation" if low != unknown else unknown
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
    """A unit as it is read: a currency by its sign where it has one, days in full.

    >>> unit_words("GBP per 1000 tonne-km"), unit_words("SEK per 1000 tonne-km"), unit_words("d")
    ('£ per 1000 tonne-km', 'SEK per 1000 tonne-km', 'days')
    """
    first, space, rest = unit.partition(" ")
    return MARKS.get(unit, SIGNS.get(first, first) + space + rest)
