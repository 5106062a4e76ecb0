"""Every price in every model form, and what each form is calibrated to."""

from collections.abc import Iterator

from mcsettle.estimate.rounding import number
from mcsettle.report.assumptions import told_apart
from mcsettle.report.charging import by_unit, headline_unit
from mcsettle.report.first_page import shown_scenarios
from mcsettle.report.form_bars import form_bars
from mcsettle.report.material import Material
from mcsettle.report.page import Block, Table
from mcsettle.report.price_words import USE, range_words
from mcsettle.report.words import cut

AT_ONCE = 4  # scenarios on one axis


def form_blocks(material: Material) -> Iterator[Block]:
    """The forms side by side where the first page has not all, the range over them, the forms."""
    answers = material.answers
    names = list(answers.summaries)
    if shown_scenarios(answers) != names:  # the first page has no room for all
        for group in by_unit(material.study, names, material.miles):
            for first in range(0, len(group), AT_ONCE):
                yield form_bars(material, group[first : first + AT_ONCE])
    yield _ranges(material)
    yield _forms(material)


def _ranges(material: Material) -> Table:
    """The range of line means and of median sections over the forms, and the verdict."""
    rows = []
    for name, summary in material.answers.summaries.items():
        unit = headline_unit(material.study, name, material.miles)
        settled = f"{summary.settled} of {len(summary.effects)}"
        verdict = f"{USE[summary.verdict]}: {summary.reason}"
        ranges = (
            range_words(ends, unit.factor, None, "not known")
            for ends in (summary.prices, summary.medians)
        )
        rows.append((cut(name, 40), f"per {unit.label}", *ranges, settled, verdict))
    head = ("scenario", "unit", "line means", "median sections", "sign settled", "supported")
    note = (
        "Line means and median sections: lowest and highest over the model forms, in the study's "
        "currency. Sign settled: in how many forms more than 95 % or fewer than 5 % of the sections "
        "have a shorter interval."
    )
    return Table("The range over the model forms", head, tuple(rows), 6, note, small=True)


def _forms(material: Material) -> Table:
    """What each form assumes, its factor, its uniform settlement and the cycles before a tamping."""
    study, answers, rows = material.study, material.answers, []
    first = study.reference_scenario
    for form in answers.forms:
        settings = study.settlement_settings(form)
        interval = answers.intervals.get((form, first))
        rows.append(
            (
                form,
                told_apart(study, form, answers.forms),
                f"{settings.settlement_factor:g}",
                "" if interval is None else interval.median.with_error(),
                "" if interval is None else number(interval.settlement),
                f"{settings.ballast_cycles_before:g}",
            )
        )
    head = (
        "model form", "assumes", "settlement factor", "days in the baseline",
        "uniform settlement by then, mm", "load cycles before",
    )  # fmt: skip
    return Table("What each model form is calibrated to", head, tuple(rows), 2, small=True)
