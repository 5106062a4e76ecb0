"""Very many kills and hostile inputs, in blocks whose results are kept: it goes on where it stopped.

    python tests/campaign.py FOLDER [MINUTES]

FOLDER/books.jsonl has a line a block: its kind, seed, cases, what became of them, seconds, and what went
wrong, if anything. A block of kills runs a study that is killed at random moments and resumed, and
compares what is left with an undisturbed run, byte for byte; a block of runs changes studies and runs
those that are accepted; others damage studies, results folders and caches. Every change of a file is
watched: one outside the block's own folder is a fault. A seed is the number of its block, so any block
can be run again. With MINUTES no block is begun later. The process is warm: each block is a fork of it,
so that one that dies or hangs is a fault of its own.
"""

import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import traceback
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT / "tests"), str(ROOT / "tests" / "cli")]
sys.dont_write_bytecode = True

import pyarrow.dataset  # noqa: E402, F401
import test_hostile_input as hostile  # noqa: E402
import toy  # noqa: E402
from watch import Watch, is_below  # noqa: E402

from mcsettle.kernels import runtime  # noqa: E402
from mcsettle.run.options import RunOptions  # noqa: E402
from mcsettle.run.pipeline import run_study  # noqa: E402
from mcsettle.storage.files import cache_folder  # noqa: E402
from mcsettle.study.study import resolved_toml  # noqa: E402

Told = Counter[str]
FIRST_SEED = 10_000_000  # beyond those of the tests
LONGEST = 3600.0  # s of a block
COMPUTING = 20  # one in so many of the killed runs computes; the others are told what was computed
PRECIOUS = ("precious.txt", "out-of-somebody/history/2023.csv")
KERNELS = ("taichi-", "T", "ticache")  # how the names of compiled kernels begin


def kills(folder: Path, seed: int, cases: int) -> Told:
    """One study killed ``cases`` times; raises where a byte differs from the undisturbed run."""
    study = toy.study(run={"realisations": 8})
    path, out = folder / "study.toml", folder / "out"
    path.write_text(resolved_toml(study), encoding="utf-8")
    for name in PRECIOUS:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text("precious", encoding="utf-8")
    before = {p.name for p in folder.iterdir()} | {"out"}
    program = [sys.executable, str(ROOT / "tests" / "faults.py"), str(path), str(out)]
    done = subprocess.run(
        [*program, str(cases), str(seed), str(COMPUTING)],
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode:
        raise AssertionError(done.stderr[-4000:])
    if new := {p.name for p in folder.iterdir()} - before:
        raise AssertionError(f"something was left behind: {sorted(new)}")
    whole = run_study(study, folder / "whole", RunOptions(threads=1, shard_size=2)).folder
    if toy.everything(out) != toy.everything(whole):
        raise AssertionError("the results are not those of an undisturbed run")
    if any((folder / name).read_text(encoding="utf-8") != "precious" for name in PRECIOUS):
        raise AssertionError("a file outside the results was touched")
    if (out / ".tmp").exists() or list((out / ".locks").glob("*.json")):
        raise AssertionError("an unfinished file or a lock was left behind")
    return Told(json.loads(done.stdout))


def runs(folder: Path, seed: int, cases: int) -> Told:
    """Studies with changes, run where they are accepted."""
    runtime.start(1)
    with hostile.few_waves():
        return hostile.fuzz_runs(folder, cases, seed * cases)


def studies(_: Path, seed: int, cases: int) -> Told:
    """Mutated files of all studies: refused in words, or valid."""
    hostile.fuzz_studies(cases, seed * cases)
    return Told()


def folders(folder: Path, seed: int, cases: int) -> Told:
    """Damaged results folders: refused, or what was written."""
    study = toy.tiny(run={"realisations": 4})
    results = run_study(study, folder / "results", RunOptions(shard_size=2, threads=1)).folder
    hostile.fuzz_folders(results, folder / "copy", cases, seed * cases)
    return Told()


def caches(folder: Path, seed: int, cases: int) -> Told:
    """Damaged caches: computed again, or what was written."""
    hostile.fuzz_caches(folder, cases, seed * cases)
    return Told()


# What a block does, its cases, and how many blocks there are: 1000 kills, 20 000 studies that run …
Block = tuple[Callable[[Path, int, int], Told], int, int]
KINDS: dict[str, Block] = {
    "kills": (kills, 250, 4),
    "runs": (runs, 500, 40),
    "studies": (studies, 500, 5),
    "folders": (folders, 150, 5),
    "caches": (caches, 150, 5),
}


def blocks() -> Iterator[tuple[str, int]]:
    """Every block: its kind and seed, the kinds spread over the whole."""
    rest = [(turn / n, kind, turn) for kind, (_, _, n) in KINDS.items() for turn in range(n)]
    for _, kind, turn in sorted(rest):
        yield kind, FIRST_SEED + turn


def watched(kind: str, seed: int, cases: int, folder: Path) -> Told:
    """The cases of one block, in this process, with a cache of their own; raises what goes wrong."""
    work, outside = folder / "work", list[str]()
    shutil.copytree(
        cache_folder(), folder / "kernels",
        ignore=lambda _, names: [name for name in names if not name.startswith(KERNELS)],
    )  # fmt: skip
    os.environ |= {
        "MCSETTLE_KERNELS": str(folder / "kernels"),
        "MCSETTLE_CACHE": str(folder / "cache"),
    }
    work.mkdir()

    def change(event: str, paths: tuple[str, ...]) -> None:
        outside.extend(
            f"{event} {path}" for path in paths if not is_below(path, [folder, Path(os.devnull)])
        )

    watch = Watch(change)
    watch.on = True
    told = KINDS[kind][0](work, seed, cases)
    watch.on = False
    if outside:
        raise AssertionError(f"files outside were touched: {outside[:20]}")
    return told


def apart(kind: str, seed: int, cases: int) -> tuple[Told, str]:
    """The cases of one block in a fork of this process: what became of them, and what went wrong."""
    with tempfile.TemporaryDirectory() as scratch:
        answer, pid = Path(scratch) / "answer", os.fork()
        if not pid:
            os.setsid()
            told, wrong = Told(), ""
            try:
                told = watched(kind, seed, cases, Path(scratch))
            except BaseException:
                wrong = traceback.format_exc()[-20_000:]
            answer.write_text(json.dumps([told, wrong]), encoding="utf-8")
            os._exit(0)
        until = time.monotonic() + LONGEST
        while not (done := os.waitpid(pid, os.WNOHANG))[0]:
            if time.monotonic() > until:
                os.killpg(pid, signal.SIGKILL)
            time.sleep(0.1)
        if done[1]:
            return Told(), f"the block ended with status {done[1]}"
        told, wrong = json.loads(answer.read_text(encoding="utf-8"))
        return Told(told), wrong


def main() -> None:
    """Run what is not yet in the books; exit code 1 where a block went wrong, now or before."""
    folder = Path(sys.argv[1])
    until = time.monotonic() + 60.0 * float(sys.argv[2]) if len(sys.argv) > 2 else None
    folder.mkdir(parents=True, exist_ok=True)
    books = folder / "books.jsonl"
    lines = books.read_text(encoding="utf-8").splitlines() if books.exists() else []
    entries = [json.loads(line) for line in lines]
    done = {(entry["kind"], entry["seed"]) for entry in entries}
    for kind, seed in (block for block in blocks() if block not in done):
        if until is not None and time.monotonic() > until:
            break
        began, cases = time.monotonic(), KINDS[kind][1]
        told, wrong = apart(kind, seed, cases)
        seconds = round(time.monotonic() - began, 1)
        entry = {
            "kind": kind,
            "seed": seed,
            "cases": cases,
            "told": told,
            "seconds": seconds,
            "wrong": wrong,
        }
        entries.append(entry)
        with books.open("a", encoding="utf-8") as file:
            file.write(json.dumps(entry) + "\n")
        print(f"{kind} {seed}: {wrong or dict(told)} ({cases} cases, {seconds} s)", flush=True)
    for kind, (_, _, n) in KINDS.items():
        own = [entry for entry in entries if entry["kind"] == kind]
        total = sum((Told(entry["told"]) for entry in own), Told())
        print(
            f"{kind}: {len(own)} of {n} blocks, {sum(e['cases'] for e in own)} cases, {dict(total)}"
        )
    bad = [f"{entry['kind']} {entry['seed']}" for entry in entries if entry["wrong"]]
    print(f"{len(bad)} blocks went wrong {bad}; books: {books}")
    sys.exit(bool(bad))


if __name__ == "__main__":
    main()
