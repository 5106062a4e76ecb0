"""A results folder read back: its tables, its study, whose it is."""

from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from mcsettle.errors import InputError
from mcsettle.estimate.conditioning import Conditioning, InputBand
from mcsettle.estimate.estimate import LEVELS, Estimate, Statistic
from mcsettle.estimate.weighted_quantiles import weighted_quantiles
from mcsettle.storage import manifest, store
from mcsettle.storage.location import Folder, Place, Where, place
from mcsettle.storage.manifest import MANIFEST, STUDY_FILE
from mcsettle.storage.tables import input_column
from mcsettle.study.effects import StudyEffect
from mcsettle.study.former_keys import COST, former_cost
from mcsettle.study.key_units import input_units
from mcsettle.study.parameter_sets import ParameterSet, all_sets
from mcsettle.study.study import Study, study_from_text
from mcsettle.summary.labelled import labelled

if TYPE_CHECKING:
    import xarray

INTERVAL, CENSORED = "tamping_interval_days", "censored_at_days"  # columns of ``realisations``
KEYS = ["parameter_set", "realisation"]  # columns that tell tracks apart


@dataclass(frozen=True)
class Results:
    """A finished run: its study and its tables (all but ``realisations`` may be empty)."""

    study: Study
    realisations: pd.DataFrame
    history: pd.DataFrame
    effects: pd.DataFrame
    weights: pd.DataFrame = field(default_factory=pd.DataFrame)
    sign_split: pd.DataFrame = field(default_factory=pd.DataFrame)
    summary: pd.DataFrame = field(default_factory=pd.DataFrame)

    @cached_property
    def members(self) -> list[ParameterSet]:
        """The parameter sets of the study."""
        return all_sets(self.study)

    @cached_property
    def sets(self) -> np.ndarray:
        """Indices [E] of the parameter sets that were run, rising."""
        return np.unique(self.realisations["parameter_set"].to_numpy(dtype=int))

    def tracks(self, variant: str, scenario: str) -> np.ndarray:
        """Numbers [R] of the realisations of one variant and scenario, rising."""
        return np.unique(self.part("realisations", variant, scenario)["realisation"].to_numpy())

    @cached_property
    def _by_scenario(self) -> dict[str, dict[object, pd.DataFrame]]:
        tables = {name: getattr(self, name) for name in ("realisations", "history", "effects")}
        by = ["variant", "scenario"]
        return {
            name: {} if table.empty else dict(iter(table.groupby(by, sort=False, observed=True)))
            for name, table in tables.items()
        }

    def part(self, table: str, variant: str, scenario: str) -> pd.DataFrame:
        """Rows of ``realisations``, ``history`` or ``effects`` of one variant and scenario."""
        nothing = getattr(self, table).iloc[:0]
        return self._by_scenario[table].get((variant, scenario), nothing)

    def sound(self, variant: str, scenario: str) -> pd.DataFrame:
        """Rows of ``realisations`` of one variant and scenario that did not fail."""
        table = self.part("realisations", variant, scenario)
        return table[table["status"] != "failed"]

    def pairs(self, variant: str, effect: StudyEffect) -> pd.DataFrame:
        """Rows of ``effects`` of one variant and effect."""
        table = self.part("effects", variant, effect.scenario)
        several = sum(other.scenario == effect.scenario for other in self.study.effects.values())
        if table.empty or several == 1:
            return table
        return table[table["baseline"] == effect.baseline]

    @cached_property
    def _statistics(self) -> dict[tuple[str, ...], list[Statistic]]:
        if self.summary.empty:
            return {}
        statistics: dict[tuple[str, ...], list[Statistic]] = {}
        for row in self.summary.astype(object).where(self.summary.notna(), None).to_dict("records"):
            estimate = Estimate(
                *(row["value"], row["lo"], row["hi"], row["standard_error"]),
                *(int(row["n"]), int(row["n_censored"]), row["unit"], row["note"] or ""),
            )
            key = row["variant"], row["scenario"], row["baseline"] or "", row["metric"]
            one = Statistic(row["statistic"], row["level"], estimate, row["subject"] or "")
            statistics.setdefault(key, []).append(one)
        return statistics

    def statistics(
        self, variant: str, scenario: str, baseline: str, metric: str
    ) -> list[Statistic]:
        """What the run's own table ``summary`` says of a metric; empty where it does not."""
        others = (e for e in self.study.effects.values() if e.scenario == scenario)
        if sum(e.baseline == baseline for e in others) > 1:  # its rows do not tell them apart
            return []
        return self._statistics.get((variant, scenario, baseline, metric), [])

    def input_bands(self, variant: str) -> list[InputBand]:
        """What the observations leave of every uncertain input in ``variant``; empty without."""
        weights = self.set_weights(variant)
        if weights is None:
            return []
        rows = self.realisations[self.realisations["variant"] == variant]
        drawn, bands = rows.groupby("parameter_set").first(), []
        for entry in self.study.uncertain:
            values = drawn[input_column(entry.input)].to_numpy(dtype=float)
            plain, given = (
                tuple(weighted_quantiles(values, of_sets, LEVELS).tolist())
                for of_sets in (np.ones(len(values)), weights)
            )
            bands.append(InputBand(entry.input, plain, given))
        return bands

    def conditioning(self, variant: str) -> Conditioning | None:
        """Weights of the parameter sets of ``variant`` given the observations; None without."""
        if self.weights.empty:
            return None
        rows = self.weights[self.weights["variant"] == variant].sort_values("parameter_set")
        logs = rows["log_likelihood"].to_numpy(dtype=float, na_value=-np.inf)
        return Conditioning(variant, logs) if len(rows) else None

    def set_weights(self, variant: str) -> np.ndarray | None:
        """Weights [E] that ``conditioning`` gives; None without, or if too few sets carry them."""
        conditioning = self.conditioning(variant)
        return conditioning.weights if conditioning is not None and conditioning.usable else None

    def to_xarray(self) -> "xarray.Dataset":
        """Intervals, SDs and effects over scenario, variant, parameter_set and realisation.

        Units and meanings are attributes (``units``, ``long_name``) of each variable. Where a scenario
        has several baselines, effects are over ``baseline`` too.

        Raises
        ------
        InputError
            The extra ``xarray`` is not installed.
        """
        tables = {"realisations": self.realisations, "effects": self.effects}
        study = self.study
        names = study.scenario_names, study.variant_names
        units, prices = input_units(study), {e.change.unit for e in study.effects.values()}
        if len(prices) == 1:
            units |= {"marginal_cost": prices.pop()}
        return labelled(tables, *names, study.currency, units)

    def __repr__(self) -> str:
        counts = self.realisations["status"].value_counts()
        said = ", ".join(f"{n} {status}" for status, n in counts.items())
        return f"<Results of {self.study!r}: {said}>"


def read_results(folder: Where, finished: bool = True, prices_only: bool = False) -> Results:
    """Read the tables that a run has left in ``folder`` (a path or a URL).

    A run that is not finished is refused, unless ``finished`` is False. ``prices_only``: without the
    tables of which intervals and prices need nothing, and which are the largest.

    Raises
    ------
    InputError
        The folder does not exist, holds no finished run, or a file of it is damaged or missing.
    """
    at = folder_of_run(folder, finished)
    wanted = ("realisations", "history", "effects", "weights", "sign_split", "summary")
    study = study_of(at)
    spared = ("history", "sign_split", "summary") if prices_only and not study.observed else ()
    spared = spared if finished else (*spared, "summary")  # of a smaller run, maybe
    realisations, *others = (
        pd.DataFrame() if name in spared else _table(at, name) for name in wanted
    )
    return Results(study, realisations.rename(columns=_former_columns(study.currency)), *others)


def folder_of_run(folder: Where, finished: bool = True) -> Place:
    """The folder of a run, which has to be ``finished``.

    Raises
    ------
    InputError
        The folder does not exist, or holds no such run.
    """
    at = place(folder)
    if not at.exists():
        raise InputError(f"{at} is no folder; 'mcsettle run STUDY --out {at}' makes one")
    names = set(at.entries())
    if STUDY_FILE not in names or not at.names("realisations"):
        raise InputError(
            f"{at} holds no finished run (realisations/ and {STUDY_FILE}); "
            f"'mcsettle run STUDY --out {at}' makes one"
        )
    if finished and MANIFEST not in names:
        raise InputError(
            f"{at} holds a run that is not finished; 'mcsettle status {at}' says what is missing, "
            "and the same run command goes on with it"
        )
    return at


def study_of(folder: Where) -> Study:
    """The study that a results folder is of.

    Raises
    ------
    InputError
        There is none, or it cannot be read.
    """
    at = place(folder)
    text = store.read_file(at, STUDY_FILE)
    folder_here = at.path.absolute() if isinstance(at, Folder) else None
    return study_from_text(text, f"{at}/{STUDY_FILE}", folder_here)


def _former_columns(currency: str) -> dict[str, str]:
    """Columns of inputs as results of earlier versions have them, and their present names."""
    keys = former_cost(currency), COST
    former, present = (input_column(f"economics.{key}") for key in keys)
    return {former: present}


def _table(at: Place, name: str) -> pd.DataFrame:
    """The table ``name`` of a run, empty where it was not written."""
    if not at.names(name) and not manifest.lists(at, name):
        return pd.DataFrame()
    table: pd.DataFrame = store.read(at, name).to_pandas()
    return table
