"""``mcsettle summarise``: the answer of a run in thirty lines of eighty columns."""

import shutil
import sys
import textwrap
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

from mcsettle.estimate.rounding import number
from mcsettle.report.assumptions import narrowed_by, stress_remarks
from mcsettle.report.charging import by_unit, headline_unit, marginal_train
from mcsettle.report.money import Money, money_for
from mcsettle.report.price_words import (
    USE,
    changes_of,
    price_interval,
    price_places,
    question,
    scaled_unit,
    scope,
    span,
    tamped_on,
)
from mcsettle.report.words import cut

if TYPE_CHECKING:
    from mcsettle.report.charging import PriceUnit
    from mcsettle.summary.answers import Answers
    from mcsettle.summary.results import Results

LINES, COLUMNS, NARROWEST = 30, 80, 50
MOST_NARROWING = 3
_EVERY = "Every number: mcsettle summarise {} --all, or --json"


def one_screen(results: "Results", answers: "Answers", name: str) -> list[str]:
    """The lines: question, prices, intervals, what next; ``name`` is the folder as it was given.

    As many scenarios as the lines have room for.
    """
    width = COLUMNS
    if sys.stdout.isatty():
        width = max(NARROWEST, min(COLUMNS, shutil.get_terminal_size().columns))
    most = len(answers.study.scenario_names)
    while True:
        lines = _screen(results, answers, name, (width, most))
        if len(lines) <= LINES or most == 1:
            return lines
        most -= 1


def _screen(results: "Results", answers: "Answers", name: str, size: tuple[int, int]) -> list[str]:
    """The lines with so many columns and scenarios."""
    width, most = size
    shown = name if len(_EVERY.format(name)) <= width else "DIR"
    return [
        cut(answers.study.title or "untitled", width),
        cut(scope(results, answers), width),
        "",
        *_prices(answers, width, most),
        *_intervals(answers, width, most),
        *_remarks(answers, width),
        *_next(answers, width),
        "",
        _EVERY.format(shown),
        f"As a page: mcsettle report {shown}",
    ]


def _prices(answers: "Answers", width: int, most: int) -> Iterator[str]:
    """The question, a line for each scenario, and why some prices are not supported."""
    shown = list(answers.summaries)[:most]
    if not shown:
        yield question(answers)
        return
    asked = question(answers)
    for group in by_unit(answers.study, shown):
        yield from _group(answers, group, asked, width)
        asked = ""
    yield from _reasons(answers, shown, width)
    more = len(answers.summaries) - len(shown)
    if more:
        yield f"  {more} more scenarios: --all"


def _group(answers: "Answers", shown: list[str], asked: str, width: int) -> Iterator[str]:
    """A line for each effect whose price is in the same unit, under what is ``asked``."""
    units = {name: headline_unit(answers.study, name) for name in shown}
    money = _money(answers, units)
    units = {name: scaled_unit(unit, money.scale) for name, unit in units.items()}
    label = f"{(money.word or money.sign).strip()} per {units[shown[0]].label}"
    pairs = [(answers.effect(name), units[name]) for name in shown]
    places = price_places(
        (name, effect, unit)
        for name, (effect, unit) in zip(shown, pairs, strict=True)
        if effect is not None
    )
    if len(asked) + len(label) + 2 <= width:
        yield asked + label.rjust(width - len(asked))
    else:
        yield from (*textwrap.wrap(asked, width), label.rjust(width))
    rows = [("", "", "line mean (95 %)", "over forms", "supported")]
    for name, (effect, unit) in zip(shown, pairs, strict=True):
        price = "no price" if effect is None else price_interval(effect, unit, places[name])
        summary = answers.summaries[name]
        spread = _range(summary.prices, unit.factor, places.get(name))
        rows.append((cut(name, 22), _change(answers, name), price, spread, USE[summary.verdict]))
    yield from _columns(rows, width, 1)  # a scenario's title stands below, its range only here


def _reasons(answers: "Answers", shown: list[str], width: int) -> Iterator[str]:
    """Why prices are not supported, scenarios of one reason together; what is known without a price."""
    reasons: dict[str, list[str]] = {}
    for name in shown:
        summary, effect = answers.summaries[name], answers.effect(name)
        if effect is not None and effect.price.value is None:
            known = effect.price.n - effect.price.n_censored
            years = answers.study.limit.horizon_years
            text = (
                f"{known} of {effect.price.n} pairs of sections reach the limit in {years:g} years"
            )
            reasons.setdefault(text, []).append(name)
        elif summary.verdict != "yes":
            reasons.setdefault(summary.reason, []).append(name)
    for reason, names in list(reasons.items())[:3]:
        yield from _wrapped(f"{reason[0].upper()}{reason[1:]} ({', '.join(names)})", width)


def _intervals(answers: "Answers", width: int, most: int) -> Iterator[str]:
    study, rows = answers.study, [("", "", "days", "half of the sections", "change")]
    late = f"> {number(study.limit.horizon_days, 0)}"
    for name in study.scenario_names[: most + 1]:
        found = answers.intervals.get((answers.form, name))
        if found is None:
            continue
        low, high = (number(day, 0, late) for day in found.half)
        middle = late if found.median.value is None else found.median.with_error()
        month = tamped_on(study, found.median.value)
        rows.append(
            (
                cut(name, 14),
                study.scenario(name).title or "",
                f"{middle} ({month})" if month else middle,
                span(low, high),
                changes_of(answers, name),
            )
        )
    yield ""
    yield "When is the line tamped?"
    yield from _columns(rows, width, 3)


def _remarks(answers: "Answers", width: int) -> Iterator[str]:
    for text in stress_remarks(answers.study):
        yield ""
        yield from textwrap.wrap(text, width)


def _next(answers: "Answers", width: int) -> Iterator[str]:
    told = list(narrowed_by(answers))[:MOST_NARROWING] if answers.summaries else []
    if told:
        yield ""
        yield "What would narrow it"
        for text in told:
            yield from _wrapped(text, width)


def _money(answers: "Answers", units: "dict[str, PriceUnit]") -> Money:
    """The money in which every price of the screen is written."""
    amounts = [
        amount * units[name].factor
        for (_, name), effect in answers.effects.items()
        for amount in (effect.price.value, effect.at_most)
        if name in units and amount is not None
    ]
    return money_for(answers.study.currency, amounts)


def _range(ends: tuple[float, float] | None, factor: float, places: int | None) -> str:
    if ends is None:
        return "–"
    low, high = (number(end, places) for end in sorted(end * factor for end in ends))
    return low if low == high else f"{low} to {high}"


def _change(answers: "Answers", scenario: str) -> str:
    """What a scenario changes in few words."""
    train = marginal_train(answers.study, scenario)
    if train is None:
        return answers.study.scenario(answers.study.effects[scenario].scenario).title
    if train.base_speed is not None:
        return f"{train.name}, {train.speed:g} km/h"
    more = f"{train.more} × " if train.more > 1 else ""
    return f"{more}{train.name}, {train.mass:.0f} t, {train.speed:g} km/h"


def _wrapped(text: str, width: int) -> list[str]:
    return textwrap.wrap(text, width, initial_indent="  ", subsequent_indent="    ")


def _columns(rows: "Sequence[tuple[str, ...]]", width: int, spare: int) -> Iterator[str]:
    """Columns of text, the second cut to what the others leave; an indent before each line.

    Where even that is too narrow the column ``spare`` is left out: digits are never cut.
    """
    least = max(len(row[1]) for row in rows[1:]) if len(rows) > 1 else 0
    sizes = [max(len(row[i]) for row in rows) for i in range(len(rows[0]))]
    kept = list(range(len(sizes)))
    room = width - 2 - sum(sizes) + sizes[1] - 2 * (len(sizes) - 1)
    if room < min(least, 12):
        kept.remove(spare)
        room += sizes[spare] + 2
    second = min(sizes[1], max(room, 3))
    for row in rows:
        cells = [row[0].ljust(sizes[0]), cut(row[1], second).ljust(second)]
        cells += [text.rjust(size) for text, size in zip(row[2:], sizes[2:], strict=True)]
        yield ("  " + "  ".join(cells[i] for i in kept)).rstrip()
