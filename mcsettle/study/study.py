"""Study: one TOML file, read, validated, frozen, every default filled in.

``load_study`` is the door. A study holds the tables of the file (``schema``) and builds the
objects of the model from them; it knows nothing of how a study is run.
"""

import hashlib
import json
import os
from collections.abc import Iterable, Mapping
from functools import cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Self, TypeVar

import numpy as np
from pydantic import Field, PrivateAttr, ValidationError

from mcsettle.economics import Change, speed_change, tonnage_change
from mcsettle.errors import InputError
from mcsettle.railway.ground_profiles import Ground
from mcsettle.railway.irregularity import wavenumbers
from mcsettle.railway.measured_profiles import Record, prepared
from mcsettle.railway.softening_choices import SofteningSettings
from mcsettle.railway.track import Track
from mcsettle.railway.traffic import Timetable, Train
from mcsettle.study.build import (
    SettlementSettings,
    build_grounds,
    build_record,
    build_softening,
    build_timetable,
    build_track,
    resolved_track,
    resolved_variant,
    settlement_settings,
)
from mcsettle.study.build_trains import build_train, resolved_train
from mcsettle.study.checks.observed import observed_faults
from mcsettle.study.checks.parts import Parts
from mcsettle.study.checks.together import faults_between, warnings_of
from mcsettle.study.checks.uncertain import uncertain_faults
from mcsettle.study.faults import Fault, faults_of, refusal, suggestion
from mcsettle.study.input_files import digest_of, input_file
from mcsettle.study.key_paths import steps_to
from mcsettle.study.library import expanded
from mcsettle.study.read import parsed_toml, sound_parts, toml_data, with_tuples
from mcsettle.study.schema.base import FileName, KeyPath, Name, Table, Text
from mcsettle.study.schema.economics import EconomicsTable, MaintenanceTable
from mcsettle.study.schema.grounds import GroundsTable
from mcsettle.study.schema.observed import ObservedTable
from mcsettle.study.schema.profile import ProfileTable, RecordTable
from mcsettle.study.schema.published import CalibrationTable, ReferenceTable
from mcsettle.study.schema.run import LimitTable, RunTable, SettlementTable
from mcsettle.study.schema.track import TrackTable
from mcsettle.study.schema.traffic import ScenarioTable, TrainTable, VehicleTable
from mcsettle.study.schema.uncertain import CorrelationTable, UncertainTable
from mcsettle.study.schema.variants import VariantTable
from mcsettle.study.uncertain import followers, with_values
from mcsettle.study.write import toml_text
from mcsettle.units import DAYS_PER_YEAR, MGT

if TYPE_CHECKING:
    pass

SCHEMA_VERSION = 1
PARAMETER_SETS = 64  # of a study with uncertain inputs that does not say how many
_NO_EFFECT_ON_RESULTS = {
    "title",
    "reference",
    "calibration",
    "maintenance",
    "files_outside",
    "sources",
}


class Study(Table):
    """One validated study. Tables keep the file's keys and units; builders return SI objects."""

    schema_version: Annotated[int, Field(ge=1, le=SCHEMA_VERSION)]
    title: Text = ""
    seed: Annotated[int, Field(ge=0, lt=2**63)] = 1
    track_table: TrackTable = Field(default=TrackTable(), alias="track")
    profile: ProfileTable = ProfileTable()
    settlement: SettlementTable = SettlementTable()
    limit: LimitTable
    run: RunTable = RunTable()
    economics: EconomicsTable | None = None
    maintenance: MaintenanceTable | None = None
    train_tables: dict[Name, TrainTable] = Field(alias="trains", min_length=1, max_length=50)
    vehicle_tables: dict[Name, VehicleTable] = Field(default={}, alias="vehicles", max_length=100)
    grounds_table: GroundsTable | None = Field(default=None, alias="grounds")
    include: Annotated[tuple[FileName, ...], Field(max_length=20)] = ()
    scenarios: Annotated[tuple[ScenarioTable, ...], Field(min_length=1, max_length=200)]
    variants: Annotated[tuple[VariantTable, ...], Field(min_length=1, max_length=50)] = (
        VariantTable(name="base"),
    )
    reference: Annotated[tuple[ReferenceTable, ...], Field(max_length=1000)] = ()
    calibration: CalibrationTable | None = None
    files_outside: bool = False
    sources: dict[KeyPath, Text] = Field(default={}, max_length=500)
    uncertain: Annotated[tuple[UncertainTable, ...], Field(max_length=100)] = ()
    correlations: Annotated[tuple[CorrelationTable, ...], Field(max_length=1000)] = ()
    observed: Annotated[tuple[ObservedTable, ...], Field(max_length=1000)] = ()

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
    def nested(self) -> bool:
        """Whether the study has parameter sets: uncertain inputs, or several grounds."""
        return bool(self.uncertain) or self.grounds_table is not None

    @property
    def scenario_names(self) -> tuple[str, ...]:
        """Names of the scenarios, in the order of the file."""
        return tuple(scenario.name for scenario in self.scenarios)

    @property
    def variant_names(self) -> tuple[str, ...]:
        """Names of the variants, in the order of the file."""
        return tuple(variant.name for variant in self.variants)

    @property
    def softens(self) -> bool:
        """Whether the soil of any variant is equivalent-linear."""
        return any((v.soil or self.track_table.soil) != "linear" for v in self.variants)

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
        data = _plain(self, exclude=_NO_EFFECT_ON_RESULTS)
        if not self.fitted:
            data.pop("observed", None)
        data["run"].pop("realisations")
        data["run"].pop("parameter_sets", None)
        data.get("economics", {}).pop("price_base_year", None)
        for entry in [*data["scenarios"], *data["variants"], data["settlement"]]:
            entry.pop("title", None)
            entry.pop("factor_digest", None)
        for entry in data.get("uncertain", []) + data.get("correlations", []):
            entry.pop("source", None)
        if self.profile.file is not None:  # what is in the file decides, not what it is called
            data["profile"].pop("file")
        for entry in data.get("observed", []):
            entry.pop("source")
        for key in ("layers", "weights") if self.grounds_table is not None else ():
            data["grounds"].pop(key)
        text = json.dumps(data, sort_keys=True, separators=(",", ":"), allow_nan=False)
        return hashlib.sha256(text.encode()).hexdigest()

    @property
    def warnings(self) -> tuple[str, ...]:
        """Remarks on a sound study: speeds near a wave speed of the ground, a record's findings.

        Raises
        ------
        InputError
            The profile's record cannot be read or used.
        """
        return (*warnings_of(_parts(self)), *self._record_remarks())

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

    def timetable(self, scenario: str) -> Timetable:
        """The ordered day of ``scenario``."""
        return build_timetable(self.scenario(scenario), self.trains)

    def settlement_settings(self, variant: str) -> SettlementSettings:
        """The settlement settings of ``variant``, its overrides applied."""
        return settlement_settings(self.settlement, self.variant(variant))

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
        data = _plain(self)
        data.pop("grounds", None)
        data["run"].pop("parameter_sets", None)
        data["track"] = data["track"] | {"ground": layers}
        own = {"ballast", "sub_ballast"}
        data["track"]["layers"] = {
            name: table for name, table in data["track"].get("layers", {}).items() if name in own
        }
        return self.from_mapping(data, origin, self._folder)

    def with_inputs(self, values: Mapping[str, float]) -> Self:
        """Copy with the inputs at the key paths ``values`` replaced; nothing of it is uncertain.

        Raises
        ------
        InputError
            A value the study file would refuse.
        """
        data = with_values(_plain(self), values)
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
        try:
            study, faults, wrong = cls.model_validate(data), [], set()
        except ValidationError as error:
            study, faults = None, faults_of(error, cls)
            wrong = {tuple(entry["loc"][:2]) for entry in error.errors(include_url=False)}
        faults += faults_between(sound_parts(data, wrong) if study is None else _parts(study))
        if study is None or faults:
            raise refusal(origin, list(dict.fromkeys(faults)))
        study, faults = study._resolved()._with_files(folder)
        faults = faults or study._source_faults() + study._uncertain_faults()
        if faults:
            raise refusal(origin, faults)
        return study

    def _source_faults(self) -> list[Fault]:
        data = _plain(self, exclude={"sources"})
        return [
            Fault(
                f"sources.{path}", "names no input of this study; give the path of a key or table"
            )
            for path in self.sources
            if steps_to(data, path) is None
        ]

    def _uncertain_faults(self) -> list[Fault]:
        horizon, names = self.limit.horizon_days, self.scenario_names
        seen = list(observed_faults(self.observed, names, horizon, bool(self.uncertain)))
        return seen + self._input_faults()

    def _input_faults(self) -> list[Fault]:
        if self.grounds_table is not None:
            return []
        if not self.uncertain:
            wrong = "correlations" if self.correlations else "run.parameter_sets"
            said = "has no meaning without [[uncertain]] inputs; leave it out"
            given = bool(self.correlations) or (self.run.parameter_sets or 1) > 1
            return [Fault(wrong, said)] if given else []
        accept = partial(type(self).from_mapping, folder=self._folder)
        return uncertain_faults(
            _plain(self), self.uncertain, self.correlations, accept, bool(self.observed)
        )

    def _with_files(self, folder: Path | None) -> tuple[Self, list[Fault]]:
        """The study with the digest of the file it names, and the faults of that name."""
        if self.grounds_table is not None:
            return self._with_grounds(folder)
        if self.profile.file is None:
            return self, []
        self._folder = folder
        record = self.profile.record or RecordTable()
        try:
            path = input_file(folder, self.profile.file, self.files_outside)
            digest = digest_of(path, record.sha256)
        except InputError as error:
            return self, [Fault("profile.file", str(error))]
        profile = self.profile.model_copy(
            update={"record": record.model_copy(update={"sha256": digest})}
        )
        return self.model_copy(update={"profile": profile}), []

    def _with_grounds(self, folder: Path | None) -> tuple[Self, list[Fault]]:
        """The study with the digests of its files of grounds, and what is wrong with them."""
        self._folder = folder
        assert self.grounds_table is not None
        table, faults, digests = self.grounds_table, [], []
        for place, key in enumerate(("layers", "weights")):
            expected = table.sha256[place] if table.sha256 else None
            try:
                path = input_file(folder, getattr(table, key), self.files_outside)
                digests.append(digest_of(path, expected))
            except InputError as error:
                faults.append(Fault(f"grounds.{key}", str(error)))
        if self.profile.file is not None:
            faults.append(Fault("grounds", "cannot stand beside profile.file"))
        if self.uncertain:
            faults.append(Fault("grounds", "cannot stand beside [[uncertain]] inputs"))
        update = {"grounds_table": table.model_copy(update={"sha256": tuple(digests)})}
        return (self, faults) if faults else (self.model_copy(update=update), [])

    def grounds(self) -> tuple[Ground, ...]:
        """The possible grounds of the study, the likeliest of each segment first; empty: none.

        Raises
        ------
        InputError
            A file of theirs cannot be read or used.
        """
        table = self.grounds_table
        if table is None:
            return ()
        paths = [
            input_file(self._folder, n, self.files_outside) for n in (table.layers, table.weights)
        ]
        for path, digest in zip(paths, table.sha256 or (), strict=True):
            digest_of(path, digest, missing=False)
        return build_grounds(table, *paths)

    def input_files(self) -> dict[str, Path]:
        """Files that a run of the study reads again, by the names the study gives them."""
        names = [] if self.profile.file is None else [self.profile.file]
        if self.grounds_table is not None:
            names += [self.grounds_table.layers, self.grounds_table.weights]
        return {name: input_file(self._folder, name, self.files_outside) for name in names}

    def record(self) -> Record | None:
        """The profile's measured record, read, filtered and cut; None where there is none.

        Raises
        ------
        InputError
            The record cannot be read or used.
        """
        profile = self.profile
        if profile.file is None or profile.record is None:
            return None
        path = input_file(self._folder, profile.file, self.files_outside)
        choice = build_record(profile, path, digest_of(path, profile.record.sha256, missing=False))
        modes = wavenumbers(profile.window_m, profile.shortest_m, profile.longest_m)
        try:
            return prepared(choice, profile.window_m, modes)
        except InputError as error:
            raise InputError(f"profile.file '{profile.file}': {error}") from None

    def _record_remarks(self) -> list[str]:
        record = self.record()
        if record is None:
            return []
        kept = self.profile.record.repair if self.profile.record else ()
        return [
            f"profile.file: {finding.kind}: {finding.text}; "
            + ("mended, as asked for" if finding.kind in kept else "left as they are")
            for finding in record.findings
        ]

    def _resolved(self) -> Self:
        """Copy with presets, vehicles, variants and economics written out."""
        return self.model_copy(
            update={
                "track_table": resolved_track(self.track_table, self.softens),
                "train_tables": {
                    k: resolved_train(t, self.vehicle_tables) for k, t in self.train_tables.items()
                },
                "variants": tuple(
                    resolved_variant(v, self.settlement, self._uncertain_settlement)
                    for v in self.variants
                ),
                "economics": self.economics if self._uncertain_traffic else self.priced,
            }
        )

    @property
    def _uncertain_settlement(self) -> set[str]:
        """Keys of ``[settlement]`` that are uncertain: a variant without its own follows them."""
        split = (path.split(".") for entry in self.uncertain for path in entry.paths)
        return {steps[1] for steps in split if len(steps) == 2 and steps[0] == "settlement"}

    @property
    def _uncertain_traffic(self) -> bool:
        """Whether what the economics take from the timetable differs between parameter sets."""
        roots = {path.split(".")[0] for entry in self.uncertain for path in entry.paths}
        return bool(roots & {"trains", "scenarios"})

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


def resolved_toml(study: Study) -> str:
    """``study`` as TOML with every default filled in; reading it gives an equal study."""
    return toml_text(_plain(study))


def study_data(study: Study) -> dict[str, Any]:
    """``study`` as nested mappings and lists under the file's keys, every default filled in."""
    return _plain(study)


def json_schema() -> dict[str, Any]:
    """JSON Schema of study files, for editors that complete and check TOML."""
    schema = Study.model_json_schema(by_alias=True)
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **schema}


def _plain(study: Study, exclude: set[str] | None = None) -> dict[str, Any]:
    """The study as mappings and lists under the file's keys; empty tables and None left out."""
    data = study.model_dump(mode="json", by_alias=True, exclude_none=True, exclude=exclude)
    data["track"] = {key: value for key, value in data["track"].items() if value not in ({}, [])}
    for variant in data["variants"]:
        if not variant["layers"]:
            del variant["layers"]
    for key in (
        "reference",
        "uncertain",
        "correlations",
        "observed",
        "sources",
        "vehicles",
        "include",
    ):
        if not data.get(key):
            data.pop(key, None)
    for entry in data.get("reference", []):
        if not entry["note"]:
            del entry["note"]
    for entry in data.get("uncertain", []):
        for key in ("also", "fitted"):
            if not entry[key]:
                del entry[key]
    return data


def _parts(study: Study) -> Parts:
    return Parts(
        track=study.track_table,
        profile=study.profile,
        limit=study.limit,
        economics=study.economics,
        calibration=study.calibration,
        run=study.run,
        maintenance=study.maintenance,
        trains=study.train_tables,
        vehicles=study.vehicle_tables,
        train_names=tuple(study.train_tables),
        scenario_names=study.scenario_names,
        variant_names=study.variant_names,
        scenarios=dict(enumerate(study.scenarios)),
        variants=dict(enumerate(study.variants)),
        reference=dict(enumerate(study.reference)),
    )


Named = TypeVar("Named", ScenarioTable, VariantTable)


def _named(name: str, kind: str, tables: Iterable[Named]) -> Named:
    found = {table.name: table for table in tables}
    if name not in found:
        raise InputError(f"'{name}' is no {kind} of this study; {suggestion(name, found)}")
    return found[name]


def study_wavenumbers(study: Study) -> np.ndarray:
    """Wavenumbers [K] rad/m of the profile modes of a study."""
    profile = study.profile
    return wavenumbers(profile.window_m, profile.shortest_m, profile.longest_m)
