"""Observations as the command line takes them: in line or from a file."""

import csv
import datetime as dt
from pathlib import Path

import numpy as np

from mcsettle.errors import InputError
from mcsettle.estimate.observation import Observation
from mcsettle.railway.dates import date_of, looks_dated
from mcsettle.railway.text_files import SEPARATORS, cells, decoded, refused, sniffed

COLUMNS = ("day", "sd_mm", "sd_error_mm")
LARGEST_FILE = 10_000_000  # bytes
HOW = (
    f"give a CSV file with the columns {', '.join(COLUMNS)} (or date in place of day), or a list such as "
    '"0:1.03:0.05,365:1.21:0.05"'
)


def read_observations(text: str, dates: str = "iso") -> tuple[Observation, ...]:
    """Observations from a CSV file with the columns ``COLUMNS``, or from "day:sd:error, …".

    In a file a date may stand for the day, ISO or in the order ``dates``; the first one is day 0.

    Raises
    ------
    InputError
        Neither a file nor such a list, or numbers that cannot be: all of them at once.

    Examples
    --------
    >>> read_observations("0:1.03:0.05, 365:1.21:0.05")[1].day
    365.0
    """
    if ":" in text and not Path(text).is_file():
        rows, decimal = _inline(text), "."
    else:
        rows, decimal = _from_file(Path(text))
    if not rows:
        raise InputError(f"--observations {text}: no observation; {HOW}")
    faults: list[str] = []
    days = _days([row[0] for row in rows], dates, decimal, faults)
    observations = []
    for place, (day, row) in enumerate(zip(days, rows, strict=True), 1):
        sd, error = (_number(cell, decimal) for cell in row[1:])
        if np.isnan([day, sd, error]).any():
            faults.append(
                f"row {place}: received {', '.join(row)}; it takes three numbers: day (or a "
                "date), SD in mm, its standard error in mm"
            )
        elif not (0.0 <= day < np.inf and 0.0 < sd < np.inf and 0.0 < error < np.inf):
            faults.append(
                f"row {place}: day {day:g}, SD {sd:g} mm, error {error:g} mm; days must not be negative, "
                "SD and error must be positive (the scatter of repeated recordings of a section is its "
                "error)"
            )
        else:
            observations.append(Observation(day, sd, error))
    if faults:
        raise refused(f"--observations {text}", faults)
    return tuple(sorted(observations, key=lambda o: o.day or 0.0))


def _inline(text: str) -> list[list[str]]:
    rows = [[part.strip() for part in row.split(":")] for row in text.split(",") if row.strip()]
    wrong = [row for row in rows if len(row) != len(COLUMNS)]
    if wrong:
        raise InputError(
            f"--observations: received {':'.join(wrong[0])}; it takes three numbers, day:sd:error"
        )
    return rows


def _from_file(path: Path) -> tuple[list[list[str]], str]:
    """Rows of day, SD and error as texts, and the decimal sign: a comma where semicolons separate."""
    origin = f"--observations {path}"
    try:
        if path.stat().st_size > LARGEST_FILE:
            raise InputError(f"{origin} has more than {LARGEST_FILE} bytes")
        lines = [line for line in decoded(path.read_bytes(), None).splitlines() if line.strip()]
    except InputError as error:
        raise refused(origin, [str(error)]) from None
    except (OSError, ValueError):
        raise InputError(f"{origin} cannot be read; {HOW}") from None
    name, first = sniffed(lines[:50]) or ("comma", 0)
    separator = SEPARATORS[name]
    heading = cells(lines[first], separator) if lines else []
    names = [cell.lower() for cell in heading]
    wanted = ("date" if "date" in names and "day" not in names else "day", *COLUMNS[1:])
    lacking = [column for column in wanted if column not in names]
    if lacking and names:
        raise refused(
            origin,
            [
                f"no column {', '.join(lacking)}; its columns: {', '.join(heading)}; "
                f"it needs {', '.join(COLUMNS)}, or date in place of day"
            ],
        )
    rows = list(csv.reader(lines[first + 1 :], delimiter=separator))
    ragged = [i for i, row in enumerate(rows, 1) if len(row) < len(names)]
    if ragged:
        raise refused(origin, [f"row {ragged[0]} has fewer cells than the heading ({len(names)})"])
    places = [names.index(column) for column in wanted] if rows else []
    decimal = "," if name == "semicolon" else "."
    return [[row[place].strip() for place in places] for row in rows], decimal


def _days(texts: list[str], order: str, decimal: str, faults: list[str]) -> list[float]:
    """Days of plain numbers, or since the first of the dates; NaN where there is none."""
    numbers = [_number(text, decimal) for text in texts]
    if not any(
        np.isnan(number) and looks_dated(text) for number, text in zip(numbers, texts, strict=True)
    ):
        serial = [
            text
            for text, day in zip(texts, numbers, strict=True)
            if day > 20_000 and looks_dated(text)
        ]
        if len(serial) == len(texts):
            faults.append(_said(serial[0], order))
        return numbers
    dates: list[dt.date | None] = []
    for place, text in enumerate(texts, 1):
        try:
            dates.append(date_of(text, order))
        except ValueError as error:
            faults.append(f"row {place}: {error}")
            dates.append(None)
    first = min((date for date in dates if date is not None), default=None)
    return [0.0 if date is None or first is None else float((date - first).days) for date in dates]


def _said(text: str, order: str) -> str:
    try:
        date_of(text, order)
    except ValueError as error:
        return str(error)
    return ""


def _number(text: str, decimal: str) -> float:
    """The number of a cell, NaN where it is none; a point is accepted where a comma is usual."""
    try:
        return float(text.replace(decimal, ".") if decimal == "," else text)
    except ValueError:
        return np.nan
