"""The cells of a record's columns, from CSV or Parquet, with the faults of the table itself."""

import csv
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import zip_longest
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from mcsettle.errors import InputError
from mcsettle.railway.text_files import (
    SEPARATORS,
    cells,
    counted,
    decoded,
    encoding_of,
    foreign_bytes,
    refused,
    sniffed,
)
from mcsettle.storage.files import n_lines, packed_as
from mcsettle.storage.parquet import read_columns

if TYPE_CHECKING:
    from mcsettle.railway.read_record import RecordFormat

HEAD = 1_000_000  # bytes in which the heading must end
LARGEST_READ = 1024**3  # bytes of a Parquet file's columns in memory
LARGEST_DAMAGED = 50_000_000  # bytes of a damaged table that are searched for its faults
MOST_BELOW = 1000  # lines of a file beyond its rows: headings, remarks
LOOKED_AT = 60  # lines that tell how a table is written
LONGEST_TEXT = 80  # characters of a run's name
MOST_NAMED = 20  # columns listed in a message


@dataclass
class Cells:
    """Columns by name: an Arrow column of texts, or numbers [N] where the file has them as such.

    ``first_line`` of the file that holds a row, or the line of each row where some are left out;
    ``faults`` of the table, in words.
    """

    columns: dict[str, Any] = field(default_factory=dict)
    first_line: int = 1
    lines: list[int] | None = None
    faults: list[str] = field(default_factory=list)

    def at(self, name: str, places: np.ndarray) -> tuple[list[str], list[int]]:
        """Different texts of column ``name`` where ``places`` [N], and the lines they stand in."""
        rows = np.flatnonzero(places)
        column = self.columns[name]
        texts = counted(str(column[int(i)]).strip() for i in rows[:10_000])
        if self.lines is not None:
            return texts, [self.lines[int(i)] for i in rows]
        return texts, [int(i) + self.first_line for i in rows]

    def texts(self, name: str) -> np.ndarray:
        """Texts [N] of a column, each of ``LONGEST_TEXT`` characters at most."""
        column = self.columns[name]
        if isinstance(column, np.ndarray):
            return np.array([str(value)[:LONGEST_TEXT] for value in column], dtype=object)
        # Each different text once, however many rows repeat it.
        packed = column.dictionary_encode(null_encoding="encode").unify_dictionaries()
        texts = [str(value)[:LONGEST_TEXT] for value in packed.chunk(0).dictionary.to_pylist()]
        places = [chunk.indices.to_numpy() for chunk in packed.chunks]
        return np.array(texts, dtype=object)[np.concatenate(places)]


def is_parquet(path: Path) -> bool:
    """Whether the file at ``path`` begins as Parquet does."""
    with path.open("rb") as source:
        return source.read(4) == b"PAR1"


def parquet_cells(path: Path, wanted: Mapping[str, str], most_rows: int) -> Cells:
    """The ``wanted`` columns (by key) of a Parquet file.

    Raises
    ------
    InputError
        It is no valid Parquet file, or has too many rows.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    read = Cells()
    try:
        with pq.ParquetFile(path) as source:
            names = list(source.schema_arrow.names)
        read.faults += _name_faults(wanted, names)
        if read.faults:
            return read
        table = read_columns(path, list(wanted.values()), most_rows, LARGEST_READ)
    except (pa.ArrowInvalid, pa.ArrowNotImplementedError):
        raise InputError(
            f"{path} begins as Parquet and is no sound Parquet file: it is damaged or was not "
            "written to its end; export it again"
        ) from None
    for key, name in wanted.items():
        column = table[name]
        if key == "run_column" or pa.types.is_dictionary(column.type):
            read.columns[name] = column.cast(pa.string())
        elif pa.types.is_floating(column.type) or pa.types.is_integer(column.type):
            read.columns[name] = np.asarray(column.cast(pa.float64()).to_numpy(), dtype=float)
        else:
            read.faults.append(f"column '{name}' does not hold numbers but {column.type}")
    return read


def csv_cells(path: Path, layout: "RecordFormat", most_rows: int) -> Cells:
    """The columns of ``layout`` in a text table, as texts.

    A separator or a place of the heading other than those stated is a fault; where the file shows
    what is meant, the rest is read so, for its faults.

    Raises
    ------
    InputError
        The file is empty, of another encoding, or has too many rows.
    """
    import pyarrow as pa

    packed = packed_as(path)
    if packed is not None:
        raise InputError(
            f"{path} is packed ({packed}); unpack it, and name the file that was in it"
        )
    if (n := n_lines(path)) > most_rows + MOST_BELOW:
        raise InputError(f"{path.name} has {n} lines; at most {most_rows} rows are read")
    with path.open("rb") as source:
        head = source.read(HEAD)
    lines = _lines(path, head, layout.encoding)
    read = Cells()
    separator, skip = layout.separator, layout.skip_rows
    names = cells(lines[skip], SEPARATORS[separator]) if skip < len(lines) else []
    if not set(layout.columns.values()) <= set(names):
        guess = sniffed(lines[:LOOKED_AT])
        if guess is not None and guess != (separator, skip):
            other = cells(lines[guess[1]], SEPARATORS[guess[0]])
            if len(other) > len(names) or set(layout.columns.values()) <= set(other):
                read.faults += _guessed(guess, separator, skip)
                (separator, skip), names = guess, other
    below = cells(lines[skip + 1], SEPARATORS[separator]) if skip + 1 < len(lines) else []
    read.faults += _name_faults(layout.columns, names, below)
    if not set(layout.columns.values()) <= set(names):
        return read
    read.first_line = skip + 2 + (layout.skip_after_heading or 0)
    places = {name: names.index(name) for name in layout.columns.values()}
    try:
        read.columns = _table(
            path, layout.encoding, separator, read.first_line - 1, len(names), places
        )
    except pa.ArrowInvalid:
        _line_by_line(read, path, layout.encoding, separator, len(names), places)
    rows = len(next(iter(read.columns.values())))
    if rows > most_rows:
        raise InputError(f"{path.name} has {rows} rows; at most {most_rows}")
    return read


def _lines(path: Path, head: bytes, encoding: str | None) -> list[str]:
    """The first lines of a file; refused where they are of another encoding."""
    codec = encoding_of(head, encoding)
    # A file longer than its head may be cut within a character: whole lines only.
    whole = head if len(head) < HEAD or codec.startswith("utf-16") else head.rpartition(b"\n")[0]
    start = b"\n".join(whole.split(b"\n")[: LOOKED_AT + 10_000])
    try:
        text = start.decode(codec, "ignore" if codec == "utf-16" and start != head else "strict")
    except UnicodeDecodeError:
        lines = start.split(b"\n")[:LOOKED_AT]
        try:
            text = b"\n".join(lines).decode(codec)
        except UnicodeDecodeError as error:
            readable = _heading_only(lines, codec)
            if readable is None:
                raise refused(path, [foreign_bytes(start, error)]) from None
            text = readable
    if not text.strip():
        raise InputError(f"{path} is empty; a record has a heading and a row for each point")
    return text.splitlines()


def _heading_only(lines: list[bytes], codec: str) -> str | None:
    """Text whose data rows alone have foreign bytes (a column of remarks), these replaced."""
    try:
        lines[0].decode(codec)
    except UnicodeDecodeError:
        return None
    return b"\n".join(lines).decode(codec, "replace")


def _guessed(guess: tuple[str, int], separator: str, skip: int) -> list[str]:
    faults = []
    if guess[0] != separator:
        faults.append(
            f"the cells are separated by a {guess[0]}, not by a {separator}: "
            f'separator = "{guess[0]}"'
        )
    if guess[1] != skip:
        faults.append(f"the heading stands in line {guess[1] + 1}: skip_rows = {guess[1]}")
    return faults


def _name_faults(
    wanted: Mapping[str, str], names: list[str], below: Sequence[str] = ()
) -> list[str]:
    """Columns that are not there or come twice; those that are, each with the cell ``below``."""
    faults = []
    lacking = {key: name for key, name in wanted.items() if name not in names}
    if lacking:
        cells_below = [f" ({cell[:20]})" if cell else "" for cell in below]
        both = zip_longest(names[:MOST_NAMED], cells_below[:MOST_NAMED], fillvalue="")
        shown = ", ".join(f"{name!r}{cell}" for name, cell in both if name)
        faults.append(
            f"no column {', '.join(map(repr, lacking.values()))}; its columns: {shown}"
            f"{' …' if len(names) > MOST_NAMED else ''}. Name yours: {', '.join(lacking)}"
        )
    twice = [name for name in wanted.values() if names.count(name) > 1]
    if twice:
        faults.append(f"the column {twice[0]!r} comes more than once")
    return faults


def _table(
    path: Path, encoding: str | None, separator: str, skip: int, n: int, places: Mapping[str, int]
) -> dict[str, Any]:
    """The columns at ``places`` of ``n`` as texts, from behind ``skip`` lines on."""
    import pyarrow as pa
    from pyarrow import csv as arrow_csv

    with path.open("rb") as source:
        codec = encoding_of(source.read(4), encoding)
    wanted = [str(place) for place in places.values()]
    reading = arrow_csv.ReadOptions(
        skip_rows=skip,
        column_names=[str(i) for i in range(n)],
        encoding="utf8" if codec.startswith("utf-8") else codec,
        use_threads=False,
    )
    turning = arrow_csv.ConvertOptions(
        column_types=dict.fromkeys(wanted, pa.string()),
        include_columns=wanted,
        strings_can_be_null=False,
        quoted_strings_can_be_null=False,
    )
    parsing = arrow_csv.ParseOptions(delimiter=SEPARATORS[separator])
    try:
        with pa.OSFile(str(path)) as source:  # a path that ends in .gz would be unpacked
            table = arrow_csv.read_csv(source, reading, parsing, turning)
    except UnicodeDecodeError as error:
        raise refused(path, [foreign_bytes(path.read_bytes(), error)]) from None
    return {name: table[str(place)] for name, place in places.items()}


def _line_by_line(
    read: Cells, path: Path, encoding: str | None, separator: str, n: int, places: Mapping[str, int]
) -> None:
    """Fill ``read`` with the lines of a damaged table that have ``n`` cells; say what others have."""
    import pyarrow as pa

    with path.open("rb") as source:  # the rest of a large one would add nothing to its faults
        data = source.read(LARGEST_DAMAGED)
    try:
        lines = decoded(data, encoding).splitlines(keepends=True)
    except InputError as error:
        raise refused(path, [str(error)]) from None
    rows: list[list[str]] = []
    ragged: list[tuple[int, int]] = []
    reader = csv.reader(lines[read.first_line - 1 :], delimiter=SEPARATORS[separator])
    read.lines = []
    try:
        for row in reader:
            line = reader.line_num + read.first_line - 1
            if len(row) == n:
                rows.append([row[place] for place in places.values()])
                read.lines.append(line)
            elif row:
                ragged.append((line, len(row)))
    except csv.Error:
        read.faults.append(
            f"behind line {reader.line_num + read.first_line - 1} the cells cannot be told apart: a "
            "quotation mark is opened and never closed; export the table again, without quotes"
        )
    if len(data) == LARGEST_DAMAGED and not ragged:
        read.faults.append("lines have another number of cells than the heading; export it again")
    if ragged:
        line, cells_there = ragged[0]
        read.faults.append(
            f"{len(ragged)} {'lines have' if len(ragged) > 1 else 'line has'} another number of cells "
            f"than the heading ({n}), first line {line} ({cells_there})"
        )
    read.columns = {
        name: pa.array([row[i] for row in rows], pa.string()) for i, name in enumerate(places)
    }
