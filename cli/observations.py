"""Observations as the command line takes them: in line or from a file."""

import csv
import io
from pathlib import Path

import numpy as np

from mcsettle.errors import InputError
from mcsettle.estimate.observation import Observation

COLUMNS = ("day", "sd_mm", "sd_error_mm")


def read_observations(text: str) -> tuple[Observation, ...]:
    """Observations from a CSV file with the columns ``COLUMNS``, or from "day:sd:error, …".

    Raises
    ------
    InputError
        Neither a file nor such a list, or a number that cannot be.

    Examples
    --------
    >>> read_observations("0:1.03:0.05, 365:1.21:0.05")[1].day
    365.0
    """
    rows = _inline(text) if ":" in text and not Path(text).is_file() else _from_file(Path(text))
    if not rows:
        raise InputError(f"--observations {text}: no observation; give rows of day, SD and error")
    found = []
    for place, row in enumerate(rows, 1):
        try:
            day, sd, error = (float(value) for value in row)
        except ValueError:
            raise InputError(
                f"--observations, row {place}: received {', '.join(row)}; it takes three numbers: "
                "day, SD in mm, its standard error in mm"
            ) from None
        if not (0.0 <= day < np.inf and 0.0 < sd < np.inf and 0.0 < error < np.inf):
            raise InputError(
                f"--observations, row {place}: day {day:g}, SD {sd:g} mm, error {error:g} mm; days "
                "must not be negative, SD and error must be positive"
            )
        found.append(Observation(day, sd, error))
    return tuple(sorted(found, key=lambda o: o.day or 0.0))


def _inline(text: str) -> list[list[str]]:
    return [[part.strip() for part in row.split(":")] for row in text.split(",") if row.strip()]


def _from_file(path: Path) -> list[list[str]]:
    try:
        text = path.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError, ValueError) as error:
        raise InputError(
            f"--observations {path} cannot be read ({error}); give a CSV file with the columns "
            f'{", ".join(COLUMNS)}, or a list such as "0:1.03:0.05,365:1.21:0.05"'
        ) from None
    lines = list(csv.DictReader(io.StringIO(text)))
    names = [name.strip() for name in (lines[0] if lines else {}) if name]
    if lines and not set(COLUMNS) <= set(names):
        raise InputError(f"--observations {path}: columns {', '.join(names)}; it needs {COLUMNS}")
    stripped = [{(k or "").strip(): (v or "").strip() for k, v in row.items()} for row in lines]
    return [[row[name] for name in COLUMNS] for row in stripped]
