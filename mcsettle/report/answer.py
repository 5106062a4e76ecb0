"""The first page: what is asked, the answer in charging units, what its band contains, one picture."""

from collections.abc import Iterator

from mcsettle.estimate.estimate import Estimate
from mcsettle.estimate.rounding import NOT_REACHED, number
from mcsettle.report.charging import Charge, MarginalTrain, charges, marginal_train
from mcsettle.report.curves import spreads, survivals
from mcsettle.report.figures.results import spreads_figure, survival_figure
from mcsettle.report.material import Material
from mcsettle.report.page import Block, Bullets, Picture, Table, Text
from mcsettle.report.words import DAYS, band, cut, level, unit_words

MOST_TOLD = 6  # scenarios told in sentences


def question(material: Material) -> str:
    """What the report answers."""
    economics = material.study.economics
    if economics is None or not material.compared:
        return "How long until the track must be tamped, and how sure is that?"
    if economics.effect == "speed":
        return "What does a faster train cost in tamping?"
    return "What does one more train cost in tamping?"


def scope(material: Material) -> str:
    """Which run, which variant, how many tracks."""
    study = material.study
    title = study.variant(material.variant).title
    named = f"{material.variant}: {title}" if title else material.variant
    sets = f" × {material.n_sets} parameter sets" if material.n_sets > 1 else ""
    return cut(f"Variant {named}. {material.n_tracks} tracks{sets} in each scenario.", 400)


def answer(material: Material) -> tuple[Block, ...]:
    """Sentences, one picture, the table in charging units, what the bands contain."""
    blocks: list[Block] = [Text(s, "lead") for s in _sentences(material)]
    blocks.append(_picture(material))
    table = _table(material)
    if table is not None:
        blocks.append(table)
    blocks += _warnings(material)
    blocks.append(Bullets(tuple(contains(material)), "What the band P5 to P95 contains"))
    blocks.append(Bullets(tuple(leaves_out(material)), "What it does not contain"))
    return tuple(blocks)


def prices(material: Material) -> str:
    """Currency and price base year in words."""
    economics = material.study.priced
    if economics is None:
        return ""
    year = economics.price_base_year
    base = f"prices of {year}" if year else "price base year not stated in the study"
    return f"pounds sterling (GBP, £), {base}"


def what_changes(material: Material, scenario: str) -> str:
    """The change of a scenario in words."""
    train = marginal_train(material.study, scenario)
    return cut(material.title(scenario), 80) if train is None else _train_words(train, scenario)


def _train_words(train: MarginalTrain, scenario: str) -> str:
    head = f"{cut(scenario, 40)}: "
    if train.base_speed is not None:
        return f"{head}{train.name} at {train.speed:g} instead of {train.base_speed:g} km/h"
    more = "one more train" if train.more == 1 else f"{train.more} more trains"
    return f"{head}{more} a day ({train.name}, {train.mass:.0f} t, {train.speed:g} km/h)"


def _sentences(material: Material) -> Iterator[str]:
    study = material.study
    if not material.compared:
        for scenario in study.scenario_names[:MOST_TOLD]:
            row = material.row(scenario, DAYS)
            if row is not None:
                yield (
                    f"{cut(material.title(scenario), 80)}: tamped after {level(row, 0.5)} days "
                    f"(median; P5 to P95: {band(row)})."
                )
        return
    for scenario in material.compared[:MOST_TOLD]:
        yield _sentence(material, scenario)


def _sentence(material: Material, scenario: str) -> str:
    head = what_changes(material, scenario)
    shown = charges(material, scenario)
    # The unit of charges per tonne if the scenario has it, else its own.
    main = next((c for c in shown if "1000 gross tonne" in c.unit), shown[0] if shown else None)
    if main is None or main.row.at(0.5).value is None:
        row = material.row(scenario, "marginal_cost")
        found = "too few" if row is None else _share_known(row.at(0.5))
        return f"{head}: no cost can be stated, {found} tracks reach the limit in both scenarios."
    unit = main.unit.removeprefix("£ ")
    plural = "cost" if " more trains a day" in head else "costs"
    text = f"{head} {plural} £{level(main.row, 0.5, main.factor)} {unit} of tamping"
    text += f" (median track; P5 to P95: {band(main.row, main.factor)})."
    reduction = material.row(scenario, "reduction_percent")
    if reduction is not None and reduction.at(0.5).value is not None:
        text += f" The tamping interval shortens by {level(reduction, 0.5)} % ({band(reduction)})."
    return text


def _share_known(found: Estimate) -> str:
    return f"{found.n - found.n_censored} of {found.n}"


def _table(material: Material) -> Table | None:
    rows: list[tuple[str, ...]] = []
    for scenario in material.compared:
        found = charges(material, scenario)
        if found:
            rows.append((what_changes(material, scenario),))
            rows += [(charge.unit, *_cells(charge)) for charge in found]
    if not rows:
        return None
    note = f"In {prices(material)}. "
    note += "Mean: what a line of many such sections costs; P50: the median section."
    if study_has_speed(material):
        note += (
            " Per train, vehicle and tonne: the cost per km/h times the difference of the speeds."
        )
    head = ("unit", "P5", "P50", "P95", "mean")
    return Table("The answer in charging units", head, tuple(rows), 1, note)


def study_has_speed(material: Material) -> bool:
    """Whether the scenarios change the speed."""
    economics = material.study.economics
    return economics is not None and economics.effect == "speed"


def _cells(charge: Charge) -> tuple[str, ...]:
    quantiles = tuple(level(charge.row, at, charge.factor) for at in (0.05, 0.5, 0.95))
    mean = charge.mean
    if mean is None or mean.value is None:
        return (*quantiles, NOT_REACHED)
    return (*quantiles, number(mean.value * charge.factor))


def _warnings(material: Material) -> Iterator[Block]:
    study = material.study
    table = material.results.realisations
    own = table[table["variant"] == material.variant]
    n, counts = len(own), own["status"].value_counts()
    failed, censored = int(counts.get("failed", 0)), int(counts.get("censored", 0))
    if failed:
        yield Text(f"{failed} of {n} realisations failed and are left out; their rows say why.",
                   "warning")  # fmt: skip
    if censored == n - failed and n > failed:
        horizon = study.limit.horizon_years
        yield Text(
            f"No track reached its limit within {horizon:g} years: neither interval nor cost can "
            "be stated.",
            "warning",
        )
    elif censored:
        yield Text(
            f"{censored} of {n} realisations had not reached their limit at the horizon of "
            f"{study.limit.horizon_years:g} years. They stay in every statistic as what they are.",
            "note",
        )
    if material.n_tracks == 1:
        yield Text("One track only: there is no spread and no Monte Carlo error.", "warning")
    yield from _calibrated(material)


def _calibrated(material: Material) -> Iterator[Block]:
    """Whether the answer rests on a fitted factor, and what is said without it."""
    factor = material.study.settlement_settings(material.variant).settlement_factor
    if factor == 1.0:
        return
    text = f"The answer rests on a settlement factor of {factor:g}"
    note = material.study.calibration
    if note is not None:
        text += f", fitted to {note.target_days:g} days in scenario {note.scenario}"
    text += "; it multiplies every settlement. "
    plain = [
        name
        for name in material.study.variant_names
        if material.study.settlement_settings(name).settlement_factor == 1.0
    ]
    if plain:
        rows = [material.row(s, DAYS, plain[0]) for s in material.study.scenario_names[:1]]
        said = [level(row, 0.5) for row in rows if row is not None]
        within = f" within {material.study.limit.horizon_years:g} years"
        median = "; ".join(v + (within if v == NOT_REACHED else " days") for v in said)
        text += f"Without it (variant {plain[0]}) the median interval of the first scenario is: "
        text += f"{median or 'unknown'}."
    yield Text(text, "note")


def _picture(material: Material) -> Picture:
    shown = spreads(material, "marginal_cost", density=True)
    known = [s for s in shown if s.quantiles is not None]
    if known:
        change = material.study.change(material.compared[0])
        unit = unit_words(change.unit) if change is not None else ""
        figure = spreads_figure(shown, f"marginal cost\n[{unit}]", density=True)
        alt = "Marginal cost by scenario: " + "; ".join(
            f"{cut(s.label, 40)}: median {number(s.quantiles[2])}, P5 {number(s.quantiles[0])}, "
            f"P95 {number(s.quantiles[4])}"
            for s in known
            if s.quantiles is not None
        )
        text = "Marginal cost by scenario: line P5 to P95, bar the middle half, mark the median."
        return Picture("answer", figure, alt + f" {unit}.", text)
    curves = survivals(material)
    figure = survival_figure(curves)
    alt = "Share of tracks not yet tamped against days, by scenario: " + "; ".join(
        f"{cut(c.label, 40)}: {len(c.days)} tamping days" for c in curves
    )
    return Picture("answer", figure, alt + ".", "Tracks not yet tamped.")


def contains(material: Material) -> Iterator[str]:
    """What varies within a band."""
    profile, study = material.study.profile, material.study
    start = (
        f"that all start at an SD of {profile.sd_mm:g} mm"
        if profile.sd_mm is not None
        else "whose initial SD varies as the spectrum has it"
    )
    yield (
        f"The spread between track sections of {profile.window_m:g} m {start}: the random profile "
        f"of {material.n_tracks} tracks, the same ones in every scenario."
    )
    if study.uncertain and material.n_sets > 1:
        names = ", ".join(dict.fromkeys(cut(e.input, 80) for e in study.uncertain))
        yield f"Inputs that are not known exactly, in {material.n_sets} draws: {names}."


def leaves_out(material: Material) -> Iterator[str]:
    """What no band covers."""
    if not (material.study.uncertain and material.n_sets > 1):
        yield "Uncertainty of the inputs: every one is held at the value of the register below."
    yield (
        "The choice of model: settlement law, stress definition, cycle count, spectrum, soil. "
        "Variants show some of it side by side."
    )
    yield "The Monte Carlo error: how far the numbers would move with more tracks (± in the tables)."
    yield (
        "Any cost but tamping: renewal, rail, wear, switches, delays, overheads. The cost is direct "
        "and short-run, from vertical settlement of ballasted plain line."
    )
