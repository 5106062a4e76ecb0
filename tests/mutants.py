"""Guards broken one at a time in a copy of the package: the tests named have to notice each.

    python tests/mutants.py [NAME...]

A guard is a line of the source, what it is broken to, and tests that fail then. One line a mutant on
stdout: killed, SURVIVED, or "no such line" where the source has moved on; exit code 1 but for killed.
"""

import json
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
LONGEST = 300  # s of one mutant's tests


def copy_of_the_package(folder: Path) -> None:
    """The package as it is installed: kernels/ and cli/ inside."""
    ignore = shutil.ignore_patterns("__pycache__")
    shutil.copytree(ROOT / "mcsettle", folder / "mcsettle", ignore=ignore)
    for name in ("kernels", "cli"):
        shutil.copytree(ROOT / name, folder / "mcsettle" / name, ignore=ignore)


def outcome(package: Path, mutant: dict[str, object]) -> str:
    """What the tests of a mutant say of it."""
    path = package / str(mutant["file"])
    text = path.read_text(encoding="utf-8")
    if text.count(str(mutant["old"])) != 1:
        return "no such line"
    path.write_text(text.replace(str(mutant["old"]), str(mutant["new"])), encoding="utf-8")
    environment = os.environ | {"PYTHONPATH": str(package), "OPENBLAS_NUM_THREADS": "1"}
    command = [
        sys.executable,
        "-m",
        "pytest",
        "-x",
        "-q",
        "-p",
        "no:cacheprovider",
        "-o",
        "addopts=",
    ]
    try:
        done = subprocess.run(
            [*command, *map(str, mutant["tests"])],  # type: ignore[call-overload]
            cwd=ROOT / "tests", env=environment, capture_output=True, check=False, timeout=LONGEST,
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        return "killed (hangs)"
    finally:
        path.write_text(text, encoding="utf-8")
    return {0: "SURVIVED", 1: "killed"}.get(done.returncode, f"pytest ended with {done.returncode}")


def main() -> None:
    """Break each guard in turn."""
    mutants = json.loads((ROOT / "tests" / "mutants.json").read_text(encoding="utf-8"))
    asked, missed = set(sys.argv[1:]), 0
    with tempfile.TemporaryDirectory() as folder:
        copy_of_the_package(Path(folder))
        for mutant in mutants:
            if asked and mutant["name"] not in asked:
                continue
            said = outcome(Path(folder), mutant)
            missed += not said.startswith("killed")
            print(f"{mutant['name']}: {said}", flush=True)
    sys.exit(bool(missed))


if __name__ == "__main__":
    main()
