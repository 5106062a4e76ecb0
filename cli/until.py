"""``mcsettle run --until … --max-minutes …``: batches, their convergence table, how it ended."""

from pathlib import Path

from mcsettle.cli.terminal import inform, say
from mcsettle.run.options import RunOptions
from mcsettle.run.pipeline import Finished, run_study
from mcsettle.run.stopping import Batch, Run, Target, parse_target, run_until
from mcsettle.study.study import Study
from mcsettle.types import Progress, silent


def run_in_batches(
    study: Study,
    out: Path,
    until: str | None,
    max_minutes: float | None,
    options: RunOptions,
    progress: Progress = silent,
    run: Run = run_study,
) -> tuple[Finished, bool]:
    """Run until the target or the time; prints the table; returns the run and whether it missed.

    ``run`` runs a batch.
    """
    target = None if until is None else parse_target(until)

    def tell(batch: Batch) -> None:
        say(batch_line(batch, target))

    stopped = run_until(study, out, target, max_minutes, options, progress, tell=tell, run=run)
    last = stopped.batches[-1].realisations
    if target is not None and stopped.met:
        inform(f"Target met with {last} realisations.")
    elif stopped.late:
        inform(f"Stopped for time at {last} realisations; the same command goes on from here.")
    elif target is not None:
        inform(f"Target missed at the cap of {last} realisations; raise --realisations to go on.")
    return stopped.finished, target is not None and not stopped.met


def batch_line(batch: Batch, target: Target | None) -> str:
    """One row of the convergence table."""
    text = f"{batch.realisations:>9} realisations  {batch.seconds:8.1f} s"
    if target is None:
        return text
    error = "unknown" if batch.error is None else f"{100.0 * batch.error:.2f} %"
    aim = f"{100.0 * target.tolerance:g} %"
    return f"{text}  standard error {error:>8} of {aim} ({target.metric}, {batch.where})"
