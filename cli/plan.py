"""``mcsettle plan``, and the plan that a long run begins with."""

import json
from collections.abc import Iterator
from dataclasses import asdict
from typing import TYPE_CHECKING

from mcsettle.cli.options import Batch, Exact, Json, ParameterSets, Realisations, StudyFile, Threads
from mcsettle.cli.study_file import study_in
from mcsettle.cli.terminal import Progress, cores, inform, plainly, say, warn

if TYPE_CHECKING:
    from mcsettle.run.plan import Plan
    from mcsettle.study.study import Study


@plainly
def plan(
    study: StudyFile,
    realisations: Realisations = None,
    parameter_sets: ParameterSets = None,
    threads: Threads = None,
    batch: Batch = None,
    exact: Exact = False,
    json_output: Json = False,
) -> None:
    """Say what a run will take: realisations, memory, disk, time, from a short probe."""
    loaded = study_in(study)
    for warning in loaded.warnings:
        warn(f"warning: {warning}")
    from mcsettle.run.plan import plan as plan_of

    asked = loaded.with_run(realisations, None, "every_axle" if exact else None, parameter_sets)
    planned = plan_of(asked, threads, batch, Progress(), cores())
    text = json.dumps(asdict(planned), indent=2) if json_output else "\n".join(plan_lines(planned))
    say(text, json_output)


def tell_plan(study: "Study", threads: int | None, batch: int | None) -> None:
    """Print the plan of a long run before it begins."""
    from mcsettle.run.plan import is_long
    from mcsettle.run.plan import plan as plan_of

    if is_long(study):
        planned = plan_of(study, threads, batch, Progress(), cores())
        inform("\n".join(plan_lines(planned)))


def plan_lines(plan: "Plan") -> Iterator[str]:
    """A plan in a few lines."""
    sets = f" × {plan.parameter_sets} parameter sets" if plan.parameter_sets > 1 else ""
    yield (
        f"rows      {plan.rows} = {plan.realisations} realisations × {plan.scenarios} scenarios"
        f" × {plan.variants} variants{sets}"
    )
    yield f"stepping  {plan.stepping}, {plan.modes} modes, {plan.passages:.3g} axle passages"
    yield f"batches   {plan.batches} of up to {plan.batch} realisations"
    yield f"memory    {plan.memory_mb:.0f} MB"
    yield f"disk      {plan.disk_mb:.1f} MB"
    yield f"time      {_duration(plan.seconds)} on this machine as busy as it is now, Step A apart"


def _duration(seconds: float) -> str:
    if seconds < 120.0:
        return f"{seconds:.0f} s"
    return f"{seconds / 60.0:.0f} min" if seconds < 7200.0 else f"{seconds / 3600.0:.1f} h"
