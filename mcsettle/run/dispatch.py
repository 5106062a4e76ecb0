"""Shards sent to Dask workers, a bounded window at a time, and their answers taken in.

Numbers of shards go out; each one is forgotten when it is answered, so the memory of client and scheduler
does not grow with the run. A shard is tried again where its worker dies or it raises; one that fails
every time becomes rows of status ``failed`` that say why. If the scheduler goes away, the client waits
for it to come back and sends what was unanswered again; a worker that finds a shard whole leaves it.
"""

import asyncio
import contextlib
import os
import socket
import time
from collections import deque
from collections.abc import Callable, Iterator
from concurrent import futures
from dataclasses import dataclass, field
from typing import Any

from mcsettle.errors import InputError
from mcsettle.run.compute import failed_tables
from mcsettle.run.pipeline import Prepared
from mcsettle.run.worker import RunSpec, work
from mcsettle.types import Progress

WINDOW = 2  # shards out at a time for each worker
RETRIES = 2  # of a shard that raises; a shard whose workers die has the scheduler's own
PATIENCE = 600.0  # s without a scheduler, or without workers, before giving up
FIRST_PATIENCE = 60.0  # s, where none has answered yet: the address is probably wrong
ANSWER = 3.0  # s in which a scheduler greets who connects to it
NO_WORKERS = 5.0  # s without workers before it is said
POLL = 0.5  # s


@dataclass
class Tally:
    """How a distributed run went; ``remarks`` without repetition, ``failed`` for good by shard."""

    n_shards: int
    answered: int = 0
    computed: int = 0
    failed: dict[str, str] = field(default_factory=dict)
    remarks: dict[str, None] = field(default_factory=dict)


@dataclass
class Work:
    """What is still to be answered: numbers waiting, and futures out by number."""

    ready: Prepared
    numbers: deque[int]
    tally: Tally
    spec: RunSpec
    tell: Callable[[str], None]
    out: dict[int, Any] = field(default_factory=dict)
    sent: int = 0
    idle_since: float | None = None  # without workers
    told_idle: bool = False
    name: str = field(default_factory=lambda: os.urandom(4).hex())  # of this client's tasks


def drive(job: Work, address: str, progress: Progress) -> None:
    """Send numbers and take answers until there are no more, through any loss of the scheduler."""
    missing_since: float | None = None
    patience = FIRST_PATIENCE
    while job.numbers or job.out:
        try:
            _refuse_silent(address)
            with _client(address) as client:
                missing_since, patience = None, PATIENCE
                while job.numbers or job.out:
                    _send(job, client)
                    _take(job, client)
                    _await_workers(job, client, address)
                    progress("Shards", job.tally.answered, job.tally.n_shards)
        except _GONE:
            _call_back(job)
            now = time.monotonic()
            if missing_since is None:
                missing_since = now
                job.tell(f"The scheduler {address} does not answer; waiting for it")
            if now - missing_since > patience:
                raise InputError(
                    f"no scheduler answers at {address}; start 'dask scheduler' there: the same "
                    "command goes on from what is there"
                ) from None
            time.sleep(POLL)


def _refuse_silent(address: str) -> None:
    """Look whether a scheduler listens at ``address``, before a client waits for one.

    Raises
    ------
    OSError
        Nobody takes the connection, or what takes it does not greet as a scheduler does.
    """
    scheme, _, place = address.partition("://")
    if scheme not in ("tcp", "tls", "ws", "wss"):
        return
    host, _, port = place.rpartition(":")
    with socket.create_connection((host.strip("[]"), int(port)), timeout=ANSWER) as line:
        line.settimeout(ANSWER)
        if scheme == "tcp" and not line.recv(1):
            raise ConnectionError(f"{address} closes the connection")


def _await_workers(job: Work, client: Any, address: str) -> None:
    """Say that a scheduler has no workers, and give up when that does not change.

    Raises
    ------
    InputError
        It has had none for ``PATIENCE`` seconds.
    """
    if client.scheduler_info(n_workers=-1)["workers"]:
        job.idle_since = None
        return
    now = time.monotonic()
    before, job.idle_since = job.idle_since, now if job.idle_since is None else job.idle_since
    if before is None:
        return
    remedy = f"start 'dask worker {address}' where the results folder can be reached"
    if now - job.idle_since > PATIENCE:
        raise InputError(f"the scheduler {address} has no workers; {remedy}: the same command goes on "
                         "from what is there")  # fmt: skip
    if not job.told_idle and now - job.idle_since > NO_WORKERS:
        job.told_idle = True
        job.tell(f"The scheduler {address} has no workers; waiting for some: {remedy}")


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


def _send(job: Work, client: Any) -> None:
    """Fill the window."""
    if not job.numbers:
        return
    room = WINDOW * max(1, len(client.scheduler_info(n_workers=-1)["workers"])) - len(job.out)
    for _ in range(min(room, len(job.numbers))):
        number = job.numbers.popleft()
        job.sent += 1
        job.out[number] = client.submit(
            work,
            job.spec,
            number,
            key=f"shard-{job.name}-{number}-{job.sent}",
            retries=RETRIES,
            pure=False,
        )


def _take(job: Work, client: Any) -> None:
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
            job.tally.remarks |= dict.fromkeys(done.remarks)
        elif future.status == "error":
            _settle(job, number, future.exception(timeout=30))
        elif future.status == "pending":
            continue
        else:  # cancelled or lost: the scheduler was another one for a while
            job.numbers.appendleft(number)
        del job.out[number]  # not before its answer is here: asking for it may fail
        future.release()


def _settle(job: Work, number: int, error: BaseException) -> None:
    """A shard failed every time: rows that say so. A folder that cannot be used ends the run."""
    if isinstance(error, InputError):
        raise error
    shard = job.ready.shards[number]
    reason = f"{type(error).__name__}: {error}".splitlines()[0][:300]
    member = job.ready.job.run.sets[shard.member]
    scene = next(scene for scene in member.scenes if shard.is_of(scene))
    text = f"the shard could not be computed ({reason})"
    job.ready.job.write(shard, failed_tables(member, scene, shard, text), failure=text)
    job.tally.answered += 1
    job.tally.failed[shard.name] = text
    job.tell(f"shard {shard.name} failed {RETRIES + 1} times: {reason}")


def _call_back(job: Work) -> None:
    """Put everything that is out back among those waiting."""
    job.numbers.extendleft(sorted(job.out, reverse=True))
    job.out.clear()
