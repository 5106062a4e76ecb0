"""What ``mcsettle compare`` prints: inputs that differ, medians, paired changes; the same as JSON."""

import dataclasses
import json
from typing import TYPE_CHECKING, Any

from mcsettle.cli.tables import UNKNOWN, add_numbers, console, quantiles, table

if TYPE_CHECKING:
    from mcsettle.summary.compare import Comparison, Row

MOST_DIFFERENCES = 40


def print_comparison(comparison: "Comparison") -> None:
    """Tables on stdout."""
    out = console()
    if comparison.differences:
        inputs = table("Inputs that differ", "input", "first", "second")
        for entry in comparison.differences[:MOST_DIFFERENCES]:
            inputs.add_row(*(_text(v) for v in (entry.path, entry.first, entry.second)))
        out.print(inputs)
        more = len(comparison.differences) - MOST_DIFFERENCES
        if more > 0:
            out.print(f"and {more} more")
    else:
        out.print("The two studies have the same inputs.")
    medians = table("Medians", "variant", "scenario", "metric")
    medians.add_column("unit", overflow="fold", max_width=16)
    add_numbers(medians, "first ± s.e.", "second ± s.e.", "change P5", "P50 ± s.e.", "P95")
    for row in comparison.rows:
        medians.add_row(*_cells(row))
    out.print(medians)
    for line in _remarks(comparison):
        out.print(line)


def comparison_json(comparison: "Comparison") -> str:
    """Everything as JSON."""
    data = dataclasses.asdict(comparison)
    return json.dumps(data, indent=1, ensure_ascii=False, allow_nan=False, default=str)


def _cells(row: "Row") -> list[str]:
    change = quantiles(*row.change) if row.change else ["", "", ""]
    if row.change_unit == "%":
        change = [text and text + (" %" if text != UNKNOWN else "") for text in change]
    medians = [estimate.with_error(UNKNOWN) for estimate in (row.first, row.second)]
    return [row.variant, row.scenario, row.metric, row.unit, *medians, *change]


def _remarks(comparison: "Comparison") -> list[str]:
    told = (
        f"Change: second against first, on {comparison.shared} common realisations, one by one; "
        "of intervals in per cent, of effects as a difference."
    )
    why = comparison.unpaired
    if why:
        told = f"Not paired: {why}. Their difference carries the error of both medians."
    unknown = "–: not reached, or not known for too many censored realisations."
    return [told, unknown, *comparison.only]


def _text(value: Any) -> str:
    if value is None:
        return UNKNOWN
    return f"{value:.6g}" if isinstance(value, float) else str(value)
