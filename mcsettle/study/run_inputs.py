"""All that a run takes from its study, taken once: nothing in ``run/`` asks the study again."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import NamedTuple

from mcsettle.estimate.factor_posterior import Prior
from mcsettle.estimate.observation import Observation
from mcsettle.step_a.transfers import TransferStore
from mcsettle.storage.manifest import INPUTS
from mcsettle.study.extent import Extent, extent_of
from mcsettle.study.key_units import input_units
from mcsettle.study.parameter_sets import CENTRAL, ParameterSet, all_sets, same_step_b
from mcsettle.study.study import Study, resolved_toml
from mcsettle.study.transfer_store import transfer_store


class FittedFactor(NamedTuple):
    """A settlement factor that every parameter set fits to the observations: key path and prior."""

    path: str
    prior: Prior


@dataclass(frozen=True, eq=False)
class RunInputs:
    """One study as a run sees it.

    ``sets`` are its parameter sets, ``central`` the one on whose trains and effects remarks are made: the
    study's own inputs, or the first ground that can be run. ``transfers``: an empty store for the sets to
    share, None where the study is its only set. ``effects``: (baseline, scenario) of each; ``fitted`` by
    variant; ``units`` of the drawn inputs by their columns. ``toml``: the study with every default filled
    in, its files under the names that they have in a results folder; ``files``: where they lie now.
    """

    digest: str
    seed: int
    precision: str
    stepping: str
    currency: str
    extent: Extent
    sets: list[ParameterSet]
    central: ParameterSet
    predicts_grounds: bool
    effects: tuple[tuple[str, str], ...]
    observations: tuple[Observation, ...]
    fitted: Mapping[str, FittedFactor]
    units: dict[str, str]
    toml: str
    files: Mapping[str, Path]
    transfers: TransferStore | None

    @cached_property
    def same_rows(self) -> dict[tuple[int, str, str], int]:
        """``same_step_b`` of the parameter sets."""
        return same_step_b(self.sets)


def run_inputs(study: Study) -> RunInputs:
    """What a run of ``study`` needs of it; a results folder's own study gives the same.

    Raises
    ------
    InputError
        A draw that the study would refuse (inputs that are each possible may not be together).
    """
    sets = all_sets(study)
    central = ParameterSet(CENTRAL, {}, study)
    if study.grounds_table is not None:
        central = next((member for member in sets if not member.failure), central)
    files = _stored_files(study)
    return RunInputs(
        digest=study.digest,
        seed=study.seed,
        precision=study.run.precision,
        stepping=study.run.stepping,
        currency=study.currency,
        extent=extent_of(study),
        sets=sets,
        central=central,
        predicts_grounds=study.nested and study.predicts_grounds,
        effects=tuple((e.baseline, e.scenario) for e in study.effects.values()),
        observations=study.observations,
        fitted={
            variant: FittedFactor(entry.input, entry.built())
            for variant, entry in study.fitted.items()
        },
        units=input_units(study),
        toml=resolved_toml(study, {key: stored for key, (stored, _) in files.items()}),
        files=dict(files.values()),
        transfers=transfer_store(study) if study.nested else None,
    )


def _stored_files(study: Study) -> dict[str, tuple[str, Path]]:
    """Names that the study's files have in a results folder, and their paths, by key path.

    Each has a folder of its own, so that none meets a file of the run or another input. A file outside
    the study's folder stays there.
    """
    return {
        key: (f"{INPUTS}/{key}/{Path(name).name}", path)
        for key, (name, path) in study.input_files().items()
        if not Path(name).is_absolute() and ".." not in Path(name).parts
    }
