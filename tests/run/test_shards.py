"""Slices, status, gather, locks: a run in parts is the run in one go, byte for byte."""

import json
import os
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import filelock
import pytest
from hypothesis import given
from hypothesis import strategies as st
from toy import everything
from typer.testing import CliRunner

from mcsettle.cli.app import app
from mcsettle.errors import InputError, NumericalError
from mcsettle.run import compute
from mcsettle.run.close import gather
from mcsettle.run.options import RunOptions
from mcsettle.run.pipeline import run_study
from mcsettle.run.shards import Slice, all_shards, parse_slice, slice_of
from mcsettle.run.status import survey
from mcsettle.step_b.cycle_jump import CycleJump
from mcsettle.storage import lock, manifest
from mcsettle.storage.location import place
from mcsettle.storage.shard_record import record_name
from mcsettle.study.extent import extent_of
from mcsettle.summary.results import read_results

pytestmark = pytest.mark.usefixtures("fresh_cache")
N, SIZE = 6, 2
runner = CliRunner()


def shard_files(folder: Path) -> list[Path]:
    return sorted((folder / "realisations").glob("*.parquet"))


# --- slices ---------------------------------------------------------------------------------------


@given(st.integers(1, 40), st.integers(1, 60))
def test_slices_are_every_shard_once(n_shards, n):
    shards = [object() for _ in range(n_shards)]
    parts = [slice_of(shards, Slice(i, n)) for i in range(1, n + 1)]
    assert [shard for part in parts for shard in part] == shards
    sizes = {len(part) for part in parts}
    assert max(sizes) - min(sizes) <= 1


@pytest.mark.parametrize(
    "text", ["0/4", "5/4", "1", "1/0", "-1/4", "a/b", "1/4/2", "1" * 20 + "/9"]
)
def test_a_slice_is_one_of_n(text):
    with pytest.raises(InputError, match="from 1 to N"):
        parse_slice(text)


def test_shards_are_counted_before_they_are_made(study):
    extent = extent_of(study)
    assert len(all_shards(extent, SIZE)) == 6
    huge = replace(extent, realisations=10_000_000)
    with pytest.raises(InputError, match="at most 5000000"):
        all_shards(huge, 1)


def test_slices_in_any_order_make_the_whole(study, whole, tmp_path):
    """Four slices of six shards, one of them twice, then gathered: the same bytes."""
    for i in (3, 1, 4, 2, 1):
        done = run_study(study, tmp_path, RunOptions(shards=Slice(i, 4), shard_size=SIZE))
        assert not done.closed
        if i == 4:
            with pytest.raises(InputError, match="is not finished"):
                read_results(tmp_path)
            with pytest.raises(InputError, match=r"has 4 of 6 shards .*not computed yet"):
                gather(tmp_path)
    assert done.n_computed == 0  # the second time
    found = gather(tmp_path)
    assert found.finished
    assert everything(tmp_path) == everything(whole)


def test_a_slice_leaves_a_finished_run_finished(study, whole):
    before = everything(whole)
    run_study(study, whole, RunOptions(shards=Slice(1, 2)))
    assert everything(whole) == before
    assert survey(whole).finished


def test_slices_have_to_agree_on_the_size_of_the_run(study, tmp_path):
    run_study(study, tmp_path, RunOptions(shards=Slice(1, 6), shard_size=SIZE))
    with pytest.raises(InputError, match="a run of 6 realisations and this slice one of 4"):
        run_study(study, tmp_path, RunOptions(realisations=4, shards=Slice(2, 6)))
    with pytest.raises(InputError, match="shard realisations 2 where this run has 3"):
        run_study(study, tmp_path, RunOptions(shards=Slice(2, 6), shard_size=3))


# --- status and gather ----------------------------------------------------------------------------


def damage(folder: Path) -> dict[str, str]:
    """One shard altered, one cut short, one deleted, one without its record: name -> state."""
    altered, short, deleted, bare, *_ = shard_files(folder)
    data = bytearray(altered.read_bytes())
    data[len(data) // 2] ^= 1
    altered.write_bytes(bytes(data))
    short.write_bytes(short.read_bytes()[:-7])
    deleted.unlink()
    (folder / record_name(bare.name)).unlink()
    states = ("damaged", "damaged", "damaged", "missing")
    return dict(zip((p.name for p in (altered, short, deleted, bare)), states, strict=True))


def test_status_says_what_is_there_missing_and_damaged(study, whole, tmp_path):
    run_study(study, tmp_path, RunOptions(shard_size=SIZE))
    assert survey(tmp_path).finished
    wrong = damage(tmp_path)
    (tmp_path / "realisations" / "notes.txt").write_text("mine", encoding="utf-8")
    found = survey(tmp_path)
    assert not found.finished
    assert {fault.shard: fault.state for fault in found.faults} == wrong
    assert found.strays == ("realisations/notes.txt",)
    assert (found.n_whole, found.n_shards) == (2, 6)
    told = runner.invoke(app, ["status", str(tmp_path), "--json"])
    assert told.exit_code == 0
    data = json.loads(told.stdout)
    assert (data["whole"], data["shards"], data["finished"]) == (2, 6, False)
    assert {fault["shard"] for fault in data["faults"]} == set(wrong)
    text = runner.invoke(app, ["status", str(tmp_path)]).stdout
    assert "2 of 6 shards" in text
    assert "computes what is missing" in text
    # What is not ours is never removed: no run begins, and nothing is closed, before it has gone.
    for verb in (lambda: gather(tmp_path), lambda: run_study(study, tmp_path)):
        with pytest.raises(InputError, match=r"notes\.txt' is of no run"):
            verb()
    (tmp_path / "realisations" / "notes.txt").unlink()
    refused = runner.invoke(app, ["gather", str(tmp_path)])
    assert refused.exit_code == 2
    assert "altered or cut short" in refused.stderr
    # The same run mends it: nothing but what was damaged is computed.
    done = run_study(study, tmp_path)
    assert done.n_computed == 4
    assert everything(tmp_path) == everything(whole)


def test_no_damage_is_read_as_a_result(whole, tmp_path):
    """Every file that a reader takes a number from: altered, cut short, deleted."""
    folder = tmp_path / "copy"
    shutil.copytree(whole, folder)
    for name, data in everything(folder).items():
        if name.startswith((".shards", "summary", "data_dictionary")):
            continue
        for other in (data.replace(b"1", b"2", 1), data[1:], None):
            path = folder / name
            path.unlink()
            if other is not None:
                path.write_bytes(other)
            with pytest.raises(InputError):
                read_results(folder)
            path.write_bytes(data)
    assert len(read_results(folder).realisations) == 2 * N


def test_status_and_gather_of_something_else(tmp_path):
    for verb in ("status", "gather"):
        for folder in (tmp_path / "none", tmp_path):
            done = runner.invoke(app, [verb, str(folder)])
            assert done.exit_code == 2
            assert "Traceback" not in done.stderr
    assert list(tmp_path.iterdir()) == []  # nothing was made there


def test_gather_refuses_a_study_that_was_changed_by_hand(study, tmp_path):
    run_study(study, tmp_path, RunOptions(shard_size=SIZE))
    path = tmp_path / "study.toml"
    (tmp_path / "manifest.json").unlink()
    path.write_text(path.read_text(encoding="utf-8").replace("1.03", "1.04"), encoding="utf-8")
    with pytest.raises(InputError, match="is not the study of this run"):
        gather(tmp_path)


# --- memory ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("times", [1, 2])
def test_out_of_memory_takes_a_smaller_batch_once(study, whole, tmp_path, monkeypatch, times):
    run, sizes = CycleJump.run, []

    def scarce(self, amplitudes, *arguments, **options):
        sizes.append(len(amplitudes))
        if len(sizes) <= times:
            raise MemoryError
        return run(self, amplitudes, *arguments, **options)

    monkeypatch.setattr(CycleJump, "run", scarce)
    if times == 2:
        with pytest.raises(NumericalError, match=r"do not fit .*batch=1"):
            run_study(study, tmp_path, RunOptions(shard_size=4))
        return
    done = run_study(study, tmp_path, RunOptions(shard_size=SIZE, batch=2))
    assert sizes[:3] == [2, 1, 1]
    assert len(done.remarks) == 1
    assert "batch=1" in done.remarks[0]
    assert everything(tmp_path) == everything(whole)


# --- locks ----------------------------------------------------------------------------------------


def put(folder: Path, owner: lock.Owner, unlocked: bool = False) -> Path:
    """The lock of ``owner``; ``unlocked``: with the file whose lock has died with it."""
    path = folder / lock.LOCKS / f"{owner.host}-{owner.pid}-00000000.json"
    path.parent.mkdir(parents=True, exist_ok=True)
    if unlocked:
        path.with_suffix(".lock").touch()
    path.write_text(json.dumps(vars(owner)), encoding="utf-8")
    return path


def test_two_runs_in_one_folder(study, whole):
    """A live owner is refused by name; the folder stays as it is."""
    before = everything(whole)
    path = put(whole, lock.myself("run"))
    with pytest.raises(InputError, match=f"in use by process {os.getpid()} on "):
        run_study(study, whole)
    with pytest.raises(InputError, match="in use by"):
        gather(whole)
    with pytest.raises(InputError, match="in use by"):
        run_study(study, whole, RunOptions(shards=Slice(1, 2)))
    assert [owner.pid for owner in survey(whole).owners] == [os.getpid()]
    path.unlink()
    run_study(study, whole)
    assert everything(whole) == before


def test_slices_work_side_by_side(study, tmp_path):
    put(tmp_path, lock.myself("shards 2/6"))
    run_study(study, tmp_path, RunOptions(shards=Slice(1, 6), shard_size=SIZE))
    with pytest.raises(InputError, match=r"in use by .*shards 2/6"):
        run_study(study, tmp_path)


def test_the_lock_of_a_dead_process_is_taken_over(tmp_path, monkeypatch):
    dead = subprocess.run(
        [sys.executable, "-c", "import os; print(os.getpid())"],
        capture_output=True, text=True, check=True,
    )  # fmt: skip
    monkeypatch.setattr(lock, "_first_line", lambda path: path)
    me = lock.myself("run")
    gone = replace(me, pid=int(dead.stdout))
    reused = replace(me, ticks=me.ticks - 1)  # an earlier process of the same number
    rebooted = replace(me, boot="another")
    contained = replace(me, namespace="another", pid=1)
    for owner in (gone, reused, rebooted, contained):
        path = put(tmp_path, owner, unlocked=True)
        assert lock.owners(place(tmp_path)) == []
        with lock.held(place(tmp_path), "run"):
            assert not path.exists()
        assert [p.name for p in (tmp_path / lock.LOCKS).iterdir()] == ["gate"]


def test_a_zombie_is_dead():
    pid = os.fork()
    if pid == 0:
        os._exit(0)
    try:
        os.waitid(os.P_PID, pid, os.WEXITED | os.WNOWAIT)
        assert lock._ticks(pid) is None
    finally:
        os.waitpid(pid, 0)


def others() -> dict[str, lock.Owner]:
    """Runs whose process this one cannot ask."""
    me = replace(lock.myself("run"), pid=1, ticks=1)
    return {
        "another host": replace(me, host="elsewhere", boot="another"),
        "another container": replace(me, namespace="another"),
        "a machine of the same name": replace(me, boot="another", machine="another"),
        "an older version": replace(me, machine="", namespace=""),
    }


@pytest.mark.parametrize("kind", others())
def test_a_lock_that_cannot_be_told_stays_until_it_is_taken_over(tmp_path, kind):
    path = put(tmp_path, others()[kind], unlocked=kind == "a machine of the same name")
    refused = pytest.raises(InputError, match=r"in use by process 1 on .*take_over=")
    with refused, lock.held(place(tmp_path), "run"):
        raise AssertionError
    assert len(lock.owners(place(tmp_path))) == 1
    with lock.held(place(tmp_path), "run", take_over=True):
        assert not path.exists()


def test_a_living_run_of_another_container_keeps_its_lock(tmp_path):
    """Same kernel, another PID namespace: the operating system's lock tells, and is never taken."""
    owner = others()["another container"]
    path = put(tmp_path, owner, unlocked=True)
    with filelock.FileLock(path.with_suffix(".lock")):
        assert lock.owners(place(tmp_path)) == [owner]
        for take_over in (False, True):
            refused = pytest.raises(InputError, match="in use by process 1 on ")
            with refused, lock.held(place(tmp_path), "run", take_over):
                raise AssertionError
    with lock.held(place(tmp_path), "run"):
        assert not path.exists()


def test_a_run_keeps_the_lock_of_its_file(tmp_path):
    """What another container asks is there while the run works, and is gone with it."""
    with lock.held(place(tmp_path), "run"):
        (file,) = (tmp_path / lock.LOCKS).glob("*.lock")
        with pytest.raises(filelock.Timeout):
            filelock.FileLock(file).acquire(timeout=0)
    assert [p.name for p in (tmp_path / lock.LOCKS).iterdir()] == ["gate"]


def test_a_gate_that_is_kept_shut_is_said(tmp_path, monkeypatch):
    monkeypatch.setattr(lock, "GATE_PATIENCE", 0.1)
    with lock._gate(place(tmp_path)):
        refused = pytest.raises(InputError, match=r"gate' has been locked for 0\.1 s by a process")
        with refused, lock.held(place(tmp_path), "run"):
            raise AssertionError


@pytest.mark.parametrize("content", ["", "{", "[]", '{"role": 1}', "[" * 100_000])
def test_a_damaged_lock_counts_for_nothing(tmp_path, content):
    path = put(tmp_path, lock.myself("run"))
    path.write_text(content, encoding="utf-8")
    with lock.held(place(tmp_path), "run"):
        pass


def test_nothing_depends_on_the_clock(study, whole, tmp_path, monkeypatch):
    """The clock jumps back by a year in mid-run, files come from the future: the same bytes."""
    run_study(study, tmp_path, RunOptions(shards=Slice(1, 2), shard_size=SIZE))
    for path in tmp_path.rglob("*"):
        os.utime(path, (4e9, 4e9))
    monkeypatch.setattr(compute.time, "monotonic", iter(range(10**9, 0, -1)).__next__)
    run_study(study, tmp_path)
    assert everything(tmp_path) == everything(whole)
    assert manifest.verify(tmp_path)
