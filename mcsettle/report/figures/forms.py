"""The prices of all model forms in one picture, as the first page has them, for papers and slides."""

from matplotlib.figure import Figure

from mcsettle.report.figures.style import COLOURS, GREY, styled
from mcsettle.report.page import Bars

ROW, EDGES = 0.24, 1.1  # inches of a bar and of what stands above and below


@styled
def forms_figure(bars: Bars) -> Figure:
    """A row for each form, a bar for each scenario: mean of the line, 95 % interval, published ring."""
    lines = [(row, bar) for row in bars.rows for bar in row.bars]
    figure = Figure(figsize=(7.2, EDGES + ROW * max(len(lines), 2)), layout="constrained")
    axes = figure.add_subplot()
    axes.axvline(bars.zero, color=GREY, linewidth=1.2)
    for place, (_, bar) in enumerate(lines):
        colour = COLOURS[bar.tint % len(COLOURS)]
        if bar.low is not None and bar.high is not None:
            axes.plot([bar.low, bar.high], [place, place], color=colour, linewidth=4.0, alpha=0.5,
                      solid_capstyle="butt")  # fmt: skip
        if bar.published is not None:
            axes.plot(bar.published, place, "o", color="none", markeredgecolor="k", markersize=7)
        if bar.middle is not None:
            axes.plot(bar.middle, place, "o", color=colour, markersize=5)
        else:
            axes.annotate(bar.cells[0], (bars.zero, place), va="center", color=GREY)
    labels = [
        f"{row.title}  {bar.label}" if bar is row.bars[0] else bar.label for row, bar in lines
    ]
    axes.set_yticks(range(len(lines)), labels)
    axes.set(xlim=(0.0, 100.0), ylim=(len(lines) - 0.4, -0.6), xlabel=bars.axis)
    axes.set_xticks([place for place, _ in bars.ticks], [text for _, text in bars.ticks])
    axes.grid(visible=False, axis="y")
    return figure
