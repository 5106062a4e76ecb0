"""Shards computed by several processes are the shards that one computes."""

import os
import threading
import time
from collections import deque
from concurrent.futures import Future
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import parent_process
from queue import SimpleQueue

import pytest
import toy
from toy import everything

from mcsettle.errors import InputError
from mcsettle.run import pipeline, together
from mcsettle.run.options import RunOptions
from mcsettle.run.pipeline import run_study
from mcsettle.run.shards import all_shards
from mcsettle.step_a import processes
from mcsettle.storage.files import ASIDE, UNFINISHED
from mcsettle.study.extent import extent_of

pytestmark = pytest.mark.usefixtures("fresh_cache")


class Mortal:
    """A pool that runs ``n`` tasks at once when they are asked for, then dies."""

    def __init__(self, n: int) -> None:
        self.n = n

    def submit(self, function, *arguments):
        if self.n == 0:
            raise BrokenProcessPool
        self.n -= 1
        future: Future = Future()
        try:
            future.set_result(function(*arguments))
        except BaseException as error:
            future.set_exception(error)
        return future


@pytest.mark.parametrize("n", range(6))
def test_every_task_is_done_once_and_answers_stand_in_order(n):
    done, told = [], []

    def ten_times(x: int) -> int:
        done.append(x)
        return 10 * x

    share = processes.Together(Mortal(n))
    assert share.map(ten_times, [(i,) for i in range(5)], told.append) == [0, 10, 20, 30, 40]
    assert sorted(done) == sorted(told) == [0, 1, 2, 3, 4]
    told.clear()
    assert processes.ALONE.map(ten_times, [(3,), (4,)], told.append) == [30, 40]
    assert told == [0, 1]


def test_an_error_in_another_process_is_raised_here():
    def fails(x: int) -> int:
        raise InputError(f"task {x}")

    with pytest.raises(InputError, match="task 0"):
        processes.Together(Mortal(1)).map(fails, [(0,)])


def dies_elsewhere(x: int) -> int:
    if parent_process() is not None:
        os._exit(1)
    return x


def test_what_a_dead_process_leaves_is_done_here():
    with processes.together(2) as share:
        assert share.map(dies_elsewhere, [(i,) for i in range(4)]) == [0, 1, 2, 3]


class ShutDown:
    """A pool that takes no more tasks, or forgets the one it has taken."""

    def __init__(self, forgets: bool) -> None:
        self.forgets = forgets

    def submit(self, *_):
        if not self.forgets:
            raise RuntimeError("cannot schedule new futures after shutdown")
        future: Future = Future()
        future.cancel()
        return future


@pytest.mark.parametrize("forgets", [False, True])
def test_a_pool_that_is_shut_down_leaves_its_tasks(forgets):
    todo, finished = deque([0, 1]), SimpleQueue()
    processes._feed(ShutDown(forgets), max, [(0, 1), (1, 2)], todo, finished)
    assert sorted(todo) == [0, 1]
    assert finished.get_nowait() is None


def sleeps(x: int) -> int:
    time.sleep(30.0)
    return x


def test_an_error_here_ends_the_others_in_silence(monkeypatch):
    """Neither the tasks that are under way nor those that wait are heard of again."""
    heard: list[object] = []
    monkeypatch.setattr(threading, "excepthook", heard.append)

    def fails(x: int) -> int:
        time.sleep(2.0)
        raise KeyboardInterrupt

    before, began = threading.active_count(), time.monotonic()
    with pytest.raises(KeyboardInterrupt), processes.together(2) as share:
        share.map(sleeps, [(i,) for i in range(6)], here=fails)
    while threading.active_count() > before and time.monotonic() < began + 20.0:
        time.sleep(0.05)
    assert threading.active_count() == before
    assert not heard


def dies_after_a_while(x: int) -> int:
    time.sleep(0.05)
    return dies_elsewhere(x)


def test_a_process_that_dies_while_tasks_are_handed_out_is_not_heard(monkeypatch):
    """No thread of the pool ends in an error, whenever it hears of the death."""
    heard: list[object] = []
    monkeypatch.setattr(threading, "excepthook", heard.append)
    for _ in range(3):
        with processes.together(2) as share:
            assert share.map(dies_after_a_while, [(i,) for i in range(12)]) == list(range(12))
    assert not heard


def test_the_same_bytes_and_remarks_by_two_processes(tmp_path, monkeypatch):
    study = toy.study(run={"realisations": 6})
    alone = run_study(study, tmp_path / "alone", RunOptions(shard_size=2))
    monkeypatch.setattr(together, "WORTHWHILE", 1)
    monkeypatch.setattr(together, "MOST_SHARDS", 2)
    told = []
    both = run_study(
        study,
        tmp_path / "both",
        RunOptions(shard_size=2, processes=2),
        lambda *line: told.append(line),
    )
    assert everything(both.folder) == everything(alone.folder)
    assert both.remarks == alone.remarks
    stages = {stage for stage, _, _ in told if stage.startswith("Step B")}
    for stage in stages:
        assert max(done for name, done, _ in told if name == stage) == 6
    assert len(stages) == len(study.scenario_names)


def test_only_large_runs_of_one_parameter_set_are_shared(monkeypatch):
    def n(study, **options) -> int:
        extent, chosen = extent_of(study), RunOptions(**{"processes": 2, "threads": 2, **options})
        return together.worthwhile(extent, study.run.stepping, all_shards(extent, 4), chosen)

    small = toy.study(run={"realisations": 6})
    assert n(small) == 1
    monkeypatch.setattr(together, "WORTHWHILE", 1)
    assert n(small) == 2
    assert n(small, threads=1) == n(small, processes=1) == 1
    assert n(toy.study(run={"realisations": 6, "stepping": "every_axle"})) == 1


def test_an_interrupt_leaves_nothing_unfinished(tmp_path, monkeypatch):
    def ended(job, *_):
        (job.at.path / ASIDE).mkdir(exist_ok=True)
        (job.at.path / ASIDE / f"begun{UNFINISHED}").write_bytes(b"half")
        raise KeyboardInterrupt

    monkeypatch.setattr(together, "WORTHWHILE", 1)
    monkeypatch.setattr(pipeline, "compute_together", ended)
    with pytest.raises(KeyboardInterrupt):
        run_study(toy.study(run={"realisations": 2}), tmp_path / "out", RunOptions(processes=2))
    assert not (tmp_path / "out" / ASIDE).exists()
