"""``mcsettle grounds``: the grounds of a study, or what a run says of them by segment."""

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from mcsettle.cli.options import Force, Json, StudyFile, Variant
from mcsettle.cli.study_file import study_in
from mcsettle.cli.tables import shown
from mcsettle.cli.terminal import checked_file, inform, plainly, say, say_result
from mcsettle.errors import InputError
from mcsettle.estimate.estimate import finite

if TYPE_CHECKING:
    from mcsettle.study.study import Study
    from mcsettle.summary.segments import GroundReport, SegmentRow

MOST_REASONS = 10


@plainly
def grounds(
    study: StudyFile,
    results: Annotated[
        Path | None, typer.Option(help="Folder of a run: intervals and costs by segment.")
    ] = None,
    variant: Variant = None,
    scenario: Annotated[str | None, typer.Option(help="Scenario (default: the first).")] = None,
    picture: Annotated[Path | None, typer.Option(help="Also draw them (PNG and SVG).")] = None,
    json_output: Json = False,
    force: Force = False,
) -> None:
    """List the grounds of a study, or print what a run says of them, segment by segment."""
    loaded = study_in(study)
    if results is None:
        say("\n".join(list_lines(loaded)))
        return
    from mcsettle.summary.segments import ground_report

    report = ground_report(results, variant, scenario)
    say_result(report, json_output, report_data, report_lines)
    if picture is not None:
        from mcsettle.report.figures.grounds import grounds_figure
        from mcsettle.report.figures.style import files_of
        from mcsettle.storage.marks import write_marked

        checked_file(picture, (".png", ".svg"), "--picture")
        files = files_of(grounds_figure(report), picture.parent, picture.stem)
        write_marked(files, loaded.identity, force)
        inform(f"Drew {picture}")


def list_lines(study: "Study") -> Iterator[str]:
    """Every ground of a study: number, name, segment, probability, and why it cannot be run."""
    from mcsettle.railway.ground_profiles import merged_layers, merging_remark, slabs
    from mcsettle.study.parameter_sets import ground_sets

    table = study.grounds_table
    if table is None:
        raise InputError("the study has no [grounds]")
    heights = slabs(table.fine_m, table.fine_depth_m, table.coarse_m, table.depth_m)
    yield f"{'set':>4} {'probability':>11}  segment, ground"
    failed = 0
    for member, ground in zip(ground_sets(study), study.grounds(), strict=False):
        failed += bool(member.failure)
        why = f"  FAILS: {member.failure.partition(': ')[2]}" if member.failure else ""
        for layer in merged_layers(ground, heights):
            why += (
                f"  MERGED: {layer.height:.3g} m of {layer.material} at {layer.top:.3g} m into "
                f"{' and '.join(layer.into)}"
            )
        yield f"{member.index:>4} {ground.probability:>11.3f}  {ground.segment}, {ground.name}{why}"
    yield f"{len(study.grounds())} grounds; {failed} of the {study.n_sets} asked for cannot be run"
    remark = merging_remark(study.grounds(), heights)
    if remark:
        yield remark


def report_lines(report: "GroundReport") -> Iterator[str]:
    """Segments in a table, the line last, then why grounds failed."""
    yield f"{report.study.title}: {report.variant}, {report.scenario}"
    yield (
        f"{'segment':>10} {'run':>4} {'failed':>6} {'known':>6} {'P5':>9} {'P50':>9} {'P95':>9}  days;"
        f" {'cost P50':>10} {'mean':>10} {report.study.currency}/track-km; {'marginal':>9}"
    )
    for row in (*report.rows, report.line):
        days = " ".join(f"{shown(value):>9}" for value in row.days)
        yield (
            f"{row.segment:>10} {row.grounds:>4} {row.failed:>6} {row.known:>6.1%} {days}       "
            f"{shown(row.cost[1]):>10} {shown(row.mean_cost):>10}               "
            f"{shown(row.marginal):>9}"
        )
    for reason in report.reasons[:MOST_REASONS]:
        yield f"failed: {reason}"
    if len(report.reasons) > MOST_REASONS:
        yield f"… and {len(report.reasons) - MOST_REASONS} more reasons: --json lists them"


def report_data(report: "GroundReport") -> dict[str, Any]:
    """The same as JSON has it; null: not known, or beyond the horizon."""
    return {
        "title": report.study.title,
        "variant": report.variant,
        "scenario": report.scenario,
        "currency": report.study.currency,
        "segments": [_row(row) for row in report.rows],
        "line": _row(report.line),
        "failures": list(report.reasons),
    }


def _row(row: "SegmentRow") -> dict[str, Any]:
    return {
        "segment": row.segment,
        "grounds": row.grounds,
        "failed": row.failed,
        "known_probability": row.known,
        "tamping_interval_days": [finite(v) for v in row.days],
        "present_cost_per_track_km": [finite(v) for v in row.cost],
        "mean_present_cost_per_track_km": finite(row.mean_cost),
        "mean_marginal_cost": finite(row.marginal),
    }
