"""The picture beside a summary: SD in time, tamping intervals, marginal costs of one variant.

Depends on: errors, summary, matplotlib.
"""

from pathlib import Path
from textwrap import fill
from typing import TYPE_CHECKING, Any

import numpy as np

from mcsettle.errors import InputError

if TYPE_CHECKING:
    from mcsettle.summary import Results

# Okabe and Ito's colours, told apart by most colour-blind readers and in grey.
COLOURS = ("#0072B2", "#E69F00", "#009E73", "#D55E00", "#CC79A7", "#56B4E9", "#000000")
GREY = "#5a5a5a"


def draw(results: "Results", path: Path) -> None:
    """Draw the first variant of a finished run.

    Raises
    ------
    InputError
        The file's ending names no picture format.
    """
    import matplotlib
    from matplotlib.figure import Figure

    if path.suffix.lower() not in (".png", ".svg", ".pdf"):
        raise InputError(f"--picture {path}: choose a name that ends in .png, .svg or .pdf")
    variant = results.study.variants[0]
    with matplotlib.rc_context({"svg.hashsalt": "mcsettle", "font.size": 9}):
        figure = Figure(figsize=(12, 4.2), layout="constrained")
        panels = figure.subplots(1, 2 if results.effects.empty else 3)
        _draw_history(panels[0], results, variant.name)
        _draw_intervals(panels[1], results, variant.name)
        if not results.effects.empty:
            _draw_costs(panels[2], results, variant.name)
        figure.suptitle(f"{results.study.title}\n{variant.name}: {variant.title}".rstrip(": \n"))
        path.parent.mkdir(parents=True, exist_ok=True)
        dateless = {".svg": {"Date": None}, ".pdf": {"CreationDate": None}, ".png": {}}
        figure.savefig(path, dpi=150, metadata=dateless[path.suffix.lower()])


def _draw_history(axes: Any, results: "Results", variant: str) -> None:
    """Median SD of each scenario and the P5–P95 band of the first; a tamped track stays at the limit."""
    limit, table = results.study.limit.sd_limit_mm, results.history
    days = {0.0, *results.study.run.history_days}
    for index, name in enumerate(results.study.scenario_names):
        if table.empty:
            break
        own = table[(table["variant"] == variant) & (table["scenario"] == name)]
        own = own[own["day"].isin(days)]  # each realisation's last day stands in the table too
        grid = own.pivot_table(
            index="day", columns=["parameter_set", "realisation"], values="sd_mm"
        )
        if grid.empty:
            continue
        low, middle, high = grid.fillna(limit).quantile([0.05, 0.5, 0.95], axis=1).to_numpy()
        colour = _colour(index)
        if index == 0:
            axes.fill_between(grid.index, low, high, color=colour, alpha=0.15, linewidth=0)
            for edge in (low, high):
                axes.plot(grid.index, edge, color=colour, linewidth=0.8, linestyle=":")
        axes.plot(grid.index, middle, color=colour, label=_title(results, name))
    axes.axhline(limit, color=GREY, linestyle="--", linewidth=1)
    axes.annotate("limit", (0.02, limit), xycoords=("axes fraction", "data"), va="bottom")
    axes.set(xlabel="days of traffic", ylabel="SD of the profile, 3–35 m [mm]")
    first = _title(results, results.study.scenario_names[0])
    axes.set_title(f"SD: medians; band P5–P95 of {first}", fontsize=9)
    if axes.get_legend_handles_labels()[0]:
        axes.legend(frameon=False, loc="lower right")


def _draw_intervals(axes: Any, results: "Results", variant: str) -> None:
    """Share of tracks tamped by each day, with the published day on the median line."""
    table = results.realisations
    for index, name in enumerate(results.study.scenario_names):
        own = table[(table["variant"] == variant) & (table["scenario"] == name)]
        days = np.sort(own["tamping_interval_days"].dropna().to_numpy(dtype=float))
        share = np.arange(1, len(days) + 1) / max(len(own), 1)
        axes.step(days, share, where="post", color=_colour(index), label=_title(results, name))
        published = _published(results, "tamping_interval_days", name)
        if published is not None:
            axes.plot(published, 0.5, "o", color=_colour(index), markeredgecolor="k", zorder=3)
    axes.axhline(0.5, color=GREY, linewidth=0.6)
    axes.set(xlabel="tamping interval [days]", ylabel="share of tracks tamped", ylim=(0, 1))
    axes.set_title("tamping intervals; dots: published value", fontsize=9)


def _draw_costs(axes: Any, results: "Results", variant: str) -> None:
    """Marginal cost of each scenario: P5–P95, quartiles, median, and the published value."""
    table = results.effects[results.effects["variant"] == variant]
    names = [n for n in results.study.scenario_names if (table["scenario"] == n).any()]
    unit, largest = "", 0.0
    for row, name in enumerate(names):
        own = table[table["scenario"] == name]["marginal_cost"].to_numpy(float, na_value=np.nan)
        known = own[np.isfinite(own)]
        change = results.study.change(name)
        unit = change.unit if change is not None else unit
        colour = _colour(results.study.scenario_names.index(name))
        if known.size:
            p5, p25, p50, p75, p95 = np.quantile(known, [0.05, 0.25, 0.5, 0.75, 0.95])
            axes.plot([p5, p95], [row, row], color=colour, linewidth=1.5)
            axes.plot([p25, p75], [row, row], color=colour, linewidth=7, alpha=0.5)
            axes.plot(p50, row, "|", color=colour, markersize=16, markeredgewidth=2.5)
            largest = max(largest, p95)
        published = _published(results, "marginal_cost", name)
        if published is not None:
            axes.plot(published, row, "o", color=colour, markeredgecolor="k", zorder=3)
    axes.axvline(0.0, color=GREY, linewidth=0.6)
    axes.set(
        yticks=range(len(names)), ylim=(len(names) - 0.5, -0.5), xlabel=f"marginal cost [{unit}]"
    )
    axes.set_yticklabels([_title(results, name) for name in names])
    axes.set_title("marginal cost: P5–P95, quartiles, median", fontsize=9)


def _colour(index: int) -> str:
    return COLOURS[index % len(COLOURS)]


def _title(results: "Results", scenario: str) -> str:
    title = results.study.scenario(scenario).title or scenario
    return fill(title, 18)


def _published(results: "Results", metric: str, scenario: str) -> float | None:
    rows = (
        r.value for r in results.study.reference if (r.metric, r.scenario) == (metric, scenario)
    )
    return next(rows, None)
