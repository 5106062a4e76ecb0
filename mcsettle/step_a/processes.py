"""Processes beside this one: spawned, one BLAS thread each, and gone when their parent is."""

import ctypes
import multiprocessing
import os
import signal
import sys
import threading
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import CancelledError, Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from functools import cache
from queue import SimpleQueue
from typing import Any, TypeVar

T = TypeVar("T")
END = 5.0  # s that a process that was told to end is waited for
WORKER = {"OPENBLAS_NUM_THREADS": "1"}  # environment of a spawned process
M_MMAP_THRESHOLD, M_TRIM_THRESHOLD = -3, -1  # parameters of glibc's mallopt
KEPT = (2**25, 2**30)  # bytes; older ones refuse the second


def cores() -> int:
    """Cores this process may use; not every system tells those from the machine's."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


@contextmanager
def process_pool(n: int) -> Iterator[ProcessPoolExecutor]:
    """``n`` spawned processes, for as long as the context lasts.

    Left by an error, or an interrupt, it ends them at once, whatever they are at: what they have not
    put into the cache folder is lost, and nothing waits for it.
    """
    others = set(multiprocessing.active_children())
    context = multiprocessing.get_context("spawn")
    with _environment():
        pool = ProcessPoolExecutor(n, mp_context=context, initializer=_begin)
        try:
            yield pool
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            ours = set(multiprocessing.active_children()) - others
            for process in ours:
                process.terminate()
            for process in ours:
                process.join(END)
            raise
        pool.shutdown(wait=True, cancel_futures=True)


class Together:
    """Processes that share out tasks: those of ``pool`` and this one, or this one alone."""

    def __init__(self, pool: ProcessPoolExecutor | None = None, n: int = 0) -> None:
        self.pool, self.in_flight = pool, n + 1 if pool else 0  # one more waits in the pool

    def map(
        self,
        function: Callable[..., T],
        arguments: Sequence[tuple[Any, ...]],
        told: Callable[[int], None] = lambda _: None,
        here: Callable[..., T] | None = None,
    ) -> list[T]:
        """``function(*one)`` for each of ``arguments``; ``told`` of each that is done, by its index.

        The others begin with the first, this process with the last, by ``here`` if it has a way of its
        own. Where one of them has died this process does the rest.
        """
        here = here or function
        todo, finished = deque(range(len(arguments))), SimpleQueue[tuple[int, Future[T]] | None]()
        for _ in range(self.in_flight):
            feeder = (self.pool, function, arguments, todo, finished)
            threading.Thread(target=_feed, args=feeder, daemon=True).start()
        results: dict[int, T] = {}
        while len(results) < len(arguments):
            own = _taken(todo.pop if self.pool else todo.popleft)
            waits = own is None
            if own is not None:
                results[own] = here(*arguments[own])
                told(own)
            while waits or not finished.empty():
                waits, answer = False, finished.get()
                if answer is not None:  # None: one has no more to hand out, or has given it back
                    index, future = answer
                    results[index] = future.result()
                    told(index)
        return [results[i] for i in range(len(arguments))]


def _feed(
    pool: ProcessPoolExecutor,
    function: Callable[..., T],
    arguments: Sequence[tuple[Any, ...]],
    todo: deque[int],
    finished: "SimpleQueue[tuple[int, Future[T]] | None]",
) -> None:
    """Hand out tasks, the first first, one at a time, until there is none or a process has died.

    The pool has no task that this process may still take: to cancel one while a process dies breaks it.
    """
    while (index := _taken(todo.popleft)) is not None:
        try:
            future = pool.submit(function, *arguments[index])
            died = isinstance(future.exception(), BrokenProcessPool)
        # The pool is broken, or was shut down after an error here.
        except (RuntimeError, CancelledError):
            died = True
        if died:
            todo.append(index)
            break
        finished.put((index, future))
    finished.put(None)


def _taken(draw: Callable[[], int]) -> int | None:
    """The task that is drawn; None where another has taken the last."""
    try:
        return draw()
    except IndexError:
        return None


@cache
def keep_freed_memory() -> None:
    """From now on this process keeps the memory that it frees, where its C library is glibc.

    Every factorisation takes tens of megabytes; their pages given back, the system would clear them
    again each time (a sixth of Step A or more).
    """
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None) if sys.platform == "linux" else None
    if mallopt is not None:
        for most in KEPT:
            mallopt(M_MMAP_THRESHOLD, most)
            mallopt(M_TRIM_THRESHOLD, most)


@contextmanager
def together(n: int) -> Iterator[Together]:
    """``n`` processes, this one among them, for as long as the context lasts."""
    if n < 2:
        yield Together()
        return
    with process_pool(n - 1) as pool:
        yield Together(pool, n - 1)


ALONE = Together()


def _begin() -> None:
    """What a new process of a pool does first."""
    keep_freed_memory()
    _end_with_parent()


def _end_with_parent() -> None:
    """In a new process: end when the parent does, however that is, and leave Ctrl-C to it."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    threading.Thread(target=_await_parent, daemon=True).start()


def _await_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()  # its end of a pipe is closed by the system, whatever ends it
        os._exit(1)


@contextmanager
def _environment() -> Iterator[None]:
    """Environment for processes spawned inside; afterwards that of this process is restored."""
    before = {name: os.environ.get(name) for name in WORKER}
    os.environ.update(WORKER)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value
