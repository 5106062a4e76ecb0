"""An effect that can be priced, and a recovery that tamps below the limit."""

from collections.abc import Iterator

from mcsettle.study.checks.parts import Parts
from mcsettle.study.checks.traffic import is_buildable, tonnage
from mcsettle.study.faults import Fault, dotted
from mcsettle.study.former_keys import COST
from mcsettle.study.schema.currencies import CODES
from mcsettle.study.schema.study import StudyTables

HOME = "GBP"  # currency of the default of the tamping cost


def economics_faults(parts: Parts) -> Iterator[Fault]:
    """The effect needs one speed a scenario, and a change against the baseline."""
    economics = parts.economics
    if economics is None:
        return
    changes = {}
    for index, scenario in parts.scenarios.items():
        path = dotted(("scenarios", index, "timetable"))
        speeds = sorted({service.speed_kmh for service in scenario.timetable})
        if economics.effect == "speed" and len(speeds) > 1:
            message = (
                f"received the speeds {speeds}; with economics.effect = 'speed' it must be one"
            )
            yield Fault(path, message)
        elif economics.effect == "speed":
            changes[scenario.name] = (path, speeds[0])
        elif all(is_buildable(service.train, parts) for service in scenario.timetable):
            changes[scenario.name] = (path, tonnage(scenario, parts))
    base = changes.get(economics.baseline)
    for name, (path, value) in changes.items():
        if base is not None and name != economics.baseline and value == base[1]:
            message = f"has the same {economics.effect} as the baseline '{economics.baseline}': "
            yield Fault(path, message + f"there is no effect of {economics.effect} to price")


def currency_faults(parts: Parts) -> Iterator[Fault]:
    """A cost in the study's own currency, and published costs in no other."""
    economics = parts.economics
    if economics is None:
        return
    if economics.currency != HOME and COST not in economics.model_fields_set:
        said = (
            f"is missing: its default is {HOME}, and the study's currency is {economics.currency}"
        )
        yield Fault(f"economics.{COST}", said)
    for index, row in parts.reference.items():
        first = row.unit.split(" ")[0]
        if row.metric == "marginal_cost" and first in CODES - {economics.currency}:
            path = dotted(("reference", index, "unit"))
            said = f"is not the study's currency: convert value and unit to {economics.currency}"
            yield Fault(path, f"received '{first} …', which {said}")


def maintenance_faults(parts: Parts) -> Iterator[Fault]:
    """What a recovery says together with the limit, and that it is followed by cycle jumps."""
    table, limit = parts.maintenance, parts.limit
    if table is None:
        return
    numbers = {"intercept_mm": table.intercept_mm, "slope": table.slope}
    for key, value in numbers.items():
        if (value is None) == (table.recovery == "linear"):
            said = "is missing" if value is None else "has no meaning"
            yield Fault(f"maintenance.{key}", f"{said} with recovery = '{table.recovery}'")
    if table.recovery == "linear" and limit is not None and None not in numbers.values():
        after = (table.intercept_mm or 0.0) + (table.slope or 0.0) * limit.sd_limit_mm
        if after >= limit.sd_limit_mm:
            yield Fault(
                "maintenance.intercept_mm",
                f"with slope {table.slope:g} a tamping at {limit.sd_limit_mm:g} mm leaves {after:g} mm; "
                "it must leave less than the limit",
            )
    if parts.run is not None and parts.run.stepping != "cycle_jump":
        yield Fault("maintenance", "takes [run] stepping = 'cycle_jump'")


def unpriced_maintenance(study: StudyTables) -> Iterator[Fault]:
    """A maintenance life whose tampings have no price."""
    if study.maintenance is not None and study.economics is None:
        yield Fault("maintenance", "has no meaning without [economics]; give it, or leave this out")
