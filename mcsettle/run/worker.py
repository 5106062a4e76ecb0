"""A worker of a run shared by processes or machines: it is told of shards, and writes them.

All it needs it finds in the results folder: study, provenance, and what Step A has computed
(DIR/.step_a). Each process keeps one Taichi runtime with kernels of its own, and works on one shard at a
time whatever the scheduler sends it. A worker outlives runs: each has its ``RunSpec``.
"""

import atexit
import json
import os
import shutil
import tempfile
import threading
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

from mcsettle.errors import InputError
from mcsettle.railway.scene import Scene
from mcsettle.run import compute
from mcsettle.run.factor_fit import read_fits, with_fits
from mcsettle.run.options import RunOptions
from mcsettle.run.shards import Shard, all_shards
from mcsettle.run.status import held_shards, refuse_other_code
from mcsettle.run.surrogate import with_errors
from mcsettle.run.train_surrogate import set_predictor
from mcsettle.step_a.transfer_file import load, save
from mcsettle.step_a.transfers import StepA, step_a
from mcsettle.step_b.engine import Engine
from mcsettle.storage.files import cache_folder
from mcsettle.storage.location import Place, place
from mcsettle.storage.provenance import read_json, read_provenance
from mcsettle.study.candidates import candidates_of
from mcsettle.study.extent import Extent, extent_of
from mcsettle.study.parameter_sets import ParameterSet
from mcsettle.study.run_inputs import run_inputs
from mcsettle.summary.results import study_of

STEP_A = ".step_a"
INDEX = f"{STEP_A}/index.json"
LARGEST_INDEX = 10_000_000  # bytes
_one = threading.Lock()
_state: "WorkerState | None" = None


class RunSpec(NamedTuple):
    """What a worker is to work on: a folder or URL, the run in it and its extent, and how.

    Runs of one provenance differ in where they lie and in how many rows they have.
    """

    where: str
    provenance: str
    extent: Extent
    threads: int | None
    batch: int | None


class Done(NamedTuple):
    """A shard that is there: whether it was computed just now, remarks on its scenario."""

    computed: bool
    remarks: tuple[str, ...]


@dataclass
class WorkerState:
    """What a worker keeps from shard to shard of one run."""

    spec: RunSpec
    job: compute.Job
    shards: list[Shard]
    group: tuple[int, str, str] | None = None
    member: ParameterSet | None = None
    scene: Scene | None = None
    engine: Engine | None = None
    prepared: dict[int, StepA] = field(default_factory=dict)

    def make(self, shard: Shard) -> None:
        """Write a shard: computed, taken over from a set with the same rows, or failed for a reason."""
        job, member = self.job, self._member(shard.member)
        if compute.copied(job, member, job.run.same_rows[shard.group], shard):
            return
        if self.scene is None or self.group != shard.group:
            self.scene = next(scene for scene in member.scenes if shard.is_of(scene))
            self.group, self.engine = shard.group, None
        if member.failure:
            job.write(shard, compute.failed_tables(member, self.scene, shard, member.failure))
            return
        if self.engine is None:
            if shard.member not in self.prepared:
                self.prepared = {shard.member: self._step_a(member)}
            job.remarks.clear()  # each answer has those of its own scenario
            self.engine = compute.engine_of(job, member, self.scene, self.prepared[shard.member])
        compute.write_computed(job, member, self.scene, self.engine, shard)

    def _member(self, index: int) -> ParameterSet:
        if self.member is None or self.member.index != index:
            run = self.job.run
            (self.member,) = with_errors([run.sets[index]], run.transfers)
        return self.member

    def _step_a(self, member: ParameterSet) -> StepA:
        transfers = self.job.run.transfers
        if transfers is None:
            return read_step_a(self.job.at)
        return step_a(member.scenes, store=transfers)


def work(spec: RunSpec, number: int) -> Done:
    """Make shard ``number`` of a run; nothing is done if it is there.

    Raises
    ------
    InputError
        The folder is of another run, or cannot be read or written; this process began with another
        number of threads.
    """
    _own_kernels()
    with _one:
        state = _state_for(spec)
        shard = state.shards[number]
        computed = not state.job.is_whole(shard)
        if computed:
            state.make(shard)
        return Done(computed, tuple(dict.fromkeys(state.job.remarks)))


def work_on(spec: RunSpec, shards: Sequence[Shard]) -> tuple[str, ...]:
    """Make missing ``shards`` of a run in a process beside it; returns the remarks on them."""
    remarks: dict[str, None] = {}
    with _one:
        state = _state_for(spec)
        for shard in shards:
            state.make(shard)
            remarks |= dict.fromkeys(state.job.remarks)
    return tuple(remarks)


def share_step_a(at: Place, central: StepA) -> None:
    """Put what Step A has computed into the results folder, for the workers."""
    index: dict[str, dict[str, list[str]]] = {}
    held = set(at.names(STEP_A))
    for (variant, scenario), group in central.transfers.items():
        for transfer in group:
            name = f"{STEP_A}/{transfer.digest}.npz"
            index.setdefault(variant, {}).setdefault(scenario, []).append(transfer.digest)
            if name not in held:
                held.add(name)
                with tempfile.TemporaryDirectory() as folder:
                    save(transfer, Path(folder) / "transfer.npz")
                    at.write(name, (Path(folder) / "transfer.npz").read_bytes())
    at.write(INDEX, json.dumps(index, indent=1).encode())


def read_step_a(at: Place) -> StepA:
    """What ``share_step_a`` has put there.

    Raises
    ------
    InputError
        It is missing or damaged.
    """
    try:
        index = read_json(at, INDEX, LARGEST_INDEX)
        by_digest = {}
        with tempfile.TemporaryDirectory() as folder:
            for digest in {d for part in index.values() for group in part.values() for d in group}:
                path = Path(folder) / "transfer.npz"
                path.write_bytes(at.read(f"{STEP_A}/{digest}.npz"))
                by_digest[digest] = load(path)
                if by_digest[digest].digest != digest:
                    raise InputError(f"'{at}/{STEP_A}/{digest}.npz' holds another file")
    except (FileNotFoundError, AttributeError, TypeError) as error:
        raise InputError(f"'{at}/{STEP_A}' is damaged ({error}); start the run again") from error
    return StepA(
        {
            (variant, scenario): tuple(by_digest[digest] for digest in group)
            for variant, part in index.items()
            for scenario, group in part.items()
        }
    )


def _state_for(spec: RunSpec) -> WorkerState:
    global _state
    if _state is None or _state.spec != spec:
        _state = _set_up(spec)
    return _state


def _set_up(spec: RunSpec) -> WorkerState:
    from mcsettle.kernels import backend, runtime

    at = place(spec.where)
    provenance, study = read_provenance(at), study_of(at)
    if (provenance.digest, extent_of(study)) != (spec.provenance, spec.extent):
        raise InputError(f"'{at}' is not the folder of this run as this worker sees it")
    refuse_other_code(at, provenance)
    compiler = f"{backend.NAME} {runtime.version()}"
    if compiler != (needed := f"{provenance.runtime} {provenance.taichi_version}"):
        raise InputError(f"'{at}' is a run of {needed}; this worker has {compiler}")
    try:
        runtime.start(spec.threads)
    except RuntimeError:
        raise InputError(
            f"a worker is to use {spec.threads} threads and has begun with another number; give "
            "threads= that number, or start the workers again"
        ) from None
    run = run_inputs(study)
    run = with_fits(run, read_fits(at, run))
    if run.transfers is not None and run.predicts_grounds:
        set_predictor(candidates_of(study), run.transfers)
    options = RunOptions(threads=spec.threads, batch=spec.batch)
    job = compute.Job(run, at, provenance, options, complete=held_shards(at))
    shards = all_shards(run.extent, provenance.shard_realisations)
    return WorkerState(spec, job, shards)


def _own_kernels() -> None:
    """Compiled kernels in a folder of this process's own, begun as a copy of the common one."""
    if "MCSETTLE_KERNELS" in os.environ:
        return
    from mcsettle.kernels import runtime

    folder = Path(tempfile.mkdtemp(prefix="mcsettle-kernels-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    common = cache_folder() / runtime.cache_name()
    if common.is_dir():
        ignore = shutil.ignore_patterns("*.lock", ".probe-*")
        try:
            shutil.copytree(common, folder / runtime.cache_name(), ignore=ignore)
        except (OSError, shutil.Error):  # changed under our hands: what is missing is compiled
            shutil.rmtree(folder / runtime.cache_name(), ignore_errors=True)
    os.environ["MCSETTLE_KERNELS"] = str(folder)
