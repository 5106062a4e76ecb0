"""What ``mcsettle compare`` prints: inputs that differ, medians, paired changes; the same as JSON."""

import dataclasses
import json
import sys
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from mcsettle.estimate.estimate import Estimate
    from mcsettle.summary.compare import Comparison, Row

MOST_DIFFERENCES = 40


def print_comparison(found: "Comparison") -> None:
    """Tables on stdout."""
    from rich.console import Console
    from rich.table import Table

    console = Console(width=None if sys.stdout.isatty() else 140, highlight=False)
    if found.differences:
        table = Table(title="Inputs that differ", title_justify="left", pad_edge=False)
        for heading in ("input", "first", "second"):
            table.add_column(heading, overflow="fold")
        for entry in found.differences[:MOST_DIFFERENCES]:
            table.add_row(*(_text(v) for v in (entry.path, entry.first, entry.second)))
        console.print(table)
        more = len(found.differences) - MOST_DIFFERENCES
        if more > 0:
            console.print(f"and {more} more", markup=False)
    else:
        console.print("The two studies have the same inputs.", markup=False)
    table = Table(title="Medians", title_justify="left", pad_edge=False)
    for heading in ("variant", "scenario", "metric"):
        table.add_column(heading, overflow="fold", no_wrap=heading == "metric")
    table.add_column("unit", overflow="fold", max_width=16)
    for heading in ("first ± s.e.", "second ± s.e.", "change P5", "P50 ± s.e.", "P95"):
        table.add_column(heading, justify="right")
    for row in found.rows:
        table.add_row(*_cells(row))
    console.print(table)
    for line in _remarks(found):
        console.print(line, markup=False)


def comparison_json(found: "Comparison") -> str:
    """Everything as JSON."""
    data = dataclasses.asdict(found)
    return json.dumps(data, indent=1, ensure_ascii=False, allow_nan=False, default=str)


def _cells(row: "Row") -> list[str]:
    change = ["", "", ""]
    if row.change:
        low, middle, high = row.change
        change = [_number(low), _number(middle, True), _number(high)]
        change = [
            text + (" %" if row.change_unit == "%" and text != "–" else "") for text in change
        ]
    medians = (_number(row.first, True), _number(row.second, True))
    return [row.variant, row.scenario, row.metric, row.unit, *medians, *change]


def _remarks(found: "Comparison") -> list[str]:
    if found.unpaired:
        told = [
            f"Not paired: {found.unpaired}. Their difference carries the error of both medians."
        ]
    else:
        told = [
            f"Change: second against first, track by track, on {found.shared} common realisations; "
            "of intervals in per cent, of effects as a difference."
        ]
    return [*told, "–: not reached, or not known for too many censored tracks.", *found.only]


def _number(estimate: "Estimate", error: bool = False) -> str:
    if estimate.value is None:
        return "–"
    known = error and estimate.standard_error
    return f"{estimate.value:.4g}" + (f" ± {estimate.standard_error:.2g}" if known else "")


def _text(value: Any) -> str:
    from rich.markup import escape

    if value is None:
        return "–"
    return escape(f"{value:.6g}" if isinstance(value, float) else str(value))
