"""Reading a measured record: CSV or Parquet, its columns, units, notations and runs.

One pass over a file collects every fault before it refuses.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from mcsettle.errors import InputError
from mcsettle.railway.chainage import (
    CHAINAGE_UNITS,
    NOTATION_OR_UNIT,
    NOTATIONS,
    looks_positional,
    notation_fault,
    positions,
    with_minor,
)
from mcsettle.railway.dates import run_dates
from mcsettle.railway.record import Run
from mcsettle.railway.record_table import Cells, csv_cells, is_parquet, parquet_cells
from mcsettle.railway.text_files import NumberFormat, number_fault, numbers, refused, without_marks

LARGEST_FILE = 500_000_000  # bytes
MOST_ROWS = 20_000_000
MOST_RUNS = 1000
LEAST_POINTS = 10  # of a run
LEVEL_UNITS = {"mm": 1e-3, "m": 1.0, "cm": 1e-2, "in": 0.0254}
_VERSINE = re.compile(r"versine|chord|pfeilh|sehne|fl[eè]che", re.IGNORECASE)


@dataclass(frozen=True)
class RecordFormat:
    """How a record is written: columns, units, signs, encoding, rows around the heading.

    ``chainage_unit`` (a unit or a notation) and ``level_unit`` are None where the columns' names end
    in their unit; ``offset_column`` has the metres, yards or chains of a position in two columns.
    ``second_level_column`` is the other rail's, ``rails`` what is made of both. ``run_column`` names
    the run of each row, or with ``dates`` (iso, day_first, month_first) its date; ``positive`` says
    where a positive level lies. ``versine_chord_m``: the levels are offsets from the middle of a chord.
    ``spacing_m``: there is no column of chainage, each run begins at ``start_m`` and its rows lie so far
    apart.
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
    offset_column: str | None = None
    second_level_column: str | None = None
    rails: str | None = None
    thousands: str | None = None
    missing_values: tuple[str | float, ...] | None = None
    encoding: str | None = None
    skip_after_heading: int | None = None
    dates: str | None = None
    versine_chord_m: float | None = None
    spacing_m: float | None = None
    start_m: float | None = None

    @property
    def number_format(self) -> NumberFormat:
        """How the numbers of its cells are written."""
        return NumberFormat(self.decimal, self.thousands, self.missing_values or ())

    @property
    def columns(self) -> dict[str, str]:
        """Names of the columns that are read, by the key that gives them."""
        keys = (
            "chainage_column",
            "level_column",
            "offset_column",
            "second_level_column",
            "run_column",
        )
        read = keys if self.spacing_m is None else keys[1:]
        return {key: getattr(self, key) for key in read if getattr(self, key) is not None}

    def units(self) -> tuple[str, str, list[str]]:
        """Unit or notation of the chainage, unit of the level, and every fault of what says them."""
        faults: list[str] = []
        along = "m"
        if self.spacing_m is None:
            along = _unit(
                "chainage", self.chainage_column, self.chainage_unit, NOTATION_OR_UNIT, faults
            )
        elif self.chainage_unit is not None or self.offset_column is not None:
            faults.append(
                "spacing_m stands for a column of chainage: leave out chainage_unit and offset_column"
            )
        level = _unit("level", self.level_column, self.level_unit, tuple(LEVEL_UNITS), faults)
        if self.offset_column is not None and along and along not in NOTATIONS:
            faults.append(
                f"offset_column is the second part of a position: chainage_unit is '{along}', and "
                "must be 'km+m', 'mi.yd' or 'mi.ch'"
            )
        if (self.second_level_column is None) != (self.rails is None):
            faults.append(
                "the levels of two rails take second_level_column and rails together: rails is "
                '"mean" (of both rails) or "worse" (of each section the rail with the larger SD)'
            )
        if self.versine_chord_m is None and _VERSINE.search(self.level_column):
            faults.append(
                f"column '{self.level_column}' has offsets from a chord by its name, which are no "
                "levels; say versine_chord_m, the length of the chord [m], and they are converted"
            )
        return along, level, faults


@dataclass
class _Reading:
    """The columns of a file as they are converted, and what is wrong with them so far."""

    cells: Cells
    layout: RecordFormat
    faults: list[str] = field(default_factory=list)

    def numbers(self, name: str) -> np.ndarray:
        """Numbers [N] of column ``name``, NaN where there is none."""
        column = self.cells.columns[name]
        if isinstance(column, np.ndarray):
            infinite = np.flatnonzero(np.isinf(column))
            if len(infinite):
                self.faults.append(f"column '{name}' holds {len(infinite)} infinite numbers")
            return without_marks(column, self.layout.number_format)
        values, wrong = numbers(column, self.layout.number_format)
        if np.any(wrong):
            texts, lines = self.cells.at(name, wrong)
            self.faults.append(number_fault(name, texts, lines, self.layout.number_format))
        return values

    def chainage(self, unit: str) -> np.ndarray:
        """Chainage [N] m in a unit or a notation."""
        name, other = self.layout.chainage_column, self.layout.offset_column
        column = self.cells.columns[name]
        if other is not None:
            return with_minor(self.numbers(name), self.numbers(other), unit)
        if unit in NOTATIONS:
            given = _as_texts(column) if isinstance(column, np.ndarray) else column
            values, wrong = positions(given, unit)
            if np.any(wrong):
                texts, lines = self.cells.at(name, wrong)
                self.faults.append(notation_fault(name, texts, lines, unit))
            return values
        values = self.numbers(name)
        as_written = None if isinstance(column, np.ndarray) else column
        positional = looks_positional(values, unit, as_written)
        if positional is not None:
            self.faults.append(f"column '{name}': {positional}")
        return values * CHAINAGE_UNITS[unit]

    def names(self) -> np.ndarray | None:
        """Name of the run of each row [N], an ISO date where the runs are dated; None: one run."""
        if self.layout.run_column is None:
            return None
        names = self.cells.texts(self.layout.run_column)
        different = list(dict.fromkeys(names))
        if len(different) > MOST_RUNS:
            self.faults.append(
                f"column '{self.layout.run_column}' names {len(different)} runs; at most {MOST_RUNS}"
            )
        elif self.layout.dates is not None:
            dates, faults = run_dates(different, self.layout.dates)
            self.faults += [f"column '{self.layout.run_column}': {fault}" for fault in faults]
            names = np.array([dates[name] for name in names], dtype=object)
        return names


def read_record(path: Path, layout: RecordFormat) -> tuple[Run, ...]:
    """Every run of the record at ``path``, in the order in which they first appear.

    Raises
    ------
    InputError
        The file cannot be read as ``layout`` says, is too large, or has fewer than ten points; all
        faults that one pass can see are listed.
    """
    runs, faults = read_runs(path, layout)
    if faults:
        raise refused(path, faults)
    return runs


def read_runs(path: Path, layout: RecordFormat) -> tuple[tuple[Run, ...], list[str]]:
    """The runs of the record at ``path``, and every fault of the file.

    Beside faults of cells the runs have the rows that can be read, to look for what else is wrong with
    them; where units or positions are not known there are none.

    Raises
    ------
    InputError
        The file cannot be read at all.
    """
    along, level, faults = layout.units()
    try:
        if not path.is_file():
            raise InputError(f"{path} is no file; give a CSV or Parquet file")
        size = path.stat().st_size
        if size > LARGEST_FILE:
            raise InputError(f"{path} has {size} bytes; a record has at most {LARGEST_FILE}")
        if is_parquet(path):
            cells = parquet_cells(path, layout.columns, MOST_ROWS)
        else:
            cells = csv_cells(path, layout, MOST_ROWS)
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error}") from None
    reading = _Reading(cells, layout, [*cells.faults, *faults])
    if not set(layout.columns.values()) <= set(cells.columns):
        return (), reading.faults
    runs = _runs(reading, along or "m", level or "m")
    return (() if faults else runs), reading.faults


def _runs(reading: _Reading, along: str, unit: str) -> tuple[Run, ...]:
    """The runs of a file; its faults gather in ``reading``."""
    layout = reading.layout
    n_faults = len(reading.faults)
    chainage = None if layout.spacing_m is not None else reading.chainage(along)
    placed = len(reading.faults) == n_faults
    factor = LEVEL_UNITS[unit] * (1.0 if layout.positive == "down" else -1.0)
    level = reading.numbers(layout.level_column) * factor
    other = None
    if layout.second_level_column is not None:
        other = reading.numbers(layout.second_level_column) * factor
        if layout.rails == "mean":
            level, other = 0.5 * (level + other), None
    n_faults = len(reading.faults)
    names = reading.names()
    if chainage is None:
        chainage = _spaced(names, len(level), layout)
    if not placed or len(reading.faults) > n_faults:
        return ()
    read = np.isfinite(chainage) & np.isfinite(level)
    if other is not None:
        read &= np.isfinite(other)
    runs = []
    for name in dict.fromkeys(names) if names is not None else [""]:
        rows = np.ones(len(read), bool) if names is None else names == name
        kept = rows & read
        if np.sum(kept) < LEAST_POINTS:
            which = f"run '{name}' has " if name else ""
            if not reading.faults:
                reading.faults.append(
                    f"{which}{int(np.sum(kept))} points; a run needs at least ten"
                )
            return ()
        missing = int(np.sum(rows & ~read))
        second = None if other is None else other[kept]
        runs.append(Run(str(name), chainage[kept], level[kept], missing, second))
    return tuple(runs)


def _spaced(names: np.ndarray | None, n: int, layout: RecordFormat) -> np.ndarray:
    """Chainage [N] m of rows that lie ``spacing_m`` apart, each run from ``start_m`` on."""
    row = np.arange(n)
    for name in dict.fromkeys(names) if names is not None else ():
        own = names == name
        row[own] = np.arange(int(np.sum(own)))
    return np.asarray((layout.start_m or 0.0) + (layout.spacing_m or 0.0) * row)


def _unit(
    what: str, column: str, stated: str | None, accepted: Sequence[str], faults: list[str]
) -> str:
    """Unit by what is stated and by the column's name; "" where neither says one that is accepted."""
    named = _unit_in(column, accepted)
    if stated is None and named is None:
        faults.append(
            f"the unit of the {what} is not told: the column '{column}' does not end in one; "
            f"give {what}_unit ({', '.join(accepted)}) or end the name in it, such as "
            f"'{what}_{accepted[0]}'"
        )
    elif stated is not None and stated not in accepted:
        faults.append(f"{what}_unit is '{stated}'; accepted: {', '.join(accepted)}")
        return ""
    elif stated is not None and named is not None and stated != named:
        faults.append(
            f"{what}_unit is '{stated}', but the column '{column}' says '{named}'; "
            "leave one of them out, or rename the column"
        )
    return stated or named or ""


def _unit_in(column: str, accepted: Sequence[str]) -> str | None:
    """Unit that a column's name ends in: ``level_mm``, ``level [mm]``, ``level (mm)``."""
    ending = re.search(r"(?:_|\[|\()\s*([A-Za-z.+]+)\s*[\])]?$", column)
    return ending[1].lower() if ending and ending[1].lower() in accepted else None


def _as_texts(values: np.ndarray) -> Any:
    import pyarrow as pa

    return pa.array([None if np.isnan(v) else repr(float(v)) for v in values], pa.string())
