"""``mcsettle life`` of a study with ``[line]``: what is printed and written of its sections."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from mcsettle.cli.marked_tables import write_tables
from mcsettle.cli.sections import SHOWN, late_text, plain, shown_date, tell_remarks
from mcsettle.cli.terminal import Progress, cores, say
from mcsettle.units import DAYS_PER_YEAR

if TYPE_CHECKING:
    from mcsettle.analysis.line_life import LineLife
    from mcsettle.study.study import Study

LEVELS = (0.05, 0.5, 0.95)


def tell_line_life(
    study: "Study", draws: int | None, out: Path | None, json_output: bool = False
) -> None:
    """Follow the sections of the line of ``study``; print, and write tables to the folder ``out``."""
    from mcsettle.analysis.line_life import line_life

    found = line_life(study, draws, Progress(), cores())
    tell_remarks(found.line)
    say(line_life_json(found) if json_output else "\n".join(line_life_lines(found)), json_output)
    if out is not None:
        tables = {"section_lives": found.table(), "line_lives": found.totals}
        write_tables(tables, out, study.identity)


def line_life_lines(found: "LineLife") -> Iterator[str]:
    """The line as a whole, year by year, and the dearest sections."""
    history, table = found.line.history, found.table()
    last, horizon = history.dates[-1], found.forecast.horizon
    yield (
        f"{len(table)} sections, {found.kilometres.sum():.4g} km, tamped again and again for "
        f"{horizon / DAYS_PER_YEAR:.3g} years from {last} on; {len(found.days)} draws of the line"
    )
    yield f"{'':<40} {'mean':>11} {'P5':>11} {'P50':>11} {'P95':>11}"
    rate = f"at {100 * found.discount_rate:.3g} % a year" if found.discount_rate else "undiscounted"
    rows = {
        "tamped, km": ("tamped_km", ",.1f"),
        f"cost, {found.currency}, {rate}": ("cost", ",.0f"),
    }
    for text, (column, form) in rows.items():
        values = found.totals[column]
        shown = (values.mean(), *values.quantile(list(LEVELS)))
        yield f"{text:<40} " + " ".join(f"{format(float(v), form):>11}" for v in shown)
    if found.is_open.any():
        yield (
            f"{int(found.is_open.sum())} of {found.is_open.size} sections drawn are followed no further "
            "([maintenance] cycles, scatter): a lower bound"
        )
    yield "tamped in each year [km], P50 (P5 to P95), the line as a whole:"
    for row in found.by_year().to_dict("records"):
        yield (
            f"  from {row['from']}: {row['due_km_p50']:.1f} "
            f"({row['due_km_p05']:.1f} to {row['due_km_p95']:.1f})"
        )
    yield f"dearest sections (times: P50; tampings and cost in {found.currency}: mean, P5 to P95):"
    yield f"{'chainage m':>15} {'first':>10} {'second':>10} {'tampings':>16} {'cost':>24}"
    late = late_text(last, horizon)
    for row in table.head(SHOWN).to_dict("records"):
        place = f"{row['chainage_from_m']:.0f}-{row['chainage_to_m']:.0f}"
        place = f"{row.get('track', '')} {place}".strip()
        dates = " ".join(
            f"{shown_date(row[f'{name}_p50'], late):>10}" for name in ("first", "second")
        )
        count = (
            f"{row['tampings_mean']:.1f} ({row['tampings_p05']:.0f} to {row['tampings_p95']:.0f})"
        )
        cost = f"{row['cost_mean']:,.0f} ({row['cost_p05']:,.0f} to {row['cost_p95']:,.0f})"
        yield f"{place:>15} {dates} {count:>16} {cost:>24}"
    if len(table) > SHOWN:
        yield f"    and {len(table) - SHOWN} more (--out DIR has them all)"


def line_life_json(found: "LineLife") -> str:
    """Totals of the line by draw, years and sections as JSON."""
    totals = found.totals
    data = {
        "last_run": found.line.history.dates[-1].isoformat(),
        "horizon_years": found.forecast.horizon / DAYS_PER_YEAR,
        "draws": len(found.days),
        "currency": found.currency,
        "followed_no_further": float(found.is_open.mean()),
        "line": {
            str(column): {
                "mean": float(totals[column].mean()),
                **dict(
                    zip(("p05", "p50", "p95"), totals[column].quantile(list(LEVELS)), strict=True)
                ),
            }
            for column in totals
        },
        "years": plain(found.by_year()),
        "sections": plain(found.table()),
    }
    return json.dumps(data, indent=1, ensure_ascii=False, allow_nan=False)
