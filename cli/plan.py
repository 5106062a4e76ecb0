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
    found = plan_of(asked, threads, batch, Progress(), cores())
    say(plan_json(found) if json_output else plan_text(found), json_output)


def tell_plan(study: "Study", threads: int | None, batch: int | None) -> None:
    """Print the plan of a long run before it begins."""
    from mcsettle.run.plan import is_long
    from mcsettle.run.plan import plan as plan_of

    if is_long(study):
        inform(plan_text(plan_of(study, threads, batch, Progress(), cores())))


def plan_text(found: "Plan") -> str:
    """A plan in a few lines."""
    return "\n".join(_lines(found))


def plan_json(found: "Plan") -> str:
    """A plan as JSON."""
    return json.dumps(asdict(found), indent=2)


def _lines(found: "Plan") -> Iterator[str]:
    sets = f" × {found.parameter_sets} parameter sets" if found.parameter_sets > 1 else ""
    yield (
        f"rows      {found.rows} = {found.realisations} realisations × {found.scenarios} scenarios"
        f" × {found.variants} variants{sets}"
    )
    yield f"stepping  {found.stepping}, {found.modes} modes, {found.passages:.3g} axle passages"
    yield f"batches   {found.batches} of up to {found.batch} realisations"
    yield f"memory    {found.memory_mb:.0f} MB"
    yield f"disk      {found.disk_mb:.1f} MB"
    yield f"time      {_duration(found.seconds)} on this machine as busy as it is now, Step A apart"


def _duration(seconds: float) -> str:
    if seconds < 120.0:
        return f"{seconds:.0f} s"
    return f"{seconds / 60.0:.0f} min" if seconds < 7200.0 else f"{seconds / 3600.0:.1f} h"
