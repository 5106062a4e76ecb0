"""``mcsettle profile``: a measured record as the options or a study describe it."""

import math
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypedDict, Unpack

import typer
from typer import Option

from mcsettle.cli.options import Force, Json, option_name, taking
from mcsettle.cli.study_file import study_in
from mcsettle.cli.terminal import as_json, checked_folder, inform, plainly, say_result
from mcsettle.errors import InputError
from mcsettle.estimate.estimate import finite
from mcsettle.estimate.rounding import with_error

if TYPE_CHECKING:
    from mcsettle.analysis.profile import ProfileReport
    from mcsettle.study.study import Study

MOST_SHOWN = 40  # sections on a screen


class RecordOptions(TypedDict):
    """How a record is written and what is taken of it: keys of ``[profile]`` and its record."""

    chainage_column: Annotated[str | None, Option(help="Default: chainage_m.")]
    level_column: Annotated[str | None, Option(help="Default: level_mm.")]
    offset_column: Annotated[
        str | None, Option(help="Second part of a position: metres, yards, chains.")
    ]
    second_level_column: Annotated[str | None, Option(help="Level of the other rail.")]
    rails: Annotated[str | None, Option(help="Of two rails: mean or worse.")]
    spacing_m: Annotated[
        float | None, Option("--spacing", help="No chainage column: distance of the rows (m).")
    ]
    chainage_unit: Annotated[
        str | None, Option(help="m, km, ft, yd, mi, km+m, km.m, mi.yd or mi.ch.")
    ]
    level_unit: Annotated[str | None, Option(help="mm, m, cm or in.")]
    positive: Annotated[str | None, Option(help="down (default) or up.")]
    separator: Annotated[str | None, Option(help="comma (default), semicolon, tab or space.")]
    decimal: Annotated[str | None, Option(help="Decimal sign, . or a comma.")]
    thousands: Annotated[str | None, Option(help="Sign between thousands.")]
    encoding: Annotated[
        str | None, Option(help="utf-8 (default), utf-16, cp1252, … of a CSV file.")
    ]
    missing_values: Annotated[
        str | None, Option(help="Cells that mean no reading, such as -9999,n/a.")
    ]
    skip_rows: Annotated[int | None, Option(min=0, help="Rows before the heading.")]
    skip_after_heading: Annotated[
        int | None, Option(min=0, help="Rows after the heading, such as units.")
    ]
    dates: Annotated[str | None, Option(help="The runs are dates: iso, day_first or month_first.")]
    run_column: Annotated[str | None, Option(help="Column of runs or dates.")]
    run: Annotated[str | None, Option(help="Which run (default: the first).")]
    repair: Annotated[str | None, Option(help="Findings to repair, such as gaps,repeated.")]
    longest_gap_m: Annotated[float | None, Option("--longest-gap", help="Gap to bridge (m; 5).")]
    window_m: Annotated[float | None, Option("--window", help="Length of a section (m; 200).")]
    shortest_m: Annotated[float | None, Option("--shortest", help="Shortest wave (m; 3).")]
    longest_m: Annotated[float | None, Option("--longest", help="Longest wave (m; 35).")]
    already_filtered: Annotated[str | None, Option(help="The record is band-passed: en13848_d1.")]
    versine_chord_m: Annotated[
        float | None, Option("--versine-chord", help="The levels are versines of a chord (m).")
    ]
    filter: Annotated[str | None, Option(help="ideal (default), butterworth or en13848_d1.")]
    filter_order: Annotated[int | None, Option("--order", help="Order of the Butterworth (4).")]


@plainly
@taking(RecordOptions)
def profile(
    file: Annotated[
        Path, typer.Argument(metavar="FILE", help="Record (CSV, Parquet), or a study with one.")
    ],
    speed_kmh: Annotated[
        float | None, Option(min=1.0, help="Speed of the line, for quality classes.")
    ] = None,
    out: Annotated[Path | None, Option(help="Folder for a picture and the JSON.")] = None,
    json_output: Json = False,
    force: Force = False,
    **options: Unpack[RecordOptions],
) -> None:
    """Look at a measured record: findings, SD by section, spectrum, fitted constants."""
    if out is not None:
        checked_folder(out)
    given: dict[str, Any] = {key: value for key, value in options.items() if value is not None}
    for key in ("repair", "missing_values"):
        if key in given:
            given[key] = [part.strip() for part in given[key].split(",")]
    report = report_of(file, given, speed_kmh)
    say_result(report, json_output, report_data, report_lines)
    if out is not None:
        write_report(report, out, file, force)


def report_of(path: Path, given: dict[str, Any], speed: float | None) -> "ProfileReport":
    """The report of a record, or of the record of the study at ``path``.

    Raises
    ------
    InputError
        The record cannot be used, or options come with a study.
    """
    from mcsettle.analysis.profile import profile_report
    from mcsettle.railway.irregularity import wavenumbers
    from mcsettle.study.build import build_record

    if path.suffix.lower() == ".toml":
        if given:
            raise InputError(
                f"{path} is a study and says how its record is read; leave out "
                + ", ".join(option_name(RecordOptions, key) for key in given)
            )
        study = study_in(path)
    else:
        study = _study_around(path, given)
    record = study.record()
    if record is None:
        raise InputError(f"{path} names no record: give profile.file, or a CSV or Parquet file")
    profile = study.profile
    band = build_record(profile, path, "").band
    modes = wavenumbers(profile.window_m, profile.shortest_m, profile.longest_m)
    return profile_report(record, profile.window_m, modes, band, speed)


def _study_around(path: Path, given: dict[str, Any]) -> "Study":
    """The smallest study whose profile is the record at ``path``: its checks are the study's."""
    from mcsettle.study.study import Study

    of_profile = {"window_m", "shortest_m", "longest_m"}
    d1 = "en13848_d1" in (given.get("filter"), given.get("already_filtered"))
    band = {"shortest_m": 3.0, "longest_m": 25.0} if d1 else {}
    profile = band | {key: value for key, value in given.items() if key in of_profile}
    record = {key: value for key, value in given.items() if key not in of_profile}
    timetable = [{"train": "t", "speed_kmh": 100.0, "per_day": 1}]
    data = {
        "schema_version": 1,
        "files_outside": True,
        "track": {"model": "beam"},
        "profile": {"file": str(path.absolute()), "record": record, **profile},
        "limit": {"sd_limit_mm": 100.0},
        "trains": {"t": {"vehicle": "passenger", "cars": 1}},
        "scenarios": [{"name": "s", "timetable": timetable}],
    }
    return Study.from_mapping(data, str(path))


def report_lines(report: "ProfileReport") -> Iterator[str]:
    """A report in words and tables."""
    run = f", run '{report.run}'" if report.run else ""
    yield (
        f"record{run}: {report.points} points over {report.length:.6g} m, "
        f"{report.median_step:.4g} m apart"
    )
    for finding in report.findings:
        yield f"finding: {finding.kind}: {finding.text}"
    if not report.findings:
        yield "findings: none"
    yield from (f"remark: {remark}" for remark in report.remarks)
    band = report.band
    order = "" if band.kind == "ideal" else f" of order {band.order}, forwards and backwards"
    before = "the record is filtered already: " if band.passed else "filter: "
    yield (
        f"{before}{band.kind}{order}, {band.shortest:g} to {band.longest:g} m; its SD is "
        f"{report.filter_effect:.3f} of the ideal band's"
    )
    parts = report.sections
    covered = float((parts.ends[-1] - parts.starts[0]) * parts.step)
    yield (
        f"SD of {len(report.sd)} sections of {report.window:g} m, {covered:.6g} m in all: "
        f"mean {report.sd.mean() * 1e3:.3f}, "
        f"{report.sd.min() * 1e3:.3f} to {report.sd.max() * 1e3:.3f} mm; "
        f"D1 (3 to 25 m) mean {report.sd_d1.mean() * 1e3:.3f} mm"
    )
    classes = f"  class at {report.speed_kmh:g} km/h" if report.classes else ""
    yield f"{'from [m]':>10} {'to [m]':>10} {'SD [mm]':>9} {'D1 [mm]':>9}{classes}"
    for i in range(min(len(report.sd), MOST_SHOWN)):
        name = f"  {report.classes[i]}" if report.classes else ""
        yield (
            f"{parts.chainage_from[i]:>10.1f} {parts.chainage_to[i]:>10.1f} {report.sd[i] * 1e3:>9.3f} "
            f"{report.sd_d1[i] * 1e3:>9.3f}{name}"
        )
    if len(report.sd) > MOST_SHOWN:
        yield f"… and {len(report.sd) - MOST_SHOWN} more: --json or --out lists them"
    yield "fitted spectra (nearest published class; misfit over wavelength in decades):"
    for fit in report.fits:
        yield (
            f"  {fit.shape:<15} {with_error(fit.roughness, fit.standard_error)} {fit.unit}"
            f"  ({fit.nearest}; {fit.misfit:.2f})"
        )


def report_data(report: "ProfileReport") -> dict[str, Any]:
    """Every number of a report as JSON has it."""
    parts = report.sections
    return {
        "run": report.run,
        "length_m": report.length,
        "median_step_m": report.median_step,
        "points": report.points,
        "findings": [
            {"kind": f.kind, "count": f.count, "first_m": finite(f.first), "text": f.text}
            for f in report.findings
        ],
        "remarks": list(report.remarks),
        "filter": {
            "kind": report.band.kind,
            "order": report.band.order,
            "shortest_m": report.band.shortest,
            "longest_m": report.band.longest,
            "sd_over_ideal": report.filter_effect,
        },
        "window_m": report.window,
        "sections": [
            {
                "chainage_from_m": float(parts.chainage_from[i]),
                "chainage_to_m": float(parts.chainage_to[i]),
                "sd_mm": float(report.sd[i]) * 1e3,
                "sd_d1_mm": float(report.sd_d1[i]) * 1e3,
                "class": report.classes[i] if report.classes else None,
            }
            for i in range(len(report.sd))
        ],
        "spectrum": [
            {"wavelength_m": float(2.0 * math.pi / k), "density_m2_per_rad_per_m": float(p)}
            for k, p in zip(report.wavenumbers, report.power, strict=True)
        ],
        "fits": [
            {
                "shape": f.shape,
                "roughness": f.roughness,
                "standard_error": f.standard_error,
                "unit": f.unit,
                "nearest": f.nearest,
                "misfit_decades": f.misfit,
            }
            for f in report.fits
        ],
    }


def write_report(report: "ProfileReport", folder: Path, file: Path, force: bool) -> None:
    """Picture and JSON of the report of ``file`` into ``folder``, with the mark of its content."""
    from mcsettle.report.figures.profile import profile_figure
    from mcsettle.report.figures.style import files_of
    from mcsettle.storage.files import sha256
    from mcsettle.storage.marks import write_marked

    files = files_of(profile_figure(report, file.name), folder, "profile")
    files[folder / "profile.json"] = f"{as_json(report_data(report))}\n".encode()
    written = write_marked(files, sha256(file), force)
    inform("Wrote " + ", ".join(str(path) for path in written))
