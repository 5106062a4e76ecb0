"""Lines on what the study's observations change: conditioned rows, weights, inputs.

Depends on: summary (types only), rich.
"""

import dataclasses
import sys
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from mcsettle.summary import Results, SummaryRow

WIDTH = 140


def conditioned_cells(row: "SummaryRow") -> list[str] | None:
    """Cells of the second line of a row: the same numbers given the observations; None without."""
    low, middle, high = (row.conditioned_at(level) for level in (0.05, 0.5, 0.95))
    if low is None or middle is None or high is None:
        return None
    error = middle.standard_error
    centre = _plain(middle.value)
    centre += f" ± {error:.2g}" if error and middle.value is not None else ""
    share = row.conditioned_percent
    at = "" if share is None else f"P{share:.0f}"
    return [
        "",
        "  given observed",
        "",
        _plain(low.value),
        centre,
        _plain(high.value),
        "",
        "",
        "",
        at,
    ]


def print_inputs(results: "Results", variant: str) -> None:
    """What the observations leave of the inputs, and how many parameter sets carry the weight."""
    from rich.console import Console
    from rich.table import Table

    found = results.conditioning(variant)
    if found is None:
        return
    console = Console(width=None if sys.stdout.isatty() else WIDTH, highlight=False)
    n = len(results.study.observed)
    console.print(
        f"given observed: {n} observation{'s' if n > 1 else ''}; {found.effective:.1f} of "
        f"{len(found.weights)} parameter sets carry the weight.",
        markup=False,
    )
    if found.remark:
        console.print(f"warning: {found.remark}", markup=False)
    bands = results.input_bands(variant)
    if not bands:
        return
    table = Table(title="Inputs: P5 / P50 / P95", title_justify="left", pad_edge=False)
    table.add_column("input", overflow="fold")
    for heading in ("as drawn", "given observed"):
        table.add_column(heading, justify="right")
    for band in bands:
        cells = [" / ".join(_plain(v) for v in own) for own in (band.drawn, band.conditioned)]
        table.add_row(band.input, *cells)
    console.print(table)


def conditioned_json(row: "SummaryRow") -> list[dict[str, Any]]:
    """The conditioned statistics of a row as plain data."""
    return [
        {
            "statistic": s.statistic,
            "subject": s.subject,
            "level": s.level,
            **dataclasses.asdict(s.estimate),
        }
        for s in row.conditioned
    ]


def weights_json(results: "Results") -> Iterator[dict[str, Any]]:
    """Every variant's conditioning as plain data."""
    for variant in results.study.variant_names:
        found = results.conditioning(variant)
        if found is not None:
            yield {
                "variant": variant,
                "parameter_sets": len(found.weights),
                "effective": found.effective,
                "usable": found.usable,
                "remark": found.remark,
                "inputs": [dataclasses.asdict(b) for b in results.input_bands(variant)],
            }


def _plain(value: float | None) -> str:
    return "–" if value is None else f"{value:.4g}"
