"""The chain: study → transfer functions → engine → tables. Run a study, or one slice of it.

Realisations are cut into shards of fixed index ranges, one set of shards for each variant, scenario
and parameter set; each shard is written whole or not at all, so an interrupted run goes on where it
stopped and the tables do not depend on batches, threads, slices or pauses.
"""

from dataclasses import dataclass
from pathlib import Path

import mcsettle
from mcsettle.errors import InputError
from mcsettle.run.close import close, count_failed
from mcsettle.run.compute import Job, compute
from mcsettle.run.factor_fit import fit_sets
from mcsettle.run.scenario import build_case, initial_profiles, sample_days
from mcsettle.run.shards import Shard, Slice, all_shards, slice_of
from mcsettle.run.status import held_shards, refuse_smaller
from mcsettle.run.transfers import Shelf, StepA, step_a
from mcsettle.storage import lock, store
from mcsettle.storage.foreign import refuse_others_files, refuse_others_folder
from mcsettle.storage.location import Place, Where, place
from mcsettle.storage.manifest import INPUTS, STUDY_FILE
from mcsettle.storage.provenance import (
    LARGEST_TEXT,
    SHARD,
    Provenance,
    provenance_of,
    refuse_difference,
    same_study,
)
from mcsettle.storage.shard_record import read_record
from mcsettle.study.parameter_sets import ParameterSet, all_sets
from mcsettle.study.study import Study, resolved_toml
from mcsettle.summary.results import study_of
from mcsettle.types import Progress

__all__ = ["Finished", "build_case", "initial_profiles", "run_study", "sample_days"]


@dataclass(frozen=True)
class Finished:
    """A finished run, or slice: its folder, how many of its rows failed, the remarks to pass on.

    ``closed``: the whole run is complete; a slice leaves that to ``closing.gather``.
    """

    folder: Path
    n_failed: int
    remarks: tuple[str, ...]
    closed: bool = True
    n_shards: int = 0
    n_computed: int = 0


@dataclass(frozen=True)
class Prepared:
    """What a run knows before its first shard."""

    job: Job
    members: list[ParameterSet]
    central: StepA
    shelf: Shelf | None
    todo: list[Shard]
    shards: list[Shard]


def run_study(
    study: Study,
    out: Where,
    realisations: int | None = None,
    seed: int | None = None,
    threads: int | None = None,
    batch: int | None = None,
    exact: bool = False,
    progress: Progress | None = None,
    processes: int = 1,
    parameter_sets: int | None = None,
    shards: Slice | None = None,
    shard_size: int | None = None,
    take_over: bool = False,
) -> Finished:
    """Run every variant and scenario of ``study`` into the folder ``out``; resumes what is there.

    Parameters
    ----------
    study : Study
    out : folder of the results (a path or its text), or the URL of one in an object store
    realisations, seed, parameter_sets : replace the study's own
    threads : Taichi threads (None: all cores)
    batch : realisations advanced at a time; changes memory and speed, not results
    exact : update after every axle passage, whatever the study's stepping
    progress : called as progress(stage, done, total)
    processes : spawned for Step A (more than 1 needs a main guard in the calling program)
    shards : compute this slice alone and leave the run open (``closing.gather`` closes it)
    shard_size : realisations of a shard (None: as the folder has it, else 2048)
    take_over : take away locks that processes of other hosts have left

    Raises
    ------
    InputError
        A parameter set the study would refuse; the folder cannot be written, holds results of
        something else, or another run is at work there.
    """
    study = study.with_run(realisations, seed, "every_axle" if exact else None, parameter_sets)
    at = place(out)
    role = "run" if shards is None else f"shards {shards}"
    refuse_foreign(at, study)
    with lock.held(at, role, take_over):
        ready = prepare(study, at, threads, batch, progress, processes, shards, shard_size)
        job = ready.job
        compute(job, ready.members, ready.todo, ready.central, ready.shelf, processes)
        if shards is None:
            job.remarks += close(at, study, ready.members, job.provenance)
            n_failed = count_failed(at)
        else:
            records = (read_record(at, s.name, job.provenance) for s in ready.shards)
            n_failed = sum(found.n_failed for found in records if found is not None)
    return Finished(
        Path(str(out)),
        n_failed,
        tuple(dict.fromkeys(job.remarks)),
        shards is None,
        len(ready.shards),
        len(ready.todo),
    )


def prepare(
    study: Study,
    at: Place,
    threads: int | None = None,
    batch: int | None = None,
    progress: Progress | None = None,
    processes: int = 1,
    part: Slice | None = None,
    shard_size: int | None = None,
    start: bool = True,
) -> Prepared:
    """Do Step A, make the folder ready and find what is left to compute.

    ``start``: this process will compute, so Taichi is started with its threads.

    Raises
    ------
    InputError
        As ``run_study``.
    """
    from mcsettle.kernels import runtime

    members = all_sets(study)
    held = provenance_of(at)
    size = shard_size or (SHARD if held is None else held.shard_realisations)
    shards = slice_of(all_shards(study, size), part)
    shelf = Shelf.of(study) if study.nested else None
    sound = next((member.study for member in members if not member.failure), study)
    central = step_a(
        sound if study.grounds_table else study, progress, processes, shelf, check_speeds=True
    )
    if start:  # before anything starts it with other threads
        runtime.start(threads)
    provenance = _provenance(study, central, size)
    same_study(at, provenance)
    remarks, held_now = list(central.remarks), held_shards(at)
    job = Job(study, at, provenance, threads, batch, progress, remarks, held_now)
    refuse_smaller(at, job.held, study)
    todo = [shard for shard in shards if not (shard.name in job.held and job.is_whole(shard))]
    store.prepare(at, provenance, finished=part is not None and not todo)
    _write_study(at, study, part)
    if shelf is not None and study.fitted:
        needed = {shard.member for shard in todo}
        members = fit_sets(study, members, needed, at, provenance, shelf, progress, processes)
    return Prepared(job, members, central, shelf, todo, shards)


def refuse_foreign(at: Place, study: Study) -> None:
    """Refuse a folder of something else, another study or seed, before anything is computed.

    Raises
    ------
    InputError
        The message names the differences, or a file that is not ours.
    """
    refuse_others_folder(at)
    stored = provenance_of(at)
    if stored is not None:
        refuse_difference(
            {"study_digest": stored.study_digest, "seed": stored.seed},
            {"study_digest": study.digest, "seed": study.seed},
            f"'{at}'",
            "give another folder",
        )
        refuse_others_files(at)


def _write_study(at: Place, study: Study, part: Slice | None) -> None:
    """The study beside its results; slices that run side by side have to agree on it.

    The files that it names are copied into a folder of their own, so that the folder stands alone.
    """
    inputs = _stored_inputs(study)
    text = resolved_toml(study, {name: stored for name, (stored, _) in inputs.items()})
    try:
        before = at.text(STUDY_FILE, LARGEST_TEXT)
    except FileNotFoundError:
        before = ""
    if part is not None and before:
        n, asked = study_of(at).run.realisations, study.run.realisations
        if n > asked:
            raise InputError(
                f"'{at}' is a run of {n} realisations and this slice one of {asked}; "
                "give every slice the same numbers"
            )
    for stored, path in inputs.values():
        if path.is_file():
            at.write(stored, path.read_bytes())
    if text != before:
        at.write(STUDY_FILE, text.encode())


def _stored_inputs(study: Study) -> dict[str, tuple[str, Path]]:
    """Names that the study's files have in a results folder, and their paths, by key path.

    Each has a folder of its own, so that none meets a file of the run or another input. A file outside
    the study's folder stays there.
    """
    return {
        key: (f"{INPUTS}/{key}/{Path(name).name}", path)
        for key, (name, path) in study.input_files().items()
        if not Path(name).is_absolute() and ".." not in Path(name).parts
    }


def _provenance(study: Study, prepared: StepA, size: int) -> Provenance:
    from mcsettle.kernels import runtime, spectral

    return Provenance(
        package_version=mcsettle.__version__,
        study_digest=study.digest,
        transfer_digest=prepared.digest,
        seed=study.seed,
        taichi_version=runtime.version(),
        precision=study.run.precision,
        lanes=spectral.LANES[study.run.precision],
        shard_realisations=size,
    )
