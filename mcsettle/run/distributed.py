"""A run spread over processes and machines by Dask: numbers of shards go out, workers write them.

The client does Step A, has the missing shards made by the workers (``dispatch``) and closes the run; the
folder ends byte for byte as that of a run on one machine.
"""

import contextlib
import re
from collections import deque
from collections.abc import Callable, Iterator
from pathlib import Path

from mcsettle.errors import InputError, computing
from mcsettle.run.close import close, count_failed
from mcsettle.run.dispatch import Tally, Work, drive
from mcsettle.run.options import RunOptions
from mcsettle.run.pipeline import Finished, prepare, refuse_foreign
from mcsettle.run.worker import RunSpec, share_step_a
from mcsettle.storage import lock
from mcsettle.storage.location import Where, place
from mcsettle.study.study import Study
from mcsettle.types import Progress, silent

_LOCAL = re.compile(r"local(?::([1-9][0-9]{0,3}))?")
_ADDRESS = re.compile(r"(tcp|tls|ws|wss)://[^\s/]+:[0-9]{1,5}")


def parse_scheduler(text: str) -> tuple[str, int | None]:
    """Address and number of local workers that ``--scheduler`` asks for.

    Raises
    ------
    InputError
        It is neither ``local``, ``local:N`` nor an address.

    Examples
    --------
    >>> parse_scheduler("local:2"), parse_scheduler("tcp://head:8786")
    (('local', 2), ('tcp://head:8786', None))
    """
    local = _LOCAL.fullmatch(text)
    if local:
        return "local", int(local[1]) if local[1] else None
    if _ADDRESS.fullmatch(text):
        return text, None
    raise InputError(
        f'scheduler= received "{text}"; it takes local, local:N (processes of this machine) or the '
        "address of a scheduler, such as tcp://host:8786"
    )


@computing()
def run_distributed(
    study: Study,
    out: Where,
    scheduler: str,
    options: RunOptions | None = None,
    progress: Progress = silent,
    tell: Callable[[str], None] = lambda _: None,
) -> Finished:
    """``pipeline.run_study`` by the workers of a Dask scheduler; the folder ends byte for byte as there.

    Parameters
    ----------
    study, out, progress : as ``run_study``
    scheduler : "local", "local:N", or the address of a scheduler whose workers see ``out``
    options : RunOptions without ``shards``; ``threads`` are those of each worker (None: its share of
        this machine's cores for local ones, else 1)
    tell : is told what a person should know

    Raises
    ------
    InputError
        As ``run_study``; the extra ``distributed`` is not installed; no scheduler answers.
    """
    parse_scheduler(scheduler)
    _wants_distributed()
    options = options or RunOptions()
    study, at = options.applied_to(study), place(out)
    refuse_foreign(at, study.digest, study.seed)
    with lock.held(at, "run", options.take_over):
        ready = prepare(study, at, options, progress, start=False)
        job, todo = ready.job, {shard.name for shard in ready.todo}
        numbers = deque(n for n, shard in enumerate(ready.shards) if shard.name in todo)
        tally = Tally(len(ready.shards))
        if numbers:
            extent = job.run.extent
            if not extent.nested:
                share_step_a(at, ready.central)
            with workers(scheduler, options.processes) as (address, share):
                threads = options.threads or share
                spec = RunSpec(at.where, job.provenance.digest, extent, threads, options.batch)
                drive(Work(ready, numbers, tally, spec, tell), address, progress)
        remarks = close(at, job.run, job.provenance, ready.central)
        n_failed = count_failed(at)
    told = dict.fromkeys((*job.remarks, *tally.remarks, *remarks))
    failed = (f"shard {name}: {why}" for name, why in tally.failed.items())
    return Finished(
        Path(str(out)), n_failed, (*told, *failed), True, tally.n_shards, tally.computed
    )


def _wants_distributed() -> None:
    try:
        import distributed  # noqa: F401
    except ImportError:
        raise InputError(
            "scheduler= needs the extra 'distributed': pip install 'mcsettle[distributed]'"
        ) from None


@contextlib.contextmanager
def workers(scheduler: str, cores: int) -> Iterator[tuple[str, int]]:
    """Address of the scheduler and threads of each worker; local ones live as long as the context.

    Parameters
    ----------
    scheduler : as for ``run_distributed``
    cores : of this machine, shared by local workers

    Raises
    ------
    InputError
        ``scheduler`` is none; the extra ``distributed`` is not installed.
    """
    address, n = parse_scheduler(scheduler)
    _wants_distributed()
    if address != "local":
        yield address, 1
        return
    from distributed import LocalCluster

    n = n or max(1, cores)
    with LocalCluster(
        n_workers=n,
        threads_per_worker=1,
        processes=True,
        dashboard_address=None,
        memory_limit=0,
        silence_logs=50,
    ) as cluster:
        yield cluster.scheduler_address, max(1, cores // n)
