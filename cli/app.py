"""The commands of mcsettle: each parses its options, calls one function of the package, prints.

Everything heavy is imported inside the command that needs it, so that ``--help`` stays quick.
Options steer a run (sample size, seed, threads, batch, folders) and never the physics.
"""

from pathlib import Path
from typing import Annotated, Any

import typer

from mcsettle.cli.report import compare, export, report
from mcsettle.cli.terminal import (
    FAILED,
    Progress,
    checked_folder,
    checked_out,
    cores,
    heed_termination,
    own_folders,
    plainly,
    talk,
    together,
    with_cache,
)

app = typer.Typer(
    name="mcsettle",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    help="Track settlement under traffic: tamping intervals and marginal tamping costs. "
    "Exit codes: 0 done, 1 a check or a computation failed, 2 bad input, 3 some realisations "
    "failed, 5 precision target missed, 130 interrupted.",
)

StudyFile = Annotated[Path, typer.Argument(metavar="STUDY", help="Study file (TOML).")]
Folder = Annotated[Path, typer.Argument(metavar="DIR", help="Folder of a run, or its URL.")]
TakeOver = Annotated[
    bool, typer.Option("--take-over", help="Take away locks that other hosts have left there.")
]
Threads = Annotated[int | None, typer.Option(min=1, help="Threads (default: all cores).")]


@app.command()
@plainly
def init(
    path: Annotated[Path, typer.Argument(help="File to write.")] = Path("study.toml"),
) -> None:
    """Write a commented study file to start from; an existing file is never overwritten."""
    from importlib.resources import files

    from mcsettle.errors import InputError

    text = files("mcsettle.cli").joinpath("template.toml").read_text(encoding="utf-8")
    try:
        with path.open("x", encoding="utf-8") as target:
            target.write(text)
    except FileExistsError:
        raise InputError(f"{path} exists; name another file or remove it first") from None
    except OSError as error:
        raise InputError(f"{path} cannot be written: {error.strerror}") from None
    talk(f"Wrote {path}. Next: mcsettle check {path}")


def _warn(study: Any) -> None:
    """Tell what is worth a second look in a sound study."""
    from mcsettle.run.factor_digest import factor_warnings

    for warning in (*study.warnings, *factor_warnings(study)):
        talk(f"warning: {warning}")


@app.command()
@plainly
def check(
    study: StudyFile,
    resolved: Annotated[
        bool, typer.Option("--resolved", help="Print the study with every default filled in.")
    ] = False,
) -> None:
    """Validate a study without running it: all faults at once."""
    from mcsettle.cli.summarise import study_lines
    from mcsettle.study.study import load_study, resolved_toml

    loaded = load_study(study)
    _warn(loaded)
    typer.echo(
        resolved_toml(loaded) if resolved else "\n".join(study_lines(loaded)), nl=not resolved
    )


@app.command()
@plainly
def schema() -> None:
    """Print the JSON Schema of study files, for editors."""
    import json

    from mcsettle.study.schema.study import json_schema

    typer.echo(json.dumps(json_schema(), indent=2, ensure_ascii=False))


@app.command()
@plainly
def run(
    studies: Annotated[
        list[Path], typer.Argument(metavar="STUDY...", help="Study file (TOML), or several.")
    ],
    out: Annotated[
        str,
        typer.Option(
            help="Folder for the results, or its URL (s3, gs, abfs); of several studies: "
            "their folders' folder."
        ),
    ],
    realisations: Annotated[int | None, typer.Option(min=1, help="Tracks to simulate.")] = None,
    parameter_sets: Annotated[
        int | None, typer.Option(min=1, help="Draws of the uncertain inputs.")
    ] = None,
    seed: Annotated[int | None, typer.Option(min=0, help="Seed of the tracks.")] = None,
    threads: Threads = None,
    batch: Annotated[int | None, typer.Option(min=1, help="Realisations at a time.")] = None,
    exact: Annotated[
        bool, typer.Option("--exact", help="Update the profile after every axle passage.")
    ] = False,
    until: Annotated[
        str | None,
        typer.Option(help='Precision to stop at, such as "tamping_interval median 2%".'),
    ] = None,
    max_minutes: Annotated[
        float | None, typer.Option(min=0.0, help="Begin no batch that would end later.")
    ] = None,
    shards: Annotated[
        str | None, typer.Option(metavar="I/N", help="Compute this part alone, such as 17/64.")
    ] = None,
    shard_size: Annotated[
        int | None, typer.Option(min=1, help="Realisations of a shard (default: 2048).")
    ] = None,
    scheduler: Annotated[
        str | None,
        typer.Option(help="Dask workers to use: local[:N] or the address of a scheduler."),
    ] = None,
    take_over: TakeOver = False,
    cache: Annotated[
        str | None, typer.Option(help="Folder or URL of what Step A has computed.")
    ] = None,
) -> None:
    """Run a study: every scenario and variant, results as Parquet in a folder.

    Several studies run one after the other, each into a folder of its file's name under DIR.
    """
    from mcsettle.cli import run as runs
    from mcsettle.run.options import RunOptions
    from mcsettle.run.shards import parse_slice
    from mcsettle.study.study import load_study

    with_cache(cache)
    folders = own_folders(studies, out)
    loaded = [load_study(study) for study in studies]
    checked_out(out)
    together(shards, scheduler, until, max_minutes)
    for study in loaded:
        _warn(study)
    options = RunOptions(
        realisations=realisations,
        parameter_sets=parameter_sets,
        seed=seed,
        exact=exact,
        threads=threads,
        batch=batch,
        processes=cores(),
        shards=None if shards is None else parse_slice(shards),
        shard_size=shard_size,
        take_over=take_over,
    )
    runs.run_all(loaded, folders, options, Progress(), until, max_minutes, scheduler)


@app.command()
@plainly
def plan(
    study: StudyFile,
    realisations: Annotated[int | None, typer.Option(min=1, help="Tracks to simulate.")] = None,
    parameter_sets: Annotated[
        int | None, typer.Option(min=1, help="Draws of the uncertain inputs.")
    ] = None,
    threads: Threads = None,
    batch: Annotated[int | None, typer.Option(min=1, help="Realisations at a time.")] = None,
    exact: Annotated[
        bool, typer.Option("--exact", help="Update the profile after every axle passage.")
    ] = False,
    json_output: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """Say what a run will take: realisations, memory, disk, time, from a short probe."""
    from mcsettle.study.study import load_study

    loaded = load_study(study)
    for warning in loaded.warnings:
        talk(f"warning: {warning}")
    from mcsettle.cli.plan import plan_json, plan_text
    from mcsettle.run.plan import plan as plan_of

    asked = loaded.with_run(realisations, None, "every_axle" if exact else None, parameter_sets)
    found = plan_of(asked, threads, batch, Progress(), cores())
    typer.echo(plan_json(found) if json_output else plan_text(found))


@app.command()
@plainly
def status(
    folder: Folder,
    json_output: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """Say what a results folder holds: shards there, missing and damaged, and who is at work."""
    from mcsettle.cli import run as runs

    found = runs.status(str(folder))
    typer.echo(runs.status_json(found) if json_output else "\n".join(runs.status_lines(found)))


@app.command()
@plainly
def gather(folder: Folder, take_over: TakeOver = False) -> None:
    """Check that every shard of a run made in parts is there, and close it: effects, summary."""
    from mcsettle.cli import run as runs

    runs.gather(str(folder), take_over)


@app.command()
@plainly
def summarise(
    folder: Folder,
    json_output: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
    picture: Annotated[
        Path | None, typer.Option(help="Also draw the results into this file (PNG, SVG).")
    ] = None,
) -> None:
    """Print days, reduction, elasticity and marginal cost, beside the study's reference values."""
    from mcsettle.cli.picture import checked_picture, draw
    from mcsettle.cli.summarise import print_summary, summary_json
    from mcsettle.summary.results import read_results
    from mcsettle.summary.summary import summary_rows

    if picture is not None:
        checked_picture(picture)
    results = read_results(folder)
    rows = summary_rows(results)
    if json_output:
        typer.echo(summary_json(results, rows))
    else:
        print_summary(results, rows)
    if picture is not None:
        draw(results, rows, folder, picture)
        talk(f"Drew {picture}")


@app.command()
@plainly
def calibrate(
    study: StudyFile,
    scenario: Annotated[str, typer.Option(help="Scenario that is observed.")],
    median_days: Annotated[
        float | None, typer.Option(help="Median tamping interval to meet (days).")
    ] = None,
    observations: Annotated[
        str | None,
        typer.Option(help="SDs of a section: CSV file (day, sd_mm, sd_error_mm) or d:sd:error,…"),
    ] = None,
    hold_out: Annotated[
        int, typer.Option(min=0, help="Observations, the last ones, to predict and not to fit.")
    ] = 0,
    variant: Annotated[str | None, typer.Option(help="Variant (default: the first).")] = None,
) -> None:
    """Find the settlement factor that meets a median interval, or the observed SDs of a section."""
    from mcsettle.errors import InputError
    from mcsettle.study.study import load_study

    loaded = load_study(study)
    loaded.scenario(scenario)
    if variant is not None:
        loaded.variant(variant)
    if (median_days is None) == (observations is None):
        raise InputError("give either --median-days or --observations")
    from mcsettle.cli.calibrate import factor_for_median, factor_for_observations

    if observations is not None:
        factor_for_observations(loaded, scenario, observations, variant, hold_out)
    elif median_days is not None:
        factor_for_median(loaded, scenario, median_days, variant)


@app.command()
@plainly
def grounds(
    study: StudyFile,
    results: Annotated[
        Path | None, typer.Option(help="Folder of a run: intervals and costs by segment.")
    ] = None,
    variant: Annotated[str | None, typer.Option(help="Variant (default: the first).")] = None,
    scenario: Annotated[str | None, typer.Option(help="Scenario (default: the first).")] = None,
    picture: Annotated[Path | None, typer.Option(help="Also draw them (PNG and SVG).")] = None,
    json_output: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """List the grounds of a study, or print what a run says of them, segment by segment."""
    from mcsettle.cli.grounds import draw_report, list_lines, report_json, report_lines
    from mcsettle.study.study import load_study

    loaded = load_study(study)
    if results is None:
        typer.echo("\n".join(list_lines(loaded)))
        return
    from mcsettle.summary.segments import ground_report

    report = ground_report(results, variant, scenario)
    typer.echo(report_json(report) if json_output else "\n".join(report_lines(report)))
    if picture is not None:
        draw_report(report, picture)
        talk(f"Drew {picture}")


@app.command()
@plainly
def life(
    study: StudyFile,
    out: Annotated[Path | None, typer.Option(help="Folder for tables (Parquet).")] = None,
    realisations: Annotated[int | None, typer.Option(min=1, help="Tracks to follow.")] = None,
    json_output: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """Tamp a study's tracks again and again to renewal; present and marginal cost beside Eq. (4)."""
    from mcsettle.study.study import load_study

    loaded = load_study(study)
    if out is not None:
        checked_folder(out)
    _warn(loaded)
    from mcsettle.analysis.life import lives
    from mcsettle.cli.life import life_json, life_lines, write_lives

    found = lives(loaded, realisations, Progress(), cores())
    typer.echo(life_json(found) if json_output else "\n".join(life_lines(found)))
    if out is not None:
        write_lives(found, out)


@app.command()
@plainly
def tornado(
    study: StudyFile,
    variant: Annotated[str | None, typer.Option(help="Variant (default: the first).")] = None,
    realisations: Annotated[int, typer.Option(min=1, help="Tracks of each run.")] = 32,
    json_output: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """Move each uncertain input to its P10 and P90, the others central, on the same tracks."""
    from mcsettle.errors import InputError
    from mcsettle.study.study import load_study

    loaded = load_study(study)
    if variant is not None:
        loaded.variant(variant)
    if not loaded.uncertain:
        raise InputError(f"{study} has no [[uncertain]] inputs; add some to see what they do")
    from mcsettle.analysis.tornado import tornado as bars_of
    from mcsettle.cli.spread import print_tornado, tornado_json

    bars = bars_of(loaded, variant, realisations, Progress(), cores())
    if json_output:
        typer.echo(tornado_json(bars))
    else:
        print_tornado(bars)


@app.command()
@plainly
def track(
    study: StudyFile,
    out: Annotated[
        Path | None, typer.Option(help="Also write pictures (PNG, SVG) and tables (CSV) there.")
    ] = None,
) -> None:
    """Describe a study's track and trains: wave speeds, deflection, stresses, Table 4."""
    from mcsettle.cli.summarise import table4_lines, track_lines
    from mcsettle.study.study import load_study

    loaded = load_study(study)
    if out is not None:
        checked_folder(out)
    _warn(loaded)
    from mcsettle.analysis.track_summary import (
        describe,
        increases_at_surface,
        speed_warnings,
        track_cases,
    )

    progress = Progress()
    cases = track_cases(loaded, progress, cores())
    for case in cases:
        rows, table = describe(case), increases_at_surface(case, progress)
        for warning in speed_warnings(case):
            talk(f"warning: {warning}")
        head = [f"== {case.variant}"] if len(cases) > 1 else []
        typer.echo("\n".join([*head, *track_lines(rows), *table4_lines(table)]))
        if out is not None:
            from mcsettle.report.track_pictures import draw_track

            folder = out / case.variant if len(cases) > 1 else out
            written = draw_track(case, rows, table, folder, progress)
            talk(f"Wrote {len(written)} files to {folder}")


def _parts_of(text: str | None) -> list[str] | None:
    """Parts of a list with commas; None where it is not given."""
    return None if text is None else [part.strip() for part in text.split(",")]


@app.command()
@plainly
def profile(
    file: Annotated[
        Path, typer.Argument(metavar="FILE", help="Record (CSV, Parquet), or a study with one.")
    ],
    chainage_column: Annotated[str | None, typer.Option(help="Default: chainage_m.")] = None,
    level_column: Annotated[str | None, typer.Option(help="Default: level_mm.")] = None,
    offset_column: Annotated[
        str | None, typer.Option(help="Second part of a position: metres, yards, chains.")
    ] = None,
    second_level_column: Annotated[
        str | None, typer.Option(help="Level of the other rail.")
    ] = None,
    rails: Annotated[str | None, typer.Option(help="Of two rails: mean or worse.")] = None,
    chainage_unit: Annotated[
        str | None, typer.Option(help="m, km, ft, yd, mi, km+m, km.m, mi.yd or mi.ch.")
    ] = None,
    level_unit: Annotated[str | None, typer.Option(help="mm, m, cm or in.")] = None,
    positive: Annotated[str | None, typer.Option(help="down (default) or up.")] = None,
    separator: Annotated[
        str | None, typer.Option(help="comma (default), semicolon, tab or space.")
    ] = None,
    decimal: Annotated[str | None, typer.Option(help="Decimal sign, . or a comma.")] = None,
    thousands: Annotated[str | None, typer.Option(help="Sign between thousands.")] = None,
    encoding: Annotated[
        str | None, typer.Option(help="utf-8 (default), utf-16, cp1252, … of a CSV file.")
    ] = None,
    missing_values: Annotated[
        str | None, typer.Option(help="Cells that mean no reading, such as -9999,n/a.")
    ] = None,
    skip_rows: Annotated[int | None, typer.Option(min=0, help="Rows before the heading.")] = None,
    skip_after_heading: Annotated[
        int | None, typer.Option(min=0, help="Rows behind the heading, such as units.")
    ] = None,
    dates: Annotated[
        str | None, typer.Option(help="The runs are dates: iso, day_first or month_first.")
    ] = None,
    run_column: Annotated[str | None, typer.Option(help="Column of runs or dates.")] = None,
    run: Annotated[str | None, typer.Option(help="Which run (default: the first).")] = None,
    repair: Annotated[
        str | None, typer.Option(help="Findings to mend, such as gaps,repeated.")
    ] = None,
    longest_gap: Annotated[float | None, typer.Option(help="Gap to bridge (m; 5).")] = None,
    window: Annotated[float | None, typer.Option(help="Length of a section (m; 200).")] = None,
    shortest: Annotated[float | None, typer.Option(help="Shortest wave (m; 3).")] = None,
    longest: Annotated[float | None, typer.Option(help="Longest wave (m; 35).")] = None,
    already_filtered: Annotated[
        str | None, typer.Option(help="The record is band-passed: en13848_d1.")
    ] = None,
    versine_chord: Annotated[
        float | None, typer.Option(help="The levels are versines of a chord (m).")
    ] = None,
    filter_kind: Annotated[
        str | None, typer.Option("--filter", help="ideal (default), butterworth or en13848_d1.")
    ] = None,
    order: Annotated[int | None, typer.Option(help="Order of the Butterworth (4).")] = None,
    speed_kmh: Annotated[
        float | None, typer.Option(min=1.0, help="Speed of the line, for quality classes.")
    ] = None,
    out: Annotated[Path | None, typer.Option(help="Folder for a picture and the JSON.")] = None,
    json_output: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """Look at a measured record: findings, SD by section, spectrum, fitted constants."""
    from mcsettle.cli.profile import report_json, report_lines, report_of, write_report

    if out is not None:
        checked_folder(out)
    options: dict[str, Any] = {
        "chainage_column": chainage_column,
        "level_column": level_column,
        "chainage_unit": chainage_unit,
        "level_unit": level_unit,
        "positive": positive,
        "separator": separator,
        "decimal": decimal,
        "skip_rows": skip_rows,
        "run_column": run_column,
        "run": run,
        "repair": _parts_of(repair),
        "offset_column": offset_column,
        "second_level_column": second_level_column,
        "rails": rails,
        "thousands": thousands,
        "encoding": encoding,
        "missing_values": _parts_of(missing_values),
        "skip_after_heading": skip_after_heading,
        "dates": dates,
        "already_filtered": already_filtered,
        "versine_chord_m": versine_chord,
        "longest_gap_m": longest_gap,
        "window_m": window,
        "shortest_m": shortest,
        "longest_m": longest,
        "filter": filter_kind,
        "filter_order": order,
    }
    report = report_of(file, options, speed_kmh)
    typer.echo(report_json(report) if json_output else "\n".join(report_lines(report)))
    if out is not None:
        write_report(report, out, file.name)


@app.command()
@plainly
def validate(
    names: Annotated[
        list[str] | None,
        typer.Argument(metavar="[NAMES]...", help="Cases or choices (default: all)."),
    ] = None,
    json_output: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
    convergence: Annotated[
        bool, typer.Option("--convergence", help="Refine Step A's numerical choices instead.")
    ] = False,
) -> None:
    """Compare the models with closed forms and exact solutions; exit code 1 if one is missed."""
    from mcsettle.cli.validate import cases_json, convergence_text, run_named_cases

    if convergence:
        typer.echo(convergence_text(names or [], json_output, Progress()))
        return
    cases = run_named_cases(names or [], Progress())
    from mcsettle.verification.run_cases import table

    typer.echo(cases_json(cases) if json_output else table(cases))
    if not all(case.passed for case in cases):
        raise typer.Exit(FAILED)


@app.command()
@plainly
def doctor(
    json_output: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """Check Python, libraries, Taichi, cores, cache and disk; say what to do; exit code 1 if ill."""
    from mcsettle.cli.installation import examine
    from mcsettle.cli.validate import doctor_json, doctor_lines

    checks = examine()
    typer.echo(doctor_json(checks) if json_output else "\n".join(doctor_lines(checks)))
    if any(check.state == "failed" for check in checks):
        raise typer.Exit(FAILED)


for verb in (report, export, compare):
    app.command()(verb)


def main() -> None:
    """Entry point of the ``mcsettle`` command."""
    heed_termination()
    app()
