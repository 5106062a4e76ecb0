"""Lines on uncertainty: what the spread consists of, lines of track, tornado, convergence, posterior."""

from collections.abc import Iterable, Iterator
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from rich.console import Console

from mcsettle.cli.tables import UNKNOWN, add_numbers, console, print_fitted, shown, table

if TYPE_CHECKING:
    from mcsettle.estimate.estimate import Statistic
    from mcsettle.summary.summary import SummaryRow


def print_spread(rows: "list[SummaryRow]") -> None:
    """Tables of one variant: variance split and indices, pairing, and the mean along a line."""
    out = console()
    split = table("What the spread consists of, share of the variance [%]", "scenario", "metric")
    add_numbers(split, "parameters", "sections", "interaction", "pairing gain", "correlation")
    for row in rows:
        parts = ("parameters", "sections", "interaction")
        cells = [_share(row, "variance_share", part, 100.0) for part in parts]
        cells += [_share(row, kind) for kind in ("pairing_gain", "correlation")]
        if any(cells):
            split.add_row(row.name, row.metric, *cells)
    if split.row_count:
        print_fitted(out, split, ("interaction", "correlation"))
    lines = list(_index_lines(rows))
    for line in lines:
        out.print(line)
    if not lines and any(row.part("variance_share") for row in rows):
        from mcsettle.estimate.variance import LEAST_SETS

        out.print(f"Indices of single inputs: from {LEAST_SETS} parameter sets on.")
    _print_lines(out, rows)


def statistics_data(statistics: "Iterable[Statistic]") -> list[dict[str, Any]]:
    """Statistics with their estimates as plain data."""
    return [
        {"statistic": s.statistic, "subject": s.subject, "level": s.level} | asdict(s.estimate)
        for s in statistics
    ]


def _print_lines(out: Console, rows: "list[SummaryRow]") -> None:
    """Mean interval and mean cost over lines of several lengths, each with its 95 % interval."""
    title = "Mean over a line of independent sections, [95 % interval of the Monte Carlo error]"
    means = table(title, "scenario", "metric")
    add_numbers(
        means, "line", "P5", "P50", "P95", "mean", "median section", "cost at mean interval"
    )
    for row in rows:
        of_line = row.part("line_mean")
        named = [row.name, row.metric]
        ends = [shown(row.at(0.5).value), _share(row, "cost_at_mean_interval")]
        for length in dict.fromkeys(s.subject for s in of_line):
            cells = [s.estimate.with_interval("\n") for s in of_line if s.subject == length]
            means.add_row(*named, length, *cells, *ends)
            named, ends = ["", ""], ["", ""]
    if not means.row_count:
        return
    print_fitted(out, means, ("cost at mean interval", "median section", "P50", "P95", "P5"))
    for note in dict.fromkeys(s.estimate.note for r in rows for s in r.spread if s.subject):
        if note.startswith("restricted"):
            out.print(f"Intervals are {note}: sections that last longer count with it.")
    out.print(
        "A line's price is the mean of its sections' costs. Uncertain inputs are the same all along "
        "a line, so their spread stays. Open: too few parameter sets or realisations to say how far.",
    )


def _index_lines(rows: "list[SummaryRow]") -> Iterator[str]:
    """First-order and total indices, the largest first, a line of each for every metric."""
    kinds = {"first_order_index": "first-order", "total_index": "total"}
    for row in rows:
        for kind, name in kinds.items():
            indices = row.part(kind)
            indices.sort(key=lambda s: -(s.estimate.value or 0.0))
            if not indices:
                continue
            cells = (f"{s.subject} {s.estimate.with_error(UNKNOWN, 100.0)}" for s in indices[:4])
            parts = ", ".join(cells)
            if all(s.estimate.value is None for s in indices):
                parts = f"not known ({indices[0].estimate.note})"
            yield f"{row.name} {row.metric}, {name} indices [%]: {parts}"


def _share(row: "SummaryRow", kind: str, subject: str = "", factor: float = 1.0) -> str:
    for s in row.part(kind):
        if s.subject == subject:
            return s.estimate.with_error(UNKNOWN, factor)
    return ""
