"""The sheet ``charges``: prices as formulas of tamping cost, discount rate, price level and currency.

A price is the mean over the sections of Eqs. (8), (9): proportional to the tamping cost, and analytic in
the discount rate r with the baseline's interval T and the elasticity γ of every pair of sections, which
stand in the sheet ``pairs``: mean of −γ w r / (exp(r T) − 1), w the pair's weight over its divisor.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from mcsettle.report.charging import KM_PER_MILE, price_units
from mcsettle.report.material import Material
from mcsettle.report.price_words import USE
from mcsettle.summary.results import INTERVAL, KEYS
from mcsettle.summary.samples import floats
from mcsettle.units import DAYS_PER_YEAR

CHARGES, PAIRS = "charges", "pairs"
FIRST_ROW = 11  # of the prices, counted from 0
COST, RATE, LEVEL, EXCHANGE = "$B$3", "$B$4", "$B$5", "$B$7"
TONNE_MILE = "1000 gross tonne-mile"


@dataclass(frozen=True)
class PairColumns:
    """What the pairs of one form and scenario hold: T [years], γ, weight over divisor, all [n]."""

    years: np.ndarray
    elasticity: np.ndarray
    weight: np.ndarray


def pair_columns(material: Material) -> dict[tuple[str, str], PairColumns]:
    """Known pairs of every form and scenario that has a price."""
    effects = material.answers.effects.items()
    return {
        key: _pairs(material, *key) for key, effect in effects if effect.price.value is not None
    }


def _pairs(material: Material, form: str, scenario: str) -> PairColumns:
    results, effect = material.results, material.study.effects[scenario]
    priced = material.study.economics
    assert priced is not None
    effects = results.pairs(form, effect)
    tracks = results.part("realisations", form, effect.baseline)
    pairs = effects[effects["status"] == "paired"][[*KEYS, "elasticity"]]
    pairs = pairs.merge(tracks[[*KEYS, INTERVAL]], on=KEYS)
    sets, of_sets = pairs["parameter_set"].to_numpy(dtype=int), results.set_weights(form)
    if of_sets is None:
        of_sets = np.ones(sets.max() + 1)
    factors = np.zeros(sets.max() + 1)
    for e in np.unique(sets):
        study = results.members[e].study
        change, money = study.change(scenario), study.economics
        assert change is not None
        assert money is not None
        cost = money.tamping_cost_per_track_km / priced.tamping_cost_per_track_km
        factors[e] = of_sets[e] * cost / change.divisor
    share = of_sets[sets].mean()
    years = floats(pairs, INTERVAL) / DAYS_PER_YEAR
    return PairColumns(years, floats(pairs, "elasticity"), factors[sets] / share)


def line_mean(pairs: PairColumns, cost: float, rate: float) -> float:
    """What the formula of a price gives, in the unit of the scenario's effect."""
    growth = np.expm1(rate * pairs.years)
    slope = 1.0 / pairs.years if rate == 0.0 else rate / growth
    return float(np.mean(-pairs.elasticity * pairs.weight * slope) * cost)


def write_charges(book: Any, material: Material) -> None:
    """Add the sheets ``charges`` and ``pairs``; nothing in a study without prices."""
    priced = material.study.economics
    if priced is None or not material.answers.effects:
        return
    page, store = book.add_worksheet(CHARGES), book.add_worksheet(PAIRS)
    pairs = pair_columns(material)
    ranges = {key: _write_pairs(store, i, key, p) for i, (key, p) in enumerate(pairs.items())}
    bold = book.add_format({"bold": True, "text_wrap": True, "valign": "top"})
    _write_inputs(book, page, material)
    heads = ("scenario", "model form", "per", "price", "at the study's own values", "supported")
    for column, name in enumerate(heads):
        page.write_string(FIRST_ROW - 1, column, name, bold)
    row, amount = FIRST_ROW, book.add_format({"num_format": "0.0000"})
    for (form, scenario), effect in material.answers.effects.items():
        words = USE[material.answers.summaries[scenario].verdict]
        if effect.price.value is None:
            n_known = effect.price.n - effect.price.n_censored
            said = f"no price: {n_known} of {effect.price.n} pairs of sections reach the limit"
            for column, text in enumerate((scenario, form, "", said)):
                page.write_string(row, column, text)
            row += 1
            continue
        money = priced.tamping_cost_per_track_km, priced.discount_rate
        price = line_mean(pairs[form, scenario], *money)
        for label, factor in _units(material, scenario):
            for column, text in enumerate((scenario, form, label)):
                page.write_string(row, column, text)
            formula = _formula(ranges[form, scenario], factor)
            page.write_formula(row, 3, formula, amount, price * factor)
            page.write_number(row, 4, price * factor, amount)
            page.write_string(row, 5, words)
            row += 1
    page.autofilter(FIRST_ROW - 1, 0, max(row - 1, FIRST_ROW), len(heads) - 1)
    page.freeze_panes(FIRST_ROW, 0)
    page.set_column(0, 1, 26)
    page.set_column(2, 5, 24)


def _write_inputs(book: Any, page: Any, material: Material) -> None:
    """The cells that may be changed, each with what it is."""
    priced, code = material.study.economics, material.study.currency
    assert priced is not None
    year = priced.price_base_year
    free = book.add_format({"bg_color": "#FFF2CC", "border": 1})
    page.write_string(0, 0, "Change the shaded cells: the prices follow.",
                      book.add_format({"bold": True}))  # fmt: skip
    rows: list[tuple[str, float | str, str]] = [
        ("tamping cost", priced.tamping_cost_per_track_km, f"{code} per track-km"),
        ("discount rate", priced.discount_rate, "1/year; 0 is no discounting"),
        ("price level", 1.0, f"over that of {year}" if year else "over that of the study's prices"),
        ("currency", code, "of the prices below"),
        ("exchange rate", 1.0, f"units of that currency for one {code}"),
    ]
    for place, (name, value, unit) in enumerate(rows, 2):
        page.write_string(place, 0, name)
        if isinstance(value, str):
            page.write_string(place, 1, value, free)
        else:
            page.write_number(place, 1, value, free)
        page.write_string(place, 2, unit)
    page.write_string(8, 0, "Mean over the sections of a line, a row for each model form and unit; the "
                      "pairs of sections stand in the sheet 'pairs'.")  # fmt: skip


def _units(material: Material, scenario: str) -> list[tuple[str, float]]:
    """Every unit a price is asked in, with its factor: also per tonne-mile."""
    units = []
    for unit in price_units(material.study, scenario):
        units.append((unit.label, unit.factor))
        if unit.label == "1000 gross tonne-km":
            units.append((TONNE_MILE, unit.factor * KM_PER_MILE))
    return units


def _write_pairs(
    page: Any, block: int, key: tuple[str, str], pairs: PairColumns
) -> tuple[str, str, str]:
    """Three columns of the sheet ``pairs``; their ranges as formulas name them."""
    import xlsxwriter.utility as cells

    (form, scenario), names = key, []
    columns = (
        ("baseline interval, years", pairs.years),
        ("elasticity", pairs.elasticity),
        ("weight over divisor", pairs.weight),
    )
    for place, (title, values) in enumerate(columns, 3 * block):
        page.write_string(0, place, f"{scenario}, {form}: {title}")
        page.write_column(1, place, values.tolist())
        names.append(f"{PAIRS}!{cells.xl_range_abs(1, place, len(values), place)}")
    return names[0], names[1], names[2]


def _formula(ranges: tuple[str, str, str], factor: float) -> str:
    years, elasticity, weight = ranges
    discounted = f"SUMPRODUCT({elasticity},{weight},{RATE}/(EXP({RATE}*{years})-1))"
    plain = f"SUMPRODUCT({elasticity},{weight},1/{years})"
    mean = f"IF({RATE}=0,{plain},{discounted})/COUNT({years})"
    return f"=-{mean}*{COST}*{LEVEL}*{EXCHANGE}*{factor:.17g}"
