"""What the tables of a study mean: its track, trains, timetables, prices, as objects in SI."""

from collections.abc import Iterable, Mapping
from functools import cached_property
from typing import TypeVar

import numpy as np

from mcsettle.economics import Change
from mcsettle.errors import InputError
from mcsettle.estimate.observation import Observation
from mcsettle.railway.softening_choices import SofteningSettings
from mcsettle.railway.track import Track
from mcsettle.railway.traffic import Timetable, Train
from mcsettle.study.build import (
    build_softening,
    build_timetable,
    build_track,
    settlement_settings,
)
from mcsettle.study.build_trains import build_train
from mcsettle.study.effects import StudyEffect, effect_entries, study_effects
from mcsettle.study.faults import suggestion
from mcsettle.study.scenes import profile_wavenumbers
from mcsettle.study.schema.run import SettlementTable
from mcsettle.study.schema.study import StudyTables
from mcsettle.study.schema.traffic import ScenarioTable
from mcsettle.study.schema.uncertain import UncertainTable
from mcsettle.study.schema.variants import VariantTable
from mcsettle.study.uncertain import followers
from mcsettle.units import DAYS_PER_YEAR, MGT


class StudyObjects(StudyTables):
    """The tables of a study and the objects of the model that they describe."""

    @property
    def fitted(self) -> Mapping[str, UncertainTable]:
        """Settlement factors that every parameter set fits to the observations, by variant."""
        by_variant: dict[str, UncertainTable] = {}
        for entry in self.uncertain:
            if entry.fitted:
                by_variant |= dict.fromkeys(followers(self.variants, entry.input), entry)
        return by_variant

    @property
    def observations(self) -> tuple[Observation, ...]:
        """What was observed of the line."""
        return tuple(entry.observation for entry in self.observed)

    @cached_property
    def trains(self) -> Mapping[str, Train]:
        """Every train of the study by name."""
        return {
            name: build_train(name, table, self.vehicle_tables)
            for name, table in self.train_tables.items()
        }

    def variant(self, name: str) -> VariantTable:
        """The variant ``name``.

        Raises
        ------
        InputError
            No such variant.
        """
        return _named(name, "variant", self.variants)

    def scenario(self, name: str) -> ScenarioTable:
        """The scenario ``name``.

        Raises
        ------
        InputError
            No such scenario.
        """
        return _named(name, "scenario", self.scenarios)

    def track(self, variant: str | None = None) -> Track:
        """The track of ``variant`` (None: without any variant's layers)."""
        return build_track(self.track_table, None if variant is None else self.variant(variant))

    def softening(self, variant: str | None = None) -> SofteningSettings | None:
        """How the layers of ``variant``'s track soften; None where the soil is linear."""
        table = None if variant is None else self.variant(variant)
        return build_softening(self.track_table, table)

    def timetable(self, scenario: str, variant: str | None = None) -> Timetable:
        """The ordered day of ``scenario``, its trains as ``variant`` reads them (None: as they are)."""
        trains = dict(self.trains)
        for name, table in ({} if variant is None else self.variant(variant).trains).items():
            changed = self.train_tables[name].model_copy(update=table.model_dump())
            trains[name] = build_train(name, changed, self.vehicle_tables)
        return build_timetable(self.scenario(scenario), trains)

    @property
    def currency(self) -> str:
        """Code of the currency of the study's prices; empty without any."""
        return "" if self.economics is None else self.economics.currency

    @property
    def reference_scenario(self) -> str:
        """Scenario whose first service is the reference of equivalent cycles: the first baseline."""
        entries = effect_entries(self)
        return entries[0].baseline if entries else self.scenario_names[0]

    def settlement_settings(self, variant: str) -> SettlementTable:
        """The settlement settings of ``variant``, its overrides applied."""
        return settlement_settings(self.settlement, self.variant(variant))

    @property
    def wavenumbers(self) -> np.ndarray:
        """Wavenumbers [K] rad/m of the profile's modes."""
        return profile_wavenumbers(self)

    @property
    def sample_days(self) -> np.ndarray:
        """Days [H] on which the SD is recorded: those of the run, the start and the first year."""
        days = {0.0, DAYS_PER_YEAR, *self.run.history_days}
        return np.array(sorted(day for day in days if day <= self.limit.horizon_days))

    def mgt_per_day(self, scenario: str) -> float:
        """Gross tonnage of ``scenario`` a day [MGT]: its own figure or its trains' sum."""
        given = self.scenario(scenario).mgt_per_day
        return given or self.timetable(scenario).mass_per_day / MGT

    def mgt_per_year(self, scenario: str) -> float:
        """Gross tonnage of ``scenario`` a year [MGT]: its own figure or 365 of its days."""
        given = self.scenario(scenario).mgt_per_year
        return given or self.mgt_per_day(scenario) * DAYS_PER_YEAR

    @cached_property
    def effects(self) -> Mapping[str, StudyEffect]:
        """What is compared with what, by name; empty without prices."""
        return study_effects(self)

    def change(self, name: str) -> Change | None:
        """What the effect ``name`` changes (a scenario's, where it has one baseline); None: no effect."""
        effect = self.effects.get(name)
        return None if effect is None else effect.change


Named = TypeVar("Named", ScenarioTable, VariantTable)


def _named(name: str, kind: str, tables: Iterable[Named]) -> Named:
    by_name = {table.name: table for table in tables}
    if name not in by_name:
        raise InputError(f"'{name}' is no {kind} of this study; {suggestion(name, by_name)}")
    return by_name[name]
