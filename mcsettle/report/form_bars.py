"""The prices of all model forms on one axis: a row for each form, a bar for each scenario."""

from collections.abc import Callable

import numpy as np
from matplotlib.ticker import MaxNLocator

from mcsettle.estimate.rounding import number
from mcsettle.report.assumptions import beside, ground_and_support
from mcsettle.report.charging import PriceUnit
from mcsettle.report.material import Material
from mcsettle.report.page import Bar, BarRow, Bars
from mcsettle.report.price_words import (
    interval_change,
    price_interval,
    price_places,
    priced_in,
    sections_words,
    sign_words,
)
from mcsettle.report.words import cut

Place = Callable[[float], float]  # from a price to per cent of the axis

MOST_LINES = 12  # bars of the first page
MOST_TOLD = 4  # scenarios told in sentences
MARGIN = 0.06  # of the axis, on either side


def form_bars(material: Material, scenarios: list[str]) -> Bars:
    """The line prices of ``scenarios`` in every form, on one axis with zero."""
    answers, study = material.answers, material.study
    shown = [(f, name) for f in answers.forms for name in scenarios if (f, name) in answers.effects]
    label, units = priced_in(answers, scenarios, material.miles)
    low, high = _ends(material, shown, units)
    span = high - low

    def place(value: float) -> float:
        return round(100.0 * (value - low) / span, 2)

    places = price_places((key[1], answers.effects[key], units[key[1]]) for key in shown)
    rows = []
    for form in answers.forms:
        bars = [
            _bar(material, (form, name), (units[name], places[name]), place)
            for name in scenarios
            if (form, name) in answers.effects
        ]
        first = answers.forms[0]
        # The first says what a reader knows best, the others what is otherwise: the rows stay short.
        note = ground_and_support(study, form) if form == first else beside(study, form, first)
        rows.append(BarRow(form.replace("_", " "), note, tuple(bars)))
    ticks = [t for t in MaxNLocator(5).tick_values(low, high) if low <= t <= high]
    step = ticks[1] - ticks[0] if len(ticks) > 1 else 1.0
    digits = max(0, -int(np.floor(np.log10(step) + 1e-9)))
    head = (
        "model form", "price", "line mean (95 %)", "sections, P5 to P95", "interval", "sign",
    )  # fmt: skip
    ringed = any(bar.published is not None for row in rows for bar in row.bars)
    of = f" of {scenarios[0]}" if len(scenarios) == 1 else ""
    axis = f"price, {label}"
    return Bars(
        caption=f"Price{of} in every model form, {label}",
        axis=axis,
        head=head,
        zero=place(0.0),
        ticks=tuple((place(t), number(t, digits)) for t in ticks),
        rows=tuple(rows),
        alt=f"P{axis[1:]}: "
        + "; ".join(f"{row.title} {bar.label} {bar.cells[0]}" for row in rows for bar in row.bars),
        note="Each form says what it assumes otherwise than the first. Dot and bar: mean of the line and "
        f"its 95 % interval{'; ring: published' if ringed else ''}. Cost, saving: 95 % of the sections "
        f"shorten, lengthen their interval; open: the share that shortens.{_more(material)}",
    )


def _more(material: Material) -> str:
    """Where the scenarios are that the first page does not tell of."""
    more = len(material.answers.summaries) - MOST_TOLD
    return f" {more} more scenarios under Prices by model form." if more > 0 else ""


def _ends(
    material: Material, shown: list[tuple[str, str]], units: dict[str, PriceUnit]
) -> tuple[float, float]:
    """Ends of the axis: every interval, every published value and zero, with a margin."""
    values = [0.0]
    for key in shown:
        price, name = material.answers.effects[key].price, key[1]
        ends = price.value, price.lower, price.upper, material.published(name, "marginal_cost")
        values += [v * units[name].factor for v in ends if v is not None]
    low, high = min(values), max(values)
    margin = MARGIN * ((high - low) or 1.0)
    return low - margin, high + margin


def _bar(
    material: Material, key: tuple[str, str], how: tuple[PriceUnit, int | None], place: Place
) -> Bar:
    """The bar of form and scenario ``key``, in a unit to so many decimals."""
    effect, name, (unit, decimals) = material.answers.effects[key], key[1], how
    ends = [effect.price.lower, effect.price.upper]
    places = [None if v is None else place(v * unit.factor) for v in ends]
    if unit.factor < 0.0:
        places.reverse()
    middle, published = effect.price.value, material.published(name, "marginal_cost")
    return Bar(
        cut(name, 20),
        material.tint(name),
        places[0],
        None if middle is None else place(middle * unit.factor),
        places[1],
        None if published is None else place(published * unit.factor),
        (
            price_interval(effect, unit, decimals),
            sections_words(effect, unit, decimals),
            interval_change(effect),
            sign_words(effect),
        ),
    )
