"""Results in tables and pictures: every variant's quantiles, the charge table, the literature."""

import tomllib
from collections.abc import Iterator
from importlib.resources import files

from mcsettle.estimate.estimate import LEVELS
from mcsettle.estimate.rounding import number
from mcsettle.report.charging import KM_PER_MILE, marginal_train, price_units
from mcsettle.report.curves import fans, spreads, survivals
from mcsettle.report.figures.results import fan_figure, spreads_figure, survival_figure
from mcsettle.report.material import Material
from mcsettle.report.money import symbol
from mcsettle.report.page import Block, Fold, Picture, Table, Text
from mcsettle.report.price_words import prices
from mcsettle.report.words import (
    METRICS,
    as_given,
    band,
    cut,
    level,
    metric_words,
    mostly_known,
    not_reached,
    percentile,
    unit_words,
    unknown_of,
)

PER_TONNE = "per 1000 tonne-km"
PER_SPEED = "per km/h per 1000 train-km"


def result_blocks(material: Material) -> Iterator[Block]:
    """Pictures of the answer's variant, then a table a variant."""
    yield from _pictures(material)
    yield quantile_table(material, material.variant)
    for variant in material.study.variant_names:
        if variant != material.variant:
            yield Fold(f"Variant {variant}", (quantile_table(material, variant),))
    yield Text(
        "P5, P50, P95: spread between realisations. ± : Monte Carlo error of the median. Effects "
        "are formed realisation by realisation against the baseline and then summarised: the "
        "median reduction "
        "is not the reduction of the medians. Not reached: the quantile lies beyond the horizon, or "
        "too many realisations are censored to know it. Tamped before: the limit came before the day "
        "to which the growth of the SD is counted.",
        "note",
    )


def quantile_table(material: Material, variant: str) -> Table:
    """Every metric of every scenario of one variant."""
    study, previous = material.study, ""
    rows: list[tuple[str, ...]] = []
    unknown: dict[str, list[str]] = {}
    for row in material.of(variant):
        middle = row.at(0.5)
        name = metric_words(row.metric)
        if all(row.at(at).value is None for at in LEVELS):
            unknown.setdefault(name, []).append(row.name)
            continue
        if row.name != previous:
            rows.append((f"{row.name}: {cut(material.title(row.name), 100)}",))
        rows.append(
            (
                name + (f", {unit_words(row.unit)}" if unit_words(row.unit) else ""),
                level(row, 0.05),
                middle.with_error(unknown_of(row.metric)),
                level(row, 0.95),
                str(middle.n),
                str(middle.n_censored),
                as_given(row.reference.value) if row.reference else "",
                percentile(row),
            )
        )
        previous = row.name
    title = cut(study.variant(variant).title)
    factor = study.settlement_settings(variant).settlement_factor
    caption = f"Variant {variant}{': ' if title else ''}{title} (settlement factor {factor:g})"
    head = ("quantity", "P5", "P50", "P95", "n", "censored", "published", "falls at")
    return Table(caption, head, tuple(rows), 1, not_reached(unknown), small=True)


def _pictures(material: Material) -> Iterator[Picture]:
    shown = fans(material)
    if shown:
        figure = fan_figure(shown, material.study.limit.sd_limit_mm)
        ends = "; ".join(
            f"{cut(f.label, 40)} {number(float(f.quantiles[2, -1]), 2)}" for f in shown
        )
        alt = f"SD against days of traffic. Median SD on day {shown[0].days[-1]:g}, mm: {ends}."
        text = (
            f"SD of the profile in time: medians; shaded, P5 to P95 and the middle half of "
            f"{cut(shown[0].label, 60)}. A tamped realisation stays at the limit. Below: the "
            "SD above the "
            "baseline's on the same realisation, medians and the middle half."
        )
        yield Picture("sd_time", figure, alt, text)
    curves = survivals(material)
    if curves:
        alt = "Share of realisations not yet tamped against days: " + "; ".join(
            f"{cut(c.label, 40)} {len(c.days)} events" for c in curves
        )
        text = (
            "Tracks not yet tamped (Kaplan–Meier), with the 95 % confidence band of the curve; "
            "the thin line is the median."
        )
        yield Picture("survival", survival_figure(curves), alt + ".", text)
    yield from _effect_pictures(material)


def _effect_pictures(material: Material) -> Iterator[Picture]:
    for metric in ("reduction_percent", "elasticity"):
        values = spreads(material, metric, dots=True)
        if not any(s.quantiles is not None for s in values):
            continue
        unit = "[%]" if metric == "reduction_percent" else "[1]"
        figure = spreads_figure(values, f"{METRICS[metric]} {unit}")
        alt = f"{METRICS[metric]} by scenario: " + "; ".join(
            f"{cut(s.label, 40)}: median {number(s.quantiles[2])}"
            for s in values
            if s.quantiles is not None
        )
        text = (
            f"Paired {METRICS[metric]}: each dot a twentieth of the sections; P5 to P95, middle "
            "half, median."
        )
        yield Picture(metric, figure, alt + ".", text)


def charge_blocks(material: Material) -> Iterator[Block]:
    """The charge table by marginal train, and what others have found."""
    if not material.compared:
        yield Text("No scenario is compared with another: there is no marginal cost.", "note")
        return
    rows: list[tuple[str, ...]] = []
    sign = symbol(material.study.currency).strip()
    for name in material.compared:
        train, row = marginal_train(material.study, name), material.row(name, "marginal_cost")
        if train is None or row is None or not mostly_known(row):
            continue
        load, mass = number(train.axle_load), number(train.mass, 0)
        title = f"{train.name}: {train.cars} cars, {load} t an axle, {mass} t, {train.speed:g} km/h"
        if train.base_speed is not None:
            title += f" instead of {train.base_speed:g} km/h"
        rows.append((f"{title} ({cut(name, 40)})",))
        statistics = (*row.spread, *row.statistics)
        means = (s.estimate for s in statistics if s.statistic in ("section_mean", "mean"))
        mean = next((estimate.value for estimate in means), None)
        for unit in price_units(material.study, name, material.miles):
            price = number(None if mean is None else mean * unit.factor)
            quantiles = level(row, 0.5, unit.factor), band(row, unit.factor)
            rows.append((f"{sign} per {unit.label}", *quantiles, price))
    if rows:
        note = (
            "Each train as the marginal one, more often or faster than in the baseline; "
            f"{prices(material.study)}. A price list for a line takes the mean."
        )
        yield Table("Charge table", ("unit", "P50", "P5 to P95", "mean"), tuple(rows), 1, note)
    elif any(marginal_train(material.study, scenario) for scenario in material.compared):
        yield Text(
            "Too few realisations reach the limit in both scenarios: no cost is stated.", "note"
        )
    else:
        yield Text("No scenario differs from the baseline by a single kind of train.", "note")
    yield from _literature(material)


def _literature(material: Material) -> Iterator[Block]:
    km, length = (KM_PER_MILE, "mile") if material.miles else (1.0, "km")
    bases = {PER_TONNE, PER_SPEED if material.has_speed_effect else PER_TONNE}
    text = files("mcsettle.report").joinpath("literature.toml").read_text(encoding="utf-8")
    rows = [
        (
            entry["source"],
            entry["covers"],
            entry["basis"].replace("-km", f"-{length}"),
            entry.get("original", ""),
            number(entry["gbp"] * km) if "gbp" in entry else "",
        )
        for entry in tomllib.loads(text)["cost"]
        if entry["basis"] in bases
    ]
    head = ("source", "what it covers", "unit", "as published", "£")
    note = (
        "For orientation: other lines, other costs, other prices. Pounds only where the conversion "
        "is the cited paper's own (£1 = SEK 12 = € 1.20); other currencies are left as published."
    )
    yield Table("Published marginal costs of track", head, tuple(rows), 4, note, small=True)
