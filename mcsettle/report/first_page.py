"""The first page: the question, the answer in charging units, what it is worth, what would narrow it."""

from collections.abc import Iterator

from mcsettle.estimate.rounding import number
from mcsettle.report.assumptions import narrowed_by, stress_remarks
from mcsettle.report.charging import by_unit
from mcsettle.report.form_bars import MOST_LINES, MOST_TOLD, form_bars
from mcsettle.report.material import Material
from mcsettle.report.money import symbol
from mcsettle.report.page import Block, Bullets, Columns, Lead, Table, Text
from mcsettle.report.price_words import answer_sentence, interval_words
from mcsettle.report.words import cut
from mcsettle.summary.answers import Answers

MOST_NARROWING = 3  # things to measure


def first_page(material: Material) -> tuple[Block, ...]:
    """Sentences, the forms side by side, when the line is tamped, what narrows the price."""
    answers = material.answers
    blocks: list[Block] = list(_warnings(material))
    told = list(answers.summaries)[:MOST_TOLD]
    for scenario in told:
        text, verdict, reason = answer_sentence(answers, scenario, material.miles)
        blocks.append(Lead(text, cut(scenario, 30), material.tint(scenario), verdict, reason))
    if answers.summaries:
        shown = by_unit(material.study, shown_scenarios(answers), material.miles)
        blocks += [form_bars(material, names) for names in shown]
    stands = Bullets(tuple(_rests_on(material)), "What it rests on")
    if answers.summaries:
        told_of = (*_price_of(material), *stands.entries)
        stands = Bullets(told_of, "What stands behind it")
    narrowing = Bullets(tuple(narrowed_by(answers))[:MOST_NARROWING], "What would narrow it")
    lists = [part for part in (stands, narrowing) if part.entries]
    return (*blocks, Columns(((interval_table(material),), *((part,) for part in lists))))


def shown_scenarios(answers: Answers) -> list[str]:
    """Scenarios of the picture, in the study's order: the ones not settled before the others."""
    n = max(1, MOST_LINES // len(answers.forms))
    names = list(answers.summaries)
    open_first = sorted(names, key=lambda name: answers.summaries[name].verdict == "yes")
    return [name for name in names if name in open_first[:n]]


def interval_table(material: Material) -> Table:
    """When the line is tamped: days, half of the sections, the change."""
    rows = []
    for scenario in material.study.scenario_names:
        words = interval_words(material.answers, scenario)
        if words is not None:
            rows.append((cut(scenario, 20), *words))
    head = ("", "days", "month", "half of the sections", "change")
    return Table("When is the line tamped?", head, tuple(rows), 1)


def _price_of(material: Material) -> Iterator[str]:
    priced = material.study.economics
    assert priced is not None
    sign = symbol(material.study.currency)
    yield (
        f"Tamping alone, {sign}{priced.tamping_cost_per_track_km:g} a track-km, discounted at "
        f"{100.0 * priced.discount_rate:g} % a year; no renewal, wear or delays."
    )
    yield "The mean of a line. Single sections differ far more; that is no error."


def _rests_on(material: Material) -> Iterator[str]:
    study, answers = material.study, material.answers
    settings = study.settlement_settings(answers.form)
    note = study.calibration
    text = f"A settlement factor of {settings.settlement_factor:g}"
    if settings.settlement_factor == 1.0:
        text = "No calibration: the settlement factor is 1"
    elif note is not None:
        text += f", fitted to {note.target_days:g} days in {note.scenario}"
        text += f" of {cut(note.study, 60)}" if note.study else ""
    first = answers.intervals.get((answers.form, study.scenario_names[0]))
    if first is not None and first.settlement is not None:
        text += f"; the line as a whole settles {number(first.settlement, 0)} mm by then"
    yield f"{text}."
    yield from stress_remarks(study)


def _warnings(material: Material) -> Iterator[Block]:
    table = material.results.realisations
    rows = table[table["variant"] == material.variant]
    n, counts = len(rows), rows["status"].value_counts()
    failed, censored = int(counts.get("failed", 0)), int(counts.get("censored", 0))
    if failed:
        yield Text(f"{failed} of {n} realisations failed and are left out; their rows say why.",
                   "warning")  # fmt: skip
    years = material.study.limit.horizon_years
    if censored and censored == n - failed:
        yield Text(f"No section reached its limit within {years:g} years: neither interval nor "
                   "price can be stated.", "warning")  # fmt: skip
    elif censored:
        yield Text(f"{censored} of {n} realisations had not reached their limit at the horizon of "
                   f"{years:g} years; they count as longer than that.", "note")  # fmt: skip
    if material.n_tracks == 1:
        yield Text("One section only: there is no spread and no Monte Carlo error.", "warning")
