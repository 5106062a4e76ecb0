"""A worker of a distributed run: it is sent the number of a shard, and writes the shard.

All it needs it finds in the results folder: study, provenance, and what Step A has computed
(DIR/.step_a). Each process keeps one Taichi runtime with kernels of its own, and works on one shard at a
time whatever the scheduler sends it. A worker outlives runs: each has its ``Order``.
"""

import atexit
import json
import os
import shutil
import tempfile
import threading
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

from mcsettle.errors import InputError
from mcsettle.run import compute
from mcsettle.run.factor_fit import fitted_sets
from mcsettle.run.scenario import build_case
from mcsettle.run.shards import Shard, all_shards
from mcsettle.run.status import held_shards
from mcsettle.run.transfers import Shelf, StepA, step_a
from mcsettle.step_a.transfer_file import load, save
from mcsettle.step_b.cycle_jump import CycleJump
from mcsettle.step_b.stepwise import Stepwise
from mcsettle.storage.files import cache_folder
from mcsettle.storage.location import Place, place
from mcsettle.storage.provenance import read_json, read_provenance
from mcsettle.storage.shard_record import read_record
from mcsettle.study.parameter_sets import ParameterSet
from mcsettle.summary.results import study_of

STEP_A = ".step_a"
INDEX = f"{STEP_A}/index.json"
LARGEST_INDEX = 10_000_000  # bytes
_one = threading.Lock()
_bench: "Bench | None" = None


class Order(NamedTuple):
    """What a worker is to work on: a folder or URL, the run in it and its size, and how.

    Runs of one provenance differ in where they lie and in how many rows they have.
    """

    where: str
    provenance: str
    realisations: int
    parameter_sets: int
    threads: int | None
    batch: int | None


class Done(NamedTuple):
    """A shard that is there: computed just now?, rows that failed, remarks on its scenario."""

    number: int
    computed: bool
    n_failed: int
    remarks: tuple[str, ...] = ()


@dataclass
class Bench:
    """What a worker keeps from shard to shard of one run."""

    order: Order
    job: compute.Job
    members: list[ParameterSet]
    twins: dict[tuple[int, str, str], int]
    shards: list[Shard]
    shelf: Shelf | None
    group: tuple[int, str, str] | None = None
    engine: CycleJump | Stepwise | None = None
    prepared: dict[int, StepA] = field(default_factory=dict)

    def make(self, shard: Shard) -> None:
        """Write a shard: computed, taken over from a set with the same rows, or failed for a reason."""
        member, twin = self.members[shard.member], self.twins[shard.group]
        if twin != shard.member and compute.copied(self.job, member, twin, shard):
            return
        if member.failure:
            self.job.write(shard, compute.failed_tables(member, shard, member.failure))
        else:
            compute.write_computed(self.job, member, self.engine_of(shard), shard)

    def engine_of(self, shard: Shard) -> CycleJump | Stepwise:
        """The engine of a shard, kept for its neighbours."""
        if self.engine is None or self.group != shard.group:
            member = self.members[shard.member]
            if shard.member not in self.prepared:
                self.prepared = {shard.member: self._step_a(member)}
            case = build_case(
                member.study, self.prepared[shard.member], shard.variant, shard.scenario
            )
            self.job.remarks.clear()  # each answer has those of its own scenario
            self.engine = compute.engine_for(self.job, member, case, shard)
            self.group = shard.group
        return self.engine

    def _step_a(self, member: ParameterSet) -> StepA:
        if self.shelf is None:
            return read_step_a(self.job.at)
        return step_a(member.study, shelf=self.shelf)


def work(order: Order, number: int) -> Done:
    """Make shard ``number`` of a run; nothing is done if it is there.

    Raises
    ------
    InputError
        The folder is of another run, or cannot be read or written; this process began with another
        number of threads.
    """
    global _bench
    with _one:
        if _bench is None or _bench.order != order:
            _bench = _set_up(order)
        bench, shard = _bench, _bench.shards[number]
        computed = not bench.job.is_whole(shard)
        if computed:
            bench.make(shard)
        found = read_record(bench.job.at, shard.name, bench.job.provenance)
        n_failed = 0 if found is None else found.n_failed
        return Done(number, computed, n_failed, tuple(dict.fromkeys(bench.job.remarks)))


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
        found = {}
        with tempfile.TemporaryDirectory() as folder:
            for digest in {d for part in index.values() for group in part.values() for d in group}:
                path = Path(folder) / "transfer.npz"
                path.write_bytes(at.read(f"{STEP_A}/{digest}.npz"))
                found[digest] = load(path)
                if found[digest].digest != digest:
                    raise InputError(f"'{at}/{STEP_A}/{digest}.npz' holds another file")
    except (FileNotFoundError, AttributeError, TypeError) as error:
        raise InputError(f"'{at}/{STEP_A}' is damaged ({error}); start the run again") from error
    return StepA(
        {
            (variant, scenario): tuple(found[digest] for digest in group)
            for variant, part in index.items()
            for scenario, group in part.items()
        }
    )


def _set_up(order: Order) -> Bench:
    from mcsettle.kernels import runtime

    _own_kernels()
    at = place(order.where)
    provenance, study = read_provenance(at), study_of(at)
    seen = provenance.digest, study.run.realisations, study.n_sets
    if seen != order[1:4]:
        raise InputError(f"'{at}' is not the folder of this run as this worker sees it")
    try:
        runtime.start(order.threads)
    except RuntimeError:
        raise InputError(
            f"a worker is to use {order.threads} threads and has begun with another number; give "
            "--threads that number, or start the workers again"
        ) from None
    held = held_shards(at)
    job = compute.Job(study, at, provenance, order.threads, order.batch, held=held)
    shelf = Shelf.of(study) if study.nested else None
    members = fitted_sets(at, study)
    shards = all_shards(study, provenance.shard_realisations)
    return Bench(order, job, members, compute.twins_of(study, members), shards, shelf)


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
