"""An alarm around what might never end: the test fails, instead of waiting for ever."""

import contextlib
import signal
from collections.abc import Iterator

import pytest


@contextlib.contextmanager
def in_time(cpu: float = 5.0, wall: float = 60.0) -> Iterator[None]:
    """Fail what takes longer than ``cpu`` seconds of this process's time, or ``wall`` of anybody's.

    The failure is no ``Exception``: nothing under test can take it for a damaged file, as it could a
    ``TimeoutError``, which is an ``OSError``.
    """

    def ring(*_: object) -> None:
        pytest.fail("it takes too long")

    clocks = ((signal.ITIMER_PROF, signal.SIGPROF, cpu), (signal.ITIMER_REAL, signal.SIGALRM, wall))
    before = [signal.signal(number, ring) for _, number, _ in clocks]
    for clock, _, limit in clocks:
        signal.setitimer(clock, limit)
    try:
        yield
    finally:
        for (clock, number, _), handler in zip(clocks, before, strict=True):
            signal.setitimer(clock, 0.0)
            signal.signal(number, handler)
