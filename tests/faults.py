"""A program that runs a study again and again in children that are killed.

Imports and the response of the track are paid once, here; each child starts Taichi for itself.

    python tests/faults.py STUDY OUT KILLS SEED

Each child runs the study into OUT; the parent kills it, by SIGKILL, after a random time, or the child
kills itself at a random one of its writes: before, in the middle of, or after it. After the last kill a
child runs undisturbed. One JSON line on stdout: kills, of them in writes by place, kills that left an
unfinished file behind, runs that ended before their kill, shards that were deleted after those.
"""

import functools
import json
import math
import os
import random
import signal
import sys
import time
from collections import Counter
from pathlib import Path

# Imported once, before the children: what a run imports on its way, too.
import pyarrow.dataset  # noqa: F401

import mcsettle.run.close
import mcsettle.run.pipeline
from mcsettle.kernels import runtime, spectral  # noqa: F401
from mcsettle.run.options import RunOptions
from mcsettle.step_a import track_response, transfers
from mcsettle.storage import files
from mcsettle.study.study import load_study

SHARDS = 8  # of the study as the tests give it
OTHERS = 10  # writes of a run besides three a shard: lock, provenance, effects, summary, manifest …


def die_in_write(nth: int, where: str) -> None:
    """Kill this process at its ``nth`` write of a file: "before" it, "half" way, or "after" it."""
    kept, count = os.replace, 0

    def replace(source: Path, target: Path) -> None:
        nonlocal count
        count += 1
        if count == nth:
            if where == "half":  # what a crash leaves of a file that was not yet synchronised
                data = source.read_bytes()
                source.write_bytes(data[: len(data) // 2])
            if where == "after":
                kept(source, target)
            os.kill(os.getpid(), signal.SIGKILL)
        kept(source, target)

    os.replace = files.os.replace = replace


def child(study: Path, out: Path, nth: int = 0, where: str = "") -> int:
    """Fork a child that runs the study, and dies in its ``nth`` write; returns its process id."""
    pid = os.fork()
    if pid:
        return pid
    code = 1
    try:
        if nth:
            die_in_write(nth, where)
        mcsettle.run.pipeline.run_study(load_study(study), out, RunOptions(threads=1, shard_size=2))
        code = 0
    finally:
        os._exit(code)


def await_or_kill(pid: int, patience: float) -> int | None:
    """Status of a child that ends by itself within ``patience`` seconds; None: it was killed here."""
    until = time.monotonic() + patience
    while time.monotonic() < until:
        done, status = os.waitpid(pid, os.WNOHANG)
        if done:
            return status
        time.sleep(0.005)
    os.kill(pid, signal.SIGKILL)
    _, status = os.waitpid(pid, 0)
    return None if os.WIFSIGNALED(status) and os.WTERMSIG(status) == signal.SIGKILL else status


def main() -> None:
    """Kill, resume, kill …"""
    study, out, kills, seed = Path(sys.argv[1]), Path(sys.argv[2]), int(sys.argv[3]), sys.argv[4]
    rng, told = random.Random(seed), Counter[str]()
    track_response.beam_response = functools.cache(track_response.beam_response)
    transfers.step_a(load_study(study).scenes)
    began = time.monotonic()
    os.waitpid(child(study, out.with_name("probe")), 0)
    longest = 1.2 * (time.monotonic() - began)  # of a whole run, on this machine as it is now
    while told["killed"] < kills:
        left = SHARDS - len(list((out / "realisations").glob("*.parquet")))
        nth = rng.randrange(1, 3 * left + OTHERS) if rng.random() < 0.5 else 0
        where = rng.choice(("before", "half", "after"))
        pid = child(study, out, nth, where)
        until = rng.uniform(0.0, longest * (1 + left / SHARDS) / 2)  # half of a run is its start
        status = await_or_kill(pid, math.inf if nth else until)
        if status is None or (os.WIFSIGNALED(status) and os.WTERMSIG(status) == signal.SIGKILL):
            told["killed"] += 1
            told["by_time" if status is None else where] += 1
            told["left_unfinished"] += any((out / files.ASIDE).glob(f"*.{pid}.part"))
        elif status:
            sys.exit(f"a run ended with status {status}")
        else:  # finished: begin again with some shards gone
            told["ended"] += 1
            shards = sorted((out / "realisations").iterdir())
            for path in rng.sample(shards, rng.randrange(1, len(shards) + 1)):
                path.unlink()
                told["removed"] += 1
    _, status = os.waitpid(child(study, out), 0)
    json.dump(told, sys.stdout)
    sys.stdout.flush()
    sys.exit(os.waitstatus_to_exitcode(status))


if __name__ == "__main__":
    main()
