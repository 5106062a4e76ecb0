"""The chain: study → transfer functions → engine → tables. Run a study, or one slice of it.

Realisations are cut into shards of fixed index ranges, one set of shards for each variant, scenario
and parameter set; each shard is written whole or not at all, so an interrupted run goes on where it
stopped and the tables do not depend on batches, threads, slices or pauses.
"""

from dataclasses import dataclass
from pathlib import Path

import mcsettle
from mcsettle.errors import InputError, computing
from mcsettle.run.close import close, count_failed
from mcsettle.run.code_digest import code_digest
from mcsettle.run.compute import Job, compute
from mcsettle.run.factor_fit import fit_sets
from mcsettle.run.options import RunOptions
from mcsettle.run.shards import Shard, Slice, all_shards, slice_of
from mcsettle.run.status import held_shards, refuse_smaller
from mcsettle.run.surrogate import Training, surrogate_remarks, with_errors
from mcsettle.run.together import compute_together, worthwhile
from mcsettle.run.train_surrogate import set_predictor
from mcsettle.run.transfer_store import transfer_store
from mcsettle.step_a.processes import together
from mcsettle.step_a.transfers import StepA, TransferStore, step_a
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
from mcsettle.study.candidates import candidates_of
from mcsettle.study.parameter_sets import ParameterSet, all_sets
from mcsettle.study.study import Study, resolved_toml
from mcsettle.summary.results import study_of
from mcsettle.types import Progress


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
    transfers: TransferStore | None
    todo: list[Shard]
    shards: list[Shard]


@computing()
def run_study(
    study: Study,
    out: Where,
    options: RunOptions | None = None,
    progress: Progress | None = None,
) -> Finished:
    """Run every variant and scenario of ``study`` into the folder ``out``; resumes what is there.

    Parameters
    ----------
    study : Study
    out : folder of the results (a path or its text), or the URL of one in an object store
    options : RunOptions; None: the study's own sample, all cores
    progress : called as progress(stage, done, total)

    Raises
    ------
    InputError
        A parameter set the study would refuse; the folder cannot be written, holds results of
        something else, or another run is at work there.
    NumericalError
        The inputs lead to numbers that cannot be computed.
    """
    options = options or RunOptions()
    study, at, part = options.applied_to(study), place(out), options.shards
    refuse_foreign(at, study)
    with lock.held(at, "run" if part is None else f"shards {part}", options.take_over):
        ready = prepare(study, at, options, progress)
        job, members, central = ready.job, ready.members, ready.central
        try:
            with together(worthwhile(job, ready.todo)) as processes:
                if processes.pool is None:
                    compute(job, members, ready.todo, central, ready.transfers)
                else:
                    compute_together(job, members[0], ready.todo, central, processes)
                if part is None:
                    job.remarks += close(at, study, members, job.provenance, central, processes)
        except BaseException:
            if part is None:  # what processes that were ended had begun to write
                at.sweep()
            raise
        if part is None:
            n_failed = count_failed(at)
        else:
            records = (read_record(at, shard.name, job.provenance) for shard in ready.shards)
            n_failed = sum(record.n_failed for record in records if record is not None)
    return Finished(
        Path(str(out)),
        n_failed,
        tuple(dict.fromkeys(job.remarks)),
        part is None,
        len(ready.shards),
        len(ready.todo),
    )


def prepare(
    study: Study,
    at: Place,
    options: RunOptions,
    progress: Progress | None = None,
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

    members, present = all_sets(study), provenance_of(at)
    size = options.shard_size or (SHARD if present is None else present.shard_realisations)
    shards = slice_of(all_shards(study, size), options.shards)
    transfers = transfer_store(study) if study.nested else None
    valid = next((member.study for member in members if not member.failure), study)
    scenes = (valid if study.grounds_table else study).scenes
    central = step_a(scenes, progress, options.processes, transfers, check_speeds=True)
    training = None
    if transfers is not None and study.predicts_grounds:
        training = set_predictor(candidates_of(study), transfers, options.processes, progress)
        members = with_errors(members, transfers)
    if start:  # before anything starts it with other threads
        runtime.start(options.threads)
    provenance = _provenance(study, central, size, training)
    same_study(at, provenance)
    job = Job(study, at, provenance, options, progress, list(central.remarks), held_shards(at))
    job.remarks += surrogate_remarks(members, training)
    refuse_smaller(at, job.complete, study)
    todo = [shard for shard in shards if not (shard.name in job.complete and job.is_whole(shard))]
    store.prepare(at, provenance, finished=options.shards is not None and not todo)
    _write_study(at, study, options.shards)
    if transfers is not None and study.fitted:
        needed = {shard.member for shard in todo}
        members = fit_sets(
            study, members, needed, at, provenance, transfers, progress, options.processes
        )
    return Prepared(job, members, central, transfers, todo, shards)


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


def _provenance(study: Study, prepared: StepA, size: int, training: Training | None) -> Provenance:
    from mcsettle.kernels import backend, runtime, spectral

    return Provenance(
        package_version=mcsettle.__version__,
        study_digest=study.digest,
        transfer_digest=prepared.digest if training is None else training.digest,
        seed=study.seed,
        taichi_version=runtime.version(),
        precision=study.run.precision,
        lanes=spectral.LANES[study.run.precision],
        shard_realisations=size,
        code_digest=code_digest(),
        surrogate="" if training is None else training.text,
        runtime=backend.NAME,
    )
