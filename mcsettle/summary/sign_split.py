"""Why an effect has its sign: the table ``sign_split`` in numbers, and the share of shorter intervals."""

import numpy as np

from mcsettle.estimate.estimate import Estimate, Statistic
from mcsettle.estimate.sample import summarise_effects
from mcsettle.study.effects import StudyEffect
from mcsettle.summary.results import CENSORED, INTERVAL, Results
from mcsettle.summary.samples import beside, floats
from mcsettle.summary.summary import SummaryRow

SHORTENS = "interval_shortens"
# Metric, column of the table, unit.
SIGNS = (
    ("reduction_by_both_percent", "reduction_percent", "%"),
    ("reduction_by_roughening_percent", "reduction_by_roughening_percent", "%"),
    ("reduction_by_hardening_percent", "reduction_by_hardening_percent", "%"),
    ("roughening_ratio", "roughening_ratio", "1"),
    ("break_even_ratio", "break_even_ratio", "1"),
    ("leverage", "leverage", "1"),
)


def sign_rows(results: Results) -> list[SummaryRow]:
    """Quantiles of the split over the tracks, and P(interval shortens), of each scenario split.

    The last row of a scenario, ``interval_shortens``, has a single statistic: the share of all pairs,
    pooled over parameter sets, whose interval shortens.
    """
    table = results.sign_split
    if table.empty:
        return []
    keys = ["variant", "scenario", "baseline"]
    of_pair = dict(iter(table.groupby(keys, sort=False, observed=True)))
    rows = []
    for variant in results.study.variant_names:
        for effect in results.study.effects.values():
            own = of_pair.get((variant, effect.scenario, effect.baseline))
            if own is None:
                continue
            for metric, column, unit in SIGNS:
                values = own[column].to_numpy(dtype=float, na_value=np.nan)
                found = tuple(summarise_effects(values, unit))
                rows.append(_row(variant, effect, metric, unit, found))
            share = shortening(results, variant, effect.scenario, effect.baseline)
            statistic = Statistic("share", None, share)
            rows.append(_row(variant, effect, SHORTENS, "1", (statistic,)))
    return rows


def _row(
    variant: str, effect: StudyEffect, metric: str, unit: str, found: tuple[Statistic, ...]
) -> SummaryRow:
    named = effect.scenario, metric, unit, found
    return SummaryRow(variant, *named, effect=effect.name, baseline=effect.baseline)


def shortening(results: Results, variant: str, scenario: str, baseline: str) -> Estimate:
    """Share of the pairs whose interval shortens, pooled over parameter sets.

    Limits are its least and largest value, censored pairs being unknown; no value where they differ.
    """
    base, other = (
        table[table["status"] != "failed"]
        for table in (results.part("realisations", variant, n) for n in (baseline, scenario))
    )
    days, end = floats(base, INTERVAL), floats(base, CENSORED)
    other_days, other_end = beside(base, other, (INTERVAL, CENSORED))
    paired = ~np.isnan(other_days) | ~np.isnan(other_end)
    days, end, other_days, other_end = (v[paired] for v in (days, end, other_days, other_end))
    n, unknown = len(days), int(np.sum(np.isnan(days) | np.isnan(other_days)))
    if n == 0:
        return Estimate(None, None, None, None, 0, 0, "1", "no pairs")
    least = np.nan_to_num(other_days, nan=np.inf) < np.where(np.isnan(days), end, days)
    most = np.where(np.isnan(other_days), other_end, other_days) < np.nan_to_num(days, nan=np.inf)
    low, high = float(np.mean(least)), float(np.mean(most))
    note = "limits: least and largest share, censored pairs being unknown"
    return Estimate(low if low == high else None, low, high, None, n, unknown, "1", note)
