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
from dataclasses import dataclass, field
from itertools import groupby
from typing import Any

import numpy as np

from mcsettle.errors import InputError, NumericalError
from mcsettle.run import columns as rows
from mcsettle.run.scenario import build_case, initial_profiles, sample_days, step_b_key
from mcsettle.run.shards import Shard
from mcsettle.run.transfers import Shelf, StepA, step_a
from mcsettle.run.transfers_ahead import Ahead
from mcsettle.step_b import engine, expansion_error
from mcsettle.step_b.case import Case, Outcome
from mcsettle.step_b.cycle_jump import CycleJump
from mcsettle.step_b.pointwise import LARGEST_EXPONENT
from mcsettle.step_b.sd_map import roughness
from mcsettle.step_b.stepwise import Stepwise
from mcsettle.storage import shard_record, store
from mcsettle.storage.files import inside, refuse_link
from mcsettle.storage.foreign import LOGS
from mcsettle.storage.location import Folder, Place
from mcsettle.storage.provenance import Provenance
from mcsettle.storage.shard_name import ShardName
from mcsettle.study.parameter_sets import ParameterSet
from mcsettle.study.study import Study, study_wavenumbers
from mcsettle.types import Progress

BATCH = 2048  # realisations at a time, unless a run says otherwise
CHECKED = range(2)  # realisations on which the second-order form is checked, in every run
Machine = CycleJump | Stepwise


@dataclass
class Job:
    """What the parts of one run share. ``held``: names of the shards that have a record."""

    study: Study
    at: Place
    provenance: Provenance
    threads: int | None = None
    batch: int | None = None
    progress: Progress | None = None
    remarks: list[str] = field(default_factory=list)
    held: set[str] = field(default_factory=set)

    def is_whole(self, shard: Shard) -> bool:
        """Whether a shard is there, whole."""
        return shard_record.is_whole(self.at, shard.name, self.provenance, len(shard.indices))

    def write(self, shard: Shard, tables: dict[str, dict[str, Any]], failure: str = "") -> None:
        """Write a shard and its record."""
        shard_record.write_shard(
            self.at, shard.name, tables, self.provenance, shard.indices, failure
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


def compute(
    job: Job,
    members: list[ParameterSet],
    todo: list[Shard],
    central: StepA,
    shelf: Shelf | None,
    processes: int,
) -> None:
    """Write the shards ``todo``."""
    twins = twins_of(job.study, members)
    sound = {s.member: members[s.member].study for s in todo if not members[s.member].failure}
    with Ahead(
        sound if job.study.nested else {}, shelf or Shelf(), processes, job.progress
    ) as ahead:
        prepared, of = central, -1
        for (index, variant, scenario), part in groupby(todo, key=lambda shard: shard.group):
            member = members[index]
            if job.progress is not None and len(members) > 1:
                job.progress("Parameter sets", index, len(members))
            twin = twins[index, variant, scenario]
            left = [s for s in part if twin == index or not copied(job, member, twin, s)]
            if not left:
                continue
            if member.failure:
                for shard in left:
                    job.write(shard, failed_tables(member, shard, member.failure))
                continue
            if job.study.nested and of != index:
                ahead.wait(index)
                prepared, of = step_a(member.study, job.progress, processes, shelf), index
            case = build_case(member.study, prepared, variant, scenario)
            advance(job, member, case, left)


def twins_of(study: Study, members: list[ParameterSet]) -> dict[tuple[int, str, str], int]:
    """For every parameter set, variant and scenario the first set with the same Step B."""
    first: dict[tuple[str, str, str], int] = {}
    found = {}
    for member in members:
        for variant in study.variant_names:
            for scenario in study.scenario_names:
                same = member.failure or step_b_key(member.study, variant, scenario)
                key = (variant, scenario, same)
                found[member.index, variant, scenario] = first.setdefault(key, member.index)
    return found


def copied(job: Job, member: ParameterSet, twin: int, shard: Shard) -> bool:
    """Take over the rows of the set ``twin``, which has the same Step B, if they are there."""
    source = Shard(twin, shard.variant, shard.scenario, shard.first, shard.last, shard.nested)
    if not job.is_whole(source):
        return False
    tables = {}
    for table in shard_record.SHARDED:
        columns = store.shard_columns(job.at, table, source.name)
        n = len(columns["parameter_set"])
        own = rows.input_columns(member, n) if table == "realisations" else {}
        own["parameter_set"] = np.full(n, member.index, np.int32)
        tables[table] = columns | own
    job.write(shard, tables)
    return True


def advance(job: Job, member: ParameterSet, case: Case, todo: Iterable[Shard]) -> None:
    """Compute shards of one parameter set, variant and scenario."""
    machine = None
    for shard in todo:
        machine = machine or engine_for(job, member, case, shard)
        write_computed(job, member, machine, shard)


def engine_for(job: Job, member: ParameterSet, case: Case, shard: Shard) -> Machine:
    """The engine of one parameter set, variant and scenario, those of ``shard``; remarks to ``job``."""
    run = member.study.run
    side, remarks = _right_hand_side(member, case, shard)
    job.remarks += remarks
    return engine.engine_for(case, run.stepping, side, threads=job.threads, precision=run.precision)


def write_computed(job: Job, member: ParameterSet, machine: Machine, shard: Shard) -> None:
    """Compute one shard and write it."""
    started = time.monotonic()
    job.log("begun", shard)
    job.write(shard, _tables(job, member, machine, shard))
    spent = time.monotonic() - started
    job.log("done", shard, seconds=round(spent, 3), threads=job.threads, batch=job.batch)


def _tables(
    job: Job, member: ParameterSet, machine: Machine, shard: Shard
) -> dict[str, dict[str, Any]]:
    """One shard: the columns of ``history`` and of ``realisations``.

    What a smaller run has left of it is taken over.
    """
    study = member.study
    done, history, outcomes = _begun(job, shard)
    while done < shard.indices.stop:
        part, outcome = _batch(job, member, machine, shard, done)
        own = member, shard.variant, shard.scenario, part
        outcomes.append(rows.realisation_columns(*own, machine.case.timetable, outcome))
        history.append(rows.history_columns(*own, outcome))
        done = part.stop
        if job.progress is not None and not job.study.nested:
            text = f"Step B: {shard.variant} {shard.scenario}"
            job.progress(text, part.stop, study.run.realisations)
    return {"history": rows.joined(history), "realisations": rows.joined(outcomes)}


def _batch(
    job: Job, member: ParameterSet, machine: Machine, shard: Shard, first: int
) -> tuple[range, Outcome]:
    """Advance the next batch; where memory does not suffice, once, a quarter of it from then on."""
    study = member.study
    for last_try in (False, True):
        part = range(first, min(first + (job.batch or BATCH), shard.indices.stop))
        try:
            profiles = initial_profiles(study, part, shard.variant)
            return part, _outcome(job, machine, profiles, sample_days(study), shard)
        except MemoryError:
            smaller = max(1, len(part) // 4)
            if last_try or len(part) == 1:
                raise NumericalError(
                    f"{len(part)} realisations at a time do not fit into the memory; free some, or "
                    f"give --batch {smaller}"
                ) from None
            job.batch = smaller
            job.remarks.append(
                f"{len(part)} realisations at a time did not fit into the memory; went on with "
                f"{smaller} (--batch {smaller})"
            )
    raise AssertionError("unreachable")


def _outcome(
    job: Job, machine: Machine, profiles: np.ndarray, days: np.ndarray, shard: Shard
) -> Outcome:
    """Advance realisations [R, K] to the limit or the horizon, with progress where it takes long."""
    if isinstance(machine, CycleJump):
        return machine.run(profiles, days)
    march, text = machine.march(profiles, days), f"Step B: {shard.variant} {shard.scenario}"
    passages = engine.foreseen_passages(machine.case, profiles)
    for day in march:
        if job.progress is not None:
            job.progress(f"{text}, axle passages", *passages(day))
    return march.outcome()


def _begun(job: Job, shard: Shard) -> tuple[int, list[dict[str, Any]], list[dict[str, Any]]]:
    """Where a shard has to go on, and the columns that a smaller run has left of it."""
    stem = shard.name.rpartition("-")[0]  # all but its last realisation
    others = (ShardName.read(name) for name in job.held if name.startswith(f"{stem}-"))
    smaller = [other for other in others if other is not None and other.last < shard.last]
    for other in sorted(smaller, key=lambda other: other.last, reverse=True):
        name, stop = str(other), other.last + 1
        if shard_record.is_whole(job.at, name, job.provenance, stop - shard.first):
            history = store.shard_columns(job.at, "history", name)
            return stop, [history], [store.shard_columns(job.at, "realisations", name)]
    return shard.first, [], []


def _right_hand_side(member: ParameterSet, case: Case, shard: Shard) -> tuple[str, list[str]]:
    """What to compute a scenario with, and a remark if the second-order form will not do.

    Raises
    ------
    InputError
        It will not do, and what the study asks for has nothing to fall back to.
    """
    run = member.study.run
    if run.right_hand_side != "spectral":
        return run.right_hand_side, []
    error = expansion_error.worst_error(
        case, initial_profiles(member.study, CHECKED, shard.variant)
    )
    if error <= expansion_error.LARGEST_ERROR:
        return "spectral", []
    where = f", parameter set {member.index}" if member.values else ""
    text = (
        f"{shard.variant} {shard.scenario}{where}: the second-order form is off by {error:.1%} of "
        "the growth"
    )
    exponent = max(law.exponent for law in case.model.group_laws)
    if run.stepping == "every_train" or exponent > LARGEST_EXPONENT:
        raise InputError(
            f"{text}; every x and depth instead takes stepping 'every_axle' or 'cycle_jump' "
            f"and exponents up to {LARGEST_EXPONENT:g}"
        )
    return "pointwise", [f'{text}; computed at every x and depth (right_hand_side = "pointwise")']


def failed_tables(member: ParameterSet, shard: Shard, reason: str) -> dict[str, dict[str, Any]]:
    """The rows of a shard that cannot be computed: every realisation failed, with the reason.

    Their initial profiles are known, so their SD at the start is; nothing else is.
    """
    study, n = member.study, len(shard.indices)
    profiles = initial_profiles(study, shard.indices, shard.variant)
    sd = roughness(study_wavenumbers(study), study.profile.window_m).sd(profiles)
    history = np.full((n, len(sample_days(study))), np.nan)
    history[:, 0] = sd
    none, nowhere = np.zeros(n), np.full(n, np.nan)
    no, yes = np.zeros(n, bool), np.ones(n, bool)
    count = np.zeros(n, np.int64)
    outcome = Outcome(no, yes, nowhere, count, sd, sd, none, profiles, history, count)
    own = member, shard.variant, shard.scenario, shard.indices
    columns = rows.realisation_columns(*own, study.timetable(shard.scenario), outcome)
    columns["failure"] = [reason] * n
    return {"history": rows.history_columns(*own, outcome), "realisations": columns}
