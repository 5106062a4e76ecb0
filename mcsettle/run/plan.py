"""What a run will take: realisations, batches, memory, disk and time, from a short probe.

The probe advances a few tracks of every scenario (Step A is computed first where it is not cached: the
run finds it there). An update passage by passage costs the same whatever the track, so its rate is
measured over one launch and multiplied by the passages that a cycle jump of the same tracks foresees.
"""

import math
import time
from dataclasses import dataclass

import numpy as np

from mcsettle.railway.scene import Scene
from mcsettle.run.compute import BATCH
from mcsettle.run.options import RunOptions
from mcsettle.run.shards import all_shards
from mcsettle.run.together import worthwhile
from mcsettle.step_a.transfers import StepA, step_a
from mcsettle.step_b.build_case import build_case
from mcsettle.step_b.case import Case, Support, support_of
from mcsettle.step_b.cycle_jump import CycleJump
from mcsettle.step_b.cycles import update_weights
from mcsettle.step_b.stepwise import Stepwise
from mcsettle.storage.provenance import SHARD
from mcsettle.study.extent import extent_of
from mcsettle.study.study import Study
from mcsettle.types import Progress, silent

PROBED = 256  # tracks of a scenario: four full tiles, enough for both cores of a small machine
MOST_PROBES = 8
BASE_MB = 450.0  # interpreter, libraries and kernels, measured
STAGES = 16  # arrays of [batch, K + 1] that a cycle jump holds at a time
ROW_BYTES = 35 + 18 + 8  # of ``realisations``, ``effects`` and their files, compressed, measured
SAMPLE_BYTES = 4.6  # of an SD of ``history``, compressed, measured
FIXED_SECONDS = 3.0  # start-up and summary
SUMMARY_SECONDS = 2e-5  # of a row


@dataclass(frozen=True)
class Plan:
    """What a run will take; ``seconds`` on this machine as busy as it is now, Step A apart."""

    scenarios: int
    variants: int
    parameter_sets: int
    realisations: int
    rows: int
    stepping: str
    modes: int
    passages: float
    batches: int
    batch: int
    memory_mb: float
    disk_mb: float
    seconds: float


def plan(
    study: Study,
    threads: int | None = None,
    batch: int | None = None,
    progress: Progress = silent,
    processes: int = 1,
) -> Plan:
    """Probe ``study`` and say what running it will take (arguments as ``run_study``).

    ``passages``: axle passages of all realisations together.
    """
    extent, scenes = extent_of(study), study.scenes
    options = RunOptions(threads=threads, processes=processes)
    shards = all_shards(extent, SHARD)
    n_processes = worthwhile(extent, study.run.stepping, shards, options)
    if n_processes > 1:  # as the run will have it: Taichi keeps the threads it starts with
        threads = 1
    prepared = step_a(scenes, progress, processes)
    probed = scenes[:: math.ceil(len(scenes) / MOST_PROBES)]
    n, rows = extent.realisations, extent.rows
    tracks = range(min(PROBED, n))
    probes = [_probe(scene, prepared, tracks, threads) for scene in probed]
    seconds, passages = np.mean(probes, axis=0)
    size = min(batch or BATCH, BATCH, n)
    modes = len(study.wavenumbers)
    return Plan(
        scenarios=len(extent.scenarios),
        variants=len(extent.variants),
        parameter_sets=extent.n_sets,
        realisations=n,
        rows=rows,
        stepping=study.run.stepping,
        modes=modes,
        passages=float(passages * rows),
        batches=math.ceil(n / size) * extent.groups,
        batch=size,
        memory_mb=BASE_MB + size * (modes + 1) * 16 * STAGES / 1e6 + rows * 400 / 1e6,
        disk_mb=rows * (ROW_BYTES + SAMPLE_BYTES * len(study.sample_days)) / 1e6,
        seconds=FIXED_SECONDS + float(seconds / n_processes + SUMMARY_SECONDS) * rows,
    )


def is_long(study: Study) -> bool:
    """Whether a run is long enough for its plan to be worth a probe."""
    slow = study.run.stepping != "cycle_jump" or study.run.right_hand_side == "pointwise"
    return extent_of(study).rows > (100 if slow else 200_000)


def _probe(
    scene: Scene, prepared: StepA, tracks: range, threads: int | None
) -> tuple[float, float]:
    """Seconds and axle passages a realisation."""
    from mcsettle.kernels import runtime

    case, days = build_case(scene, prepared), scene.sample_days
    profiles = scene.profiles.sample(tracks)
    support = support_of(scene, tracks, profiles)
    jump_side = "spectral" if scene.stepping != "cycle_jump" else scene.right_hand_side
    runtime.running(threads)
    jump = CycleJump(case, jump_side)
    jump.run(profiles[:1], days, support=support[:1])  # compiled
    start = time.perf_counter()
    outcome = jump.run(profiles, days, support=support)
    seconds = (time.perf_counter() - start) / len(profiles)
    passages = float(outcome.passages.mean())
    if scene.stepping == "cycle_jump":
        return seconds, passages
    rate = _marching(case, scene, profiles, support)
    trains = passages / case.timetable.passages_per_day
    trains *= case.timetable.trains_per_day
    return (passages if scene.stepping == "every_axle" else trains) / rate, passages


def _marching(case: Case, scene: Scene, profiles: np.ndarray, support: Support) -> float:
    """Updates of realisations a second, one launch measured."""
    loads = Stepwise(case, scene.stepping, scene.right_hand_side, scene.precision).loads
    lanes = loads.begin(profiles, np.inf, support)
    first = update_weights(case, loads.plan, 0, 2)
    lanes.advance(*first, *loads.coefficients)  # compiled
    count = lanes.burst_size()
    updates = update_weights(case, loads.plan, 2, count)
    start = time.perf_counter()
    lanes.advance(*updates, *loads.coefficients)
    return count * len(profiles) / (time.perf_counter() - start)
