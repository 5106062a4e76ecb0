"""The chain: study → transfer functions → engine → tables. Run a study, or one slice of it.

Realisations are cut into shards of fixed index ranges, one set of shards for each variant, scenario
and parameter set; each shard is written whole or not at all, so an interrupted run goes on where it
stopped and the tables do not depend on batches, threads, slices or pauses.
"""

from dataclasses import dataclass, replace
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
from mcsettle.run.together import compute_together, own_step_a, worthwhile
from mcsettle.run.train_surrogate import set_predictor
from mcsettle.step_a.processes import together
from mcsettle.step_a.transfers import StepA, step_a
from mcsettle.storage import lock, store
from mcsettle.storage.foreign import refuse_others_files, refuse_others_folder
from mcsettle.storage.location import Place, Where, place
from mcsettle.storage.manifest import STUDY_FILE
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
from mcsettle.study.run_inputs import RunInputs, run_inputs
from mcsettle.study.study import Study
from mcsettle.summary.results import study_of
from mcsettle.types import Progress, silent


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
    """What a run knows before its first shard; ``processes`` are worth their start."""

    job: Job
    central: StepA
    todo: list[Shard]
    shards: list[Shard]
    processes: int


@computing()
def run_study(
    study: Study, out: Where, options: RunOptions | None = None, progress: Progress = silent
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
    refuse_foreign(at, study.digest, study.seed)
    with lock.held(at, "run" if part is None else f"shards {part}", options.take_over):
        ready = prepare(study, at, options, progress)
        job, central = ready.job, ready.central
        try:
            with together(ready.processes) as processes:
                if processes.pool is None:
                    compute(job, ready.todo, central)
                else:
                    compute_together(job, ready.todo, central, processes)
                if part is None:
                    job.remarks += close(at, job.run, job.provenance, central, processes)
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
    study: Study, at: Place, options: RunOptions, progress: Progress = silent, start: bool = True
) -> Prepared:
    """Do Step A, make the folder ready and find what is left to compute.

    ``start``: this process will compute, so Taichi is started with its threads.

    Raises
    ------
    InputError
        As ``run_study``.
    """
    from mcsettle.kernels import runtime

    run, present = run_inputs(study), provenance_of(at)
    size = options.shard_size or (SHARD if present is None else present.shard_realisations)
    shards = slice_of(all_shards(run.extent, size), options.shards)
    central = step_a(
        run.central.scenes, progress, options.processes, run.transfers, check_speeds=True
    )
    training = None
    if run.transfers is not None and run.predicts_grounds:
        if start:  # learning runs tracks, too, and Taichi keeps the threads it starts with
            shared = options.processes > 1 and run.stepping == "cycle_jump"
            runtime.running(1 if shared else options.threads)
        candidates = candidates_of(study)
        training = set_predictor(candidates, run.transfers, options.processes, progress)
        run = replace(run, sets=with_errors(run.sets, run.transfers))
    provenance = _provenance(run, central, size, training)
    same_study(at, provenance)
    job = Job(run, at, provenance, options, progress, list(central.remarks), held_shards(at))
    job.remarks += surrogate_remarks(run.sets, training)
    refuse_smaller(at, job.complete, run.extent)
    todo = [shard for shard in shards if not (shard.name in job.complete and job.is_whole(shard))]
    of_own = own_step_a(run.sets, run.transfers)
    processes = worthwhile(run.extent, run.stepping, todo, options, of_own)
    if start:
        job.options = replace(
            options, threads=runtime.running(1 if processes > 1 else options.threads)
        )
    store.prepare(at, provenance, finished=options.shards is not None and not todo)
    write_study(at, run, options.shards)
    if run.fitted:
        job.run = fit_sets(job, todo)
    return Prepared(job, central, todo, shards, processes)


def refuse_foreign(at: Place, digest: str, seed: int) -> None:
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
            {"study_digest": digest, "seed": seed},
            f"'{at}'",
            "give another folder",
        )
        refuse_others_files(at)


def write_study(at: Place, run: RunInputs, part: Slice | None) -> None:
    """The study beside its results; slices that run side by side have to agree on it.

    The files that it names are copied into a folder of their own, so that the folder stands alone.
    """
    try:
        before = at.text(STUDY_FILE, LARGEST_TEXT)
    except FileNotFoundError:
        before = ""
    if part is not None and before:
        n, asked = study_of(at).run.realisations, run.extent.realisations
        if n > asked:
            raise InputError(
                f"'{at}' is a run of {n} realisations and this slice one of {asked}; "
                "give every slice the same numbers"
            )
    for stored, path in run.files.items():
        if path.is_file():
            at.write(stored, path.read_bytes())
    if run.toml != before:
        at.write(STUDY_FILE, run.toml.encode())


def _provenance(
    run: RunInputs, prepared: StepA, size: int, training: Training | None
) -> Provenance:
    from mcsettle.kernels import backend, runtime, spectral

    return Provenance(
        package_version=mcsettle.__version__,
        study_digest=run.digest,
        transfer_digest=prepared.digest if training is None else training.digest,
        seed=run.seed,
        taichi_version=runtime.version(),
        precision=run.precision,
        lanes=spectral.LANES[run.precision],
        shard_realisations=size,
        code_digest=code_digest(),
        surrogate="" if training is None else training.text,
        runtime=backend.NAME,
    )
