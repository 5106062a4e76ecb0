"""Study: one TOML file, read, validated, frozen, every default filled in.

``load_study`` is the door. A study holds the tables of the file (``schema.study``) and builds the
objects of the model from them; it knows nothing of how a study is run.
"""

import os
from collections.abc import Iterable, Mapping
from functools import cached_property, partial
from pathlib import Path
from typing import Any, Self, TypeVar

import numpy as np
import tomli_w
from pydantic import PrivateAttr, ValidationError

from mcsettle.economics import Change, speed_change, tonnage_change
from mcsettle.errors import InputError
from mcsettle.estimate.observation import Observation
from mcsettle.railway.ground_profiles import Ground
from mcsettle.railway.initial_profiles import InitialProfiles
from mcsettle.railway.measured_profiles import Record
from mcsettle.railway.scene import Scene
from mcsettle.railway.softening_choices import SofteningSettings
from mcsettle.railway.track import Track
from mcsettle.railway.traffic import Timetable, Train
from mcsettle.study.build import (
    SettlementSettings,
    build_softening,
    build_timetable,
    build_track,
    resolved_track,
    resolved_variant,
    settlement_settings,
)
from mcsettle.study.build_trains import build_train, resolved_train
from mcsettle.study.checks.names import source_faults
from mcsettle.study.checks.observed import observed_faults
from mcsettle.study.checks.parts import parts_of, valid_parts
from mcsettle.study.checks.together import faults_between, warnings_of
from mcsettle.study.checks.uncertain import uncertain_faults
from mcsettle.study.faults import Fault, faults_of, refusal, suggestion
from mcsettle.study.input_files import (
    ground_remarks,
    grounds_with_digests,
    input_file,
    profile_with_digest,
    read_grounds,
    read_record,
    record_remarks,
)
from mcsettle.study.library import expanded
from mcsettle.study.read import parsed_toml, toml_data, with_tuples
from mcsettle.study.scenes import (
    build_initial_profiles,
    build_scene,
    profile_wavenumbers,
    recorded_days,
    step_b_key,
)
from mcsettle.study.schema.economics import EconomicsTable
from mcsettle.study.schema.study import StudyTables
from mcsettle.study.schema.traffic import ScenarioTable
from mcsettle.study.schema.uncertain import UncertainTable
from mcsettle.study.schema.variants import VariantTable
from mcsettle.study.uncertain import (
    followers,
    has_uncertain_traffic,
    uncertain_settlement,
    with_values,
)
from mcsettle.study.written import study_data, study_digest
from mcsettle.units import DAYS_PER_YEAR, MGT

PARAMETER_SETS = 64  # of a study with uncertain inputs that does not say how many
EMBANKMENT = {"ballast", "sub_ballast"}  # layers that stay where the ground is replaced


class Study(StudyTables):
    """One validated study. Tables keep the file's keys and units; builders return SI objects."""

    _folder: Path | None = PrivateAttr(default=None)  # what file names start from

    def __repr__(self) -> str:
        sets = f", {self.run.parameter_sets or 'all'} parameter sets" if self.nested else ""
        return (
            f"<Study {self.title or 'untitled'!r}: scenarios {', '.join(self.scenario_names)}; "
            f"variants {', '.join(self.variant_names)}; {self.run.realisations} realisations{sets}>"
        )

    __str__ = __repr__

    @property
    def n_sets(self) -> int:
        """Parameter sets: draws of the uncertain inputs; 1 if none is uncertain."""
        if self.grounds_table is not None:
            return min(self.run.parameter_sets or len(self.grounds()), len(self.grounds()))
        return (self.run.parameter_sets or PARAMETER_SETS) if self.uncertain else 1

    @property
    def fitted(self) -> Mapping[str, UncertainTable]:
        """Settlement factors that every parameter set fits to the observations, by variant."""
        found: dict[str, UncertainTable] = {}
        for entry in self.uncertain:
            if entry.fitted:
                found |= dict.fromkeys(followers(self.variants, entry.input), entry)
        return found

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

    @cached_property
    def digest(self) -> str:
        """SHA-256 [hex] of all that decides a result: not titles, references, sample size.

        Observations decide it only where the sets fit a factor to them.
        """
        return study_digest(self, bool(self.fitted))

    @property
    def warnings(self) -> tuple[str, ...]:
        """Remarks on a sound study: wave speeds, a record's findings, layers too thin for the slabs.

        Raises
        ------
        InputError
            The profile's record or the grounds cannot be read or used.
        """
        return (
            *warnings_of(parts_of(self)),
            *record_remarks(self.profile, self.locate),
            *ground_remarks(self.grounds_table, self.locate),
        )

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
            own = self.train_tables[name].model_copy(update=table.model_dump())
            trains[name] = build_train(name, own, self.vehicle_tables)
        return build_timetable(self.scenario(scenario), trains)

    @property
    def reference_scenario(self) -> str:
        """Scenario whose first service is the reference of equivalent cycles: the baseline."""
        return self.scenario_names[0] if self.economics is None else self.economics.baseline

    def settlement_settings(self, variant: str) -> SettlementSettings:
        """The settlement settings of ``variant``, its overrides applied."""
        return settlement_settings(self.settlement, self.variant(variant))

    def scene(self, variant: str, scenario: str) -> Scene:
        """All that Steps A and B need of one variant and scenario."""
        return build_scene(self, variant, scenario)

    @property
    def scenes(self) -> tuple[Scene, ...]:
        """The scene of every variant and scenario, variants outermost."""
        return tuple(self.scene(v, s) for v in self.variant_names for s in self.scenario_names)

    def step_b_key(self, variant: str, scenario: str) -> str:
        """Digest of all that decides the rows of Step B: parameter sets of equal key share them."""
        return step_b_key(self, variant, scenario)

    def initial_profiles(self, variant: str | None = None) -> InitialProfiles:
        """Where the initial profiles of ``variant`` come from (None: as the study says)."""
        return build_initial_profiles(self, variant)

    @property
    def wavenumbers(self) -> np.ndarray:
        """Wavenumbers [K] rad/m of the profile's modes."""
        return profile_wavenumbers(self)

    @property
    def sample_days(self) -> np.ndarray:
        """Days [H] on which the SD is recorded: those of the run, the start and the first year."""
        return recorded_days(self)

    def mgt_per_day(self, scenario: str) -> float:
        """Gross tonnage of ``scenario`` a day [MGT]: its own figure or its trains' sum."""
        given = self.scenario(scenario).mgt_per_day
        return given or self.timetable(scenario).mass_per_day / MGT

    def mgt_per_year(self, scenario: str) -> float:
        """Gross tonnage of ``scenario`` a year [MGT]: its own figure or 365 of its days."""
        given = self.scenario(scenario).mgt_per_year
        return given or self.mgt_per_day(scenario) * DAYS_PER_YEAR

    def change(self, scenario: str) -> Change | None:
        """What ``scenario`` changes against the baseline; None for the baseline."""
        economics = self.priced
        if economics is None or scenario == economics.baseline:
            return None
        table = self.scenario(scenario)
        if economics.effect == "speed":
            speed = table.timetable[0].speed_kmh
            trains = economics.trains_thousand_per_year or 0.0
            return speed_change(economics.base_speed_kmh or 0.0, speed, trains)
        base = economics.mgt_per_day or 0.0
        added = self.mgt_per_day(scenario) - self.mgt_per_day(economics.baseline)
        return tonnage_change(base, base + added, table.mgt_per_year)

    def with_run(
        self,
        realisations: int | None = None,
        seed: int | None = None,
        stepping: str | None = None,
        parameter_sets: int | None = None,
    ) -> Self:
        """Copy with other sample sizes, seed or stepping (None: unchanged).

        Raises
        ------
        InputError
            A value the study file would refuse.
        """
        data = self.model_dump(by_alias=True, exclude_none=True)
        changes = {
            "realisations": realisations,
            "stepping": stepping,
            "parameter_sets": parameter_sets,
        }
        data["run"] |= {key: value for key, value in changes.items() if value is not None}
        data["seed"] = self.seed if seed is None else seed
        return type(self)._checked(data, "the run asked for", self._folder)

    def with_ground(self, layers: list[dict[str, Any]], origin: str) -> Self:
        """Copy on the ground ``layers`` (tables as in ``track.ground``) alone.

        Raises
        ------
        InputError
            A ground the study file would refuse.
        """
        data = study_data(self)
        data.pop("grounds", None)
        data["run"].pop("parameter_sets", None)
        data["track"] = data["track"] | {"ground": layers}
        data["track"]["layers"] = {
            name: table
            for name, table in data["track"].get("layers", {}).items()
            if name in EMBANKMENT
        }
        return self.from_mapping(data, origin, self._folder)

    def with_inputs(self, values: Mapping[str, float]) -> Self:
        """Copy with the inputs at the key paths ``values`` replaced; nothing of it is uncertain.

        Raises
        ------
        InputError
            A value the study file would refuse.
        """
        data = with_values(study_data(self), values)
        return self.from_mapping(data, "a draw of the inputs", self._folder)

    @classmethod
    def from_mapping(
        cls, data: Mapping[str, Any], origin: str = "the study", folder: Path | None = None
    ) -> Self:
        """Study of nested mappings and lists, as a TOML file gives them; all faults at once.

        File names in it start from ``folder`` (None: where the program runs).

        Raises
        ------
        InputError
            One line a fault: key path, value received, what is accepted.
        """
        return cls._checked(with_tuples(expanded(data, origin, folder)), origin, folder)

    @classmethod
    def _checked(cls, data: Mapping[str, Any], origin: str, folder: Path | None) -> Self:
        """Study of ``data`` after three kinds of checks: each table, tables together, inputs."""
        try:
            study, faults, faulty = cls.model_validate(data), [], set()
        except ValidationError as error:
            study, faults = None, faults_of(error, cls)
            faulty = {tuple(entry["loc"][:2]) for entry in error.errors(include_url=False)}
        faults += faults_between(valid_parts(data, faulty) if study is None else parts_of(study))
        if study is None or faults:
            raise refusal(origin, list(dict.fromkeys(faults)))
        study, faults = study._resolved()._with_digests(folder)
        faults = faults or study._input_faults()
        if faults:
            raise refusal(origin, faults)
        return study

    def _input_faults(self) -> list[Fault]:
        """Faults of sources, observations and uncertain inputs; the rest of the study is valid."""
        data = study_data(self)
        accept = partial(type(self).from_mapping, folder=self._folder)
        return [
            *source_faults(data, self.sources),
            *observed_faults(self),
            *uncertain_faults(self, data, accept),
        ]

    def locate(self, name: str) -> Path:
        """Path of the file that the study calls ``name``."""
        return input_file(self._folder, name, self.files_outside)

    def _with_digests(self, folder: Path | None) -> tuple[Self, list[Fault]]:
        """The study with the digests of the files it names, and the faults of those names."""
        self._folder = folder
        if self.profile.file is None and self.grounds_table is None:
            return self, []
        if self.grounds_table is None:
            profile, faults = profile_with_digest(self.profile, self.locate)
            return self.model_copy(update={"profile": profile}), faults
        grounds, faults = grounds_with_digests(self.grounds_table, self.locate)
        return self.model_copy(update={"grounds_table": grounds}), faults

    def grounds(self) -> tuple[Ground, ...]:
        """The possible grounds of the study, the likeliest of each segment first; empty: none.

        Raises
        ------
        InputError
            A file of theirs cannot be read or used.
        """
        table = self.grounds_table
        return () if table is None else read_grounds(table, self.locate)

    def input_files(self) -> dict[str, tuple[str, Path]]:
        """Files that a run of the study reads again: their names and paths, by key path."""
        names = {} if self.profile.file is None else {"profile.file": self.profile.file}
        if self.grounds_table is not None:
            names["grounds.layers"] = self.grounds_table.layers
            names["grounds.weights"] = self.grounds_table.weights
        return {key: (name, self.locate(name)) for key, name in names.items()}

    def record(self) -> Record | None:
        """The profile's measured record, read, filtered and cut; None where there is none.

        Raises
        ------
        InputError
            The record cannot be read or used.
        """
        return read_record(self.profile, self.locate)

    def _resolved(self) -> Self:
        """Copy with presets, vehicles, variants and economics written out."""
        varied = uncertain_settlement(self)
        return self.model_copy(
            update={
                "track_table": resolved_track(self.track_table, self.softens),
                "train_tables": {
                    k: resolved_train(t, self.vehicle_tables) for k, t in self.train_tables.items()
                },
                "variants": tuple(
                    resolved_variant(v, self.settlement, varied) for v in self.variants
                ),
                "economics": self.economics if has_uncertain_traffic(self) else self.priced,
            }
        )

    @property
    def identity(self) -> str:
        """SHA-256 [hex] of the study whatever its tracks: its reports and pictures are marked with it."""
        return study_digest(self.model_copy(update={"seed": 0}), bool(self.fitted))

    @property
    def priced(self) -> EconomicsTable | None:
        """The economics with base speed, trains a year and tonnage a day from the baseline."""
        if self.economics is None:
            return None
        timetable = self.timetable(self.economics.baseline)
        own = self.economics.model_dump(exclude_none=True)
        defaults = {
            "base_speed_kmh": self.scenario(self.economics.baseline).timetable[0].speed_kmh,
            "trains_thousand_per_year": timetable.trains_per_day * DAYS_PER_YEAR / 1000.0,
            "mgt_per_day": self.mgt_per_day(self.economics.baseline),
        }
        return EconomicsTable.model_validate(defaults | own)


def load_study(path: str | os.PathLike[str]) -> Study:
    """Read, validate and complete the study file at ``path``.

    Raises
    ------
    InputError
        The file cannot be read, is no TOML, or has faults (all of them are listed).
    """
    data = toml_data(Path(path))
    return Study.from_mapping(data, str(path), Path(path).absolute().parent)


def study_from_text(text: bytes, origin: str, folder: Path | None = None) -> Study:
    """The study in the bytes of a TOML file of ``folder``; ``origin`` names it in messages.

    Raises
    ------
    InputError
        It is no TOML, or has faults.
    """
    return Study.from_mapping(parsed_toml(text, origin), origin, folder)


def resolved_toml(study: Study, files: Mapping[str, str] | None = None) -> str:
    """``study`` as TOML with every default filled in; reading it gives an equal study.

    ``files``: other names for the files that the study names, by key path.
    """
    data = study_data(study)
    for path, name in (files or {}).items():
        table, _, key = path.partition(".")
        data[table][key] = name
    return tomli_w.dumps(data)


Named = TypeVar("Named", ScenarioTable, VariantTable)


def _named(name: str, kind: str, tables: Iterable[Named]) -> Named:
    found = {table.name: table for table in tables}
    if name not in found:
        raise InputError(f"'{name}' is no {kind} of this study; {suggestion(name, found)}")
    return found[name]
