"""The answer in sentences: what a change costs or saves, and whether the number may be used."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from datetime import date, timedelta

from mcsettle.estimate.rounding import decimals, number
from mcsettle.report.charging import MarginalTrain, PriceUnit, headline_unit, marginal_train
from mcsettle.report.money import NAMES, about, between, money_for, symbol
from mcsettle.report.words import cut
from mcsettle.study.study import Study
from mcsettle.summary.answers import Answers
from mcsettle.summary.forms import FormEffect, FormsSummary, Verdict
from mcsettle.summary.results import Results

USE = {"yes": "yes", "as a range": "only as a range", "no": "no"}


def question(answers: Answers) -> str:
    """What the study asks, in a plain sentence."""
    study, compared = answers.study, list(answers.summaries)
    if not compared:
        return "How long until the track must be tamped?"
    faster, added = (
        [name for name in compared if study.effects[name].change.effect == kind]
        for kind in ("speed", "tonnage")
    )
    if not added:
        return f"What does a faster {_kind(study, faster)}train cost in tamping?"
    if faster:
        return (
            f"What do a faster {_kind(study, faster)}train and one more {_kind(study, added)}train "
            "cost in tamping?"
        )
    trains = [marginal_train(study, name) for name in added]
    several = all(train is not None and train.more > 1 for train in trains)
    more = "do more" if several else "does one more"
    kind = _kind(study, added)
    return f"What {more} {kind}train{'s' if several else ''} a day cost in tamping?"


def _kind(study: Study, effects: list[str]) -> str:
    """Name of the train of all ``effects`` with a space; empty where they have several."""
    trains = [marginal_train(study, name) for name in effects]
    names = {"" if train is None else f"{train.name} " for train in trains}
    return names.pop() if len(names) == 1 else ""


def scope(results: Results, answers: Answers) -> str:
    """The size of the sample, the forms, the seed, the prices."""
    tracks, sets = (results.realisations[key].nunique() for key in ("realisation", "parameter_set"))
    n, study = len(answers.forms), answers.study
    sections = f"{tracks} section{'s' if tracks > 1 else ''}"
    sections += f" × {sets} parameter sets" if sets > 1 else ""
    parts = [f"{sections} in each scenario"]
    parts += [f"{n} model form{'s' if n > 1 else ''}", f"seed {study.seed}"]
    if study.economics is not None:
        year = study.economics.price_base_year
        parts.append(study.currency + (f" of {year}" if year else ", base year unknown"))
    return " · ".join(parts)


def prices(study: Study) -> str:
    """Currency and price base year in words."""
    economics = study.economics
    if economics is None:
        return ""
    code, year = study.currency, economics.price_base_year
    base = f"prices of {year}" if year else "price base year not stated"
    name = f"{NAMES[code]} ({code})" if code in NAMES else code
    return f"{name}, {base}"


def answer_sentence(answers: Answers, name: str, miles: bool = False) -> tuple[str, Verdict, str]:
    """What one effect costs and between what over the forms; the verdict, and its reason."""
    study, summary, effect = answers.study, answers.summaries[name], answers.effect(name)
    unit, currency = headline_unit(study, name, miles), study.currency
    head = what_changes(study, name)
    if effect is None or effect.price.value is None:
        text = f"{head}: no price. {_bound(answers, effect, unit)}"
        return text, "no", summary.reason
    error = effect.price.standard_error
    value = effect.price.value * unit.factor
    amount = about(value, None if error is None else error * abs(unit.factor), currency)
    verb = "save" if value < 0.0 else "cost"
    several = " more " in head and " trains a day" in head
    text = f"{head} {verb}{'' if several else 's'} about {amount} per {unit.label}"
    spread = over_forms(summary, unit, currency)
    if spread and summary.verdict == "no":  # the price of one form would be taken for an answer
        text = f"{head}: {spread}."
    elif spread:
        text = f"{text}; {spread}."
    else:
        text += "." if len(answers.forms) > 1 else " in one model form."
    return text, summary.verdict, summary.reason


def over_forms(summary: FormsSummary, unit: PriceUnit, currency: str) -> str:
    """The range of the line means over the forms in words; empty with one form."""
    n = len(summary.effects)
    if n < 2 or summary.prices is None:
        return ""
    low, high = sorted(price * unit.factor for price in summary.prices)
    text, sign = between(low, high, currency), symbol(currency)
    alike = text.split("between ")[-1].removeprefix("savings of ").split(" and ")
    if alike[0].removeprefix(sign) == alike[1].removeprefix(sign).split()[0]:
        return f"the same in all {n} model forms"
    per = f" per {unit.label}" if summary.verdict == "no" else ""
    return f"{text}{per} over {n} model forms"


def _bound(answers: Answers, effect: FormEffect | None, unit: PriceUnit) -> str:
    """What is known where most of the sections outlive the horizon."""
    if effect is None:
        return "No pair of sections has a result."
    currency = answers.study.currency
    price, years = effect.price, answers.study.limit.horizon_years
    n_known = price.n - price.n_censored
    text = f"Only {n_known} of {price.n} pairs of sections reach the limit within {years:g} years"
    if effect.at_most is not None and unit.factor > 0.0:
        text += (
            f"; the line's mean is at most {about(effect.at_most * unit.factor, None, currency)}"
        )
        text += f" per {unit.label}"
    wanted = answers.horizon_wanted
    if wanted is not None and wanted > years:
        text += f". A horizon of some {number(wanted, 0)} years or more would give one"
    return f"{text}."


def what_changes(study: Study, name: str) -> str:
    """The change of an effect as the subject of a sentence."""
    train, effect = marginal_train(study, name), study.effects[name]
    base = study.scenario(effect.baseline)
    # Where all are compared with one baseline it needs no naming.
    several = len({other.baseline for other in study.effects.values()}) > 1
    against = f" (beside {cut(base.title or base.name, 40)})" if several else ""
    if train is None:
        return f"“{cut(study.scenario(effect.scenario).title or effect.scenario, 80)}”{against}"
    return _train_words(train) + against


def _train_words(train: MarginalTrain) -> str:
    if train.base_speed is not None:
        return f"A {train.name} train at {train.speed:g} instead of {train.base_speed:g} km/h"
    about_it = f"{train.mass:.0f} t, {train.speed:g} km/h"
    if train.more == 1:
        return f"One more {train.name} train a day ({about_it})"
    return f"{train.more} more {train.name} trains a day ({about_it} each)"


def interval_change(effect: FormEffect) -> str:
    """Change of the interval in per cent: below zero it is shorter."""
    if effect.reduction is None:
        return "unknown"
    change = -effect.reduction
    return ("+" if change > 0.0 else "") + number(change, 1) + " %"


def changes_of(answers: Answers, scenario: str) -> str:
    """Change of the interval of ``scenario``, against each of its baselines where it has several."""
    effects = answers.effects_of(scenario)
    if len(effects) == 1:
        return interval_change(effects[0][1])
    return ", ".join(f"{interval_change(effect)} ({cut(base, 10)})" for base, effect in effects)


def tamped_on(study: Study, days: float | None) -> str:
    """Month of the tamping after ``days``, where the study has a date of its day 0; else empty.

    A month is as fine as the error of an interval ever allows.
    """
    start = study.start_date
    if start is None or days is None or start.toordinal() + days >= date.max.toordinal():
        return ""
    return (start + timedelta(days=days)).strftime("%Y-%m")


def span(low: str, high: str) -> str:
    """Two ends in words, once where they are the same.

    >>> span("3", "5"), span("> 548", "> 548")
    ('3 to 5', '> 548')
    """
    return low if low == high else f"{low} to {high}"


def range_words(
    ends: tuple[float, float] | None, factor: float, places: int | None, empty: str
) -> str:
    """Lowest and highest price, each times ``factor``, in any order; ``empty`` where not known."""
    if ends is None:
        return empty
    return span(*(number(end, places) for end in sorted(end * factor for end in ends)))


def interval_words(answers: Answers, scenario: str) -> tuple[str, str, str, str] | None:
    """When the line is tamped, in the form that stands first; None where nothing is known.

    Median [days] with its error, its month, half of the sections, change against the baselines.
    """
    interval = answers.intervals.get((answers.form, scenario))
    if interval is None:
        return None
    late = f"> {number(answers.study.limit.horizon_days, 0)}"
    month = tamped_on(answers.study, interval.median.value)
    half = span(*(number(day, 0, late) for day in interval.half))
    return interval.median.with_error(late), month, half, changes_of(answers, scenario)


def sections_words(effect: FormEffect, unit: PriceUnit, places: int | None) -> str:
    """P5 to P95 of the price between single sections; open where the censored ones decide an end."""
    ends = [
        None if v is None else v * unit.factor for v in (effect.sections[0], effect.sections[2])
    ]
    if unit.factor < 0.0:
        ends.reverse()
    places = None if places is None else max(places - 1, 0)
    low, high = (number(end, places, "open") for end in ends)
    return span(low, high)


def sign_words(effect: FormEffect) -> str:
    """Whether the sign is settled, and the share of the sections whose interval shortens.

    The larger share: of those that shorten or of those that lengthen.
    """
    low, high = effect.shortens
    if effect.sign > 0:
        return f"cost, {_share(low)}"
    if effect.sign < 0:
        return f"saving, {_share(1.0 - high)}"
    return f"open, {_share(low)}" if low == high else f"open, {_share(low)} to {_share(high)}"


def _share(share: float) -> str:
    return f"{100.0 * share:.0f} %"


def priced_in(
    answers: Answers, names: Sequence[str], miles: bool = False
) -> tuple[str, dict[str, PriceUnit]]:
    """Money and unit of the prices of the effects ``names``, all in one unit, as "pence per train-km".

    And the unit of each, whose amounts are of that money: pence instead of pounds.
    """
    study = answers.study
    units = {name: headline_unit(study, name, miles) for name in names}
    amounts = [
        amount * units[name].factor
        for (_, name), effect in answers.effects.items()
        for amount in (effect.price.value, effect.at_most)
        if name in units and amount is not None
    ]
    money = money_for(study.currency, amounts)
    label = f"{(money.word or money.sign).strip()} per {units[names[0]].label}"
    return label, {n: replace(u, factor=u.factor * money.scale) for n, u in units.items()}


def price_places(
    effects: Iterable[tuple[str, FormEffect, PriceUnit]],
) -> Mapping[str, int | None]:
    """Decimals of the prices of each effect by name: two digits of its largest error; None: unknown.

    The same for all in a column, unless one would lose more than a digit by it.
    """
    errors: dict[str, float] = {}
    names: dict[str, int | None] = {}
    for name, effect, unit in effects:
        names[name] = None
        if effect.price.standard_error:
            error = effect.price.standard_error * abs(unit.factor)
            errors[name] = max(error, errors.get(name, 0.0))
    if errors:
        places = {name: max(0, decimals(error)) for name, error in errors.items()}
        least, most = min(places.values()), max(places.values())
        names |= dict.fromkeys(names, least) if most - least <= 1 else places
    return names


def price_interval(effect: FormEffect, unit: PriceUnit, places: int | None) -> str:
    """A line's mean with its 95 % interval; or what bounds it."""
    price, factor = effect.price, unit.factor
    if price.value is None:
        if effect.at_most is None or factor < 0.0:
            return "no price"
        return f"at most {number(effect.at_most * factor, None)}"
    middle = number(price.value * factor, places)
    if price.lower is None or price.upper is None:
        return middle
    low, high = sorted((price.lower * factor, price.upper * factor))
    return f"{middle} ({number(low, places)} to {number(high, places)})"
