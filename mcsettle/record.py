"""A measured track record: chainage and level of one or several runs, read and looked at.

CSV or Parquet, each row one point. Units are told or taken from the ends of the columns' names
(``chainage_m``, ``level_mm``); a record that says neither is refused, for feet read as metres look
like a good track. Nothing is mended in silence: ``findings`` names gaps, repeated and unordered
chainage, spikes and missing values, and ``mended`` mends those kinds that it is told to.

Depends on: errors, units.
"""

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from mcsettle.errors import InputError

LARGEST_FILE = 500_000_000  # bytes
MOST_ROWS = 20_000_000
MOST_RUNS = 1000
CHAINAGE_UNITS = {"m": 1.0, "km": 1e3, "ft": 0.3048, "yd": 0.9144, "mi": 1609.344}
LEVEL_UNITS = {"mm": 1e-3, "m": 1.0, "cm": 1e-2, "in": 0.0254}
SEPARATORS = {"comma": ",", "semicolon": ";", "tab": "\t", "space": " "}
KINDS = ("missing", "unordered", "repeated", "gaps", "spikes")
SPIKE = 8.0  # scaled median absolute deviations of the second difference
GAP = 1.5  # steps
_SCALE = 1.4826  # from a median absolute deviation to a standard deviation


@dataclass(frozen=True)
class RecordFormat:
    """How a record is written: columns, units, separator, decimal sign, rows before the heading.

    ``chainage_unit`` and ``level_unit`` are None where the columns' names end in their unit;
    ``run_column`` names the run or date of each row; ``positive`` says where a positive level lies.
    """

    chainage_column: str = "chainage_m"
    level_column: str = "level_mm"
    run_column: str | None = None
    chainage_unit: str | None = None
    level_unit: str | None = None
    separator: str = "comma"
    decimal: str = "."
    skip_rows: int = 0
    positive: str = "down"

    def factors(self) -> tuple[float, float]:
        """Factors that take chainage and level into metres, the level positive down.

        Raises
        ------
        InputError
            A unit that is not told, unknown, or not that of the column's name.
        """
        along = _unit("chainage", self.chainage_column, self.chainage_unit, CHAINAGE_UNITS)
        level = _unit("level", self.level_column, self.level_unit, LEVEL_UNITS)
        sign = 1.0 if self.positive == "down" else -1.0
        return CHAINAGE_UNITS[along], sign * LEVEL_UNITS[level]


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


def read_record(path: Path, layout: RecordFormat) -> tuple[Run, ...]:
    """Every run of the record at ``path``, in the order in which they first appear.

    Raises
    ------
    InputError
        The file cannot be read as ``layout`` says, is too large, or has fewer than ten points.
    """
    along, level = layout.factors()
    columns = _columns(path, layout)
    chainage, height = columns[layout.chainage_column], columns[layout.level_column]
    names = columns[layout.run_column] if layout.run_column else None
    known = np.isfinite(chainage) & np.isfinite(height)
    runs = []
    for name in dict.fromkeys(names) if names is not None else [""]:
        own = np.ones(len(known), bool) if names is None else names == name
        kept = own & known
        if np.sum(kept) < 10:
            where = f", run '{name}'" if name else ""
            raise InputError(f"{path}{where}: {int(np.sum(kept))} points; a run needs at least ten")
        missing = int(np.sum(own & ~known))
        runs.append(Run(str(name), chainage[kept] * along, height[kept] * level, missing))
    return tuple(runs)


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


def _unit(what: str, column: str, told: str | None, known: dict[str, float]) -> str:
    ending = column.rsplit("_", 1)[-1].lower() if "_" in column else ""
    named = ending if ending in known else None
    if told is None and named is None:
        raise InputError(
            f"the unit of the {what} is not told: the column '{column}' does not end in one; "
            f"give {what}_unit ({', '.join(known)}) or end the name in it, such as "
            f"'{what}_{next(iter(known))}'"
        )
    if told is not None and told not in known:
        raise InputError(f"{what}_unit is '{told}'; accepted: {', '.join(known)}")
    if told is not None and named is not None and told != named:
        raise InputError(
            f"{what}_unit is '{told}', but the column '{column}' says '{named}'; "
            "leave one of them out, or rename the column"
        )
    return told or named or ""


def _columns(path: Path, layout: RecordFormat) -> dict[str, np.ndarray]:
    """The columns that are needed: floats (NaN where empty), the run's names as text."""
    try:
        if not path.is_file():
            raise InputError(f"{path} is no file; give a CSV or Parquet file")
        size = path.stat().st_size
        if size > LARGEST_FILE:
            raise InputError(f"{path} has {size} bytes; a record has at most {LARGEST_FILE}")
        numbers = [layout.chainage_column, layout.level_column]
        wanted = [*numbers, *([layout.run_column] if layout.run_column else [])]
        table = _parquet(path, wanted) if _is_parquet(path) else _csv(path, layout, wanted)
        columns = {name: _floats(path, name, table[name]) for name in numbers}
        if layout.run_column:
            columns[layout.run_column] = _texts(path, layout.run_column, table)
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error}") from None
    return columns


def _is_parquet(path: Path) -> bool:
    with path.open("rb") as source:
        return source.read(4) == b"PAR1"


def _parquet(path: Path, wanted: list[str]) -> Any:
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        with pq.ParquetFile(path) as source:
            _check_names(path, wanted, source.schema_arrow.names)
            if source.metadata.num_rows > MOST_ROWS:
                raise InputError(f"{path} has {source.metadata.num_rows} rows; at most {MOST_ROWS}")
            return source.read(columns=wanted)
    except (pa.ArrowInvalid, pa.ArrowNotImplementedError) as error:
        raise InputError(f"{path} is no sound Parquet file: {_first_line(error)}") from None


def _csv(path: Path, layout: RecordFormat, wanted: list[str]) -> Any:
    import pyarrow as pa
    from pyarrow import csv

    reading = csv.ReadOptions(skip_rows=layout.skip_rows, use_threads=False)
    parsing = csv.ParseOptions(delimiter=SEPARATORS[layout.separator])
    kinds = {layout.chainage_column: pa.float64(), layout.level_column: pa.float64()}
    if layout.run_column:
        kinds[layout.run_column] = pa.string()
    turning = csv.ConvertOptions(
        column_types=kinds,
        decimal_point=layout.decimal,
        strings_can_be_null=False,
        null_values=["", "NaN", "nan", "NA", "null", "-"],
    )
    try:
        table = csv.read_csv(path, reading, parsing, turning)
    except (pa.ArrowInvalid, pa.ArrowKeyError, UnicodeDecodeError) as error:
        raise InputError(
            f"{path} cannot be read as a table with separator '{layout.separator}' and decimal "
            f"sign '{layout.decimal}': {_first_line(error)}"
        ) from None
    _check_names(path, wanted, table.column_names)
    if table.num_rows > MOST_ROWS:
        raise InputError(f"{path} has {table.num_rows} rows; at most {MOST_ROWS}")
    return table


def _check_names(path: Path, wanted: list[str], held: list[str]) -> None:
    lacking = [name for name in wanted if name not in held]
    if lacking:
        raise InputError(
            f"{path} has no column {', '.join(map(repr, lacking))}; its columns: "
            f"{', '.join(map(repr, held[:20]))}. Name yours (chainage_column, level_column, "
            "run_column), or another separator"
        )
    twice = [name for name in wanted if held.count(name) > 1]
    if twice:
        raise InputError(f"{path} has the column {twice[0]!r} more than once")


def _floats(path: Path, name: str, column: Any) -> np.ndarray:
    import pyarrow as pa

    try:
        values = np.asarray(column.cast(pa.float64()).to_numpy(), dtype=float)
    except (pa.ArrowInvalid, pa.ArrowNotImplementedError):
        raise InputError(
            f"{path}: column '{name}' does not hold numbers but {column.type}"
        ) from None
    if np.any(np.isinf(values)):
        raise InputError(f"{path}: column '{name}' holds an infinite number")
    return values


def _texts(path: Path, name: str, table: Any) -> np.ndarray:
    values = np.array([str(value)[:80] for value in table[name].to_pylist()], dtype=object)
    n = len(set(values))
    if n > MOST_RUNS:
        raise InputError(f"{path}: column '{name}' names {n} runs; at most {MOST_RUNS}")
    return values


def _first_line(error: BaseException) -> str:
    return str(error).splitlines()[0][:200] if str(error) else type(error).__name__
