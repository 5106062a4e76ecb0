"""Tables and numbers on the terminal, the same for every command."""

import sys
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

from rich.console import Console, ConsoleOptions, RenderableType
from rich.segment import Segment
from rich.table import Column, Table

from mcsettle.estimate.rounding import number
from mcsettle.report.outgoing import lines

if TYPE_CHECKING:
    from mcsettle.estimate.estimate import Estimate

WIDTH = 140  # of a table that is not on a terminal
UNKNOWN = "–"
FOLDED = 8  # characters of a column of text that folds


def console() -> Console:
    """Stdout, as wide as the terminal or ``WIDTH``."""
    return _Console(
        width=None if sys.stdout.isatty() else WIDTH, highlight=False, markup=False, emoji=False
    )


class _Console(Console):
    """A console to which every text is data: no markup, and nothing that the terminal would obey."""

    def render(
        self, renderable: RenderableType, options: ConsoleOptions | None = None
    ) -> Iterable[Segment]:
        """Segments of ``renderable``, their texts as they may leave."""
        for segment in super().render(renderable, options):
            yield segment if segment.control else Segment(lines(segment.text), segment.style)


def table(title: str, *headings: str) -> Table:
    """Table whose columns of text have these ``headings``; long ones fold, metrics do not."""
    made = Table(title=title, title_justify="left", pad_edge=False)
    for heading in headings:
        made.add_column(heading, overflow="fold", no_wrap=heading == "metric")
    return made


def add_numbers(made: Table, *headings: str) -> None:
    """Columns of numbers with these ``headings``; their digits stay on one line."""
    for heading in headings:
        made.add_column(heading, justify="right", no_wrap=True)


def print_fitted(out: Console, made: Table, dispensable: Sequence[str]) -> None:
    """Print a table; where it is too wide its ``dispensable`` columns go, the first ones first.

    What text is left folds; digits are never cut.
    """
    kept, left = list(made.columns), list(dispensable)
    while left and _least(kept) > out.width:
        kept = [column for column in kept if column.header != left[0]]
        left.pop(0)
    fitted = Table(title=made.title, title_justify="left", pad_edge=False)
    folds = _least(kept) > out.width
    for column in kept:
        number_column = column.justify == "right"
        fitted.add_column(column.header, justify=column.justify, overflow="fold",
                          no_wrap=column.no_wrap and (number_column or not folds))  # fmt: skip
    for row in zip(*(column.cells for column in kept), strict=True):
        fitted.add_row(*row)
    out.print(fitted)


def _least(columns: Sequence[Column]) -> int:
    """Width [columns] below which numbers would be cut; text folds down to eight characters."""
    widths = []
    for column in columns:
        cells = [str(column.header), *(str(cell) for cell in column.cells)]
        width = max(len(line) for cell in cells for line in cell.split("\n"))
        widths.append(width if column.no_wrap else min(width, FOLDED))
    return sum(widths) + 3 * len(widths) + 1


def shown(value: float | None, digits: int = 4) -> str:
    """A number that has no error, with this many significant digits."""
    return number(value, empty=UNKNOWN, digits=digits)


def quantiles(low: "Estimate", middle: "Estimate", high: "Estimate") -> list[str]:
    """Cells of P5, P50 ± its standard error and P95, all with the decimals of that error."""
    places = middle.places()
    ends = [number(end.value, places, UNKNOWN) for end in (low, high)]
    return [ends[0], middle.with_error(UNKNOWN), ends[1]]
