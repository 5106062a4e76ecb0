"""``mcsettle track``: what Step A says of a study's track and trains."""

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from mcsettle.cli.check import warn_of
from mcsettle.cli.options import Force, StudyFile
from mcsettle.cli.study_file import study_in
from mcsettle.cli.terminal import Progress, checked_folder, cores, inform, plainly, say, warn

if TYPE_CHECKING:
    from mcsettle.analysis.table4 import Increase
    from mcsettle.analysis.track_summary import Row


@plainly
def track(
    study: StudyFile,
    out: Annotated[
        Path | None, typer.Option(help="Also write pictures (PNG, SVG) and tables (CSV) there.")
    ] = None,
    force: Force = False,
) -> None:
    """Describe a study's track and trains: wave speeds, deflection, stresses, Table 4."""
    loaded = study_in(study)
    if out is not None:
        checked_folder(out)
    warn_of(loaded)
    from mcsettle.analysis.track_case import table4, track_cases
    from mcsettle.analysis.track_summary import describe, speed_warnings

    progress = Progress()
    cases = track_cases(loaded, progress, cores())
    for case in cases:
        rows, table = describe(case), table4(case, progress)
        for warning in speed_warnings(case):
            warn(f"warning: {warning}")
        head = [f"== {case.variant}"] if len(cases) > 1 else []
        say("\n".join([*head, *track_lines(rows), *table4_lines(table)]))
        if out is not None:
            from mcsettle.report.track_pictures import draw_track

            folder = out / case.variant if len(cases) > 1 else out
            written = draw_track(case, rows, table, folder, progress, loaded.identity, force)
            inform(f"Wrote {len(written)} files to {folder}")


def track_lines(rows: "list[Row]") -> Iterator[str]:
    """Rows (quantity, value, unit) in columns, four digits."""
    width = max((len(name) for name, _, _ in rows), default=0)
    for name, value, unit in rows:
        text = value if isinstance(value, str) else f"{value:.4g}"
        yield f"{name:<{width}}  {text:>9} {unit}".rstrip()


def table4_lines(table: "list[Increase]") -> Iterator[str]:
    """Table 4: a line a definition, the published values below each kind; nothing if empty."""
    from mcsettle.analysis.table4 import DEFINITIONS, REALISATIONS
    from mcsettle.units import KMH

    if not table:
        return
    speeds = [f"{speed / KMH:.0f} km/h" for speed in dict.fromkeys(row.speed for row in table)]
    yield ""
    yield f"Increase of deviatoric stress at the subgrade surface over {speeds[0]} (Table 4), in %"
    yield f"{'':<32}" + "".join(f"{speed:>23}" for speed in speeds[1:])
    names = list(DEFINITIONS)
    for name, following in zip(names, [*names[1:], ""], strict=True):
        increases = [row for row in table if row.definition == name][1:]
        yield f"{name:<32}" + "".join(f"{_increase(row):>23}" for row in increases)
        last = name.split(",")[0] != following.split(",")[0]  # of its kind
        if last and any(row.published is not None for row in increases):
            published = [
                "–" if row.published is None else f"{row.published:g}" for row in increases
            ]
            yield f"{'  published':<32}" + "".join(f"{value:>23}" for value in published)
    for name, meaning in DEFINITIONS.items():
        yield f"{name}: {meaning}"
    yield f"in brackets: P5 to P95 over {REALISATIONS} realisations of the profile"
    yield from (f"published: {source}" for source in sorted({r.source for r in table if r.source}))


def _increase(row: "Increase") -> str:
    spread = "" if row.low == row.high else f" ({row.low:.1f} to {row.high:.1f})"
    return f"{row.percent:.2f}{spread}"
