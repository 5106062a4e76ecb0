"""Step B of a run: compute the shards that are missing, batch by batch, and write each of them whole.

Parameter sets cost what they touch: sets that differ in money alone share the rows of Step B, and
Step A is computed once for all sets that agree on what it depends on.
"""

import contextlib
import json
import os
import socket
import time
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from itertools import groupby
from typing import Any

import numpy as np

from mcsettle.errors import InputError, NumericalError
from mcsettle.railway.scene import Scene
from mcsettle.run import columns
from mcsettle.run.options import RunOptions
from mcsettle.run.shards import Shard
from mcsettle.step_a.transfers import StepA, step_a
from mcsettle.step_b import expansion_error
from mcsettle.step_b.build_case import build_case
from mcsettle.step_b.case import Case, Outcome, support_of
from mcsettle.step_b.cycle_jump import CycleJump
from mcsettle.step_b.engine import Engine, engine_for, foreseen_passages
from mcsettle.step_b.equivalent_cycles import counting_remark
from mcsettle.step_b.pointwise import LARGEST_EXPONENT
from mcsettle.step_b.sd_map import roughness
from mcsettle.storage import shard_record, store
from mcsettle.storage.files import inside, refuse_link
from mcsettle.storage.foreign import LOGS
from mcsettle.storage.location import Folder, Place
from mcsettle.storage.provenance import Provenance
from mcsettle.storage.shard_name import ShardName
from mcsettle.study.parameter_sets import ParameterSet
from mcsettle.study.run_inputs import RunInputs
from mcsettle.types import Progress, silent

BATCH = 2048  # realisations at a time, unless a run says otherwise
CHECKED = range(2)  # realisations on which the second-order form is checked, in every run


@dataclass
class Job:
    """What the parts of one run share.

    ``complete``: names of the shards that have a record; ``batch``: realisations advanced at a time,
    fewer once memory did not suffice.
    """

    run: RunInputs
    at: Place
    provenance: Provenance
    options: RunOptions = RunOptions()
    progress: Progress = silent
    remarks: list[str] = field(default_factory=list)
    complete: set[str] = field(default_factory=set)
    batch: int = 0

    def __post_init__(self) -> None:
        self.batch = self.batch or self.options.batch or BATCH

    def is_whole(self, shard: Shard) -> bool:
        """Whether a shard is there, whole."""
        return shard_record.is_whole(self.at, shard.name, self.provenance, len(shard.indices))

    def write(self, shard: Shard, tables: dict[str, dict[str, Any]], failure: str = "") -> None:
        """Write a shard and its record."""
        shard_record.write_shard(
            *(self.at, shard.name, tables, self.provenance, shard.indices, failure), self.run.units
        )

    def log(self, event: str, shard: Shard, **more: Any) -> None:
        """A line in this process's log: what the bytes of the results must not depend on."""
        if not isinstance(self.at, Folder):
            return
        line = {"event": event, "shard": shard.name, **more}
        with contextlib.suppress(OSError, InputError):  # the log is a courtesy
            path = inside(self.at.path, f"{LOGS}/{socket.gethostname()}-{os.getpid()}.jsonl")
            refuse_link(path)
            path.parent.mkdir(exist_ok=True)
            with path.open("a", encoding="utf-8") as file:
                file.write(json.dumps(line) + "\n")


def compute(job: Job, todo: list[Shard], central: StepA) -> None:
    """Write the shards ``todo``: the main loop of Step B.

    ``central``: Step A of a study without parameter sets; with them every set asks for its own.
    """
    sets, transfers, processes = job.run.sets, job.run.transfers, job.options.processes
    for index, of_set in groupby(todo, key=lambda shard: shard.member):
        member, prepared = sets[index], central
        if len(sets) > 1:
            job.progress("Parameter sets", index, len(sets))
        missing = [s for s in of_set if not copied(job, member, job.run.same_rows[s.group], s)]
        if missing and transfers is not None and not member.failure:
            prepared = step_a(member.scenes, job.progress, processes, transfers)
        for scene in member.scenes if missing else ():
            shards = [shard for shard in missing if shard.is_of(scene)]
            if member.failure:
                for shard in shards:
                    job.write(shard, failed_tables(member, scene, shard, member.failure))
            elif shards:
                advance(job, member, scene, prepared, shards)


def copied(job: Job, member: ParameterSet, first: int, shard: Shard) -> bool:
    """Take over the rows of ``first``, the first set with the same Step B, if they are there."""
    source = replace(shard, member=first)
    if first == member.index or not job.is_whole(source):
        return False
    tables = {}
    for table in shard_record.SHARDED:
        rows = store.shard_columns(job.at, table, source.name)
        n = len(rows["parameter_set"])
        inputs = columns.input_columns(member, n) if table == "realisations" else {}
        tables[table] = rows | inputs | {"parameter_set": np.full(n, member.index, np.int32)}
    job.write(shard, tables)
    return True


def advance(
    job: Job, member: ParameterSet, scene: Scene, prepared: StepA, shards: Iterable[Shard]
) -> None:
    """Compute shards of one scene of a parameter set."""
    engine = engine_of(job, member, scene, prepared)
    for shard in shards:
        write_computed(job, member, scene, engine, shard)


def engine_of(job: Job, member: ParameterSet, scene: Scene, prepared: StepA) -> Engine:
    """The engine of a scene; remarks on it go to ``job``."""
    case = build_case(scene, prepared)
    side, remarks = _right_hand_side(member, scene, case)
    counting = counting_remark(case)
    job.remarks += (
        remarks if counting is None else [*remarks, f"{scene.variant} {scene.scenario}: {counting}"]
    )
    threads, precision = job.options.threads, scene.precision
    return engine_for(case, scene.stepping, side, threads=threads, precision=precision)


def write_computed(
    job: Job, member: ParameterSet, scene: Scene, engine: Engine, shard: Shard
) -> None:
    """Compute one shard and write it; what a smaller run has left of it is taken over."""
    started = time.monotonic()
    job.log("begun", shard)
    done, history, realisations = _begun(job, shard)
    while done < shard.indices.stop:
        batch, outcome = _batch(job, scene, engine, range(done, shard.indices.stop))
        realisations.append(columns.realisation_columns(member, scene, batch, outcome))
        history.append(columns.history_columns(member, scene, batch, outcome))
        done = batch.stop
        if not job.run.extent.nested:
            job.progress(_stage(scene), done, job.run.extent.realisations)
    tables = {"history": columns.joined(history), "realisations": columns.joined(realisations)}
    job.write(shard, tables)
    seconds = round(time.monotonic() - started, 3)
    job.log("done", shard, seconds=seconds, threads=job.options.threads, batch=job.batch)


def _batch(job: Job, scene: Scene, engine: Engine, rest: range) -> tuple[range, Outcome]:
    """Advance the next batch of the realisations ``rest``.

    Where memory does not suffice, once, a quarter of it from then on.
    """
    for last_try in (False, True):
        batch = rest[: job.batch]
        try:
            return batch, _outcome(job, scene, engine, batch)
        except MemoryError:
            smaller = max(1, len(batch) // 4)
            if last_try or len(batch) == 1:
                raise NumericalError(
                    f"{len(batch)} realisations at a time do not fit into the memory; free some, "
                    f"or take a smaller batch (batch={smaller})"
                ) from None
            job.batch = smaller
            job.remarks.append(
                f"{len(batch)} realisations at a time did not fit into the memory; went on with "
                f"{smaller} (batch={smaller})"
            )
    raise AssertionError("unreachable")


def _outcome(job: Job, scene: Scene, engine: Engine, batch: range) -> Outcome:
    """Advance realisations to the limit or the horizon, with progress where it takes long."""
    profiles = scene.profiles.sample(batch)
    support = support_of(scene, batch, profiles)
    if isinstance(engine, CycleJump):
        return engine.run(profiles, scene.sample_days, support=support)
    passages = foreseen_passages(engine.case, profiles, support)
    march = engine.march(profiles, scene.sample_days, support=support)
    for day in march:
        job.progress(f"{_stage(scene)}, axle passages", *passages(day))
    return march.outcome()


def _stage(scene: Scene) -> str:
    return f"Step B: {scene.variant} {scene.scenario}"


def _begun(job: Job, shard: Shard) -> tuple[int, list[dict[str, Any]], list[dict[str, Any]]]:
    """Where a shard has to go on, and the columns that a smaller run has left of it."""
    stem = shard.name.rpartition("-")[0]  # all but its last realisation
    others = (ShardName.read(name) for name in job.complete if name.startswith(f"{stem}-"))
    smaller = [other for other in others if other is not None and other.last < shard.last]
    for other in sorted(smaller, key=lambda other: other.last, reverse=True):
        name, stop = str(other), other.last + 1
        if shard_record.is_whole(job.at, name, job.provenance, stop - shard.first):
            history = store.shard_columns(job.at, "history", name)
            return stop, [history], [store.shard_columns(job.at, "realisations", name)]
    return shard.first, [], []


def _right_hand_side(member: ParameterSet, scene: Scene, case: Case) -> tuple[str, list[str]]:
    """What to compute a scenario with, and a remark if the second-order form will not do.

    Raises
    ------
    InputError
        It will not do, and what the study asks for has nothing to fall back to.
    """
    if scene.right_hand_side != "spectral":
        return scene.right_hand_side, []
    profiles = scene.profiles.sample(CHECKED)
    error = expansion_error.worst_error(case, profiles, support_of(scene, CHECKED, profiles))
    if error <= expansion_error.LARGEST_ERROR:
        return "spectral", []
    where = f", parameter set {member.index}" if member.values else ""
    text = (
        f"{scene.variant} {scene.scenario}{where}: the second-order form is off by {error:.1%} of "
        "the growth"
    )
    exponent = max(law.exponent for law in case.model.group_laws)
    if scene.stepping == "every_train" or exponent > LARGEST_EXPONENT:
        raise InputError(
            f"{text}; every x and depth instead takes stepping 'every_axle' or 'cycle_jump' "
            f"and exponents up to {LARGEST_EXPONENT:g}"
        )
    return "pointwise", [f'{text}; computed at every x and depth (right_hand_side = "pointwise")']


def failed_tables(
    member: ParameterSet, scene: Scene, shard: Shard, reason: str
) -> dict[str, dict[str, Any]]:
    """The rows of a shard that cannot be computed: every realisation failed, with the reason.

    Their initial profiles are known, so their SD at the start is; nothing else is.
    """
    n, profiles = len(shard.indices), scene.profiles.sample(shard.indices)
    sd = roughness(scene.wavenumbers, scene.window).sd(profiles)
    history = np.full((n, len(scene.sample_days)), np.nan)
    history[:, 0] = sd
    outcome = Outcome(
        reached=np.zeros(n, bool),
        failed=np.ones(n, bool),
        days=np.full(n, np.nan),
        passages=np.zeros(n, np.int64),
        sd_initial=sd,
        sd_final=sd,
        mean_settlement=np.zeros(n),
        amplitudes=profiles,
        history=history,
        steps=np.zeros(n, np.int64),
    )
    rows = columns.realisation_columns(member, scene, shard.indices, outcome)
    rows["failure"] = [reason] * n
    return {
        "history": columns.history_columns(member, scene, shard.indices, outcome),
        "realisations": rows,
    }
