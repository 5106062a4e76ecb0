"""Shards computed by several processes of this machine at once, one core each.

A cycle jump is thousands of kernels of a millisecond with NumPy in between: a second thread wakes too
late to help with either (measured: two are no quicker than one), a second process halves the time.
"""

from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from itertools import groupby
from multiprocessing import parent_process

from mcsettle.railway.scene import Scene
from mcsettle.run.compute import Job, advance
from mcsettle.run.options import RunOptions
from mcsettle.run.shards import Shard
from mcsettle.step_a.processes import Together, cores
from mcsettle.step_a.transfers import StepA
from mcsettle.study.extent import Extent
from mcsettle.study.parameter_sets import ParameterSet
from mcsettle.types import silent

WORTHWHILE = 16_384  # realisations; fewer are there before a process has started
MOST_SHARDS = 8  # of a task, for which the engine is made once


def worthwhile(extent: Extent, stepping: str, todo: list[Shard], options: RunOptions) -> int:
    """How many processes, this one among them, are worth their start."""
    few = sum(len(shard.indices) for shard in todo) < WORTHWHILE
    # Sets of parameters have processes for their Step A; long marches fill all threads.
    if few or extent.nested or stepping != "cycle_jump":
        return 1
    return min(options.processes, options.threads or cores(), len(list(_tasks(todo))))


def compute_together(job: Job, todo: list[Shard], central: StepA, processes: Together) -> None:
    """Write the shards ``todo`` of a study without parameter sets; remarks go to ``job`` in order."""
    quiet = replace(job, progress=silent, remarks=[], options=replace(job.options, threads=None))
    member, done = job.run.sets[0], Counter[tuple[str, str]]()
    scenes = {(scene.variant, scene.scenario): scene for scene in member.scenes}
    arguments = [
        # Of the whole variant: another scenario's train may count cycles.
        (
            quiet,
            member,
            scenes[first.group[1:]],
            central.of_variant(first.variant),
            [first, *others],
        )
        for first, *others in _tasks(todo)
    ]

    def told(index: int) -> None:
        *_, scene, _, shards = arguments[index]
        pair = scene.variant, scene.scenario
        done[pair] += sum(len(shard.indices) for shard in shards)
        job.progress(f"Step B: {' '.join(pair)}", done[pair], job.run.extent.realisations)

    for remarks in processes.map(_advanced, arguments, told):
        job.remarks += remarks


def _tasks(todo: list[Shard]) -> Iterator[list[Shard]]:
    """Shards of one scenario, a few at a time."""
    for _, of_scenario in groupby(todo, key=lambda shard: shard.group):
        shards = list(of_scenario)
        for first in range(0, len(shards), MOST_SHARDS):
            yield shards[first : first + MOST_SHARDS]


def _advanced(
    job: Job, member: ParameterSet, scene: Scene, prepared: StepA, shards: list[Shard]
) -> list[str]:
    """Compute shards of a scene, in whatever process; returns the remarks on it."""
    from mcsettle.kernels import runtime

    if parent_process() is not None:
        runtime.start(1)
    of_task = replace(job, remarks=[])
    advance(of_task, member, scene, prepared, shards)
    return of_task.remarks
