"""What a page consists of: frozen descriptions without any markup."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from typing import Any


@dataclass(frozen=True)
class Text:
    """A paragraph."""

    text: str
    kind: str = ""  # "", "lead", "note" or "warning"


@dataclass(frozen=True)
class Bullets:
    """A list of short statements; ``title`` stands above it."""

    entries: tuple[str, ...]
    title: str = ""


@dataclass(frozen=True)
class Table:
    """A table of cells already worded; the first ``n_text`` columns hold text, the rest numbers.

    A row of a single cell is a heading over the rows below it.
    """

    caption: str
    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    n_text: int = 1
    note: str = ""
    small: bool = False


def tidied(table: Table) -> Table:
    """``table`` without the columns that are empty in every row."""
    full = [row for row in table.rows if len(row) == len(table.head)]
    kept = [i for i in range(len(table.head)) if i == 0 or any(row[i] for row in full)]
    if len(kept) == len(table.head) or not full:
        return table
    rows = tuple(
        tuple(row[i] for i in kept) if len(row) == len(table.head) else row for row in table.rows
    )
    head = tuple(table.head[i] for i in kept)
    return replace(table, head=head, rows=rows, n_text=sum(i < table.n_text for i in kept))


@dataclass(frozen=True)
class Fold:
    """Parts that are opened where they are wanted; ``title`` is what is seen of them."""

    title: str
    parts: "tuple[Block, ...]"


@dataclass(frozen=True)
class Picture:
    """A picture: ``figure`` a matplotlib Figure, ``alt`` what it shows in words.

    ``least`` [px] is the width below which its text would be too small: it scrolls rather.
    """

    name: str
    figure: Any
    alt: str
    caption: str
    least: int = 340


@dataclass(frozen=True)
class Code:
    """Lines to type or to keep."""

    text: str
    title: str = ""
    folded: bool = False


@dataclass(frozen=True)
class Bar:
    """One price on an axis, places in per cent of it (None: unknown), and what stands beside it.

    ``tint`` is the number of the scenario's colour; ``published`` a ring. ``cells`` stand to the right.
    """

    label: str
    tint: int
    low: float | None
    middle: float | None
    high: float | None
    published: float | None
    cells: tuple[str, ...]


@dataclass(frozen=True)
class BarRow:
    """One model form: its name, what it assumes, a bar a scenario."""

    title: str
    note: str
    bars: tuple[Bar, ...]


@dataclass(frozen=True)
class Bars:
    """Prices by model form on one axis: ``zero`` and ``ticks`` (place in per cent, text).

    ``head`` names the columns: form, axis, then one a cell. ``axis`` is the axis with its unit, for a
    picture without the caption.
    """

    caption: str
    axis: str
    head: tuple[str, ...]
    zero: float
    ticks: tuple[tuple[float, str], ...]
    rows: tuple[BarRow, ...]
    alt: str
    note: str = ""


@dataclass(frozen=True)
class Lead:
    """A sentence of the answer with the colour of its scenario and whether the number may be used."""

    text: str
    label: str
    tint: int
    verdict: str = ""  # "yes", "as a range", "no"; "": nothing to say
    reason: str = ""


@dataclass(frozen=True)
class Columns:
    """Short parts side by side where there is room for it."""

    parts: "tuple[tuple[Block, ...], ...]"


Block = Text | Bullets | Table | Picture | Code | Bars | Lead | Columns | Fold


@dataclass(frozen=True)
class Section:
    """A part of the page; ``key`` is its address."""

    key: str
    title: str
    blocks: tuple[Block, ...]


@dataclass(frozen=True)
class Page:
    """The whole page: what is asked, what the answer is (the first page), then the sections."""

    title: str
    question: str
    scope: str
    answer: tuple[Block, ...]
    sections: tuple[Section, ...]
    footer: str = ""

    @property
    def bars(self) -> Bars | None:
        """The prices by model form on the first page; None without prices."""
        return next((block for block in self.answer if isinstance(block, Bars)), None)

    @property
    def pictures(self) -> list[Picture]:
        """Every picture, in the order of the page."""
        blocks = [*self.answer, *(b for section in self.sections for b in section.blocks)]
        return [block for block in _flat(blocks) if isinstance(block, Picture)]


def _flat(blocks: Iterable[Block]) -> Iterator[Block]:
    """Blocks, those of folds and columns in their places."""
    for block in blocks:
        if isinstance(block, Fold):
            yield from _flat(block.parts)
        elif isinstance(block, Columns):
            yield from _flat(part for parts in block.parts for part in parts)
        else:
            yield block
