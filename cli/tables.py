"""Tables and numbers on the terminal, the same for every command."""

import sys
from typing import TYPE_CHECKING

from rich.console import Console
from rich.table import Table

from mcsettle.estimate.rounding import number

if TYPE_CHECKING:
    from mcsettle.estimate.estimate import Estimate

WIDTH = 140  # of a table that is not on a terminal
UNKNOWN = "–"


def console() -> Console:
    """Stdout, as wide as the terminal or ``WIDTH``."""
    return Console(width=None if sys.stdout.isatty() else WIDTH, highlight=False)


def table(title: str, *headings: str) -> Table:
    """Table whose columns of text have these ``headings``; long ones fold, metrics do not."""
    made = Table(title=title, title_justify="left", pad_edge=False)
    for heading in headings:
        made.add_column(heading, overflow="fold", no_wrap=heading == "metric")
    return made


def add_numbers(made: Table, *headings: str) -> None:
    """Columns of numbers with these ``headings``."""
    for heading in headings:
        made.add_column(heading, justify="right")


def shown(value: float | None, digits: int = 4) -> str:
    """A number that has no error, with this many significant digits."""
    return number(value, empty=UNKNOWN, digits=digits)


def quantiles(low: "Estimate", middle: "Estimate", high: "Estimate") -> list[str]:
    """Cells of P5, P50 ± its standard error and P95, all with the decimals of that error."""
    places = middle.places()
    ends = [number(end.value, places, UNKNOWN) for end in (low, high)]
    return [ends[0], middle.with_error(UNKNOWN), ends[1]]
