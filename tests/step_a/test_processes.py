"""Processes of Step A end with their parent, however it ends, and at once when it is interrupted."""

import multiprocessing
import os
import platform
import signal
import subprocess
import sys
import time

import pytest

from mcsettle.step_a.processes import process_pool

PROGRAM = """
import os, time
from mcsettle.step_a.processes import process_pool

if __name__ == "__main__":
    with process_pool(2) as pool:
        jobs = [pool.submit(time.sleep, 600) for _ in range(4)]
        print(*pool._processes, flush=True)
        time.sleep(600)
"""


def is_there(pid: int) -> bool:
    try:
        with open(f"/proc/{pid}/stat", encoding="ascii") as file:
            return file.read().rpartition(")")[2].split()[0] != "Z"
    except FileNotFoundError:
        return False


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM])
def test_no_worker_outlives_its_parent(tmp_path, number):
    program = tmp_path / "program.py"
    program.write_text(PROGRAM, encoding="utf-8")
    parent = subprocess.Popen(
        [sys.executable, str(program)], stdout=subprocess.PIPE, text=True, stderr=subprocess.DEVNULL
    )
    assert parent.stdout is not None
    pids = [int(pid) for pid in parent.stdout.readline().split()]
    assert len(pids) == 2
    assert all(is_there(pid) for pid in pids)
    parent.send_signal(number)
    parent.wait(10)
    parent.stdout.close()
    until = time.monotonic() + 20.0
    while any(is_there(pid) for pid in pids):
        assert time.monotonic() < until, "a worker outlived its parent"
        time.sleep(0.05)


def runs(pid):
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    return True


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="another allocator")
def test_a_process_of_the_pool_keeps_the_memory_it_frees():
    with process_pool(1) as pool:
        first, again = pool.submit(_faults_of_memory_taken_twice).result()
    assert again < 0.1 * first


def _faults_of_memory_taken_twice() -> list[int]:
    """Page faults while 64 MB are taken, written and freed, the first time and the second."""
    import resource  # not on Windows

    faults = []
    for _ in range(2):
        before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
        bytearray(b"x") * 2**26
        faults.append(resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before)
    return faults


def test_an_interrupt_does_not_wait_for_what_is_running():
    began = time.monotonic()

    def interrupted() -> None:
        with process_pool(1) as pool:
            assert pool.submit(os.getpid).result() != os.getpid()
            for _ in range(3):
                pool.submit(time.sleep, 600)
            time.sleep(0.5)  # the first is under way
            raise KeyboardInterrupt

    before = set(multiprocessing.active_children())
    threads = os.environ.get("OPENBLAS_NUM_THREADS")
    with pytest.raises(KeyboardInterrupt):
        interrupted()
    # Where the pool's own thread has heard of the end, the process itself does not know its exit code.
    left = {p for p in set(multiprocessing.active_children()) - before if runs(p.pid)}
    for process in left:  # or the end of the tests would wait for them
        process.kill()
    assert not left
    assert time.monotonic() - began < 60.0
    assert os.environ.get("OPENBLAS_NUM_THREADS") == threads
