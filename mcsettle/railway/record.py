"""A measured track record: chainage and level of one or several runs.

CSV or Parquet, each row one point. Units are told or taken from the ends of the columns' names
(``chainage_m``, ``level_mm``); a record that says neither is refused, for feet read as metres look
like a good track. Nothing is repaired in silence: ``record_findings`` names what is not as it should
be, and repairs those kinds that it is told to.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mcsettle.errors import InputError

GAP = 1.5  # steps


@dataclass(frozen=True)
class Run:
    """One recording: ``chainage`` and ``level`` [N] m (level positive down), in the file's order.

    ``missing``: rows that had no number in one of the columns and were left out. ``other_rail`` [N]
    m: the level of the second rail, where both are kept. ``posted`` [N] m: the chainage as it stands
    in the file, where ``chainage`` had to be made from the distance travelled.
    """

    name: str
    chainage: np.ndarray
    level: np.ndarray
    missing: int = 0
    other_rail: np.ndarray | None = None
    posted: np.ndarray | None = None

    @property
    def step(self) -> float:
        """Median distance of neighbouring points [m]."""
        steps = np.abs(np.diff(self.chainage))
        steps = steps[steps > 0.0]
        return float(np.median(steps)) if len(steps) else 0.0

    @property
    def length(self) -> float:
        """From the first to the last point [m]."""
        return float(np.ptp(self.chainage))

    @property
    def labels(self) -> np.ndarray:
        """Chainage [N] m as the owner of the record reads it."""
        return self.chainage if self.posted is None else self.posted

    def rows(self, kept: np.ndarray) -> "Run":
        """The run with the rows ``kept`` (a mask or places, in their order)."""
        return Run(
            self.name,
            self.chainage[kept],
            self.level[kept],
            self.missing,
            None if self.other_rail is None else self.other_rail[kept],
            None if self.posted is None else self.posted[kept],
        )


def chosen_run(runs: Sequence[Run], name: str | None) -> Run:
    """The run ``name`` (None: the first).

    Raises
    ------
    InputError
        There is no such run.
    """
    if name is None:
        return runs[0]
    named = {run.name: run for run in runs}
    if name not in named:
        names = ", ".join(list(named)[:10]) or "none has a name"
        raise InputError(f"the record has no run '{name}'; its runs: {names}")
    return named[name]
