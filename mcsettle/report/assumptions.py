"""What each model form assumes in a few words, and what would have to be measured to tell them apart."""

from collections.abc import Iterator, Sequence

from mcsettle.study.build_forms import build_rail_loads, variability_table
from mcsettle.study.study import Study
from mcsettle.summary.answers import Answers

# What would tell the forms apart, by the assumption in which they differ.
NARROWED_BY = {
    "support": "Levelling after two years: is the support uniform along the track?",
    "ground": "Rail deflection under a train at two speeds: is the ground softened?",
    "stress": "Levelling after two years: how much does the line settle as a whole?",
    "cycles": "SD before and after one tamping: how do load cycles count?",
    "rail": "Rail deflection beside voids or soft spots: how far does the rail spread the load?",
    "long run": "Settlement per tonne of old track against new: does it speed up in the long run?",
    "vehicles": "Car lengths and wheel loads of the trains that run.",
    "spectrum": "The line's own record of a track recording car, instead of a spectrum.",
}
DAMPING = "Damping of the freight wagons in service: it decides the sign."
FEWER = "More sections: 'mcsettle run … --until' narrows the 95 % interval."
FORMS = (
    "One model form: its choice can move this price by more than the 95 % interval. Run the set of forms "
    "([[variants]], each calibrated)."
)
# Measured by studies/beam_beside_section.py.
HALF_SPACE = (
    "Closed-form beam: its stresses are those of a uniform half-space, not of the layered section. In "
    "the study of 'mcsettle init' it makes the effect of speed 3.1 times as large: 225 instead of "
    "201 km/h shortens the interval by 44.6 %, on the section by 14.5 ± 1.7 %. "
    'model = "section" computes the section.'
)


def stress_remarks(study: Study) -> Iterator[str]:
    """What to know of where the stresses of ``study`` come from; nothing for a section."""
    if study.track_table.model == "beam":
        yield HALF_SPACE


def assumptions(study: Study, variant: str) -> dict[str, str]:
    """What ``variant`` assumes, by subject, each in two or three words."""
    settings = study.settlement_settings(variant)
    table = study.variant(variant)
    spectrum = table.spectrum or study.profile.spectrum
    long_run = settings.long_run_cycles
    return {
        "ground": "linear ground" if study.softening(variant) is None else "softened ground",
        "stress": f"{settings.stress} stress",
        "support": _support(study, variant),
        "rail": _rail(study, variant),
        "cycles": _cycles(settings.cycles, settings.equivalence_exponent),
        "long run": "" if long_run is None else f"faster from {long_run:g} cycles",
        "vehicles": "own vehicles" if table.trains or table.load_per_rail else "",
        "spectrum": f"{spectrum.replace('_', ' ')} spectrum",
    }


def _support(study: Study, variant: str) -> str:
    """How the settlement susceptibility varies along the track."""
    table = variability_table(study.spatial_variability, study.variant(variant))
    if table is None or not table.cov:
        return "uniform support"
    kind = ", lognormal" if table.distribution == "lognormal" else ""
    return f"support varies {100.0 * table.cov:g} %{kind}"


def _rail(study: Study, variant: str) -> str:
    """Whether the rail's bending spreads the load."""
    share = build_rail_loads(study.track_table, study.variant(variant)).bending_share
    return f"rail bending {share:g}" if share else ""


def _cycles(kind: str, exponent: float | str | None) -> str:
    """How load cycles count."""
    if kind != "equivalent":
        return f"cycles {kind.replace('_', ' ')}"
    return f"equivalent axles, n {'by the law' if exponent == 'law' else f'= {exponent:g}'}"


def differing(study: Study, variants: Sequence[str]) -> list[str]:
    """The subjects in which the variants differ."""
    told = [assumptions(study, variant) for variant in variants]
    return [subject for subject in told[0] if len({words[subject] for words in told}) > 1]


def told_apart(study: Study, variant: str, variants: Sequence[str]) -> str:
    """What ``variant`` assumes where the variants differ; of one alone, ground and stress."""
    subjects = differing(study, variants) or ["ground", "stress"]
    words = assumptions(study, variant)
    return ", ".join(words[subject] for subject in subjects if words[subject])


def ground_and_support(study: Study, variant: str) -> str:
    """What ``variant`` assumes of ground and support, those that a reader knows best."""
    words = assumptions(study, variant)
    return f"{words['ground']}, {words['support']}"


def beside(study: Study, variant: str, first: str) -> str:
    """What ``variant`` assumes otherwise than the form ``first``."""
    assumed, others = assumptions(study, variant), assumptions(study, first)
    words = [text for subject, text in assumed.items() if text and text != others[subject]]
    return ", ".join(words) or f"as {first.replace('_', ' ')}, with a factor of its own"


def narrowed_by(answers: Answers) -> Iterator[str]:
    """What to measure or to run so that the price is known better, the most telling first."""
    study = answers.study
    if len(answers.forms) < 2:
        yield FORMS
    differ = differing(study, answers.forms)
    yield from (text for subject, text in NARROWED_BY.items() if subject in differ)
    unsettled = any(s.settled < len(s.effects) for s in answers.summaries.values())
    if unsettled and any("freight" in name for name in study.trains):
        yield DAMPING
    if any(_wide(answers, scenario) for scenario in answers.summaries):
        yield FEWER


def _wide(answers: Answers, scenario: str) -> bool:
    """Whether the sample leaves more than a tenth of the price open."""
    effect = answers.effect(scenario)
    share = None if effect is None else effect.price.relative_error
    return share is not None and share > 0.05
