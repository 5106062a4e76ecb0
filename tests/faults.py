"""A program that runs a study again and again in children that are killed.

    python tests/faults.py STUDY OUT KILLS SEED [EVERY]

Imports and the response of the track are paid once, here. A first child runs the study and keeps what the
engine answers; most later ones are told that, so that a run is its files and little else, and one in
EVERY (none: each) starts Taichi and computes. The parent kills a child, by SIGKILL, after a random time,
or the child kills itself at a random one of its changes of a file: before it, or with half of what it was
to move into place. After the last kill a child runs undisturbed. A change of any file but those of the
results, the cache and the kernels (MCSETTLE_KERNELS, its own) ends the program. One JSON line on
stdout: kills, of them by time and by place, kills that left an unfinished file behind, runs that
ended before their kill, shards that were deleted after those, kills of children that computed.
"""

import functools
import json
import math
import os
import pickle
import random
import shutil
import signal
import sys
import time
import traceback
from collections import Counter
from pathlib import Path

# Imported once, before the children: what a run imports on its way, too.
import pyarrow.dataset  # noqa: F401
from watch import Watch, is_below

import mcsettle.run.close
import mcsettle.run.pipeline
from mcsettle.kernels import runtime, spectral  # noqa: F401
from mcsettle.run import compute, sign_split
from mcsettle.run.options import RunOptions
from mcsettle.step_a import track_response, transfers
from mcsettle.storage import files
from mcsettle.study.study import load_study

sys.dont_write_bytecode = True
SHARDS = 8  # of the study as the tests give it
OUTSIDE = 97  # exit code of a run that was about to change a file of somebody else
PLACES = ("before", "half")
answers: dict[tuple[object, ...], object] = {}  # of the engine, by what it was asked


def child(
    study: Path,
    out: Path,
    real: bool = True,
    nth: int = 0,
    where: str = "",
    keep: Path | None = None,
) -> int:
    """Fork a child that runs the study, and dies before its ``nth`` change; returns its process id.

    ``real``: it computes; ``keep``: a file for what the engine answers, and the number of changes.
    """
    pid = os.fork()
    if pid:
        return pid
    code, counts = 1, {"before": 0, "half": 0}
    own = [out, files.cache_folder(), Path(os.environ["MCSETTLE_KERNELS"])]

    def change(event: str, paths: tuple[str, ...]) -> None:
        for path in paths:
            if not is_below(path, own) and path != os.devnull:
                os.write(2, f"outside: {event} {path}\n".encode())
                os._exit(OUTSIDE)
        if is_below(paths[-1], [out]):
            counts["before"] += 1
            counts["half"] += event == "os.rename"
        if nth and counts[where] == nth:
            if where == "half":  # what a crash leaves of what was not synchronised
                os.truncate(paths[0], os.stat(paths[0]).st_size // 2)
            os.kill(os.getpid(), signal.SIGKILL)

    try:
        if keep:
            note()
        elif not real:
            remember()
        watch = Watch(change)
        watch.on = True
        mcsettle.run.pipeline.run_study(load_study(study), out, RunOptions(threads=1, shard_size=2))
        watch.on = False
        if keep:
            keep.write_bytes(pickle.dumps((answers, counts)))
        code = 0
    except BaseException:
        traceback.print_exc()  # which os._exit would swallow
    finally:
        os._exit(code)


def of_batch(job, scene, engine, batch: range) -> tuple[object, ...]:
    return scene.variant, scene.scenario, batch.start, batch.stop


def of_split(case, traffic, profiles, *_) -> tuple[object, ...]:
    return "split", len(case.transfers), len(profiles)


def noted(function, key):
    """``function``, whose answers are noted."""

    def ask(*arguments):
        answers[key(*arguments)] = answer = function(*arguments)
        return answer

    return ask


def note() -> None:
    """Note what the engine answers."""
    compute._outcome = noted(compute._outcome, of_batch)
    sign_split.sign_split = noted(sign_split.sign_split, of_split)


def remember() -> None:
    """Answer what was noted, without an engine."""
    compute.engine_of = lambda *_: None
    compute._outcome = lambda *arguments: answers[of_batch(*arguments)]
    sign_split.sign_split = lambda *arguments: answers[of_split(*arguments)]
    runtime.start = lambda *_: {"threads": 1}


def await_or_kill(pid: int, patience: float) -> tuple[int, bool]:
    """Status of a child, and whether it was killed here, after ``patience`` seconds."""
    until = time.monotonic() + patience
    while time.monotonic() < until:
        done, status = os.waitpid(pid, os.WNOHANG)
        if done:
            return status, False
        time.sleep(0.002)
    os.kill(pid, signal.SIGKILL)
    return os.waitpid(pid, 0)[1], True


def measured(study: Path, out: Path) -> tuple[dict[str, int], dict[bool, float]]:
    """Changes of files, and moves, of a whole run; its seconds computed (True) and remembered."""
    took, kept, counts = {}, out.with_name("answers"), {}
    for real in (True, False):
        began, probe = time.monotonic(), out.with_name(f"probe-{real}")
        status = os.waitpid(child(study, probe, real, keep=kept if real else None), 0)[1]
        if status:
            sys.exit(f"the first run ended with status {status}")
        took[real] = time.monotonic() - began
        if real:
            noted_answers, counts = pickle.loads(kept.read_bytes())
            answers.update(noted_answers)
            kept.unlink()
        shutil.rmtree(probe)
    return counts, took


def main() -> None:
    """Kill, resume, kill …"""
    study, out, kills, seed = Path(sys.argv[1]), Path(sys.argv[2]), int(sys.argv[3]), sys.argv[4]
    every = int(sys.argv[5]) if len(sys.argv) > 5 else 1
    rng, told = random.Random(seed), Counter[str]()
    track_response.beam_response = functools.cache(track_response.beam_response)
    transfers.step_a(load_study(study).scenes)
    counts, took = measured(study, out)
    while told["killed"] < kills:
        left = len(list((out / "realisations").glob("*.parquet")))
        share = 1.0 - 0.75 * left / SHARDS  # of a whole run; a quarter is its beginning and end
        real = rng.randrange(every) == 0
        where = rng.choice(PLACES)
        nth = rng.randrange(1, int(counts[where] * share) + 2) if rng.random() < 0.5 else 0
        pid = child(study, out, real, nth, where)
        until = math.inf if nth else rng.uniform(0.0, 1.2 * took[real] * share)
        status, here = await_or_kill(pid, until)
        if os.WIFSIGNALED(status) and os.WTERMSIG(status) == signal.SIGKILL:
            told["killed"] += 1
            told["computing"] += real
            told["by_time" if here else where] += 1
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
