"""``mcsettle run``, ``status``, ``gather``: what they call, and what they say."""

import json
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from mcsettle import types
from mcsettle.cli.terminal import MISSED, PARTIAL, Progress, talk
from mcsettle.errors import InputError
from mcsettle.storage.files import is_url
from mcsettle.storage.location import place

if TYPE_CHECKING:
    from mcsettle.run.options import RunOptions
    from mcsettle.run.pipeline import Finished
    from mcsettle.run.status import Survey
    from mcsettle.study.study import Study

MOST_SHOWN = 10


def run_all(studies: list["Study"], folders: list[str], options: "RunOptions", *rest: Any) -> None:
    """``run`` for each study and folder in turn; exits with the highest of their exit codes."""
    worst = 0
    for study, folder in zip(studies, folders, strict=True):
        try:
            run(study, folder, options, *rest)
        except typer.Exit as ended:
            worst = max(worst, ended.exit_code)
    if worst:
        raise typer.Exit(worst)


def run(
    study: "Study",
    out: str,
    options: "RunOptions",
    progress: Progress,
    until: str | None = None,
    max_minutes: float | None = None,
    scheduler: str | None = None,
) -> None:
    """Run a study or a slice of it; tells how it ended; exits with 3 or 5 where that is due."""
    where: Any = out if is_url(out) else Path(out)
    missed = False
    # Taichi's import looks at every module there is: it comes before the others.
    import mcsettle.kernels.runtime  # noqa: F401

    if scheduler is not None:
        finished, missed = _by_workers(
            study, where, scheduler, until, max_minutes, options, progress
        )
    elif until is None and max_minutes is None:
        from mcsettle.cli.plan import tell_plan
        from mcsettle.run.pipeline import run_study

        if options.shards is None and not place(out).exists():
            tell_plan(options.applied_to(study), options.threads, options.batch)
        finished = run_study(study, where, options, progress)
    else:
        from mcsettle.cli.until import run_in_batches

        finished, missed = run_in_batches(study, where, until, max_minutes, options, progress)
    for remark in finished.remarks:
        talk(f"remark: {remark}")
    shown = str(place(out))
    if finished.closed:
        talk(f"Results in {shown}. Next: mcsettle summarise {shown}")
    else:
        done = f"{finished.n_shards} shards, {finished.n_computed} of them computed now"
        talk(f"Slice {options.shards}: {done}. When all slices are done: mcsettle gather {shown}")
    tell_failed(finished.n_failed)
    if missed:
        raise typer.Exit(MISSED)


def _by_workers(
    study: "Study",
    where: Any,
    scheduler: str,
    until: str | None,
    max_minutes: float | None,
    options: "RunOptions",
    progress: Progress,
) -> tuple["Finished", bool]:
    """A run by Dask workers, at once or in batches; whether it missed its target."""
    from mcsettle.run.distributed import run_distributed, workers

    if until is None and max_minutes is None:
        return run_distributed(study, where, scheduler, options, progress, talk), False
    from mcsettle.cli.until import run_in_batches

    with workers(scheduler, options.processes) as (address, share):  # the same for all batches
        options = replace(options, threads=options.threads or share)

        def run(
            study: "Study", out: Any, options: "RunOptions", progress: types.Progress | None
        ) -> "Finished":
            return run_distributed(study, out, address, options, progress, talk)

        return run_in_batches(study, where, until, max_minutes, options, progress, run)


def tell_failed(n_failed: int) -> None:
    """Say how many realisations failed and exit with 3, if any did."""
    if n_failed:
        talk(f"{n_failed} realisations failed; their rows say why.")
        raise typer.Exit(PARTIAL)


def gather(folder: str, take_over: bool) -> None:
    """Check that a run is complete and close it."""
    from mcsettle.run.close import gather as close

    found = close(folder, take_over)
    talk(f"{found.n_shards} shards are whole. Next: mcsettle summarise {found.folder}")
    tell_failed(found.n_failed)


def status(folder: str) -> "Survey":
    """What a results folder holds."""
    from mcsettle.run.status import survey

    if not place(folder).exists():
        raise InputError(f"{folder} is no folder; 'mcsettle run STUDY --out {folder}' makes one")
    return survey(folder)


def status_json(found: "Survey") -> str:
    """The survey as JSON."""
    data = {
        "folder": found.folder,
        "finished": found.finished,
        "remark": found.remark,
        "provenance": asdict(found.provenance),
        "realisations": found.realisations,
        "parameter_sets": found.parameter_sets,
        "shards": found.n_shards,
        "whole": found.n_whole,
        "failed_realisations": found.n_failed,
        "scenarios": [
            {"variant": variant, "scenario": scenario, "shards": n,
             "whole": found.whole[variant, scenario]}
            for (variant, scenario), n in found.shards.items()
        ],
        "faults": [asdict(fault) for fault in found.faults],
        "strays": list(found.strays),
        "at_work": [asdict(owner) for owner in found.owners],
    }  # fmt: skip
    return json.dumps(data, indent=2, ensure_ascii=False)


def status_lines(found: "Survey") -> list[str]:
    """The survey as text."""
    state = "finished" if found.finished else "not finished"
    sets = f" × {found.parameter_sets} parameter sets" if found.parameter_sets > 1 else ""
    lines = [
        f"{found.folder}: {state}, {found.n_whole} of {found.n_shards} shards, "
        f"{found.realisations} realisations{sets}, seed {found.provenance.seed}, "
        f"mcsettle {found.provenance.package_version}"
    ]
    for (variant, scenario), n in found.shards.items():
        lines.append(f"  {variant} {scenario}: {found.whole[variant, scenario]} of {n}")
    lines += [f"  {f.state}: {f.shard} ({f.reason})" for f in found.faults[:MOST_SHOWN]]
    if len(found.faults) > MOST_SHOWN:
        lines.append(f"  … and {len(found.faults) - MOST_SHOWN} more")
    lines += [f"  stray: {name}" for name in found.strays[:MOST_SHOWN]]
    lines += [f"  at work: {owner}" for owner in found.owners]
    if found.n_failed:
        lines.append(f"  {found.n_failed} realisations failed; their rows say why")
    return lines + _next(found)


def _next(found: "Survey") -> list[str]:
    """What to do."""
    if found.finished:
        return [f"Next: mcsettle summarise {found.folder}"]
    if found.owners:
        return ["Next: wait for those at work"]
    if found.n_whole < found.n_shards:
        return [f"Next: mcsettle run STUDY --out {found.folder} computes what is missing"]
    return [f"{found.remark}. Next: mcsettle gather {found.folder}"]
