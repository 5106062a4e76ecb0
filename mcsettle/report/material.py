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
from mcsettle.summary.results import Results, read_results
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

    def row(self, scenario: str, metric: str, variant: str | None = None) -> SummaryRow | None:
        """One row, of the answer's variant unless another is named."""
        wanted = (variant or self.variant, scenario, metric)
        found = (r for r in self.rows if (r.variant, r.scenario, r.metric) == wanted)
        return next(found, None)

    def tracks(self, scenario: str, variant: str | None = None) -> pd.DataFrame:
        """Rows of ``realisations`` of one scenario that did not fail."""
        table = self.results.realisations
        own = (table["variant"] == (variant or self.variant)) & (table["scenario"] == scenario)
        return table[own & (table["status"] != "failed")]

    def effects(self, scenario: str) -> pd.DataFrame:
        """Rows of ``effects`` of one scenario with both intervals known."""
        table = self.results.effects
        if table.empty:
            return table
        own = (table["variant"] == self.variant) & (table["scenario"] == scenario)
        return table[own & (table["status"] == "paired")]

    def title(self, scenario: str) -> str:
        """Title of a scenario, or its name."""
        return self.study.scenario(scenario).title or scenario

    def tint(self, scenario: str) -> int:
        """Number of the colour that a scenario has in every picture."""
        return self.study.scenario_names.index(scenario)

    @property
    def compared(self) -> list[str]:
        """Scenarios that are compared with the baseline."""
        return [name for name in self.study.scenario_names if self.study.change(name) is not None]


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


def rows_digest(table: pd.DataFrame) -> str:
    """SHA-256 [hex] of the rows of a table, in whatever order and files they were stored."""
    if table.empty:
        return "empty"
    hashes = pd.util.hash_pandas_object(table, index=False).to_numpy()
    return hashlib.sha256(np.sort(hashes).tobytes()).hexdigest()
