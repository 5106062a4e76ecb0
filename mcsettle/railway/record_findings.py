"""What is not as it should be in a run, and repair of those kinds that are named.

Symptoms are told apart in the order of travel: a step back with rising chainage on both sides is a
step of the chainage (a long kilometre) or the same track measured again, and no disorder. Readings
that are none (a constant where the car was too slow, a sentinel) are set aside first, so that no
other finding takes them for level.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal, get_args

import numpy as np

from mcsettle.errors import InputError
from mcsettle.railway.record import GAP, Run

Kind = Literal[
    "missing",
    "implausible",
    "constant",
    "steps",
    "restarts",
    "unordered",
    "repeated",
    "short_kilometres",
    "gaps",
    "spikes",
]
KINDS: tuple[Kind, ...] = get_args(Kind)
SPIKE = 8.0  # scaled median absolute deviations of the second difference
IMPLAUSIBLE = 0.1  # m from the median level: no track in service
JUMP = 20.0  # typical differences of neighbours, at the ends of a constant
STUCK = (20, 5.0)  # points and metres of one value that no moving track writes
PASSAGE = 10  # points of rising chainage between two steps back
SAME_TRACK = 0.8  # correlation of two passages over one chainage
POSTS = (1000.0, 1609.344)  # m: whole kilometres and miles
_SCALE = 1.4826  # from a median absolute deviation to a standard deviation


@dataclass(frozen=True)
class Finding:
    """What is not as it should be in a run: kind, how often, where first [m], and in words."""

    kind: str
    count: int
    first: float
    text: str


@dataclass(frozen=True)
class _Seams:
    """Steps back of the chainage in the order of travel.

    ``places`` of the first points behind them; ``again``: whether the track between is the one that
    was measured before; ``ordered``: whether what lies between them are passages and no disorder.
    """

    places: np.ndarray
    again: np.ndarray
    ordered: bool


def findings(run: Run) -> list[Finding]:
    """What is not as it should be in ``run``, each kind of ``KINDS`` at most once."""
    found = []
    if run.missing:
        found.append(
            Finding("missing", run.missing, np.nan, f"{run.missing} rows without a number")
        )
    far, stuck = _implausible(run), _constant(run)
    stuck &= ~far
    for kind, places in (("implausible", far), ("constant", stuck)):
        if np.any(places):
            found.append(_no_readings(kind, run, np.flatnonzero(places)))
    run = _readings(run, far | stuck)
    seams = _seams(run)
    found += _order_findings(run, seams)
    run = _travelled(run, seams)
    x = np.sort(run.chainage)
    same = np.flatnonzero(np.diff(x) == 0.0)
    if len(same):
        found.append(_finding("repeated", same, x, f"{len(same)} chainages come again"))
    rising = _rising(run)
    found += _gap_findings(rising)
    spikes = spike_places(rising.level, _gaps(rising))
    if len(spikes):
        worst = float(np.max(np.abs(rising.level[spikes] - np.median(rising.level)))) * 1e3
        text = f"{len(spikes)} spikes, up to {worst:.3g} mm from the median level"
        found.append(_finding("spikes", spikes, rising.labels, text))
    return found


def to_repair(run: Run, kinds: Sequence[str]) -> str | None:
    """What has to be repaired in ``run`` beside the findings ``kinds``, in words; None: nothing."""
    allowed = {*kinds, "spikes", *(("short_kilometres",) if "gaps" in kinds else ())}
    left = [f for f in findings(run) if f.kind not in allowed]
    if not left:
        return None
    said = "; ".join(f"{f.kind}: {f.text}" for f in left)
    return (
        f"the record{_named(run)} has {said}. Repair the file, or say which to repair: "
        f"repair = [{', '.join(repr(f.kind) for f in left)}]"
    )


def spike_places(level: np.ndarray, gaps: np.ndarray | None = None) -> np.ndarray:
    """Places of single points far off both of their neighbours.

    Told by the second difference, beyond ``SPIKE`` robust standard deviations of it, at the point
    where it is largest: a spike spoils those of its neighbours too. Behind and before ``gaps``
    (places of the points before them) a second difference says nothing.
    """
    bend = np.abs(level[2:] - 2.0 * level[1:-1] + level[:-2])
    scale = _SCALE * float(np.median(bend)) if len(bend) else 0.0
    if gaps is not None and len(bend):
        beside = np.concatenate([gaps - 1, gaps])
        bend[beside[(beside >= 0) & (beside < len(bend))]] = 0.0
    digits = np.abs(np.diff(level))  # of a coarse record the bends are rounding
    digit = float(np.min(digits[digits > 1e-9], initial=np.inf))
    far = np.flatnonzero(bend > max(SPIKE * scale, 4.0 * digit if digit < np.inf else 0.0, 1e-9))
    peaks = [i for i in far if bend[i] >= np.max(bend[max(0, i - 1) : i + 2])]
    return np.array(peaks, dtype=int) + 1


def repaired(run: Run, kinds: Sequence[str], longest_gap: float) -> Run:
    """``run`` with the findings ``kinds`` repaired, in the order of ``KINDS``; its chainage rises.

    ``missing``: leave those rows out (they then are gaps); so with ``implausible`` and ``constant``.
    ``steps``: the chainage goes on by the distance travelled. ``restarts``: leave out what is measured
    again. ``unordered``: sort. ``repeated``: mean of the levels at one chainage. ``short_kilometres``:
    a gap up to a kilometre's or mile's post is none. ``gaps``: allow gaps up to ``longest_gap`` [m],
    bridged when the record is resampled. ``spikes``: straight line between the neighbours.

    Raises
    ------
    InputError
        A finding that is not among ``kinds`` (all are named), or a longer gap. Spikes alone are let
        pass: they are reported, and stay.
    """
    unrepaired = to_repair(run, kinds)
    if unrepaired is not None:
        raise InputError(unrepaired)
    run = _readings(run, _implausible(run) | _constant(run))
    run = _rising(_travelled(run, _seams(run)))
    if "short_kilometres" in kinds:
        run = _closed(run, _short_kilometres(run))
    widest = float(np.max(np.diff(run.chainage)))
    if widest > max(longest_gap, GAP * run.step):
        raise InputError(
            f"the record{_named(run)} has a gap of {widest:.4g} m; gaps of up to "
            f"{longest_gap:g} m are bridged (longest_gap_m). Cut the record there"
        )
    return _without_spikes(run) if "spikes" in kinds else run


def _implausible(run: Run) -> np.ndarray:
    """Readings [N] that no track has: far from the median, in a record that is near it elsewhere."""
    far = np.zeros(len(run.level), dtype=bool)
    for level in (run.level, run.other_rail):
        if level is not None:
            off = np.abs(level - np.median(level))
            far |= off > max(IMPLAUSIBLE, JUMP * _SCALE * float(np.median(off)))
    return far


def _constant(run: Run) -> np.ndarray:
    """Readings [N] of one value: between two jumps, or over more track than a moving car's are."""
    stuck = np.zeros(len(run.level), dtype=bool)
    for level in (run.level, run.other_rail):
        if level is None or len(level) < 3:
            continue
        change = np.abs(np.diff(level))
        scale = _SCALE * float(np.median(change))
        begins = np.flatnonzero(np.concatenate([[True], change > 0.0]))
        lengths = np.diff(np.append(begins, len(level)))
        into = np.concatenate([[np.inf], change])[begins]
        out = np.concatenate([change, [np.inf]])[begins + lengths - 1]
        jumps = np.minimum(into, out) > max(JUMP * scale, 5e-3)
        between = (lengths > 1) & jumps & (lengths < len(level))
        still = (lengths >= STUCK[0]) & (lengths * run.step >= STUCK[1]) & (scale > 0.0)
        for begin, n in zip(begins[between | still], lengths[between | still], strict=True):
            stuck[begin : begin + n] = True
    return stuck


def _no_readings(kind: str, run: Run, places: np.ndarray) -> Finding:
    values = np.unique(run.level[places]) * 1e3
    said = f"{len(places)} readings " + (
        f"more than {IMPLAUSIBLE * 1e3:g} mm from the median level"
        if kind == "implausible"
        else "that stay at one value"
    )
    shown = ", ".join(f"{value:g}" for value in values[:3]) + (" …" if len(values) > 3 else "")
    text = (
        f"{said} ({shown} mm): where that means that nothing was read, name it in missing_values, "
        "which leaves gaps"
    )
    return _finding(kind, places, run.labels, text)


def _readings(run: Run, none: np.ndarray) -> Run:
    """``run`` without the rows that are ``none``, turned where it was travelled against its chainage."""
    if len(run.level) - np.sum(none) < PASSAGE:
        raise InputError(
            f"the record{_named(run)} has {int(np.sum(none))} rows of {len(run.level)} that are no "
            "readings of a track (one value, or far from all others); check level_unit and the column"
        )
    run = run.rows(~none) if np.any(none) else run
    against = np.median(np.diff(run.chainage)) < 0.0
    return run.rows(np.arange(len(run.chainage))[::-1]) if against else run


def _seams(run: Run) -> _Seams:
    x, level = run.chainage, run.level
    places = np.flatnonzero(np.diff(x) < 0.0) + 1
    ends = np.concatenate([[0], places, [len(x)]])
    ordered = bool(np.all(np.diff(ends) >= PASSAGE))
    if ordered and len(places):  # points that fill the gaps beside them are swapped ones
        beside = np.maximum(x[places - 1] - x[places - 2], x[places + 1] - x[places])
        back = x[places - 1] - x[places]
        ordered = not bool(np.any((back < PASSAGE * run.step) & (beside > GAP * run.step)))
    again = np.zeros(len(places), dtype=bool)
    for i, place in enumerate(places if ordered else ()):
        before, after = slice(ends[i], place), slice(place, ends[i + 2])
        common = x[after] <= x[place - 1]
        if np.sum(common) < PASSAGE or x[place] < x[ends[i]] - run.step:
            continue
        one = np.interp(x[after][common], x[before], level[before])
        two = level[after][common]
        spread = float(np.std(one) * np.std(two))
        mean = float(np.mean((one - one.mean()) * (two - two.mean())))
        again[i] = spread > 0.0 and mean / spread > SAME_TRACK
    return _Seams(places, again, ordered)


def _order_findings(run: Run, seams: _Seams) -> list[Finding]:
    if not len(seams.places):
        return []
    before = seams.places - 1
    if not seams.ordered:
        text = f"{len(before)} times the chainage runs back"
        return [_finding("unordered", before, run.chainage, text)]
    found = []
    steps, restarts = before[~seams.again], before[seams.again]
    if len(steps):
        back = float(np.max(run.chainage[steps] - run.chainage[steps + 1])) + run.step
        text = (
            f"{len(steps)} steps back of the chainage, the longest {back:.4g} m, each with rising "
            "chainage before and behind it: a long kilometre, another line, or several runs "
            "(run_column). The order of travel is kept, and the chainage goes on by the distance"
        )
        found.append(_finding("steps", steps, run.chainage, text))
    if len(restarts):
        text = (
            f"{len(restarts)} times a piece of the same track comes again: the car went back, or the "
            "file has several runs (run_column)"
        )
        found.append(_finding("restarts", restarts, run.chainage, text))
    return found


def _travelled(run: Run, seams: _Seams) -> Run:
    """``run`` with the chainage of the distance travelled over steps, and nothing twice."""
    if not len(seams.places) or not seams.ordered:
        return run
    x, step = run.chainage.copy(), run.step
    kept = np.ones(len(x), dtype=bool)
    for place, again in zip(seams.places, seams.again, strict=True):
        if again:
            kept[place:] &= ~(run.chainage[place:] <= np.max(x[:place][kept[:place]]))
        else:
            x[place:] += x[place - 1] + step - x[place]
    posted = None if np.all(seams.again) else run.labels
    return replace(run, chainage=x, posted=posted).rows(kept)


def _gaps(run: Run) -> np.ndarray:
    """Places of the points before gaps of a run of rising chainage."""
    return np.flatnonzero(np.diff(run.chainage) > GAP * run.step)


def _short_kilometres(run: Run) -> np.ndarray:
    """Those gaps that end at a whole kilometre or mile."""
    gaps = _gaps(run)
    behind = run.labels[gaps + 1]
    at_post = [np.abs(behind - post * np.round(behind / post)) < run.step for post in POSTS]
    return gaps[np.any(at_post, axis=0)] if len(gaps) else gaps


def _closed(run: Run, gaps: np.ndarray) -> Run:
    """``run`` with ``gaps`` of its chainage, and none of the track, taken out."""
    if not len(gaps):
        return run
    x, step = run.chainage.copy(), run.step
    for place in gaps:
        x[place + 1 :] += x[place] + step - x[place + 1]
    return replace(run, chainage=x, posted=run.labels)


def _gap_findings(run: Run) -> list[Finding]:
    found, gaps, steps = [], _gaps(run), np.diff(run.chainage)
    short = _short_kilometres(run)
    others = np.setdiff1d(gaps, short)
    if len(short):
        text = (
            f"{len(short)} gaps of up to {float(np.max(steps[short])):.4g} m that end at a post: short "
            "kilometres (or miles), over which the track goes on, or readings that are missing (gaps)"
        )
        found.append(_finding("short_kilometres", short, run.labels, text))
    if len(others):
        text = f"{len(others)} gaps, the longest {float(np.max(steps[others])):.4g} m"
        found.append(_finding("gaps", others, run.labels, text))
    return found


def _rising(run: Run) -> Run:
    """``run`` sorted by chainage, the levels at one chainage averaged."""
    x, first, place = np.unique(run.chainage, return_index=True, return_inverse=True)
    rows = run.rows(first)
    if len(x) == len(run.chainage):
        return rows
    count = np.bincount(place)
    other = run.other_rail
    return replace(
        rows,
        level=np.bincount(place, weights=run.level) / count,
        other_rail=None if other is None else np.bincount(place, weights=other) / count,
    )


def _without_spikes(run: Run) -> Run:
    level = _straightened(run.chainage, run.level, _gaps(run))
    other = run.other_rail
    other = None if other is None else _straightened(run.chainage, other, _gaps(run))
    return replace(run, level=level, other_rail=other)


def _straightened(x: np.ndarray, level: np.ndarray, gaps: np.ndarray) -> np.ndarray:
    level = level.copy()
    for place in spike_places(level, gaps):
        share = (x[place] - x[place - 1]) / (x[place + 1] - x[place - 1])
        level[place] = (1.0 - share) * level[place - 1] + share * level[place + 1]
    return level


def _finding(kind: str, places: np.ndarray, x: np.ndarray, text: str) -> Finding:
    first = float(x[places[0]])
    return Finding(kind, len(places), first, f"{text} (first at {first:.6g} m)")


def _named(run: Run) -> str:
    return f" (run '{run.name}')" if run.name else ""
