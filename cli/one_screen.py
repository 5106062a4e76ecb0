"""``mcsettle summarise``: the answer of a run in thirty lines of eighty columns."""

import shutil
import sys
import textwrap
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, NamedTuple

from mcsettle.report.assumptions import narrowed_by, stress_remarks
from mcsettle.report.charging import by_unit, marginal_train
from mcsettle.report.price_words import (
    interval_words,
    price_interval,
    price_places,
    priced_in,
    question,
    range_words,
    scope,
)
from mcsettle.report.words import cut

if TYPE_CHECKING:
    from mcsettle.summary.answers import Answers
    from mcsettle.summary.results import Results

LINES, COLUMNS, NARROWEST = 30, 80, 50
MOST_NARROWING = 3
SHORTEST = 12  # a label, that is worth its place
_EVERY = "Every number: mcsettle summarise {} --all, or --json"


class Size(NamedTuple):
    """How much a screen shows: columns, scenarios, and whether long labels have lines of their own."""

    columns: int
    scenarios: int
    folded: bool


def one_screen(results: "Results", answers: "Answers", name: str) -> list[str]:
    """The lines: question, prices, intervals, what next; ``name`` is the folder as it was given.

    What does not fit beside its numbers stands on a line above them, where there are lines for that.
    As many scenarios as the lines have room for.
    """
    width = COLUMNS
    if sys.stdout.isatty():
        width = max(NARROWEST, min(COLUMNS, shutil.get_terminal_size().columns))
    most = len(answers.study.scenario_names)
    for size in [Size(width, most, True), *(Size(width, n, False) for n in range(most, 0, -1))]:
        lines = _screen(results, answers, name, size)
        if len(lines) <= LINES:
            break
    return lines


def _screen(results: "Results", answers: "Answers", name: str, size: "Size") -> list[str]:
    """The lines of a screen of that size."""
    width = size.columns
    shown = name if len(_EVERY.format(name)) <= width else "DIR"
    return [
        cut(answers.study.title or "untitled", width),
        cut(scope(results, answers), width),
        "",
        *_prices(answers, size),
        *_intervals(answers, size),
        *_remarks(answers, width),
        *_next(answers, width),
        "",
        _EVERY.format(shown),
        f"As a page: mcsettle report {shown}",
    ]


def _prices(answers: "Answers", size: "Size") -> Iterator[str]:
    """The question, a line for each scenario, and why some prices are not supported."""
    shown = list(answers.summaries)[: size.scenarios]
    if not shown:
        yield question(answers)
        return
    asked = question(answers)
    for group in by_unit(answers.study, shown):
        yield from _group(answers, group, asked, size)
        asked = ""
    yield from _reasons(answers, shown, size.columns)
    more = len(answers.summaries) - len(shown)
    if more:
        yield f"  {more} more scenarios: --all"


def _group(answers: "Answers", shown: list[str], asked: str, size: "Size") -> Iterator[str]:
    """A line for each effect whose price is in the same unit, under what is ``asked``."""
    label, units = priced_in(answers, shown)
    width = size.columns
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
        spread = range_words(summary.prices, unit.factor, places.get(name), "–")
        rows.append((cut(name, 22), _change(answers, name), price, spread, summary.verdict))
    yield from _columns(rows, size, 1)  # a scenario's title stands below, its range only here


def _reasons(answers: "Answers", shown: list[str], width: int) -> Iterator[str]:
    """Why prices are not supported, scenarios of one reason together; what is known without a price."""
    reasons: dict[str, list[str]] = {}
    for name in shown:
        summary, effect = answers.summaries[name], answers.effect(name)
        if effect is not None and effect.price.value is None:
            n_known = effect.price.n - effect.price.n_censored
            years = answers.study.limit.horizon_years
            text = f"{n_known} of {effect.price.n} pairs of sections reach the limit in {years:g} years"
            reasons.setdefault(text, []).append(name)
        elif summary.verdict != "yes":
            reasons.setdefault(summary.reason, []).append(name)
    for reason, names in list(reasons.items())[:3]:
        yield from _wrapped(f"{reason[0].upper()}{reason[1:]} ({', '.join(names)})", width)


def _intervals(answers: "Answers", size: "Size") -> Iterator[str]:
    study, rows = answers.study, [("", "", "days", "half of the sections", "change")]
    for name in study.scenario_names[: size.scenarios + 1]:
        words = interval_words(answers, name)
        if words is not None:
            middle, month, half, change = words
            days = f"{middle} ({month})" if month else middle
            rows.append((cut(name, 14), study.scenario(name).title or "", days, half, change))
    yield ""
    yield "When is the line tamped?"
    yield from _columns(rows, size, 3)


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


def _columns(rows: "Sequence[tuple[str, ...]]", size: "Size", spare: int) -> Iterator[str]:
    """Columns of text, an indent before each line.

    Labels (column 1) that have no room stand above the others, or are cut between words. Where even that
    is too narrow the column ``spare`` is left out: digits are never cut.
    """
    sizes = [max(len(row[i]) for row in rows) for i in range(len(rows[0]))]
    kept = list(range(2, len(sizes)))
    room = size.columns - 2 - sum(sizes) + sizes[1] - 2 * (len(sizes) - 1)
    above = size.folded and room < sizes[1]
    if above and room < -2:
        kept.remove(3)
        room += sizes[3] + 2
    elif not above and room < min(sizes[1], SHORTEST) and spare > 1:
        kept.remove(spare)
        room += sizes[spare] + 2
    second = 0 if room < SHORTEST <= sizes[1] and not above else min(sizes[1], max(room, 0))
    for row in rows:
        cells = [row[0].ljust(sizes[0]), *([cut(row[1], second).ljust(second)] if second else [])]
        if above:
            if row[0]:
                yield f"  {cells[0]}  {cut(row[1], size.columns - sizes[0] - 4)}"
            cells = [" " * (sizes[0] + second)]
        cells += [row[i].rjust(sizes[i]) for i in kept]
        yield ("  " + "  ".join(cells)).rstrip()
