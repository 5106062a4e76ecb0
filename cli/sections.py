"""``mcsettle sections``: when each section of a line must be tamped, from a study with ``[line]``."""

from collections.abc import Hashable, Iterator, Mapping
from datetime import date
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from mcsettle.cli.check import warn_of
from mcsettle.cli.marked_tables import marked_table
from mcsettle.cli.options import Force, Json, StudyFile
from mcsettle.cli.study_file import study_in
from mcsettle.cli.terminal import Progress, checked_file, cores, inform, plainly, say_result
from mcsettle.errors import InputError
from mcsettle.estimate.rounding import number
from mcsettle.units import DAYS_PER_YEAR, MM

if TYPE_CHECKING:
    import pandas as pd

    from mcsettle.analysis.line_forecast import FormOfGrowth
    from mcsettle.analysis.line_hold_out import HoldOut
    from mcsettle.analysis.sections import SectionsReport
    from mcsettle.analysis.worksites import Worksite
    from mcsettle.study.build_line import Line

SHOWN = 12
DUE = ["due_p05", "due_p50", "due_p95"]
TABLES = (".csv", ".xlsx", ".parquet")


@plainly
def sections(
    study: StudyFile,
    table: Annotated[
        Path | None, typer.Option(help="File for all sections (.csv, .xlsx, .parquet).")
    ] = None,
    picture: Annotated[Path | None, typer.Option(help="Strip chart (.png, .svg).")] = None,
    hold_out: Annotated[
        bool, typer.Option("--hold-out", help="Predict the last run from those before it.")
    ] = False,
    json_output: Json = False,
    force: Force = False,
) -> None:
    """Say when each section of a line must be tamped: its own rate, its dates, a plan."""
    from mcsettle.storage.marks import refuse_others, write_marked

    files = []
    if table is not None:
        files.append(checked_file(table, TABLES, "--table"))
    if picture is not None:
        files.append(checked_file(picture, (".png", ".svg"), "--picture"))
    loaded = study_in(study)
    refuse_others(files, loaded.identity, force)  # before anything takes its time
    warn_of(loaded)
    if hold_out:
        from mcsettle.analysis.sections import line_hold_out

        line, held = line_hold_out(loaded, Progress(), cores())
        tell_remarks(line)
        say_result(held, json_output, hold_out_data, lambda held: hold_out_lines(line, held))
        return
    from mcsettle.analysis.sections import sections_report

    report = sections_report(loaded, Progress(), cores())
    tell_remarks(report.line)
    say_result(report, json_output, sections_data, sections_lines)
    contents = {}
    if table is not None:
        contents[table] = table_bytes(report, table.suffix.lower(), loaded.identity)
    if picture is not None:
        contents[picture] = picture_bytes(report, picture.suffix.lower())
    for path in write_marked(contents, loaded.identity, force):
        inform(f"Wrote {path}")


def tell_remarks(line: "Line") -> None:
    """How the line was read, on stderr."""
    for remark in line.remarks:
        inform(f"remark: {remark}")


def sections_lines(report: "SectionsReport") -> Iterator[str]:
    """The worst sections, what falls due in the coming years, the worksites."""
    history, table = report.line.history, report.table
    length = float(history.lengths.sum()) / 1000.0
    yield (
        f"{len(table)} sections, {length:.4g} km; last run {report.last_run}; "
        f"{int(table['beyond_limit'].sum())} beyond their limit today"
    )
    middle, spread = report.forecast.factors.middle, report.forecast.factors.spread
    yield (
        f"the study's factor × {middle[1]:.2g} ({middle[0]:.2g} to {middle[2]:.2g}) for the line; "
        f"log-SD between sections {spread[1]:.2g} ({spread[0]:.2g} to {spread[2]:.2g})"
    )
    yield _forms_line(report.forecast.forms)
    yield ""
    yield (
        f"{'':>3} {'chainage m':>15} {'SD mm':>6} {'mm/year':>8} "
        f"{'P5':>10} {'P50':>10} {'P95':>10} {'1 y':>5}"
    )
    late = late_text(report.last_run, report.forecast.horizon)
    for row in table.head(SHOWN).to_dict("records"):
        days = " ".join(f"{shown_date(row[name], late):>10}" for name in DUE)
        rate = number(row["rate_mm_per_year"], 2, "-")
        yield (
            f"{row['priority']:>3} {place_text(row):>15} {row['sd_now_mm']:>6.2f} {rate:>8} {days} "
            f"{row['probability_1y']:>5.0%}"
        )
    if len(table) > SHOWN:
        yield f"    and {len(table) - SHOWN} more (--table FILE.csv has them all)"
    any_late = table.head(SHOWN)[DUE].isna().any(axis=None)
    yield f"{late}: beyond the horizon ([limit] horizon_years)" if any_late else ""
    yield "due per year from the last run on [km], P50 (P5 to P95), the line as a whole:"
    yield from due_lines(report.due.head(5))
    yield from _increment_lines(report)
    if report.sites:
        shifts = sum(site.shifts for site in report.sites)
        yield (
            f"plan: {len(report.sites)} worksites, {shifts} shifts, cost {report.site_cost:,.0f}; each "
            f"due section by itself {report.single_cost:,.0f}"
        )


def hold_out_lines(line: "Line", held: "HoldOut") -> Iterator[str]:
    """How the last run was predicted, and whether by hand would have been better."""
    errors = held.mean_absolute_error()
    yield (
        f"last run ({line.history.dates[-1]}) predicted for {len(held.rows)} sections: "
        f"{held.coverage:.0%} inside P5 to P95 (90 % are meant to be)"
    )
    yield _forms_line(held.forms)
    for name, error in errors.items():
        yield f"  {name:<14} mean error {error / MM:.3f} mm"
    best = min(errors, key=lambda name: errors[name])
    yield (
        "the forecast is at least as good as both baselines"
        if best == "forecast"
        else f"'{best}' predicts this run better: growth follows none of these forms"
    )


def _increment_lines(report: "SectionsReport") -> Iterator[str]:
    """Where profiles grew between two runs, and where the model says that they grow."""
    if report.increments is None:
        return
    yield "growth between two profiles, SD over that of the first (correlation with it); Step B:"
    for row in report.increments.to_dict("records"):
        waves = f"{row['shortest_m']:.3g} to {row['longest_m']:.3g} m"
        yield (
            f"  waves of {waves:<14} {row['growth']:.2f} ({row['correlation']:+.2f}); "
            f"{row['model_growth']:.2f} ({row['model_correlation']:+.2f})"
        )


def _forms_line(forms: "tuple[FormOfGrowth, ...]") -> str:
    """How the line grows, by its own runs."""
    parts = ", ".join(f"{form.name} {form.probability:.0%}" for form in forms)
    return f"form of growth, by the runs of the line: {parts}"


def due_lines(table: "pd.DataFrame") -> Iterator[str]:
    """Kilometres of the line that fall due in each year."""
    for row in table.to_dict("records"):
        yield (
            f"  from {row['from']}: {row['due_km_p50']:.1f} "
            f"({row['due_km_p05']:.1f} to {row['due_km_p95']:.1f})"
        )


def place_text(row: Mapping[Hashable, Any]) -> str:
    """Where a section lies: its track, if it has a name, and its chainage [m]."""
    return f"{row.get('track', '')} {row['chainage_from_m']:.0f}-{row['chainage_to_m']:.0f}".strip()


def sections_data(report: "SectionsReport") -> dict[str, Any]:
    """All sections, kilometres due and worksites as JSON has them."""
    levels, factors = ("p05", "p50", "p95"), report.forecast.factors
    return {
        "last_run": report.last_run.isoformat(),
        "factor": dict(zip(levels, factors.middle, strict=True)),
        "section_log_sd": dict(zip(levels, factors.spread, strict=True)),
        "forms": {form.name: form.probability for form in report.forecast.forms},
        "sections": plain(report.table),
        "due": plain(report.due),
        "increments": None if report.increments is None else plain(report.increments),
        "worksites": [_site(report, site) for site in report.sites],
        "plan_cost": report.site_cost,
        "single_cost": report.single_cost,
    }


def _site(report: "SectionsReport", site: "Worksite") -> dict[str, Any]:
    """A worksite by its chainage."""
    history = report.line.history
    return {
        "track": history.track[site.first],
        "chainage_from_m": float(history.chainage_from[site.first]),
        "chainage_to_m": float(history.chainage_to[site.last]),
        "shifts": site.shifts,
        "cost": site.cost,
        "lost": site.lost,
    }


def hold_out_data(held: "HoldOut") -> dict[str, Any]:
    """Coverage and mean absolute errors as JSON has them."""
    errors = held.mean_absolute_error().items()
    return {
        "sections": len(held.rows),
        "coverage": held.coverage,
        "mean_absolute_error_mm": {name: error / MM for name, error in errors},
        "forms": {form.name: form.probability for form in held.forms},
    }


def table_bytes(report: "SectionsReport", kind: str, study: str) -> bytes:
    """All sections as a ".csv", ".xlsx" or ".parquet", the latter two with the mark of ``study``."""
    import io

    from mcsettle.storage.marks import NAME
    from mcsettle.storage.parquet import encode

    buffer, table = io.BytesIO(), report.table
    if kind == ".parquet":
        return encode(marked_table(table, study))
    if kind == ".xlsx":
        import pandas as pd

        try:
            writer = pd.ExcelWriter(buffer, engine="xlsxwriter")
        except ImportError:
            raise InputError(
                "a workbook needs the extra 'xlsx': pip install 'mcsettle[xlsx]'; or write a .csv"
            ) from None
        with writer:
            table.to_excel(writer, sheet_name="sections", index=False)
            writer.book.set_custom_property(NAME, study)
    else:
        table.to_csv(buffer, index=False)
    return buffer.getvalue()


def picture_bytes(report: "SectionsReport", kind: str) -> bytes:
    """The strip chart as a ".png" or ".svg"."""
    from mcsettle.report.figures.strip_chart import strip_chart
    from mcsettle.report.figures.style import drawn

    forecast = report.forecast
    figure = strip_chart(report.line.history, forecast.quantiles(), forecast.rows, forecast.horizon)
    return drawn(figure, kind.removeprefix("."))


def plain(table: "pd.DataFrame") -> list[dict[str, Any]]:
    """Rows as JSON has them: dates as ISO text, null for what is not known."""

    def value(cell: Any) -> Any:
        if isinstance(cell, date):
            return cell.isoformat()
        return None if cell is None or cell != cell else cell

    return [{str(k): value(v) for k, v in row.items()} for row in table.to_dict("records")]


def late_text(last_run: date, horizon: float) -> str:
    """How a date beyond the horizon [days] is written."""
    return f"> {last_run.year + round(horizon / DAYS_PER_YEAR)}"


def shown_date(day: date | None, late: str) -> str:
    """A date as it is printed."""
    return late if day is None else day.isoformat()
