"""A run spread over processes and machines by Dask: numbers of shards go out, workers write them.

The client does Step A, then sends the numbers of the missing shards, a bounded window at a time, and
forgets each one when it is answered: its memory and the scheduler's do not grow with the run. A shard is
tried again where its worker dies or it raises; one that fails every time becomes rows of status
``failed`` that say why, and the run goes on. If the scheduler goes away, the client waits for it to come
back and sends what was unanswered again; a worker that finds a shard whole leaves it.

Depends on: closing, errors, lock, pipeline, place, step_b, study, worker; inside: distributed.
"""

import asyncio
import contextlib
import re
import time
from collections import deque
from collections.abc import Callable, Iterator
from concurrent import futures
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from mcsettle import lock
from mcsettle.closing import close, count_failed
from mcsettle.errors import InputError
from mcsettle.pipeline import Finished, Prepared, prepare, refuse_foreign
from mcsettle.place import Where, place
from mcsettle.step_b import failed_tables
from mcsettle.study import Study
from mcsettle.worker import share_step_a, work

WINDOW = 2  # shards out at a time for each worker
RETRIES = 2  # of a shard that raises; a shard whose workers die has the scheduler's own
PATIENCE = 600.0  # s without a scheduler before giving up
POLL = 0.5  # s
_LOCAL = re.compile(r"local(?::([1-9][0-9]{0,3}))?")
_ADDRESS = re.compile(r"(tcp|tls|ws|wss)://[^\s/]+:[0-9]{1,5}")


@dataclass
class Tally:
    """How a distributed run went."""

    n_shards: int
    answered: int = 0
    computed: int = 0
    failed: list[str] = field(default_factory=list)


@dataclass
class _Work:
    """What is still to be answered: numbers waiting, and futures out by number."""

    ready: Prepared
    numbers: deque[int]
    tally: Tally
    threads: int | None
    batch: int | None
    tell: Callable[[str], None]
    out: dict[int, Any] = field(default_factory=dict)
    sent: int = 0


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
        f'--scheduler received "{text}"; it takes local, local:N (processes of this machine) or the '
        "address of a scheduler, such as tcp://host:8786"
    )


def run_distributed(
    study: Study,
    out: Where,
    scheduler: str,
    realisations: int | None = None,
    seed: int | None = None,
    threads: int | None = None,
    batch: int | None = None,
    exact: bool = False,
    progress: Callable[[str, int, int], None] | None = None,
    processes: int = 1,
    parameter_sets: int | None = None,
    shard_size: int | None = None,
    take_over: bool = False,
    tell: Callable[[str], None] = lambda _: None,
) -> Finished:
    """``pipeline.run_study`` by the workers of a Dask scheduler; the folder ends byte for byte as there.

    Parameters
    ----------
    scheduler : "local", "local:N", or the address of a scheduler whose workers see ``out``
    threads : of each worker (None: its share of this machine's cores for local ones, else 1)
    tell : is told what a person should know
    others : as ``run_study``

    Raises
    ------
    InputError
        As ``run_study``; the extra ``distributed`` is not installed; no scheduler answers.
    """
    address, n_workers = parse_scheduler(scheduler)
    _wants_distributed()
    study = study.with_run(realisations, seed, "every_axle" if exact else None, parameter_sets)
    at = place(out)
    refuse_foreign(at, study)
    with lock.held(at, "run", take_over):
        ready = prepare(
            study, at, None, batch, progress, processes, shard_size=shard_size, start=False
        )
        numbers = _numbers(ready)
        tally = Tally(len(ready.shards))
        if numbers:
            if not study.uncertain:
                share_step_a(at, ready.central)
            with _scheduler(address, n_workers, processes) as (found, share):
                job = _Work(ready, numbers, tally, threads or share, batch, tell)
                _drive(job, found, progress)
        close(at, study, ready.members, ready.job.provenance)
        n_failed = count_failed(at)
    remarks = tuple(f"shard {name}: {why}" for name, why in _failures(tally))
    return Finished(Path(str(out)), n_failed, remarks, True, tally.n_shards, tally.computed)


def _failures(tally: Tally) -> Iterator[tuple[str, str]]:
    for text in tally.failed:
        name, _, why = text.partition("\n")
        yield name, why


def _numbers(ready: Prepared) -> deque[int]:
    """Numbers of the shards that are left to compute, in order."""
    todo = {shard.name for shard in ready.todo}
    return deque(n for n, shard in enumerate(ready.shards) if shard.name in todo)


def _wants_distributed() -> None:
    try:
        import distributed  # noqa: F401
    except ImportError:
        raise InputError(
            "--scheduler needs the extra 'distributed': pip install 'mcsettle[distributed]'"
        ) from None


@contextlib.contextmanager
def _scheduler(address: str, n: int | None, cores: int) -> Iterator[tuple[str, int]]:
    """Address of the scheduler and threads of each worker; local ones live as long as the run."""
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


def _drive(job: _Work, address: str, progress: Callable[[str, int, int], None] | None) -> None:
    """Send numbers and take answers until there are no more, through any loss of the scheduler."""
    missing_since: float | None = None
    while job.numbers or job.out:
        try:
            with _client(address) as client:
                missing_since = None
                while job.numbers or job.out:
                    _send(job, client)
                    _take(job, client)
                    if progress is not None:
                        progress("Shards", job.tally.answered, job.tally.n_shards)
        except _GONE:
            _call_back(job)
            now = time.monotonic()
            if missing_since is None:
                missing_since = now
                job.tell(f"The scheduler {address} does not answer; waiting for it")
            if now - missing_since > PATIENCE:
                raise InputError(
                    f"no scheduler answers at {address}; start 'dask scheduler' there: the same "
                    "command goes on from what is there"
                ) from None
            time.sleep(POLL)


class _LostError(Exception):
    """The scheduler has gone away."""


# What may reach us of a scheduler's end: errors of connections are OSErrors.
_GONE = (_LostError, OSError, TimeoutError, asyncio.CancelledError, futures.CancelledError)


@contextlib.contextmanager
def _client(address: str) -> Iterator[Any]:
    """A connection to the scheduler; ``_LostError`` where there is none."""
    from distributed import Client

    try:
        client = Client(address, timeout="10s", set_as_default=False)
    except (OSError, TimeoutError, ValueError) as error:
        raise _LostError from error
    try:
        yield client
    finally:
        with contextlib.suppress(Exception):  # it may be half gone
            client.close(timeout=2)


def _send(job: _Work, client: Any) -> None:
    """Fill the window."""
    if not job.numbers:
        return
    room = WINDOW * max(1, len(client.scheduler_info(n_workers=-1)["workers"])) - len(job.out)
    at, provenance = job.ready.job.at, job.ready.job.provenance
    for _ in range(min(room, len(job.numbers))):
        number = job.numbers.popleft()
        job.sent += 1
        job.out[number] = client.submit(
            work,
            at.where,
            provenance.digest,
            number,
            job.threads,
            job.batch,
            key=f"shard-{provenance.digest[:8]}-{number}-{job.sent}",
            retries=RETRIES,
            pure=False,
        )


def _take(job: _Work, client: Any) -> None:
    """Wait a moment for answers and take them in; what was lost goes back to those waiting."""
    from distributed import wait

    with contextlib.suppress(TimeoutError, OSError), client.as_current():
        if job.out:
            wait(list(job.out.values()), timeout=POLL, return_when="FIRST_COMPLETED")
    if client.status != "running":
        raise _LostError
    for number, future in list(job.out.items()):
        if future.status == "finished":
            done = future.result(timeout=30)
            job.tally.answered += 1
            job.tally.computed += done.computed
        elif future.status == "error":
            _settle(job, number, future.exception(timeout=30))
        elif future.status == "pending":
            continue
        else:  # cancelled or lost: the scheduler was another one for a while
            job.numbers.appendleft(number)
        del job.out[number]  # not before its answer is here: asking for it may fail
        future.release()


def _settle(job: _Work, number: int, error: BaseException) -> None:
    """A shard failed every time: rows that say so. A folder that cannot be used ends the run."""
    if isinstance(error, InputError):
        raise error
    shard = job.ready.shards[number]
    reason = f"{type(error).__name__}: {error}".splitlines()[0][:300]
    member = job.ready.members[shard.member]
    text = f"the shard could not be computed ({reason})"
    job.ready.job.write(shard, failed_tables(member, shard, text), failure=text)
    job.tally.answered += 1
    job.tally.failed.append(f"{shard.name}\n{text}")
    job.tell(f"shard {shard.name} failed {RETRIES + 1} times: {reason}")


def _call_back(job: _Work) -> None:
    """Put everything that is out back among those waiting."""
    job.numbers.extendleft(sorted(job.out, reverse=True))
    job.out.clear()
