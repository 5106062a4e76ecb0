"""A page as one self-contained HTML file, or its tables as Markdown.

No script, nothing loaded from elsewhere (a content security policy says so to the browser), every
text escaped; pictures are inline SVG. The same page gives the same bytes.
"""

import re
from collections.abc import Iterable
from dataclasses import replace
from importlib.resources import files

from jinja2 import Environment, FunctionLoader, StrictUndefined
from markupsafe import Markup

from mcsettle.report import outgoing
from mcsettle.report.figures.style import page_svg
from mcsettle.report.page import Bars, Bullets, Columns, Fold, Lead, Page, Table, Text, tidied
from mcsettle.report.price_words import USE

NUMBER = re.compile(r"(−?\d+(\.\d+)? ± )?−?\d+(\.(?P<decimals>\d+))?")
KEY_PATH, LONG = re.compile(r"[A-Za-z0-9_.-]+"), 16  # characters of a text that may have to break
DIGIT_SPACE, POINT_SPACE = "\u2007", "\u2008"


def html(page: Page) -> str:
    """The page as HTML."""
    environment = Environment(
        loader=FunctionLoader(_text),
        autoescape=True,
        undefined=StrictUndefined,
        finalize=_sound,
        trim_blocks=False,
        keep_trailing_newline=True,
    )
    pictures = page.pictures
    # Ours, not the user's: matplotlib has escaped what titles it holds.
    svg = {p.name: Markup(page_svg(p.figure, p.name)) for p in pictures}
    number = {p.name: place for place, p in enumerate(pictures, 1)}
    environment.filters |= {"tidied": tidied, "aligned": aligned, "breakable": breakable}
    template = environment.get_template("page.html")
    style = Markup(_text("page.css").strip())
    return template.render(page=page, svg=svg, number=number, style=style)


def aligned(table: Table) -> Table:
    """``table`` whose numbers stand with their decimal points below one another.

    Missing decimals are filled with spaces as wide as a digit and as a point.
    """
    n = table.n_text
    numbers = [row[n:] for row in table.rows if len(row) > 1]
    places = [max(_decimals(cell) or 0 for cell in column) for column in zip(*numbers, strict=True)]
    rows = tuple((*row[:n], *map(_filled, row[n:], places)) for row in table.rows)
    return replace(table, rows=rows)


def breakable(cell: str) -> str:
    """A long key path with places to break it, after dots and underscores; other texts as they are."""
    if len(cell) < LONG or not KEY_PATH.fullmatch(cell):
        return cell
    return Markup(re.sub(r"([._])", r"\1<wbr>", cell))


def _decimals(cell: str) -> int | None:
    """Decimals of a number, also of one with its error; None for other texts."""
    match = NUMBER.fullmatch(cell)
    return None if match is None else len(match["decimals"] or "")


def _filled(cell: str, places: int) -> str:
    decimals = _decimals(cell)
    if decimals is None or decimals >= places:
        return cell
    return cell + ("" if decimals else POINT_SPACE) + DIGIT_SPACE * (places - decimals)


def markdown(page: Page, sections: tuple[str, ...] = ()) -> str:
    """Texts and tables of the page, or of the named sections, as Markdown."""
    lines = [f"# {outgoing.markdown(page.title)}", ""]
    parts = [s for s in page.sections if not sections or s.key in sections]
    if not sections:
        lines += [f"**{outgoing.markdown(page.question)}**", "", outgoing.markdown(page.scope), ""]
        lines += [line for block in page.answer for line in _lines(block)]
    for section in parts:
        lines += [f"## {section.title}", ""]
        lines += [line for block in section.blocks for line in _lines(block)]
    return "\n".join(lines).rstrip() + "\n"


def _lines(block: object) -> list[str]:
    if isinstance(block, Text):
        return [outgoing.markdown(block.text), ""]
    if isinstance(block, Lead):
        worth = f" Supported: {USE[block.verdict]} ({block.reason})." if block.verdict else ""
        return [outgoing.markdown(block.text + worth), ""]
    if isinstance(block, Columns):
        return [line for part in block.parts for inner in part for line in _lines(inner)]
    if isinstance(block, Fold):
        inner = [line for part in block.parts for line in _lines(part)]
        return [f"### {outgoing.markdown(block.title)}", "", *inner]
    if isinstance(block, Bars):
        return _lines(_as_table(block))
    if isinstance(block, Bullets):
        head = [f"**{outgoing.markdown(block.title)}**", ""] if block.title else []
        return [*head, *(f"- {outgoing.markdown(entry)}" for entry in block.entries), ""]
    if isinstance(block, Table):
        block = tidied(block)
        rule = ["---" if i < block.n_text else "---:" for i in range(len(block.head))]
        filled = ((*row, *("",) * (len(block.head) - len(row))) for row in block.rows)
        heading, *rows = (_row(map(outgoing.markdown, row)) for row in (block.head, *filled))
        note = [outgoing.markdown(block.note), ""] if block.note else []
        title = [f"**{outgoing.markdown(block.caption)}**", ""] if block.caption else []
        return [*title, heading, _row(rule), *rows, "", *note]
    return []


def _as_table(bars: Bars) -> Table:
    rows = tuple(
        (f"{row.title} ({row.note})", bar.label, *bar.cells)
        for row in bars.rows
        for bar in row.bars
    )
    head = (bars.head[0], "scenario", f"{bars.head[1]}: {bars.head[2]}", *bars.head[3:])
    return Table(bars.caption, head, rows, 2)


def _row(cells: Iterable[str]) -> str:
    return f"| {' | '.join(cells)} |"


def _sound(value: object) -> object:
    """Texts without the characters that HTML does not allow, or hides; markup is escaped elsewhere."""
    if isinstance(value, str) and not isinstance(value, Markup):
        return outgoing.lines(value)
    return value


def _text(name: str) -> str:
    return files("mcsettle.report").joinpath(name).read_text(encoding="utf-8")
