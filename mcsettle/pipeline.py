"""The chain: study → transfer functions → engine → tables. Run a study, or one scenario of it.

Realisations are cut into shards of fixed index ranges, one set of shards for each variant, scenario
and parameter set; each shard is one atomic file per table, so an interrupted run goes on where it
stopped and the tables do not depend on batches, threads or pauses.

Parameter sets cost what they touch: sets that differ in money alone share the rows of Step B, and
Step A is computed once for all sets that agree on what it depends on.

Depends on: draws, economics, engine, errors, rows, scene, step_a, store, study, summary,
summary_table.
"""

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

import mcsettle
from mcsettle import economics, engine, rows, store
from mcsettle.case import Case
from mcsettle.draws import ParameterSet, all_sets
from mcsettle.errors import InputError
from mcsettle.scene import build_case, initial_profiles, sample_days, step_b_key
from mcsettle.step_a import Progress, Shelf, StepA, step_a
from mcsettle.study import Study, resolved_toml
from mcsettle.summary import STUDY_FILE, read_results, summary_rows
from mcsettle.summary_table import summary_columns

__all__ = ["Finished", "build_case", "initial_profiles", "run_study", "sample_days"]

SHARD = 2048
CHECKED_REALISATIONS = 4
CHECKED_SETS = 4
SHARDED = ("realisations", "history", "effects")


@dataclass(frozen=True)
class Finished:
    """A finished run: its folder, how many rows failed, and the remarks to pass on."""

    folder: Path
    n_failed: int
    remarks: tuple[str, ...]


@dataclass
class _Job:
    """What the parts of one run share."""

    study: Study
    out: Path
    provenance: store.Provenance
    ranges: list[range]
    threads: int | None
    batch: int | None
    progress: Progress | None
    remarks: list[str] = field(default_factory=list)

    def shard(self, member: ParameterSet, variant: str, scenario: str, indices: range) -> str:
        """File name of a shard."""
        own = member.index if self.study.uncertain else None
        return store.shard_name(variant, scenario, indices.start, indices.stop - 1, own)

    def write(self, table: str, name: str, columns: dict[str, Any], indices: range) -> None:
        """Write one shard."""
        store.write(
            self.out, table, name, columns, self.provenance, indices.start, indices.stop - 1
        )


def run_study(
    study: Study,
    out: Path | str,
    realisations: int | None = None,
    seed: int | None = None,
    threads: int | None = None,
    batch: int | None = None,
    exact: bool = False,
    progress: Progress | None = None,
    processes: int = 1,
    parameter_sets: int | None = None,
) -> Finished:
    """Run every variant and scenario of ``study`` into the folder ``out``; resumes what is there.

    Parameters
    ----------
    study : Study
    out : folder of the results (a path or its text)
    realisations, seed, parameter_sets : replace the study's own
    threads : Taichi threads (None: all cores)
    batch : realisations advanced at a time; changes memory and speed, not results
    exact : update after every axle passage, whatever the study's stepping
    progress : called as progress(stage, done, total)
    processes : spawned for Step A (more than 1 needs a main guard in the calling program)

    Raises
    ------
    InputError
        A parameter set the study would refuse; the folder cannot be written or holds results of
        something else.
    """
    from mcsettle.kernels import runtime

    out = Path(out)
    study = study.with_run(realisations, seed, "every_axle" if exact else None, parameter_sets)
    members = all_sets(study)
    shelf = Shelf.of(study) if study.uncertain else None
    prepared = step_a(study, progress, processes, shelf)
    runtime.start(threads)  # before anything starts it with other threads
    ranges = list(_ranges(study.run.realisations))
    job = _Job(study, out, _provenance(study, prepared), ranges, threads, batch, progress)
    _refuse_smaller(out, study)
    store.prepare(out, job.provenance)
    store.write_text(out, STUDY_FILE, resolved_toml(study))
    _step_b(job, members, prepared, shelf, processes)
    _drop_superseded(job, members)  # first: the effects pair rows of one run only
    _write_parameters(job, members)
    _write_effects(job, members)
    _write_summary(job)
    store.finish(out)
    held = store.read(out, "realisations")
    n_failed = int(np.sum(np.asarray(held["status"]) == "failed"))
    return Finished(out, n_failed, tuple(job.remarks))


def _step_b(
    job: _Job,
    members: list[ParameterSet],
    central: StepA,
    shelf: Shelf | None,
    processes: int,
) -> None:
    """Write every missing shard of ``realisations`` and ``history``."""
    twins: dict[tuple[str, str, str], ParameterSet] = {}
    for member in members:
        if job.progress is not None and len(members) > 1:
            job.progress("Parameter sets", member.index, len(members))
        prepared = None if job.study.uncertain else central
        for variant in job.study.variant_names:
            for scenario in job.study.scenario_names:
                key = (variant, scenario, step_b_key(member.study, variant, scenario))
                twin = twins.setdefault(key, member)
                todo = [r for r in job.ranges if not _is_done(job, member, variant, scenario, r)]
                if not todo:
                    continue
                if twin is not member:
                    _copy(job, twin, member, variant, scenario, todo)
                    continue
                prepared = prepared or step_a(member.study, job.progress, processes, shelf)
                case = build_case(member.study, prepared, variant, scenario)
                _advance(job, member, variant, scenario, case, todo)


def _advance(
    job: _Job, member: ParameterSet, variant: str, scenario: str, case: Case, todo: list[range]
) -> None:
    """Compute the shards ``todo`` of one parameter set, variant and scenario."""
    if member.index < CHECKED_SETS:
        remark = _check_expansion(member, case, variant, scenario)
        job.remarks += [remark] if remark else []
    run = member.study.run
    machine = engine.Engine(case, run.stepping, run.right_hand_side, threads=job.threads)
    for indices in todo:
        tables = _shard(job, member, machine, variant, scenario, indices)
        name = job.shard(member, variant, scenario, indices)
        for table, columns in tables.items():
            job.write(table, name, columns, indices)


def _copy(
    job: _Job,
    twin: ParameterSet,
    member: ParameterSet,
    variant: str,
    scenario: str,
    todo: list[range],
) -> None:
    """Shards of ``twin``, which has the same Step B, as those of ``member``."""
    for indices in todo:
        source = job.shard(twin, variant, scenario, indices)
        target = job.shard(member, variant, scenario, indices)
        for table in ("history", "realisations"):
            columns = store.shard_columns(job.out / table / source)
            n = len(columns["parameter_set"])
            own = rows.input_columns(member, n) if table == "realisations" else {}
            own["parameter_set"] = np.full(n, member.index, np.int32)
            job.write(table, target, columns | own, indices)


def _is_done(job: _Job, member: ParameterSet, variant: str, scenario: str, indices: range) -> bool:
    """Whether a shard is on disk, whole: ``realisations`` is written last."""
    name = job.shard(member, variant, scenario, indices)
    history = store.shard_rows(job.out / "history" / name)
    n = store.shard_rows(job.out / "realisations" / name)
    return n == len(indices) and history is not None


def _shard(
    job: _Job,
    member: ParameterSet,
    machine: engine.Engine,
    variant: str,
    scenario: str,
    indices: range,
) -> dict[str, dict[str, Any]]:
    """One shard: the columns of ``history`` and of ``realisations``, in that order.

    What a smaller run has left of it is taken over.
    """
    text, horizon = f"Step B: {variant} {scenario}", int(machine.case.horizon)

    def tick(day: float) -> None:
        if job.progress is not None:
            job.progress(text + ", day", min(int(day), horizon), horizon)

    study = member.study
    done, history, outcomes = _begun(job, member, variant, scenario, indices)
    size = min(job.batch or SHARD, SHARD)
    for first in range(done, indices.stop, size):
        part = range(first, min(first + size, indices.stop))
        outcome = machine.run(initial_profiles(study, part), sample_days(study), tick=tick)
        outcomes.append(
            rows.realisation_columns(member, variant, scenario, part, machine.case, outcome)
        )
        history.append(rows.history_columns(member, variant, scenario, part, outcome))
        if job.progress is not None and not job.study.uncertain:
            job.progress(text, part.stop, study.run.realisations)
    return {"history": rows.joined(history), "realisations": rows.joined(outcomes)}


def _begun(
    job: _Job, member: ParameterSet, variant: str, scenario: str, indices: range
) -> tuple[int, list[dict[str, Any]], list[dict[str, Any]]]:
    """Where a shard has to go on, and the columns that a smaller run has left of it."""
    stem = job.shard(member, variant, scenario, indices).rsplit("-", 1)[0]
    best, found = indices.start, ""
    for path in (job.out / "realisations").glob(f"{stem}-*.parquet"):
        stop = int(path.stem.rsplit("-", 1)[1]) + 1
        sound = store.shard_rows(path) == stop - indices.start
        sound = sound and store.shard_rows(job.out / "history" / path.name) is not None
        if sound and best < stop < indices.stop:
            best, found = stop, path.name
    if not found:
        return best, [], []
    history = store.shard_columns(job.out / "history" / found)
    return best, [history], [store.shard_columns(job.out / "realisations" / found)]


def _write_parameters(job: _Job, members: list[ParameterSet]) -> None:
    """The table ``parameters`` of a study with uncertain inputs."""
    if not job.study.uncertain:
        return
    name = f"sets-000000-{len(members) - 1:06d}.parquet"
    columns = rows.parameter_columns(members)
    job.write("parameters", name, columns, range(job.study.run.realisations))
    for path in (job.out / "parameters").glob("*.parquet"):
        if path.name != name:
            path.unlink()


def _write_effects(job: _Job, members: list[ParameterSet]) -> None:
    """Pair every scenario with the baseline, realisation by realisation."""
    if job.study.economics is None:
        return
    frame = store.read(job.out, "realisations").to_pandas()
    own = ["variant", "parameter_set", "scenario"]
    parts = {key: g.sort_values("realisation") for key, g in frame.groupby(own)}
    for variant in job.study.variant_names:
        for member in members:
            for scenario in job.study.scenario_names:
                effects = _effects(member, variant, scenario, parts)
                if effects is None:
                    continue
                for indices in job.ranges:
                    columns = rows.effect_columns(member, variant, scenario, indices, effects)
                    name = job.shard(member, variant, scenario, indices)
                    job.write("effects", name, columns, indices)


def _effects(
    member: ParameterSet,
    variant: str,
    scenario: str,
    parts: dict[Any, pd.DataFrame],
) -> economics.Effects | None:
    table, change = member.study.priced, member.study.change(scenario)
    if table is None or change is None:
        return None
    base = parts[variant, member.index, table.baseline]
    other = parts[variant, member.index, scenario]
    return economics.paired_effects(
        base["tamping_interval_days"].to_numpy(float),
        other["tamping_interval_days"].to_numpy(float),
        base["censored_at_days"].to_numpy(float),
        other["censored_at_days"].to_numpy(float),
        change,
        table.tamping_cost_gbp_per_track_km,
        table.discount_rate,
    )


def _write_summary(job: _Job) -> None:
    """The table ``summary``: every number of the summary with its error."""
    results = read_results(job.out)
    columns = summary_columns(summary_rows(results))
    if len(columns["variant"]):
        job.write("summary", "summary.parquet", columns, range(job.study.run.realisations))


def _check_expansion(member: ParameterSet, case: Case, variant: str, scenario: str) -> str | None:
    """Compare the second-order form with every x and depth on fixed indices; a remark if it is off."""
    study = member.study
    if study.run.right_hand_side != "spectral":
        return None
    n = min(CHECKED_REALISATIONS, study.run.realisations)
    profiles = initial_profiles(study, range(n))
    rough = engine.expansion_error(case, profiles)
    if rough > 3e-3:
        where = f", parameter set {member.index}" if member.values else ""
        return (
            f"{variant} {scenario}{where}: the second-order form is off by {rough:.1%} of the "
            'growth; set [run] right_hand_side = "pointwise"'
        )
    return None


def _provenance(study: Study, prepared: StepA) -> store.Provenance:
    from mcsettle.kernels import runtime, spectral

    return store.Provenance(
        package_version=mcsettle.__version__,
        study_digest=study.digest,
        transfer_digest=prepared.digest,
        seed=study.seed,
        taichi_version=runtime.version(),
        precision="f64",
        lanes=spectral.LANES,
    )


def _ranges(n: int) -> Iterator[range]:
    for first in range(0, n, SHARD):
        yield range(first, min(n, first + SHARD))


def _refuse_smaller(out: Path, study: Study) -> None:
    """Refuse a folder that already holds more than is asked for."""
    names = [path.stem for path in (out / "realisations").glob("*.parquet")]
    held = [int(name.rsplit("-", 1)[-1]) + 1 for name in names]
    sets = [int(found[1]) + 1 for name in names if (found := re.search(r"--set(\d+)--", name))]
    for kind, n, asked in (
        ("realisations", max(held, default=0), study.run.realisations),
        ("parameter sets", max(sets, default=0), study.n_sets),
    ):
        if n > asked:
            raise InputError(
                f"'{out}' holds {n} {kind} and {asked} are asked for; "
                "ask for at least as many, or give another folder"
            )


def _drop_superseded(job: _Job, members: list[ParameterSet]) -> None:
    """Remove shards of an earlier, smaller run that the shards of this one contain."""
    wanted = {
        job.shard(member, v, s, r)
        for member in members
        for v in job.study.variant_names
        for s in job.study.scenario_names
        for r in job.ranges
    }
    for table in SHARDED:
        for path in (job.out / table).glob("*.parquet"):
            if path.name not in wanted:
                path.unlink()
