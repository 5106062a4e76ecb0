"""One look for all pictures, and files whose bytes depend on the picture alone.

The colours are those of Okabe and Ito, told apart by readers with any kind of colour vision; lines
differ in dash as well, so that they survive a black-and-white printer.
"""

import functools
import io
import re
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, ParamSpec

import matplotlib
from matplotlib import ticker
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure

P = ParamSpec("P")

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
DASHES = ("-", "--", "-.", ":", (0, (5, 1, 1, 1, 1, 1)), (0, (8, 2)), (0, (1, 1)))
MARKERS = ("o", "s", "^", "D", "v", "P", "X")
GREY = "#555555"
GRID = "#DDDDDD"
# What a page has for ink, ground, grid and scenarios; its style sheet defines them.
PAGE_COLOURS = {
    "#000000": "currentColor",
    "#ffffff": "none",
    GRID.lower(): "var(--line)",
    GREY: "var(--soft)",
} | {colour.lower(): f"var(--t{i})" for i, colour in enumerate(COLOURS[:-1])}
MAP = "cividis"  # even in lightness, the same for all colour vision
FORMATS = ("png", "svg")
METADATA: dict[str, dict[str, None]] = {
    "png": {"Software": None},
    "svg": {"Date": None},
    "pdf": {"CreationDate": None},
}
_RULES: Any = {
    "axes.axisbelow": True,
    "axes.grid": True,
    "axes.spines.right": False,
    "axes.spines.top": False,
    "axes.titlelocation": "left",
    "axes.titlesize": 10,
    "figure.dpi": 100,
    "figure.titlesize": 11,
    "font.family": "DejaVu Sans",
    "font.size": 9,
    "grid.color": GRID,
    "grid.linewidth": 0.6,
    "legend.frameon": False,
    "lines.linewidth": 1.4,
    "mathtext.fontset": "dejavusans",
    "savefig.dpi": 150,
    "svg.fonttype": "path",
    "svg.hashsalt": "mcsettle",
    "text.parse_math": False,  # a title may hold a dollar sign
}


def styled(draw: Callable[P, Figure]) -> Callable[P, Figure]:
    """Let a drawing function work under the common style, whatever the user's own settings."""

    @functools.wraps(draw)
    def wrapped(*args: P.args, **kwargs: P.kwargs) -> Figure:
        with matplotlib.rc_context():
            matplotlib.rcdefaults()
            matplotlib.rcParams.update(_RULES)
            return draw(*args, **kwargs)

    return wrapped


def look(index: int) -> dict[str, Any]:
    """Colour and dash of the line number ``index``."""
    return {"color": COLOURS[index % len(COLOURS)], "linestyle": DASHES[index % len(DASHES)]}


class LogTicks(ticker.Locator):
    """Ticks of a log axis, two at least: decades, else 1, 2 and 5, else evenly spaced."""

    def __call__(self) -> Sequence[float]:
        """Ticks of what the axis shows."""
        assert self.axis is not None
        return self.tick_values(*self.axis.get_view_interval())

    def tick_values(self, vmin: float, vmax: float) -> Sequence[float]:
        """Ticks between two values."""
        low, high = sorted((vmin, vmax))
        for subs, least in (((1.0,), 3), ((1.0, 2.0, 5.0), 2)):
            ticks = ticker.LogLocator(subs=subs).tick_values(low, high)
            inside = [float(tick) for tick in ticks if low <= tick <= high]
            if len(inside) >= least:
                return inside
        even = ticker.MaxNLocator(4).tick_values(low, high)
        return [float(tick) for tick in even if low <= tick <= high]


def log_labels(axis: Axis) -> None:
    """Let every tick of a log axis be labelled, and two at least be there."""
    axis.set_major_locator(LogTicks())
    axis.set_major_formatter(ticker.FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_formatter(ticker.NullFormatter())


def note(figure: Figure, text: str) -> None:
    """Definitions and sources below a picture."""
    figure.supxlabel(text, x=0.01, ha="left", fontsize=7.5, color=GREY)


def legend_outside(axes: Axes, **options: Any) -> None:
    """Legend to the right of the axes, where it hides nothing."""
    axes.legend(loc="upper left", bbox_to_anchor=(1.01, 1.0), borderaxespad=0.0, **options)


def files_of(
    figure: Figure, folder: Path, name: str, formats: Sequence[str] = FORMATS
) -> dict[Path, bytes]:
    """Files of ``figure`` in each format, and their content: the same picture gives the same bytes."""
    return {folder / f"{name}.{kind}": drawn(figure, kind) for kind in formats}


def drawn(figure: Figure, kind: str, **rules: Any) -> bytes:
    """``figure`` as the content of a file: "png", "svg" or "pdf"; ``rules`` over the common ones."""
    buffer = io.BytesIO()
    with matplotlib.rc_context():
        matplotlib.rcdefaults()
        matplotlib.rcParams.update(_RULES | rules)
        figure.savefig(buffer, format=kind, metadata=METADATA[kind])
    return buffer.getvalue()


def page_svg(figure: Figure, name: str) -> str:
    """``figure`` as an SVG element to stand in a page, its text as text.

    Ids begin with ``name``, so that several pictures do not share one.
    """
    text = drawn(figure, "svg", **{"svg.fonttype": "none"}).decode("utf-8")
    text = text[text.index("<svg") :]
    text = re.sub(r"<metadata>.*?</metadata>\s*", "", text, flags=re.DOTALL)
    text = re.sub(r"<!--.*?-->\s*", "", text, flags=re.DOTALL)
    # A colour of the page differs in a dark window.
    text = re.sub(
        r"(?<=[: \"])#[0-9a-f]{6}\b", lambda colour: PAGE_COLOURS.get(colour[0], colour[0]), text
    )
    ids = r'((?<![\w-])id="|href="#|url\(#)'
    return re.sub(r"<[^>]*>", lambda tag: re.sub(ids, rf"\1{name}-", tag[0]), text).strip()
