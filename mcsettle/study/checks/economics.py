"""An effect that can be priced, and a recovery that tamps below the limit."""

from collections import Counter
from collections.abc import Iterator

from mcsettle.study.checks.parts import Parts
from mcsettle.study.checks.traffic import is_buildable, tonnage
from mcsettle.study.effects import SHORTHAND, services_of
from mcsettle.study.faults import Fault, dotted
from mcsettle.study.former_keys import COST
from mcsettle.study.schema.currencies import CODES
from mcsettle.study.schema.economics import EconomicsTable
from mcsettle.study.schema.study import StudyTables
from mcsettle.study.schema.traffic import ScenarioTable

HOME = "GBP"  # currency of the default of the tamping cost


def economics_faults(parts: Parts) -> Iterator[Fault]:
    """What is compared, said once; and a change between each scenario and its baseline."""
    economics = parts.economics
    if economics is None:
        if parts.effects and not parts.has_economics:
            yield Fault("effects", "has no meaning without [economics]; give it, or leave this out")
        return
    if parts.effects:
        for key in SHORTHAND:
            if getattr(economics, key) is not None:
                yield Fault(
                    f"economics.{key}", "stands in each of the [[effects]]: leave it out here"
                )
        yield from _entries_faults(parts)
        return
    missing = [key for key in SHORTHAND[:2] if getattr(economics, key) is None]
    if len(missing) == 2 and (len(parts.scenario_names) < 2 or parts.has_line):
        return  # a price of tampings, and nothing to compare
    for key in missing:
        yield Fault(f"economics.{key}", "is missing and has no default but [[effects]]")
    if not missing:
        yield from _shorthand_faults(parts, economics)


def _shorthand_faults(parts: Parts, economics: EconomicsTable) -> Iterator[Fault]:
    """The effect needs one speed a scenario, and a change against the baseline."""
    changes = {}
    for index, scenario in parts.scenarios.items():
        path = dotted(("scenarios", index, "timetable"))
        speeds = sorted({service.speed_kmh for service in scenario.timetable})
        if economics.effect == "speed" and len(speeds) > 1:
            yield Fault(
                path,
                f"received the speeds {speeds}; with economics.effect = 'speed' it must be one, or "
                "name the train that becomes faster in [[effects]]",
            )
        elif economics.effect == "speed":
            changes[scenario.name] = (path, speeds[0])
        elif all(is_buildable(service.train, parts) for service in scenario.timetable):
            changes[scenario.name] = (path, tonnage(scenario, parts))
    base = changes.get(economics.baseline or "")
    for name, (path, value) in changes.items():
        if base is not None and name != economics.baseline and value == base[1]:
            message = f"has the same {economics.effect} as the baseline '{economics.baseline}': "
            yield Fault(path, message + f"there is no effect of {economics.effect} to price")


def _entries_faults(parts: Parts) -> Iterator[Fault]:
    """Entries that stand twice, and those between whose scenarios nothing changes, or too much."""
    scenarios = {scenario.name: scenario for scenario in parts.scenarios.values()}
    pairs = Counter((entry.scenario, entry.baseline) for entry in parts.effects.values())
    for index, entry in parts.effects.items():
        path = dotted(("effects", index))
        if pairs[entry.scenario, entry.baseline] > 1:
            said = (
                f"compares '{entry.scenario}' with '{entry.baseline}' a second time: once is enough"
            )
            yield Fault(path, said)
        elif entry.scenario == entry.baseline:
            yield Fault(f"{path}.baseline", "is the scenario itself")
        elif {entry.scenario, entry.baseline} <= set(scenarios):
            sides = scenarios[entry.scenario], scenarios[entry.baseline]
            fault = _speed_fault if entry.effect == "speed" else _tonnage_fault
            said = fault(entry.train, *sides, parts)
            if said:
                yield Fault(path, said)


def _speed_fault(
    train: str | None, scenario: ScenarioTable, base: ScenarioTable, parts: Parts
) -> str:
    """Why two scenarios do not differ in one speed alone; empty where they do."""
    del parts
    speeds = []
    for side in (base, scenario):
        found = sorted({s.speed_kmh for s in services_of(side.timetable, train)})
        if not found:
            return f"'{train}' does not run in '{side.name}'"
        if len(found) > 1:
            whose = f"'{train}' has" if train else "the trains have"
            name = "the train of one speed" if train else "the train that becomes faster"
            return f"{whose} the speeds {found} in '{side.name}'; an effect of speed needs {name}"
        speeds += found
    if speeds[0] == speeds[1]:
        return f"'{scenario.name}' has the same speed as '{base.name}': there is no effect to price"
    if train and _per_day(base, train) != _per_day(scenario, train):
        return (
            f"'{scenario.name}' differs from '{base.name}' in more than the speed of '{train}': the "
            "change of the interval could not be put down to it"
        )
    return ""


def _tonnage_fault(
    train: str | None, scenario: ScenarioTable, base: ScenarioTable, parts: Parts
) -> str:
    """Why two scenarios do not differ in tonnage, or not by ``train`` alone; empty where they do."""
    services = (*scenario.timetable, *base.timetable)
    if not all(is_buildable(service.train, parts) for service in services):
        return ""
    if tonnage(scenario, parts) == tonnage(base, parts):
        return (
            f"'{scenario.name}' has the same tonnage as '{base.name}': there is no effect to price"
        )
    before, after = _per_day(base), _per_day(scenario)
    moved = {key[0] for key in {*before, *after} if before[key] != after[key]}
    if train and moved != {train}:
        others = ", ".join(f"'{name}'" for name in sorted(moved - {train}))
        return f"'{train}' is not the train that is added: " + (
            f"{others} run otherwise than in '{base.name}'"
            if others
            else "it runs as often in both"
        )
    return ""


def _per_day(
    scenario: ScenarioTable, at_any_speed: str | None = None
) -> Counter[tuple[str, float]]:
    """Trains a day by name and speed, those of ``at_any_speed`` together."""
    found: Counter[tuple[str, float]] = Counter()
    for service in scenario.timetable:
        speed = 0.0 if service.train == at_any_speed else service.speed_kmh
        found[service.train, speed] += service.per_day
    return found


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
