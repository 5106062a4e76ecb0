"""Reading a measured record: CSV or Parquet, its columns, units and runs."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from mcsettle.errors import InputError
from mcsettle.railway.record import Run

LARGEST_FILE = 500_000_000  # bytes


MOST_ROWS = 20_000_000


MOST_RUNS = 1000


CHAINAGE_UNITS = {"m": 1.0, "km": 1e3, "ft": 0.3048, "yd": 0.9144, "mi": 1609.344}


LEVEL_UNITS = {"mm": 1e-3, "m": 1.0, "cm": 1e-2, "in": 0.0254}


SEPARATORS = {"comma": ",", "semicolon": ";", "tab": "\t", "space": " "}


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
