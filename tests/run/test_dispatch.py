"""Shards that were out when something was lost go back to those waiting; silence is said."""

import contextlib
import socket
import threading
import time
from collections import deque
from types import SimpleNamespace

import pytest

from mcsettle.errors import InputError
from mcsettle.run import dispatch, worker
from mcsettle.run.dispatch import Tally, Work


class Future:
    """An answer that is there, under way, or lost."""

    def __init__(self, status: str) -> None:
        self.status = status

    def result(self, timeout: float) -> worker.Done:
        del timeout
        return worker.Done(True, ("remark",))

    def release(self) -> None:
        """Nobody needs it."""


def client(status: str = "running", workers: int = 1) -> SimpleNamespace:
    return SimpleNamespace(
        status=status,
        as_current=contextlib.nullcontext,
        scheduler_info=lambda **_: {"workers": dict.fromkeys(range(workers))},
    )


def job(told: list[str], **out: str) -> Work:
    made = Work(None, deque([9]), Tally(4), None, told.append)  # type: ignore[arg-type]
    made.out = {int(name[1:]): Future(status) for name, status in out.items()}
    return made


@pytest.fixture(autouse=True)
def no_wait(monkeypatch):
    distributed = pytest.importorskip("distributed")
    monkeypatch.setattr(distributed, "wait", lambda *_, **__: None)


def test_what_was_lost_or_cancelled_is_sent_again():
    made = job([], n1="finished", n2="cancelled", n3="pending", n4="lost")
    dispatch._take(made, client())
    assert set(made.out) == {3}
    assert sorted(made.numbers) == [2, 4, 9]
    assert (made.tally.answered, made.tally.computed, list(made.tally.remarks)) == (
        1,
        1,
        ["remark"],
    )


def test_what_was_out_when_the_scheduler_went_is_called_back():
    made = job([], n3="pending", n1="pending")
    with pytest.raises(dispatch._LostError):
        dispatch._take(made, client("closed"))
    dispatch._call_back(made)
    assert list(made.numbers) == [1, 3, 9]
    assert made.out == {}


def test_a_scheduler_without_workers_is_said_and_given_up(monkeypatch):
    told: list[str] = []
    made = job(told)
    clock = iter([0.0, 4.0, 8.0, 12.0, 0.0, 700.0]).__next__
    monkeypatch.setattr(dispatch.time, "monotonic", clock)
    for _ in range(4):
        dispatch._await_workers(made, client(workers=0), "tcp://h:1")
    assert told == [
        "The scheduler tcp://h:1 has no workers; waiting for some: start 'dask worker tcp://h:1' where "
        "the results folder can be reached"
    ]
    dispatch._await_workers(made, client(), "tcp://h:1")
    assert made.idle_since is None
    dispatch._await_workers(made, client(workers=0), "tcp://h:1")
    with pytest.raises(InputError, match="has no workers; start 'dask worker"):
        dispatch._await_workers(made, client(workers=0), "tcp://h:1")


@pytest.mark.parametrize("answer", [None, b""])
def test_what_is_no_scheduler_is_found_out_in_seconds(monkeypatch, answer):
    """A port that takes connections and says nothing, as one for HTTP; or closes them."""
    monkeypatch.setattr(dispatch, "ANSWER", 0.2)
    with socket.create_server(("127.0.0.1", 0)) as silent:
        if answer is not None:
            threading.Thread(target=lambda: silent.accept()[0].close(), daemon=True).start()
        address = f"tcp://127.0.0.1:{silent.getsockname()[1]}"
        began = time.monotonic()
        with pytest.raises(OSError, match=r"timed out|closes the connection"):
            dispatch._refuse_silent(address)
        assert time.monotonic() - began < 5.0
    with pytest.raises(OSError, match="refused"):
        dispatch._refuse_silent("tcp://127.0.0.1:9")
