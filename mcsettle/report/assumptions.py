"""What each model form assumes in a few words, and what would have to be measured to tell them apart."""

from collections.abc import Iterator, Sequence

from mcsettle.study.study import Study
from mcsettle.summary.answers import Answers

# What would tell the forms apart, by the assumption in which they differ.
NARROWED_BY = {
    "ground": "Rail deflection under a train at two speeds: is the ground softened?",
    "stress": "Levelling after two years: how much does the line settle as a whole?",
    "cycles": "SD before and after one tamping: how do load cycles count?",
    "spectrum": "The line's own record of a track recording car, instead of a spectrum.",
}
DAMPING = "Damping of the freight wagons in service: it decides the sign."
FEWER = "More sections: 'mcsettle run … --until' narrows the 95 % interval."
FORMS = (
    "One model form: its choice can move this price by more than the 95 % interval. Run the set of forms "
    "([[variants]], each calibrated)."
)


def assumptions(study: Study, variant: str) -> dict[str, str]:
    """What ``variant`` assumes, by subject, each in two or three words."""
    settings = study.settlement_settings(variant)
    table = study.variant(variant)
    spectrum = table.spectrum or study.profile.spectrum
    return {
        "ground": "linear ground" if study.softening(variant) is None else "softened ground",
        "stress": f"{settings.stress} stress",
        "cycles": f"cycles {settings.cycles.replace('_', ' ')}",
        "spectrum": f"{spectrum.replace('_', ' ')} spectrum",
    }


def differing(study: Study, variants: Sequence[str]) -> list[str]:
    """The subjects in which the variants differ."""
    told = [assumptions(study, variant) for variant in variants]
    return [subject for subject in told[0] if len({words[subject] for words in told}) > 1]


def told_apart(study: Study, variant: str, variants: Sequence[str]) -> str:
    """What ``variant`` assumes where the variants differ; of one alone, ground and stress."""
    subjects = differing(study, variants) or ["ground", "stress"]
    words = assumptions(study, variant)
    return ", ".join(words[subject] for subject in subjects)


def narrowed_by(answers: Answers) -> Iterator[str]:
    """What to measure or to run so that the price is known better, the most telling first."""
    study = answers.study
    if len(answers.forms) < 2:
        yield FORMS
    for subject in differing(study, answers.forms):
        yield NARROWED_BY[subject]
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
