"""What the commands print: tables, JSON and one picture, from a study and its results alone.

Depends on: estimate, study, summary, economics, rich; matplotlib (when a picture is drawn).
"""

import dataclasses
import importlib.metadata
import json
import os
import platform
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from mcsettle.estimate import Estimate
    from mcsettle.study import Study
    from mcsettle.summary import Results, SummaryRow

LIBRARIES = ("numpy", "scipy", "pandas", "pyarrow", "pydantic", "scikit-fem", "taichi", "typer")


def study_lines(study: "Study") -> Iterator[str]:
    """A sound study in a few lines."""
    yield f"{study.title or 'untitled'}: sound"
    yield f"digest {study.digest}"
    yield (
        f"track {study.track_table.preset_name}, {study.run.realisations} realisations, "
        f"limit {study.limit.sd_limit_mm:g} mm"
    )
    for scenario in study.scenarios:
        services = ", ".join(
            f"{s.per_day} × {s.train} at {s.speed_kmh:g} km/h" for s in scenario.timetable
        )
        tonnage = study.mgt_per_day(scenario.name)
        yield f"scenario {scenario.name}: {services}; {tonnage:.6g} MGT/day"
    for name in study.variant_names:
        settings = study.settlement_settings(name)
        yield (
            f"variant {name}: {settings.stress} stress, {settings.cycles} cycles, "
            f"settlement factor {settings.settlement_factor:g}"
        )


def summary_json(results: "Results", rows: list["SummaryRow"]) -> str:
    """Every number of the summary as JSON, standard errors and intervals included."""
    study = results.study
    keys = ["variant", "scenario", "status"]
    counts = results.realisations.groupby(keys).size().reset_index(name="n")
    data = {
        "title": study.title,
        "study_digest": study.digest,
        "seed": study.seed,
        "counts": [
            {key: row[key] for key in keys} | {"n": int(row["n"])} for _, row in counts.iterrows()
        ],
        "rows": [_json_row(row) for row in rows],
    }
    return json.dumps(data, indent=1, ensure_ascii=False, allow_nan=False)


def print_summary(results: "Results", rows: list["SummaryRow"]) -> None:
    """Print one table a variant on stdout."""
    from rich.console import Console
    from rich.table import Table

    console = Console(width=None if sys.stdout.isatty() else 132, highlight=False)
    console.print(results.study.title or "untitled", style="bold", markup=False)
    for variant in results.study.variants:
        own = [row for row in rows if row.variant == variant.name]
        title = f"{variant.name}: {variant.title}" if variant.title else variant.name
        table = Table(title=title, title_justify="left", pad_edge=False)
        for heading in ("scenario", "metric", "unit"):
            table.add_column(heading, overflow="fold")
        for heading in ("P5", "P50 ± s.e.", "P95", "n", "cens.", "published", "at"):
            table.add_column(heading, justify="right")
        previous = ""
        for row in own:
            table.add_row(*_cells(row, row.scenario != previous))
            previous = row.scenario
        console.print(table if own else f"{title}: no realisation has a result")
    for line in _remarks(results):
        console.print(line, markup=False)


def calibration_lines(found: Any) -> Iterator[str]:
    """A calibration: the factor as a line of TOML, and what was done."""
    yield f"settlement_factor = {found.factor:.6g}"
    for field in dataclasses.fields(found):
        if field.name != "factor":
            yield f"# {field.name}: {_value(getattr(found, field.name))}"


def track_lines(summary: Any) -> Iterator[str]:
    """Rows (quantity, value, unit) in columns."""
    rows = [(str(name), _value(value), str(unit)) for name, value, unit in summary]
    width = max((len(name) for name, _, _ in rows), default=0)
    for name, value, unit in rows:
        yield f"{name:<{width}}  {value:>12} {unit}".rstrip()


def doctor_lines() -> Iterator[str]:
    """Versions, cores, and whether the engine loads."""
    from mcsettle import __version__

    yield f"mcsettle {__version__}"
    yield f"Python {platform.python_version()} on {platform.platform()}"
    yield f"{len(os.sched_getaffinity(0))} cores for this process"
    for name in LIBRARIES:
        yield f"{name} {importlib.metadata.version(name)}"
    import mcsettle.engine  # noqa: F401  (loads Taichi, or says why not)

    yield "engine loads: yes"


def draw(results: "Results", path: Path) -> None:
    """Draw SD against time and the distribution of tamping intervals of the first variant.

    Raises
    ------
    InputError
        The file's ending names no picture format.
    """
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib.figure import Figure

    from mcsettle.errors import InputError

    if path.suffix.lower() not in (".png", ".svg", ".pdf"):
        raise InputError(f"--picture {path}: choose a name that ends in .png, .svg or .pdf")
    figure = Figure(figsize=(11, 4.2), layout="constrained")
    left, right = figure.subplots(1, 2)
    variant = results.study.variants[0]
    _draw_history(left, results, variant.name)
    _draw_intervals(right, results, variant.name)
    figure.suptitle(f"{results.study.title} ({variant.name})")
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=150)


def _draw_history(axes: Any, results: "Results", variant: str) -> None:
    """Median SD and its P5–P95 band; a tamped realisation stays at the limit."""
    limit = results.study.limit.sd_limit_mm
    table = results.history
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
        axes.fill_between(grid.index, low, high, color=f"C{index}", alpha=0.12, linewidth=0)
        axes.plot(
            grid.index, middle, color=f"C{index}", label=results.study.scenario(name).title or name
        )
    axes.axhline(limit, color="0.3", linestyle="--", linewidth=1)
    axes.set(xlabel="days of traffic", ylabel="SD of the profile, 3–35 m [mm]")
    axes.set_title("median and P5–P95 of the realisations", fontsize=10)
    if axes.get_legend_handles_labels()[0]:
        axes.legend(frameon=False)


def _draw_intervals(axes: Any, results: "Results", variant: str) -> None:
    """Share of realisations tamped by each day, with the published day where there is one."""
    import numpy as np

    table = results.realisations
    for index, name in enumerate(results.study.scenario_names):
        own = table[(table["variant"] == variant) & (table["scenario"] == name)]
        days = np.sort(own["tamping_interval_days"].dropna().to_numpy(dtype=float))
        share = np.arange(1, len(days) + 1) / max(len(own), 1)
        title = results.study.scenario(name).title or name
        axes.step(days, share, where="post", color=f"C{index}", label=title)
        for row in results.study.reference:
            if row.metric == "tamping_interval_days" and row.scenario == name:
                axes.plot([row.value], [0.5], "o", color=f"C{index}", markeredgecolor="k")
    axes.set(xlabel="tamping interval [days]", ylabel="share tamped", ylim=(0, 1))
    axes.set_title("distribution over realisations; dots: published value", fontsize=10)


def _cells(row: "SummaryRow", first: bool) -> list[str]:
    middle = row.at(0.5)
    error = middle.standard_error
    centre = _number(middle) + (f" ± {error:.2g}" if error and middle.value is not None else "")
    published = f"{row.reference.value:g}" if row.reference else ""
    percent = f"P{row.reference_percent:.0f}" if row.reference_percent is not None else ""
    counts = [str(middle.n), str(middle.n_censored)]
    name = row.scenario if first else ""
    low, high = _number(row.at(0.05)), _number(row.at(0.95))
    return [name, row.metric, row.unit, low, centre, high, *counts, published, percent]


def _number(estimate: "Estimate") -> str:
    return "–" if estimate.value is None else f"{estimate.value:.4g}"


def _remarks(results: "Results") -> Iterator[str]:
    yield (
        "P5, P50, P95: spread between realisations (track sections). ± s.e.: Monte Carlo error of "
        "the median. –: not reached, or not known for too many censored tracks."
    )
    yield "at: percentile of our realisations at which the published value falls."
    for source in sorted({row.source for row in results.study.reference}):
        yield f"published: {source}"
    note = results.study.calibration
    if note is not None:
        target = f"{note.scenario} at {note.target_days:g} days"
        yield f"calibration: factor {note.factor:g}, {target}. {note.note}"
    failed = int((results.realisations["status"] == "failed").sum())
    if failed:
        yield f"{failed} realisations failed; the column 'failure' says why."


def _json_row(row: "SummaryRow") -> dict[str, Any]:
    reference = row.reference.model_dump() if row.reference else None
    return {
        "variant": row.variant,
        "scenario": row.scenario,
        "metric": row.metric,
        "unit": row.unit,
        "statistics": [
            {"statistic": s.statistic, "level": s.level, **dataclasses.asdict(s.estimate)}
            for s in row.statistics
        ],
        "reference": reference,
        "reference_percent": row.reference_percent,
    }


def _value(value: Any) -> str:
    return f"{value:.6g}" if isinstance(value, float) else str(value)
