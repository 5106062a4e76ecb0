"""Why an effect has its sign: the table ``sign_split`` in numbers, and the share of shorter intervals."""

from dataclasses import replace

import numpy as np

from mcsettle.estimate.estimate import Estimate, Statistic
from mcsettle.estimate.sample import summarise_effects
from mcsettle.study.effects import StudyEffect
from mcsettle.summary.results import CENSORED, INTERVAL, Results
from mcsettle.summary.samples import beside, floats, shortening
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
            split = of_pair.get((variant, effect.scenario, effect.baseline))
            if split is None:
                continue
            told = [(m, unit, summarise_effects(floats(split, c), unit)) for m, c, unit in SIGNS]
            share = Statistic("share", None, _share(results, variant, effect))
            for metric, unit, statistics in (*told, (SHORTENS, "1", [share])):
                row = SummaryRow(variant, effect.scenario, metric, unit, tuple(statistics))
                rows.append(replace(row, effect=effect.name, baseline=effect.baseline))
    return rows


def _share(results: Results, variant: str, effect: StudyEffect) -> Estimate:
    """Share of the pairs whose interval shortens, pooled over parameter sets.

    Limits are its least and largest value, censored pairs being unknown; no value where they differ.
    """
    base, other = (results.sound(variant, side) for side in (effect.baseline, effect.scenario))
    days, end = beside(base, other, (INTERVAL, CENSORED))
    paired = ~np.isnan(days) | ~np.isnan(end)
    arrays = floats(base, INTERVAL), days, floats(base, CENSORED), end
    base_days, days, base_end, end = (array[paired] for array in arrays)
    n, unknown = len(days), int(np.sum(np.isnan(base_days) | np.isnan(days)))
    if n == 0:
        return Estimate(None, None, None, None, 0, 0, "1", "no pairs")
    low, high = (float(np.mean(part)) for part in shortening(base_days, days, base_end, end))
    note = "limits: least and largest share, censored pairs being unknown"
    return Estimate(low if low == high else None, low, high, None, n, unknown, "1", note)
