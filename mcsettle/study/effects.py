"""What a study compares: each scenario with its baselines, and what changes between them.

``[economics]`` with ``effect`` and ``baseline`` is short for one entry of ``[[effects]]`` for every other
scenario. The figures that an entry leaves out follow from the baseline's timetable.
"""

from collections import Counter
from dataclasses import dataclass
from typing import TYPE_CHECKING

from mcsettle.economics import Change, speed_change, tonnage_change
from mcsettle.study.schema.economics import EconomicsTable, EffectTable
from mcsettle.study.schema.traffic import ServiceTable
from mcsettle.units import DAYS_PER_YEAR

if TYPE_CHECKING:
    from mcsettle.study.objects import StudyObjects

SHORTHAND = ("effect", "baseline", "base_speed_kmh", "trains_thousand_per_year", "mgt_per_day")


@dataclass(frozen=True)
class StudyEffect:
    """One scenario against one baseline.

    ``name``: that of the scenario, with its baseline where it has several. ``train``: the one whose speed
    changes, or that is added; None: all trains.
    """

    name: str
    scenario: str
    baseline: str
    train: str | None
    change: Change


def study_effects(study: "StudyObjects") -> dict[str, StudyEffect]:
    """Effects by name, in the order of the scenarios; empty without prices."""
    if study.economics is None:
        return {}
    entries = effect_entries(study)
    places = {name: place for place, name in enumerate(study.scenario_names)}
    counts, effects = Counter(entry.scenario for entry in entries), {}
    for entry in sorted(entries, key=lambda entry: places[entry.scenario]):
        name = entry.scenario
        if counts[name] > 1:
            name = f"{name} against {entry.baseline}"
        change = _change(study, resolved_entry(study, entry))
        effects[name] = StudyEffect(name, entry.scenario, entry.baseline, entry.train, change)
    return effects


def effect_entries(study: "StudyObjects") -> tuple[EffectTable, ...]:
    """The entries of ``[[effects]]``, or those that ``[economics]`` is short for."""
    table = study.economics
    if table is None or table.effect is None:
        return study.effect_tables
    common = {key: getattr(table, key) for key in SHORTHAND}
    others = (name for name in study.scenario_names if name != table.baseline)
    return tuple(EffectTable(scenario=name, **common) for name in others)


def resolved_entry(study: "StudyObjects", entry: EffectTable) -> EffectTable:
    """``entry`` with base speed, trains a year and tonnage a day from its baseline."""
    return entry.model_copy(update=_figures(study, entry.baseline, entry.train) | _given(entry))


def resolved_economics(study: "StudyObjects") -> EconomicsTable | None:
    """``[economics]`` with the figures of the baseline, where it names one."""
    table = study.economics
    if table is None or table.baseline is None:
        return table
    return table.model_copy(update=_figures(study, table.baseline, None) | _given(table))


def services_of(services: tuple[ServiceTable, ...], train: str | None) -> list[ServiceTable]:
    """The services of ``train``; of all trains where it is None."""
    return [service for service in services if train in (None, service.train)]


def _given(table: EconomicsTable | EffectTable) -> dict[str, float]:
    """The figures that a table states itself."""
    values = {key: getattr(table, key) for key in SHORTHAND[2:]}
    return {key: value for key, value in values.items() if value is not None}


def _figures(study: "StudyObjects", baseline: str, train: str | None) -> dict[str, float]:
    figures = {"mgt_per_day": study.mgt_per_day(baseline)}
    services = services_of(study.scenario(baseline).timetable, train)
    if services:  # none of a train that is added
        trains = sum(service.per_day for service in services)
        figures["base_speed_kmh"] = services[0].speed_kmh
        figures["trains_thousand_per_year"] = trains * DAYS_PER_YEAR / 1000.0
    return figures


def _change(study: "StudyObjects", entry: EffectTable) -> Change:
    table, currency = study.scenario(entry.scenario), study.currency
    if entry.effect == "speed":
        speed = services_of(table.timetable, entry.train)[0].speed_kmh
        trains = entry.trains_thousand_per_year or 0.0
        return speed_change(entry.base_speed_kmh or 0.0, speed, trains, currency)
    base = entry.mgt_per_day or 0.0
    added = study.mgt_per_day(entry.scenario) - study.mgt_per_day(entry.baseline)
    return tonnage_change(base, base + added, table.mgt_per_year, currency)
