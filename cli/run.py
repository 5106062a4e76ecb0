"""``mcsettle run``: a study, several, a slice of one, or batches to a precision."""

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from mcsettle import types
from mcsettle.cli.check import warn_of
from mcsettle.cli.options import (
    Batch,
    Exact,
    ParameterSets,
    Realisations,
    StudyFiles,
    TakeOver,
    Threads,
)
from mcsettle.cli.study_file import study_in
from mcsettle.cli.terminal import (
    MISSED,
    PARTIAL,
    Progress,
    checked_out,
    cores,
    inform,
    own_folders,
    plainly,
    together,
    warn,
    with_cache,
)
from mcsettle.storage.files import is_url
from mcsettle.storage.location import place

if TYPE_CHECKING:
    from mcsettle.run.options import RunOptions
    from mcsettle.run.pipeline import Finished
    from mcsettle.study.study import Study

Out = Annotated[
    str,
    typer.Option(
        help="Folder for the results, or its URL (s3, gs, abfs); of several studies: "
        "the folder of their folders."
    ),
]
Seed = Annotated[int | None, typer.Option(min=0, help="Seed of the realisations.")]
Until = Annotated[
    str | None, typer.Option(help='Precision to stop at, such as "tamping_interval median 2%".')
]
MaxMinutes = Annotated[
    float | None, typer.Option(min=0.0, help="Begin no batch that would end later.")
]
Shards = Annotated[
    str | None, typer.Option(metavar="I/N", help="Compute this part alone, such as 17/64.")
]
ShardSize = Annotated[
    int | None, typer.Option(min=1, help="Realisations of a shard (default: 2048).")
]
Scheduler = Annotated[
    str | None, typer.Option(help="Dask workers to use: local[:N] or the address of a scheduler.")
]
Cache = Annotated[str | None, typer.Option(help="Folder or URL of what Step A has computed.")]


@plainly
def run(
    studies: StudyFiles,
    out: Out,
    realisations: Realisations = None,
    parameter_sets: ParameterSets = None,
    seed: Seed = None,
    threads: Threads = None,
    batch: Batch = None,
    exact: Exact = False,
    until: Until = None,
    max_minutes: MaxMinutes = None,
    shards: Shards = None,
    shard_size: ShardSize = None,
    scheduler: Scheduler = None,
    take_over: TakeOver = False,
    cache: Cache = None,
) -> None:
    """Run a study: every scenario and variant, results as Parquet in a folder.

    Several studies run one after the other, each into a folder of its file's name under DIR.
    """
    from mcsettle.run.options import RunOptions
    from mcsettle.run.shards import parse_slice

    with_cache(cache)
    folders = own_folders(studies, out)
    loaded = [study_in(study) for study in studies]
    checked_out(out)
    together(shards, scheduler, until, max_minutes)
    for study in loaded:
        warn_of(study)
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
    run_all(loaded, folders, options, Progress(), until, max_minutes, scheduler)


def run_all(studies: list["Study"], folders: list[str], options: "RunOptions", *rest: Any) -> None:
    """``run_one`` for each study and folder in turn; exits with the highest of their exit codes."""
    worst = 0
    for study, folder in zip(studies, folders, strict=True):
        try:
            run_one(study, folder, options, *rest)
        except typer.Exit as ended:
            worst = max(worst, ended.exit_code)
    if worst:
        raise typer.Exit(worst)


def run_one(
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
        warn(f"remark: {remark}")
    shown = str(place(out))
    if finished.closed:
        inform(f"Results in {shown}. Next: mcsettle summarise {shown}")
    else:
        done = f"{finished.n_shards} shards, {finished.n_computed} of them computed now"
        inform(f"Slice {options.shards}: {done}. When all slices are done: mcsettle gather {shown}")
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
        return run_distributed(study, where, scheduler, options, progress, inform), False
    from mcsettle.cli.until import run_in_batches

    with workers(scheduler, options.processes) as (address, share):  # the same for all batches
        options = replace(options, threads=options.threads or share)

        def run(
            study: "Study", out: Any, options: "RunOptions", progress: types.Progress
        ) -> "Finished":
            return run_distributed(study, out, address, options, progress, inform)

        return run_in_batches(study, where, until, max_minutes, options, progress, run)


def tell_failed(n_failed: int) -> None:
    """Say how many realisations failed and exit with 3, if any did."""
    if n_failed:
        warn(f"{n_failed} realisations failed; their rows say why.")
        raise typer.Exit(PARTIAL)
