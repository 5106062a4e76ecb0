"""Whatever ends a run, the next one continues to the same bytes: kills, full disks, read-only disks."""

import errno
import json
import os
import resource
import shutil
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from toy import everything

from mcsettle.errors import InputError
from mcsettle.run.options import RunOptions
from mcsettle.run.pipeline import run_study
from mcsettle.run.status import survey
from mcsettle.storage import files, lock
from mcsettle.storage.location import place
from mcsettle.storage.store import read
from mcsettle.study.study import resolved_toml

pytestmark = pytest.mark.usefixtures("fresh_cache")
ROOT = Path(__file__).resolve().parents[2]
KERNELS = str(files.cache_folder())  # compiled ones, before a test has a cache of its own
PROCESSES = True  # others go on with what is computed here
N, SIZE = 8, 2


def logs(out: Path, event: str) -> dict[str, set[str]]:
    """The shards that each process has begun, or done, by the name of its log."""
    return {
        file.name: {
            line["shard"]
            for line in map(json.loads, file.read_text(encoding="utf-8").splitlines())
            if line["event"] == event
        }
        for file in (out / ".log").iterdir()
    }


def campaign(study, whole, tmp_path, fresh_cache, kills, *seed):
    """Kill ``kills`` times, resume each time; what is left is the undisturbed run."""
    path, out = tmp_path / "study.toml", tmp_path / "out"
    path.write_text(resolved_toml(study), encoding="utf-8")
    shutil.copytree(
        KERNELS,
        tmp_path / "kernels",
        ignore=lambda _, names: [n for n in names if not n.startswith(("taichi-", "T", "ticache"))],
    )  # kills may leave a lock there
    environment = os.environ | {"MCSETTLE_KERNELS": str(tmp_path / "kernels")}
    done = subprocess.run(
        [sys.executable, str(ROOT / "tests" / "faults.py"), str(path), str(out), str(kills), *seed],
        capture_output=True, text=True, check=False, env=environment,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout)
    assert told["killed"] == kills
    assert everything(out) == everything(whole)
    keys = read(out, "realisations").to_pandas()[["scenario", "realisation"]]
    assert len(keys) == 2 * N
    assert not keys.duplicated().any()
    begun, done = logs(out, "begun"), logs(out, "done")
    assert max(len(one - done[name]) for name, one in begun.items()) == 1  # the shard in hand
    n_begun, shards = sum(map(len, begun.values())), set().union(*begun.values())
    told["repeated"] = n_begun - len(shards) - told.get("removed", 0)
    assert told["repeated"] <= kills
    assert not list((out / ".locks").glob("*.json"))
    assert not (out / ".tmp").exists()
    return told


def test_a_few_kills(study, whole, tmp_path, fresh_cache):
    """Of children that are told what the engine answers: the files are what a kill may spoil."""
    campaign(study, whole, tmp_path, fresh_cache, 3, "1", "1000")


@pytest.mark.slow
def test_two_hundred_kills(study, whole, tmp_path, fresh_cache):
    told = campaign(study, whole, tmp_path, fresh_cache, 200, "2026", "10")
    assert min(told[where] for where in ("before", "half", "by_time")) >= 30
    assert told["computing"] >= 10
    assert told["left_unfinished"] >= 10
    print(json.dumps(told))  # for docs/scale.md: pytest -s


@pytest.mark.parametrize("sent", [signal.SIGINT, signal.SIGTERM])
def test_signals_end_a_run_with_130_and_the_lock_is_given_back(sent, study, whole, tmp_path):
    """The command line as a user has it, interrupted at its second shard."""
    code = (
        "import os, sys\n"
        "from mcsettle.run import compute\n"
        "kept, n = compute.write_computed, 0\n"
        "def write(*arguments):\n"
        "    global n\n"
        "    n += 1\n"
        f"    os.kill(os.getpid(), {int(sent)}) if n == 2 else None\n"
        "    kept(*arguments)\n"
        "compute.write_computed = write\n"
        "from mcsettle.cli.app import main\n"
        "main()\n"
    )
    path, out = tmp_path / "study.toml", tmp_path / "out"
    path.write_text(resolved_toml(study), encoding="utf-8")
    done = subprocess.run(
        [sys.executable, "-c", code, "run", str(path), "--out", str(out), "--shard-size", str(SIZE)],
        capture_output=True, text=True, check=False,
        env=os.environ | {"MCSETTLE_KERNELS": KERNELS},
    )  # fmt: skip
    assert done.returncode == 130, done.stderr
    assert "goes on from here" in done.stderr
    assert "Traceback" not in done.stderr
    assert survey(out).n_whole == 1
    assert lock.owners(place(out)) == []
    run_study(study, out)
    assert everything(out) == everything(whole)


# --- disks, as root too ---------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("call", "number", "words"),
    [
        ("replace", errno.ENOSPC, "No space left"),
        ("replace", errno.EROFS, "Read-only file system"),
        ("fsync", errno.EIO, "Input/output error"),
        ("open", errno.EDQUOT, "quota exceeded"),
    ],
)
def test_a_disk_that_fails_in_mid_run(study, whole, tmp_path, monkeypatch, call, number, words):
    """The system refuses the n-th call and all later ones; mended, the same run goes on."""
    owner: Any = Path if call == "open" else files.os
    kept, calls, first = getattr(owner, call), [], {"replace": 12}.get(call, 28)

    def refuse(*arguments, **options):
        calls.append(arguments)
        if len(calls) > first and (call == "fsync" or ".tmp" in str(arguments[0])):
            raise OSError(number, os.strerror(number))
        return kept(*arguments, **options)

    with monkeypatch.context() as patch:
        patch.setattr(owner, call, refuse)
        with pytest.raises(InputError, match=f"cannot be written: .*{words}"):
            run_study(study, tmp_path, RunOptions(shard_size=SIZE))
    found = survey(tmp_path)
    assert not found.finished
    assert 0 < found.n_whole < found.n_shards
    assert not [f for f in found.faults if f.state == "damaged"]
    run_study(study, tmp_path)
    assert everything(tmp_path) == everything(whole)


def test_a_file_size_limit_is_a_full_disk(study, whole, tmp_path):
    """A limit of the kernel itself, which root cannot pass either: EFBIG in the middle of a write."""
    kept = resource.getrlimit(resource.RLIMIT_FSIZE)
    old = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    try:
        resource.setrlimit(resource.RLIMIT_FSIZE, (5000, kept[1]))
        with pytest.raises(InputError, match="cannot be written: File too large"):
            run_study(study, tmp_path, RunOptions(shard_size=SIZE))
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, kept)
        signal.signal(signal.SIGXFSZ, old)
    assert survey(tmp_path).n_whole == 0
    run_study(study, tmp_path)
    assert everything(tmp_path) == everything(whole)


@pytest.fixture
def tiny_disk(tmp_path):
    """A file system of 64 KiB, where this process may make one."""
    folder = tmp_path / "disk"
    folder.mkdir()
    made = subprocess.run(
        ["mount", "-t", "tmpfs", "-o", "size=64k", "tmpfs", str(folder)],
        capture_output=True, check=False,
    )  # fmt: skip
    if made.returncode:
        pytest.skip("no file systems can be mounted here")
    yield folder
    subprocess.run(["umount", str(folder)], check=True)


def test_a_disk_that_is_full_and_then_read_only(study, whole, tiny_disk):
    out = tiny_disk / "out"
    with pytest.raises(InputError, match="cannot be written: No space left"):
        run_study(study, out, RunOptions(shard_size=SIZE))
    assert 0 < survey(out).n_whole < 8
    held = survey(out).n_whole
    remount = ["mount", "-o", "remount"]
    subprocess.run([*remount, "-o", "ro", str(tiny_disk)], check=True)
    with pytest.raises(InputError, match="cannot be written: Read-only file system"):
        run_study(study, out)
    assert survey(out).n_whole == held
    subprocess.run([*remount, "-o", "rw,size=16m", str(tiny_disk)], check=True)
    run_study(study, out)
    assert everything(out) == everything(whole)
