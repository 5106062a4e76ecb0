"""Study: one TOML file, read, validated, frozen, every default filled in.

``load_study`` is the door. A study holds the tables of the file (``schema.study``) and builds the
objects of the model from them; it knows nothing of how a study is run.
"""

import os
from collections.abc import Mapping
from functools import cached_property, partial
from pathlib import Path
from typing import Any, Self

import tomli_w
from pydantic import PrivateAttr, ValidationError

from mcsettle.railway.ground_profiles import Ground
from mcsettle.railway.initial_profiles import InitialProfiles
from mcsettle.railway.measured_profiles import Record
from mcsettle.railway.scene import Scene
from mcsettle.study.build import resolved_track, resolved_variant
from mcsettle.study.build_trains import resolved_train
from mcsettle.study.checks.economics import unpriced_maintenance
from mcsettle.study.checks.names import source_faults
from mcsettle.study.checks.observed import observed_faults, unfitted_faults
from mcsettle.study.checks.parts import parts_of, valid_parts
from mcsettle.study.checks.together import faults_between, warnings_of
from mcsettle.study.checks.uncertain import uncertain_faults
from mcsettle.study.effects import resolved_economics, resolved_entry
from mcsettle.study.faults import Fault, faults_of, refusal
from mcsettle.study.former_keys import with_present_keys
from mcsettle.study.input_files import (
    ground_remarks,
    grounds_with_digests,
    input_file,
    profile_with_digest,
    read_grounds,
    read_record,
    record_remarks,
)
from mcsettle.study.library import expanded, stated_inputs
from mcsettle.study.objects import StudyObjects
from mcsettle.study.read import parsed_toml, toml_data, with_tuples
from mcsettle.study.sample_cap import capped
from mcsettle.study.scenes import build_initial_profiles, build_scene, step_b_key
from mcsettle.study.uncertain import has_uncertain_traffic, uncertain_settlement, with_values
from mcsettle.study.written import study_data, study_digest

PARAMETER_SETS = 64  # of a study with uncertain inputs that does not say how many
EMBANKMENT = {"ballast", "sub_ballast"}  # layers that stay where the ground is replaced


class Study(StudyObjects):
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
        asked = {key: value for key, value in changes.items() if value is not None}
        others = {f"run.{key}" for key, value in asked.items() if data["run"].get(key) != value}
        if seed not in (None, self.seed):
            others |= {"seed"}
        data["run"] |= asked
        data["seed"] = self.seed if seed is None else seed
        data["stated"] = tuple(path for path in self.stated if path not in others)
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
        present = with_present_keys(data, origin)
        study = cls._checked(with_tuples(expanded(present, origin, folder)), origin, folder)
        if "stated" in data:
            return study
        return study.model_copy(update={"stated": stated_inputs(present, origin, folder)})

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
            *unpriced_maintenance(self),
            *observed_faults(self),
            *unfitted_faults(self, self.variant_names, self.fitted),
            *uncertain_faults(self, data, accept),
        ]

    def locate(self, name: str) -> Path:
        """Path of the file that the study calls ``name``."""
        return input_file(self._folder, name, self.files_outside)

    def _with_digests(self, folder: Path | None) -> tuple[Self, list[Fault]]:
        """The study with the digests of the files it names, and the faults of those names."""
        if self.profile.file is None and self.grounds_table is None and self.line is None:
            return self, []
        self._folder = folder
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
            }
            | ({} if has_uncertain_traffic(self) else self._resolved_effects())
        )

    def _resolved_effects(self) -> dict[str, Any]:
        """The figures of the baselines written out."""
        entries = tuple(resolved_entry(self, entry) for entry in self.effect_tables)
        return {"economics": resolved_economics(self), "effect_tables": entries}

    @property
    def identity(self) -> str:
        """SHA-256 [hex] of the study whatever its tracks: its reports and pictures are marked with it."""
        return study_digest(self.model_copy(update={"seed": 0}), bool(self.fitted))


def load_study(path: str | os.PathLike[str]) -> Study:
    """Read, validate and complete the study file at ``path``; its sample is as large as allowed.

    Raises
    ------
    InputError
        The file cannot be read, is no TOML, or has faults (all of them are listed).
    """
    data = toml_data(Path(path))
    study = Study.from_mapping(data, str(path), Path(path).absolute().parent)
    n, sets = capped(study.run.realisations), capped(study.n_sets)
    if n == study.run.realisations and sets == study.n_sets:
        return study
    return study.with_run(n, parameter_sets=sets if study.nested else None)


def study_from_text(text: bytes, origin: str, folder: Path | None = None) -> Study:
    """The study in the bytes that a run keeps in its ``folder``; ``origin`` names it in messages.

    Earlier versions kept no record of the inputs that the author wrote: those are unknown then.

    Raises
    ------
    InputError
        It is no TOML, or has faults.
    """
    return Study.from_mapping({"stated": (), **parsed_toml(text, origin)}, origin, folder)


def resolved_toml(study: Study, files: Mapping[str, str] | None = None) -> str:
    """``study`` as TOML with every default filled in; reading it gives an equal study.

    ``files``: other names for the files that the study names, by key path.
    """
    data = study_data(study)
    for path, name in (files or {}).items():
        table, _, key = path.partition(".")
        data[table][key] = name
    return tomli_w.dumps(data)
