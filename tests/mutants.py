"""Guards broken one at a time in a copy of the package: the tests named have to notice each.

    python tests/mutants.py [NAME...]

A guard is a line of the source, what it is broken to, and the tests that fail then, and only then: first
all of them have to pass. One line a mutant on stdout: killed, SURVIVED, or "no such line" where the
source has moved on; exit code 1 but for killed. Package and tests are those of one moment: where a source
changes meanwhile the rest is not run (exit code 2).
"""

import contextlib
import hashlib
import importlib
import json
import os
import shutil
import signal
import sys
import tempfile
import time
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
LONGEST = 300  # s of one mutant's tests; of all of them unbroken three times that
OPTIONS = ("-x", "-q", "-p", "no:cacheprovider", "-o", "addopts=")
# What the package rests on, read once; the package itself is read by each child.
RESTS_ON = ("distributed", "filelock", "matplotlib.figure", "pandas", "pyarrow.dataset",
            "pyarrow.parquet", "pydantic", "rich", "scipy.sparse.linalg", "scipy.stats", "taichi",
            "typer")  # fmt: skip


def digest_of_sources() -> str:
    """Of the package and its tests, by name and bytes."""
    digest = hashlib.sha256()
    for room in ("mcsettle", "kernels", "cli", "tests"):
        for path in sorted((ROOT / room).rglob("*.*")):
            kept = not any(part[0] in "._" for part in path.relative_to(ROOT).parts[:-1])
            if kept and path.is_file():
                digest.update(f"{path.relative_to(ROOT)}\n".encode() + path.read_bytes())
    return digest.hexdigest()


def copy_of_the_package(folder: Path) -> None:
    """The package as it is installed: kernels/ and cli/ inside."""
    ignore = shutil.ignore_patterns("__pycache__")
    shutil.copytree(ROOT / "mcsettle", folder / "mcsettle", ignore=ignore)
    for name in ("kernels", "cli"):
        shutil.copytree(ROOT / name, folder / "mcsettle" / name, ignore=ignore)


def run(package: Path, tests: list[str], longest: float) -> tuple[int, str]:
    """Exit code and words of the tests on the package in this folder, in a child of this process.

    Nothing that they start outlives them: a broken guard may leave processes behind.
    """
    with tempfile.TemporaryFile("w+") as told:
        pid = os.fork()
        if not pid:
            os.setsid()
            for stream in (1, 2):
                os.dup2(told.fileno(), stream)
            os.chdir(ROOT / "tests")
            os.environ |= {"PYTHONPATH": str(package), "OPENBLAS_NUM_THREADS": "1"}
            sys.path.insert(0, str(package))
            os._exit(pytest.main([*OPTIONS, *tests]))
        until = time.monotonic() + longest
        while not (done := os.waitpid(pid, os.WNOHANG))[0]:
            if time.monotonic() > until:
                os.killpg(pid, signal.SIGKILL)
            time.sleep(0.05)
        with contextlib.suppress(ProcessLookupError):  # nobody is left
            os.killpg(pid, signal.SIGKILL)
        told.seek(0)
        return os.waitstatus_to_exitcode(done[1]), told.read()


def outcome(package: Path, mutant: dict[str, str]) -> str:
    """What the tests of a mutant say of it."""
    path = package / mutant["file"]
    text = path.read_text(encoding="utf-8")
    if text.count(mutant["old"]) != 1:
        return "no such line"
    path.write_text(text.replace(mutant["old"], mutant["new"]), encoding="utf-8")
    try:
        code, _ = run(package, mutant["tests"].split(), LONGEST)
    finally:
        path.write_text(text, encoding="utf-8")
    names = {0: "SURVIVED", 1: "killed", -9: "killed (hangs)"}
    return names.get(code, f"pytest ended with {code}")


def main() -> None:
    """Break each guard in turn."""
    mutants = json.loads((ROOT / "tests" / "mutants.json").read_text(encoding="utf-8"))
    asked, missed, before = set(sys.argv[1:]), 0, digest_of_sources()
    mutants = [mutant for mutant in mutants if not asked or mutant["name"] in asked]
    os.environ["ENABLE_TAICHI_HEADER_PRINT"] = "False"
    for name in RESTS_ON:
        importlib.import_module(name)
    with tempfile.TemporaryDirectory() as folder:
        copy_of_the_package(Path(folder))
        tests = dict.fromkeys(test for mutant in mutants for test in mutant["tests"].split())
        code, told = run(Path(folder), list(tests), 3 * LONGEST)
        if code:
            sys.exit(f"{told}\nThese tests have to pass before a guard is broken")
        for mutant in mutants:
            began = time.monotonic()
            said = outcome(Path(folder), mutant)
            if digest_of_sources() != before:
                print("The sources have changed meanwhile: begin again", file=sys.stderr)
                sys.exit(2)
            missed += not said.startswith("killed")
            print(f"{mutant['name']}: {said} ({time.monotonic() - began:.0f} s)", flush=True)
    sys.exit(bool(missed))


if __name__ == "__main__":
    main()
