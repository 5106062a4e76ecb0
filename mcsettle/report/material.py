"""Everything a report is made of: the tables of a run, their summary, their origin, the choices."""

import hashlib
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from mcsettle.analysis.table4 import Increase
from mcsettle.analysis.track_case import TrackCase
from mcsettle.storage.provenance import Provenance, read_provenance
from mcsettle.study.study import Study
from mcsettle.summary.answers import Answers, answers
from mcsettle.summary.results import KEYS, Results, read_results
from mcsettle.summary.summary import SummaryRow, summary_rows


@dataclass(frozen=True)
class StepAPart:
    """What Step A adds: the track made ready to be looked at, and Table 4 (may be empty)."""

    case: TrackCase
    table4: tuple[Increase, ...]


@dataclass(frozen=True)
class Material:
    """What the parts of a report share."""

    results: Results
    rows: tuple[SummaryRow, ...]
    answers: Answers
    provenance: Provenance
    miles: bool = False
    step_a: StepAPart | None = None

    @property
    def study(self) -> Study:
        """The study of the run."""
        return self.results.study

    @property
    def variant(self) -> str:
        """The variant the answer is taken from."""
        return self.answers.form

    @property
    def n_tracks(self) -> int:
        """Different tracks simulated."""
        return int(self.results.realisations["realisation"].nunique())

    @property
    def n_sets(self) -> int:
        """Parameter sets simulated."""
        return int(self.results.realisations["parameter_set"].nunique())

    def of(self, variant: str) -> list[SummaryRow]:
        """Rows of one variant."""
        return [row for row in self.rows if row.variant == variant]

    def row(self, name: str, metric: str, variant: str | None = None) -> SummaryRow | None:
        """One row of a scenario or effect, of the answer's variant unless another is named."""
        key = (variant or self.variant, name, metric)
        return next((r for r in self.rows if (r.variant, r.name, r.metric) == key), None)

    def published(self, name: str, metric: str) -> float | None:
        """The published value of a metric of a scenario or effect; None without."""
        row = self.row(name, metric)
        return None if row is None or row.reference is None else row.reference.value

    def tracks(self, scenario: str, variant: str | None = None) -> pd.DataFrame:
        """Rows of ``realisations`` of one scenario that did not fail."""
        return self.results.sound(variant or self.variant, scenario)

    def history(self, scenario: str) -> pd.DataFrame:
        """Rows of ``history`` of one scenario in the answer's variant, of tracks that did not fail."""
        history = self.results.part("history", self.variant, scenario)
        table = self.results.part("realisations", self.variant, scenario)
        failed = table[table["status"] == "failed"]
        if history.empty or failed.empty:
            return history
        lost = pd.MultiIndex.from_frame(failed[KEYS])
        return history[~pd.MultiIndex.from_frame(history[KEYS]).isin(lost)]

    def effects(self, name: str) -> pd.DataFrame:
        """Rows of ``effects`` of the effect ``name`` with both intervals known."""
        if self.results.effects.empty:
            return self.results.effects
        table = self.results.pairs(self.variant, self.study.effects[name])
        return table[table["status"] == "paired"]

    def title(self, name: str) -> str:
        """Title of a scenario or effect, or its name."""
        effect = self.study.effects.get(name)
        if effect is None or effect.name == effect.scenario:
            return self.study.scenario(name).title or name
        sides = (self.study.scenario(side) for side in (effect.scenario, effect.baseline))
        return " against ".join(side.title or side.name for side in sides)

    def tint(self, name: str) -> int:
        """Number of the colour that a scenario, and each of its effects, has in every picture."""
        effect = self.study.effects.get(name)
        return self.study.scenario_names.index(name if effect is None else effect.scenario)

    @property
    def compared(self) -> list[str]:
        """Names of the effects."""
        return list(self.study.effects)

    @property
    def has_speed_effect(self) -> bool:
        """Whether a scenario is compared for its speed."""
        return any(e.change.effect == "speed" for e in self.study.effects.values())


def read_material(folder: Path, variant: str | None = None, miles: bool = False) -> Material:
    """What the folder of a run holds.

    Raises
    ------
    InputError
        No finished run there, or no such variant.
    """
    results = read_results(folder)
    first = answers(results, variant)
    rows = tuple(summary_rows(results))
    return Material(results, rows, first, read_provenance(folder), miles)


def for_pictures(results: Results, variant: str | None = None) -> Material:
    """What pictures of ``results`` are made of; they say nothing of provenance.

    Raises
    ------
    InputError
        No such variant.
    """
    unsaid = Provenance("", "", "", 0, "", "", 0)
    return Material(results, tuple(summary_rows(results)), answers(results, variant), unsaid)


def rows_digest(table: pd.DataFrame) -> str:
    """SHA-256 [hex] of the rows of a table, in whatever order and files they were stored."""
    if table.empty:
        return "empty"
    hashes = pd.util.hash_pandas_object(table, index=False).to_numpy()
    return hashlib.sha256(np.sort(hashes).tobytes()).hexdigest()
