"""Shards computed by several processes of this machine at once, one core each.

A cycle jump is thousands of kernels of a millisecond with NumPy in between: a second thread wakes too
late to help with either (measured: two are no quicker than one), a second process halves the time.
"""

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import count, groupby
from multiprocessing import parent_process

from mcsettle.railway.scene import Scene
from mcsettle.railway.track import SectionTrack
from mcsettle.run.compute import Job, advance, compute
from mcsettle.run.options import RunOptions
from mcsettle.run.shards import Shard
from mcsettle.run.worker import RunSpec, work_on
from mcsettle.step_a.processes import Together, cores
from mcsettle.step_a.transfers import StepA, TransferStore, needs
from mcsettle.study.extent import Extent
from mcsettle.study.parameter_sets import ParameterSet
from mcsettle.types import silent

WORTHWHILE = 16_384  # realisations; fewer are there before a process has started
MOST_SHARDS = 8  # of a task, for which the engine is made once


def worthwhile(
    extent: Extent,
    stepping: str,
    todo: list[Shard],
    options: RunOptions,
    own_step_a: bool = False,
) -> int:
    """How many processes, this one among them, are worth their start.

    ``own_step_a``: every parameter set has a Step A of its own that takes longer than a process to start.
    """
    few = sum(len(shard.indices) for shard in todo) < WORTHWHILE
    if (few and not own_step_a) or stepping != "cycle_jump":  # long marches fill all threads
        return 1
    tasks = _sets(todo) if extent.nested else _tasks(todo)
    return max(1, min(options.processes, options.threads or cores(), len(list(tasks))))


def own_step_a(members: Sequence[ParameterSet], transfers: TransferStore | None) -> bool:
    """Whether parameter sets differ in what a cross-section takes to compute; a beam takes no time."""
    sound = [member for member in members if not member.failure][:2]
    if transfers is None or len(sound) < 2:
        return False
    first, second = (needs(member.scenes, transfers) for member in sound)
    return any(isinstance(key[0], SectionTrack) for key in second - first)


def compute_together(job: Job, todo: list[Shard], central: StepA, processes: Together) -> None:
    """Write the shards ``todo`` of a study; remarks go to ``job`` in order."""
    if job.run.extent.nested:
        _compute_sets(job, todo, central, processes)
    else:
        _compute_scenes(job, todo, central, processes)


def _compute_sets(job: Job, todo: list[Shard], central: StepA, processes: Together) -> None:
    """Parameter sets side by side; then those that have the rows of another."""
    first = job.run.same_rows
    own = [shard for shard in todo if first[shard.group] == shard.member]
    spec = RunSpec(job.at.where, job.provenance.digest, job.run.extent, 1, job.options.batch)
    options, done = replace(job.options, processes=1), count(1)
    quiet = replace(job, progress=silent, remarks=[], options=options)
    arguments = [(spec, shards) for shards in _sets(own)]

    def here(_: RunSpec, shards: list[Shard]) -> tuple[str, ...]:
        quiet.remarks.clear()
        compute(quiet, shards, central)
        return tuple(quiet.remarks)

    def told(_: int) -> None:
        job.progress("Parameter sets", next(done), len(arguments))

    for remarks in processes.map(work_on, arguments, told, here):
        job.remarks += remarks
    compute(job, [shard for shard in todo if first[shard.group] != shard.member], central)


def _compute_scenes(job: Job, todo: list[Shard], central: StepA, processes: Together) -> None:
    """Shards of a study without parameter sets."""
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


def _sets(todo: list[Shard]) -> Iterator[list[Shard]]:
    """Shards of each parameter set."""
    for _, of_set in groupby(todo, key=lambda shard: shard.member):
        yield list(of_set)


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
