"""Scenario table and variants: what ran, with the tonnages of trains and of the study."""

from collections.abc import Iterator

from mcsettle.estimate.rounding import number
from mcsettle.report.material import Material
from mcsettle.report.page import Block, Table, Text
from mcsettle.report.words import cut
from mcsettle.units import DAYS_PER_YEAR, MGT, TONNE


def scenario_blocks(material: Material) -> Iterator[Block]:
    """The scenarios, the trains, the variants."""
    yield _scenarios(material)
    yield _trains(material)
    yield _variants(material)
    if material.study.economics is None:
        yield Text("The study has no economics: intervals only.", "note")


def _scenarios(material: Material) -> Table:
    study, rows = material.study, []
    bases = {effect.baseline: effect for effect in study.effects.values()}
    for name in study.scenario_names:
        entries = study.scenario(name).timetable
        services = ", then ".join(
            f"{e.per_day} × {e.train} at {e.speed_kmh:g} km/h" for e in entries
        )
        summed = study.timetable(name).mass_per_day / MGT
        stated = study.scenario(name).mgt_per_day
        if stated is None and name in bases and bases[name].change.effect == "tonnage":
            stated = bases[name].change.base
            stated = None if stated == summed else stated
        rows.append(
            (
                name + (" (baseline)" if name in bases else ""),
                cut(material.title(name)),
                services,
                number(summed, 5),
                "" if stated is None else f"{stated:g}",
                number(study.mgt_per_year(name), 3),
            )
        )
    note = (
        "MGT: million gross tonnes. Stated: the study's own figure, which the economics take instead of "
        f"the sum over the trains. A year has {DAYS_PER_YEAR:g} days; the services of a day run one "
        "after the other in this order."
    )
    head = ("scenario", "title", "trains a day", "MGT/day, trains", "MGT/day, stated", "MGT/year")
    return Table("Scenarios", head, tuple(rows), 3, note)


def _trains(material: Material) -> Table:
    rows = []
    for name, train in material.study.trains.items():
        table = material.study.train_tables[name]
        mass = train.mass / TONNE
        load = mass / train.n_axles
        vehicles = table.vehicle or ", ".join(
            f"{entry.count} × {entry.vehicle}" for entry in table.consist or ()
        )
        rows.append((name, cut(vehicles), str(len(train.cars)), number(load), number(mass, 0)))
    head = ("train", "vehicle", "cars", "axle load, t", "mass, t")
    return Table("Trains", head, tuple(rows), 2)


def _variants(material: Material) -> Table:
    rows = []
    for variant in material.study.variants:
        settings = material.study.settlement_settings(variant.name)
        rows.append(
            (
                variant.name + (" (answer)" if variant.name == material.variant else ""),
                cut(variant.title),
                settings.stress,
                "linear" if material.study.softening(variant.name) is None else "softened",
                settings.cycles,
                f"{settings.settlement_factor:g}",
                f"{settings.ballast_cycles_before:g}",
            )
        )
    head = ("variant", "title", "stress", "soil", "cycles", "settlement factor", "cycles before")
    note = (
        "Variants are readings of the same study side by side; they are never averaged. Stress: "
        "traffic leaves the geostatic part out, total has it. Soil: softened by the strains of each "
        "train, or linear."
    )
    return Table("Variants", head, tuple(rows), 5, note)
