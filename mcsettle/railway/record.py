"""A measured track record: chainage and level of one or several runs, read and looked at.

CSV or Parquet, each row one point. Units are told or taken from the ends of the columns' names
(``chainage_m``, ``level_mm``); a record that says neither is refused, for feet read as metres look
like a good track. Nothing is mended in silence: ``findings`` names gaps, repeated and unordered
chainage, spikes and missing values, and ``mended`` mends those kinds that it is told to.
"""

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from mcsettle.errors import InputError

KINDS = ("missing", "unordered", "repeated", "gaps", "spikes")
SPIKE = 8.0  # scaled median absolute deviations of the second difference
GAP = 1.5  # steps
_SCALE = 1.4826  # from a median absolute deviation to a standard deviation


@dataclass(frozen=True)
class Finding:
    """What is not as it should be in a run: kind, how often, where first [m], and in words."""

    kind: str
    count: int
    first: float
    text: str


@dataclass(frozen=True)
class Run:
    """One recording: ``chainage`` and ``level`` [N] m (level positive down), in the file's order.

    ``missing``: rows that had no number in one of the columns and were left out.
    """

    name: str
    chainage: np.ndarray
    level: np.ndarray
    missing: int = 0

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


def chosen_run(runs: Sequence[Run], name: str | None) -> Run:
    """The run ``name`` (None: the first).

    Raises
    ------
    InputError
        There is no such run.
    """
    if name is None:
        return runs[0]
    found = {run.name: run for run in runs}
    if name not in found:
        known = ", ".join(list(found)[:10]) or "none has a name"
        raise InputError(f"the record has no run '{name}'; its runs: {known}")
    return found[name]


def findings(run: Run) -> list[Finding]:
    """What is not as it should be in ``run``, each kind of ``KINDS`` at most once."""
    found = []
    if run.missing:
        found.append(
            Finding("missing", run.missing, np.nan, f"{run.missing} rows without a number")
        )
    steps = np.diff(run.chainage)
    back = np.flatnonzero(steps < 0.0)
    if len(back):
        text = f"{len(back)} times the chainage runs back"
        found.append(_finding("unordered", back, run.chainage, text))
    x = np.sort(run.chainage)
    same = np.flatnonzero(np.diff(x) == 0.0)
    if len(same):
        found.append(_finding("repeated", same, x, f"{len(same)} chainages come again"))
    step = run.step
    gaps = np.flatnonzero(np.diff(x) > GAP * step)
    if len(gaps):
        text = f"{len(gaps)} gaps, the longest {float(np.max(np.diff(x))):.4g} m"
        found.append(_finding("gaps", gaps, x, text))
    rising = _rising(run)
    spikes = spike_places(rising.level)
    if len(spikes):
        worst = float(np.max(np.abs(rising.level[spikes] - np.median(rising.level)))) * 1e3
        text = f"{len(spikes)} spikes, up to {worst:.3g} mm from the median level"
        found.append(_finding("spikes", spikes, rising.chainage, text))
    return found


def spike_places(level: np.ndarray) -> np.ndarray:
    """Places of single points far off both of their neighbours.

    Told by the second difference, beyond ``SPIKE`` robust standard deviations of it, at the point
    where it is largest: a spike spoils those of its neighbours too.
    """
    bend = np.abs(level[2:] - 2.0 * level[1:-1] + level[:-2])
    scale = _SCALE * float(np.median(bend)) if len(bend) else 0.0
    far = np.flatnonzero(bend > max(SPIKE * scale, 1e-9))
    peaks = [i for i in far if bend[i] >= np.max(bend[max(0, i - 1) : i + 2])]
    return np.array(peaks, dtype=int) + 1


def mended(run: Run, kinds: Sequence[str], longest_gap: float) -> Run:
    """``run`` with the findings ``kinds`` mended, in this order; its chainage rises strictly.

    ``missing``: leave those rows out (they then are gaps). ``unordered``: sort. ``repeated``: mean
    of the levels at one chainage. ``spikes``: straight line between the neighbours. ``gaps``: allow
    gaps up to ``longest_gap`` [m], bridged when the record is resampled.

    Raises
    ------
    InputError
        A finding that is not among ``kinds`` (all are named), or a longer gap. Spikes alone are let
        pass: they are reported, and stay.
    """
    left = [f for f in findings(run) if f.kind not in (*kinds, "spikes")]
    if left:
        said = "; ".join(f"{f.kind}: {f.text}" for f in left)
        raise InputError(
            f"the record{_named(run)} has {said}. Mend the file, or say which to mend: "
            f"repair = [{', '.join(repr(f.kind) for f in left)}]"
        )
    run = _rising(run)
    widest = float(np.max(np.diff(run.chainage)))
    if widest > max(longest_gap, GAP * run.step):
        raise InputError(
            f"the record{_named(run)} has a gap of {widest:.4g} m; gaps of up to "
            f"{longest_gap:g} m are bridged (longest_gap_m). Cut the record there"
        )
    return _without_spikes(run) if "spikes" in kinds else run


def file_digest(path: Path) -> str:
    """SHA-256 [hex] of a file's bytes."""
    with path.open("rb") as source:
        return hashlib.file_digest(source, "sha256").hexdigest()


def _rising(run: Run) -> Run:
    """``run`` sorted by chainage, the levels at one chainage averaged."""
    x, place = np.unique(run.chainage, return_inverse=True)
    level = np.bincount(place, weights=run.level) / np.bincount(place)
    return replace(run, chainage=x, level=level)


def _without_spikes(run: Run) -> Run:
    level = run.level.copy()
    for place in spike_places(level):
        before, after = run.chainage[place - 1], run.chainage[place + 1]
        share = (run.chainage[place] - before) / (after - before)
        level[place] = (1.0 - share) * level[place - 1] + share * level[place + 1]
    return replace(run, level=level)


def _finding(kind: str, places: np.ndarray, x: np.ndarray, text: str) -> Finding:
    first = float(x[places[0]])
    return Finding(kind, len(places), first, f"{text} (first at {first:.6g} m)")


def _named(run: Run) -> str:
    return f" (run '{run.name}')" if run.name else ""
