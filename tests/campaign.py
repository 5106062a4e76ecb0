"""Hours of kills and hostile inputs, in blocks whose results are kept: it goes on where it stopped.

    python tests/campaign.py FOLDER [BLOCKS]

FOLDER/books.jsonl has a line a block: its kind, seed, cases, seconds, and what went wrong, if anything.
A block of kills runs a study that is killed at random moments and resumed, and compares what is left
with an undisturbed run, byte for byte; beside the results lie files that nothing may touch. Blocks of
inputs damage studies, results folders and caches, and run the studies that are accepted. A seed is the
number of its block, so any block can be run again. With BLOCKS only so many are run now.
"""

import json
import os
import shutil
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

import test_hostile_input as hostile  # noqa: E402
import toy  # noqa: E402

from mcsettle.run.options import RunOptions  # noqa: E402
from mcsettle.run.pipeline import run_study  # noqa: E402
from mcsettle.storage.files import cache_folder  # noqa: E402
from mcsettle.study.study import resolved_toml  # noqa: E402

KILLS, STUDIES, RUNS, FOLDERS, CACHES = 50, 500, 25, 150, 150  # cases of a block
ROUNDS = 25  # blocks of each kind: 1250 kills, 12 500 + 625 studies, 3750 folders, 3750 caches
FIRST_SEED = 10_000_000  # beyond those of the tests
PRECIOUS = ("precious.txt", "out-of-somebody/history/2023.csv")


def kills(folder: Path, seed: int) -> int:
    """One study killed ``KILLS`` times; raises where a byte differs from the undisturbed run."""
    study = toy.study(run={"realisations": 8})
    path, out = folder / "study.toml", folder / "out"
    path.write_text(resolved_toml(study), encoding="utf-8")
    for name in PRECIOUS:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text("precious", encoding="utf-8")
    kernels = folder / "kernels"  # kills may leave a lock there
    shutil.copytree(cache_folder(), kernels, ignore=shutil.ignore_patterns("*.npz", "*.lock", ".*"))
    before = {p.name for p in folder.iterdir()} | {"out", "probe"}
    done = subprocess.run(
        [sys.executable, str(ROOT / "tests" / "faults.py"), str(path), str(out), str(KILLS), str(seed)],
        capture_output=True, text=True, check=False,
        env=os.environ | {"MCSETTLE_KERNELS": str(kernels)},
    )  # fmt: skip
    if done.returncode:
        raise AssertionError(done.stderr[-2000:])
    whole = run_study(study, folder / "whole", RunOptions(threads=1, shard_size=2)).folder
    if toy.everything(out) != toy.everything(whole):
        raise AssertionError("the results are not those of an undisturbed run")
    if any((folder / name).read_text(encoding="utf-8") != "precious" for name in PRECIOUS):
        raise AssertionError("a file outside the results was touched")
    if (new := {p.name for p in folder.iterdir()} - before - {"whole"}) or (out / ".tmp").exists():
        raise AssertionError(f"something was left behind: {sorted(new)}")
    return KILLS


def studies(_: Path, seed: int) -> int:
    """Mutated study files: refused in words, or valid."""
    hostile.fuzz_studies(STUDIES, seed * STUDIES)
    return STUDIES


def runs(folder: Path, seed: int) -> int:
    """Studies with changed values, run where they are accepted."""
    hostile.fuzz_runs(folder, RUNS, seed * 40 * RUNS)
    return RUNS


def folders(folder: Path, seed: int) -> int:
    """Damaged results folders: refused, or what was written."""
    study = toy.study(run={"realisations": 4})
    results = run_study(study, folder / "results", RunOptions(shard_size=2)).folder
    hostile.fuzz_folders(results, folder / "copy", FOLDERS, seed * FOLDERS)
    return FOLDERS


def caches(folder: Path, seed: int) -> int:
    """Damaged caches: computed again, or what was written."""
    hostile.fuzz_caches(folder, CACHES, seed * CACHES)
    return CACHES


KINDS: dict[str, Callable[[Path, int], int]] = {
    "kills": kills, "studies": studies, "runs": runs, "folders": folders, "caches": caches,
}  # fmt: skip


def blocks() -> Iterator[tuple[str, int]]:
    """Every block: its kind and its seed, the kinds in turn."""
    for turn in range(ROUNDS):
        for kind in KINDS:
            yield kind, FIRST_SEED + turn


def main() -> None:
    """Run what is not yet in the books; exit code 1 where a block went wrong, now or before."""
    folder = Path(sys.argv[1])
    most = int(sys.argv[2]) if len(sys.argv) > 2 else None
    folder.mkdir(parents=True, exist_ok=True)
    books = folder / "books.jsonl"
    lines = books.read_text(encoding="utf-8").splitlines() if books.exists() else []
    written = [json.loads(line) for line in lines]
    known = {(entry["kind"], entry["seed"]) for entry in written}
    left = [block for block in blocks() if block not in known][:most]
    for kind, seed in left:
        began, wrong, cases = time.monotonic(), "", 0
        with tempfile.TemporaryDirectory() as scratch:
            try:
                cases = KINDS[kind](Path(scratch), seed)
            except Exception:
                wrong = traceback.format_exc()[-4000:]
        seconds = round(time.monotonic() - began, 1)
        entry = {"kind": kind, "seed": seed, "cases": cases, "seconds": seconds, "wrong": wrong}
        written.append(entry)
        with books.open("a", encoding="utf-8") as file:
            file.write(json.dumps(entry) + "\n")
        print(
            f"{kind} {seed}: {wrong or 'nothing went wrong'} ({cases} cases, {seconds} s)",
            flush=True,
        )
    totals = Counter[str]()
    for entry in written:
        totals[entry["kind"]] += entry["cases"]
    bad = sum(bool(entry["wrong"]) for entry in written)
    print(f"{dict(totals)}, {bad} blocks went wrong; books: {books}")
    sys.exit(bad > 0)


if __name__ == "__main__":
    main()
