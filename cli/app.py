"""The commands of mcsettle: each parses its options, calls one function of the package, prints.

Everything heavy is imported inside the command that needs it, so that ``--help`` stays quick.
Options steer a run (sample size, seed, threads, batch, folders) and never the physics.

Depends on: cli.edge, typer; inside the commands: calibration, errors, pipeline, study, summary,
track_report, cli.views.
"""

from pathlib import Path
from typing import Annotated

import typer

from mcsettle.cli.edge import PARTIAL, Progress, checked_folder, cores, plainly, talk

app = typer.Typer(
    name="mcsettle",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    help="Track settlement under traffic: tamping intervals and marginal tamping costs. "
    "Exit codes: 0 done, 2 bad input, 3 some realisations failed, 130 interrupted.",
)

StudyFile = Annotated[Path, typer.Argument(metavar="STUDY", help="Study file (TOML).")]
Folder = Annotated[Path, typer.Argument(metavar="DIR", help="Folder of a finished run.")]
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


@app.command()
@plainly
def check(
    study: StudyFile,
    resolved: Annotated[
        bool, typer.Option("--resolved", help="Print the study with every default filled in.")
    ] = False,
) -> None:
    """Validate a study without running it: all faults at once."""
    from mcsettle.cli.views import study_lines
    from mcsettle.study import load_study, resolved_toml

    loaded = load_study(study)
    for warning in loaded.warnings:
        talk(f"warning: {warning}")
    typer.echo(
        resolved_toml(loaded) if resolved else "\n".join(study_lines(loaded)), nl=not resolved
    )


@app.command()
@plainly
def schema() -> None:
    """Print the JSON Schema of study files, for editors."""
    import json

    from mcsettle.study import json_schema

    typer.echo(json.dumps(json_schema(), indent=2, ensure_ascii=False))


@app.command()
@plainly
def run(
    study: StudyFile,
    out: Annotated[Path, typer.Option(help="Folder for the results.")],
    realisations: Annotated[int | None, typer.Option(min=1, help="Tracks to simulate.")] = None,
    seed: Annotated[int | None, typer.Option(min=0, help="Seed of the tracks.")] = None,
    threads: Threads = None,
    batch: Annotated[int | None, typer.Option(min=1, help="Realisations at a time.")] = None,
    exact: Annotated[
        bool, typer.Option("--exact", help="Update the profile after every axle passage.")
    ] = False,
) -> None:
    """Run a study: every scenario and variant, results as Parquet in a folder."""
    from mcsettle.pipeline import run_study
    from mcsettle.study import load_study

    loaded = load_study(study)
    checked_folder(out)
    for warning in loaded.warnings:
        talk(f"warning: {warning}")
    finished = run_study(
        loaded,
        out,
        realisations=realisations,
        seed=seed,
        threads=threads,
        batch=batch,
        exact=exact,
        progress=Progress(),
        processes=cores(),
    )
    for remark in getattr(finished, "remarks", ()):
        talk(f"remark: {remark}")
    talk(f"Results in {out}. Next: mcsettle summarise {out}")
    failed = getattr(finished, "n_failed", 0)
    if failed:
        talk(f"{failed} realisations failed; their rows say why.")
        raise typer.Exit(PARTIAL)


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
    from mcsettle.cli.pictures import draw
    from mcsettle.cli.views import print_summary, summary_json
    from mcsettle.summary import read_results, summary_rows

    results = read_results(folder)
    rows = summary_rows(results)
    if json_output:
        typer.echo(summary_json(results, rows))
    else:
        print_summary(results, rows)
    if picture is not None:
        draw(results, picture)
        talk(f"Drew {picture}")


@app.command()
@plainly
def calibrate(
    study: StudyFile,
    scenario: Annotated[str, typer.Option(help="Scenario whose median is to be met.")],
    median_days: Annotated[float, typer.Option(help="Median tamping interval to meet [days].")],
    variant: Annotated[str | None, typer.Option(help="Variant (default: the first).")] = None,
) -> None:
    """Find the settlement factor that puts a scenario's median interval at the given days."""
    import math

    from mcsettle.cli.views import calibration_lines
    from mcsettle.errors import InputError
    from mcsettle.study import load_study

    loaded = load_study(study)
    loaded.scenario(scenario)
    if variant is not None:
        loaded.variant(variant)
    if not (median_days > 0.0 and math.isfinite(median_days)):
        raise InputError(f"--median-days is {median_days:g}; it must be positive and finite")
    from mcsettle.calibration import calibrate as find_factor

    found = find_factor(
        loaded, scenario, median_days, variant=variant, progress=Progress(), processes=cores()
    )
    typer.echo("\n".join(calibration_lines(found)))


@app.command()
@plainly
def track(study: StudyFile) -> None:
    """Describe a study's track and trains: wave speeds, deflection, compliance, stresses."""
    from mcsettle.cli.views import track_lines
    from mcsettle.study import load_study

    loaded = load_study(study)
    from mcsettle.track_report import track_summary

    typer.echo("\n".join(track_lines(track_summary(loaded, Progress()))))


@app.command()
@plainly
def doctor() -> None:
    """Say what this installation consists of and whether its parts load."""
    from mcsettle.cli.views import doctor_lines

    typer.echo("\n".join(doctor_lines()))


def main() -> None:
    """Entry point of the ``mcsettle`` command."""
    app()
