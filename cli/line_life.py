"""``mcsettle life`` of a study with ``[line]``: what is printed and written of its sections."""

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mcsettle.cli.marked_tables import write_tables
from mcsettle.cli.sections import (
    SHOWN,
    due_lines,
    late_text,
    place_text,
    plain,
    shown_date,
    tell_remarks,
)
from mcsettle.cli.terminal import Progress, cores, say_result
from mcsettle.units import DAYS_PER_YEAR

if TYPE_CHECKING:
    import pandas as pd

    from mcsettle.analysis.line_life import LineLife
    from mcsettle.study.study import Study

LEVELS = {"p05": 0.05, "p50": 0.5, "p95": 0.95}


def tell_line_life(study: "Study", draws: int | None, out: Path | None, json_output: bool) -> None:
    """Follow the sections of the line of ``study``; print, and write tables to the folder ``out``."""
    from mcsettle.analysis.line_life import line_life

    life = line_life(study, draws, Progress(), cores())
    tell_remarks(life.line)
    say_result(life, json_output, line_life_data, line_life_lines)
    if out is not None:
        tables = {"section_lives": life.table(), "line_lives": life.totals}
        write_tables(tables, out, study.identity)


def line_life_lines(life: "LineLife") -> Iterator[str]:
    """The line as a whole, year by year, and the dearest sections."""
    table, last, horizon = life.table(), life.line.history.dates[-1], life.forecast.horizon
    yield (
        f"{len(table)} sections, {life.kilometres.sum():.4g} km, tamped again and again for "
        f"{horizon / DAYS_PER_YEAR:.3g} years from {last} on; {len(life.days)} draws of the line"
    )
    yield f"{'':<40} {'mean':>11} {'P5':>11} {'P50':>11} {'P95':>11}"
    rate = f"at {100 * life.discount_rate:.3g} % a year" if life.discount_rate else "undiscounted"
    rows = {
        "tamped, km": ("tamped_km", ",.1f"),
        f"cost, {life.currency}, {rate}": ("cost", ",.0f"),
    }
    for text, (column, form) in rows.items():
        cells = (format(value, form) for value in _numbers(life.totals[column]).values())
        yield f"{text:<40} " + " ".join(f"{cell:>11}" for cell in cells)
    if life.is_open.any():
        yield (
            f"{int(life.is_open.sum())} of {life.is_open.size} sections drawn are followed no further "
            "([maintenance] cycles, scatter): a lower bound"
        )
    yield "tamped in each year [km], P50 (P5 to P95), the line as a whole:"
    yield from due_lines(life.by_year())
    yield f"dearest sections (times: P50; tampings and cost in {life.currency}: mean, P5 to P95):"
    yield f"{'chainage m':>15} {'first':>10} {'second':>10} {'tampings':>16} {'cost':>24}"
    late = late_text(last, horizon)
    for row in table.head(SHOWN).to_dict("records"):
        dates = (f"{shown_date(row[f'{name}_p50'], late):>10}" for name in ("first", "second"))
        count = (
            f"{row['tampings_mean']:.1f} ({row['tampings_p05']:.0f} to {row['tampings_p95']:.0f})"
        )
        cost = f"{row['cost_mean']:,.0f} ({row['cost_p05']:,.0f} to {row['cost_p95']:,.0f})"
        yield f"{place_text(row):>15} {' '.join(dates)} {count:>16} {cost:>24}"
    if len(table) > SHOWN:
        yield f"    and {len(table) - SHOWN} more (--out DIR has them all)"


def line_life_data(life: "LineLife") -> dict[str, Any]:
    """Totals of the line by draw, years and sections as JSON has them."""
    return {
        "last_run": life.line.history.dates[-1].isoformat(),
        "horizon_years": life.forecast.horizon / DAYS_PER_YEAR,
        "draws": len(life.days),
        "currency": life.currency,
        "followed_no_further": float(life.is_open.mean()),
        "line": {str(column): _numbers(life.totals[column]) for column in life.totals},
        "years": plain(life.by_year()),
        "sections": plain(life.table()),
    }


def _numbers(totals: "pd.Series[float]") -> dict[str, float]:
    """Mean and quantiles of a total of the line over the draws."""
    return {"mean": float(totals.mean())} | {
        name: float(totals.quantile(level)) for name, level in LEVELS.items()
    }
