"""The tables of a run for workbooks: one XLSX file, or a folder of CSV files.

Sheets and files: ``about`` (what this is, provenance), in a workbook ``charges`` and ``pairs`` (prices as
formulas), ``summary``, ``effects``, ``realisations``,
``inputs`` (the assumptions register), ``scenarios``, ``columns`` (units and meanings). Numbers stay
numbers, empty cells are unknown. Text never becomes a formula. The same run gives the same bytes.
"""

import datetime
import io
import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import pandas as pd

from mcsettle.errors import InputError
from mcsettle.report.charge_sheet import write_charges
from mcsettle.report.material import Material, rows_digest
from mcsettle.report.outgoing import csv_text, plain
from mcsettle.report.register import entries
from mcsettle.run.columns import summary_columns
from mcsettle.storage.marks import NAME, write_marked
from mcsettle.storage.tables import TABLES, in_currency
from mcsettle.units import MGT

MOST_ROWS = 1_048_575  # of a worksheet, its heading left out
LARGEST_WHOLE = 2**53  # that a double holds with all smaller ones
MOST_TEXT = 32_767  # characters of a cell
# How the numbers of a column are shown, by the end of its name; all their digits stay.
FORMATS = {
    "_days": "0.0",
    "_percent": "0.00",
    "_mm": "0.000",
    "elasticity": "0.000",
    "marginal_cost": "0.0000",
}
CREATED = datetime.datetime(2000, 1, 1)  # a workbook wants a date; the same every time


@dataclass(frozen=True)
class Sheet:
    """One table: names and units of its columns, and its rows."""

    name: str
    columns: tuple[str, ...]
    rows: tuple[tuple[Any, ...], ...]


def sheets(material: Material) -> list[Sheet]:
    """Every table of an export."""
    summary = summary_columns(list(material.rows))
    tables = [
        _about(material),
        Sheet("summary", tuple(summary), tuple(zip(*summary.values(), strict=True))),
        _frame("effects", material.results.effects),
        _frame("realisations", material.results.realisations),
        _inputs(material),
        _scenarios(material),
        _columns(material.study.currency),
    ]
    return [sheet for sheet in tables if sheet.columns]


def write_csv(material: Material, folder: Path, force: bool = False) -> list[Path]:
    """One CSV file (UTF-8, RFC 4180) a table in ``folder``; ``about.csv`` bears the study's mark.

    Raises
    ------
    InputError
        The folder cannot be written, or holds others' files of these names (not so with ``force``).
    """
    files = {}
    for sheet in sheets(material):
        text = csv_text(sheet.columns, ([_cell(value) for value in row] for row in sheet.rows))
        files[folder / f"{sheet.name}.csv"] = text.encode()
    return write_marked(files, material.study.identity, force)


def write_xlsx(material: Material, path: Path, force: bool = False) -> list[str]:
    """One workbook; returns remarks on tables that are too long for a sheet.

    Raises
    ------
    InputError
        The extra is not installed, the file cannot be written, or another's stands there (not so with
        ``force``).
    """
    try:
        import xlsxwriter
    except ImportError:
        raise InputError(
            "a workbook needs the extra 'xlsx': pip install 'mcsettle[xlsx]'; or export csv= files"
        ) from None
    remarks: list[str] = []
    buffer = io.BytesIO()
    options = {"in_memory": True, "strings_to_formulas": False, "strings_to_urls": False,
               "strings_to_numbers": False, "nan_inf_to_errors": False}  # fmt: skip
    with xlsxwriter.Workbook(buffer, options) as book:
        book.set_properties({"title": plain(material.study.title)[:200], "created": CREATED})
        book.set_custom_property(NAME, material.study.identity)
        for sheet in sheets(material):
            rows = sheet.rows[:MOST_ROWS]
            if len(rows) < len(sheet.rows):
                remarks.append(
                    f"sheet '{sheet.name}' holds the first {len(rows)} of {len(sheet.rows)} rows; "
                    "export to CSV for all"
                )
            _fill(book, sheet.name, sheet.columns, rows)
            if sheet.name == "about":
                write_charges(book, material)
    write_marked({path: buffer.getvalue()}, material.study.identity, force)
    return remarks


def _fill(book: Any, name: str, columns: tuple[str, ...], rows: Sequence[tuple[Any, ...]]) -> None:
    """A sheet: heading with filters, cells with their types, widths that fit the first rows."""
    page = book.add_worksheet(name)
    bold = book.add_format({"bold": True, "text_wrap": True, "valign": "top"})
    widths = [len(name) for name in columns]
    for place, name in enumerate(columns):
        page.write_string(0, place, name, bold)
    for line, row in enumerate(rows, 1):
        for place, raw in enumerate(row):
            value = _cell(raw)
            if value is None:
                continue
            if isinstance(value, bool):
                page.write_boolean(line, place, value)
            elif isinstance(value, int) and abs(value) > LARGEST_WHOLE:
                page.write_string(line, place, str(value))  # a workbook would round it
            elif isinstance(value, int | float):
                page.write_number(line, place, value)
            else:
                page.write_string(line, place, value[:MOST_TEXT])
            if line < 200:
                widths[place] = max(widths[place], len(str(value)))
    page.freeze_panes(1, 0)
    for place, width in enumerate(widths):
        shape = next((f for end, f in FORMATS.items() if columns[place].endswith(end)), None)
        look = None if shape is None else book.add_format({"num_format": shape})
        page.set_column(place, place, min(max(width + 1, 8), 60), look)
    page.autofilter(0, 0, max(len(rows), 1), len(columns) - 1)


def _cell(value: Any) -> Any:
    """A plain value, None where unknown."""
    if value is None or value is pd.NA:
        return None
    if hasattr(value, "item"):
        value = value.item()
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return plain(value) if isinstance(value, str) else value


def _frame(name: str, table: pd.DataFrame) -> Sheet:
    rows = tuple(table.itertuples(index=False, name=None))
    return Sheet(name, tuple(str(column) for column in table.columns), rows)


def _about(material: Material) -> Sheet:
    study = material.study
    economics = study.economics
    rows: list[tuple[Any, ...]] = [("title", study.title), ("answer's variant", material.variant)]
    if economics is not None:
        rows += [
            ("currency", economics.currency),
            ("price base year", economics.price_base_year or "not stated"),
            ("baseline", ", ".join(dict.fromkeys(e.baseline for e in study.effects.values()))),
        ]
    rows += [(key.replace("_", " "), value) for key, value in asdict(material.provenance).items()]
    rows += [("realisations", material.n_tracks), ("parameter sets", material.n_sets)]
    for name in ("realisations", "history", "effects"):
        rows.append((f"digest of the rows of {name}", rows_digest(getattr(material.results, name))))
    rows.append((NAME, study.identity))
    rows.append(("empty cells", "not reached, not identified, or without meaning for that row"))
    return Sheet("about", ("what", "value"), tuple(rows))


def _inputs(material: Material) -> Sheet:
    rows = []
    for e in entries(material.study):
        value = e.value if e.given is None else e.given
        rows.append((e.path, value, e.unit, e.distribution, e.set_by, e.source))
    names = ("input", "value", "unit", "distribution", "set_by", "source")
    return Sheet("inputs", names, tuple(rows))


def _scenarios(material: Material) -> Sheet:
    study = material.study
    rows = [
        (
            scenario.name,
            scenario.title,
            place,
            entry.train,
            entry.speed_kmh,
            entry.per_day,
            study.timetable(scenario.name).mass_per_day / MGT,
            study.mgt_per_day(scenario.name),
            study.mgt_per_year(scenario.name),
        )
        for scenario in study.scenarios
        for place, entry in enumerate(scenario.timetable, 1)
    ]
    names = (
        "scenario", "title", "service", "train", "speed_kmh", "per_day", "mgt_per_day_of_trains",
        "mgt_per_day_stated", "mgt_per_year",
    )  # fmt: skip
    return Sheet("scenarios", names, tuple(rows))


def _columns(currency: str) -> Sheet:
    rows = [
        (table, column.name, str(column.type), in_currency(column.unit, currency), column.meaning)
        for table in ("summary", "effects", "realisations")
        for column in TABLES[table].columns
    ]
    return Sheet("columns", ("table", "column", "type", "unit", "meaning"), tuple(rows))
