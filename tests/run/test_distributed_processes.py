"""A run by Dask workers that are processes: the same bytes, whatever dies on the way."""

import contextlib
import json
import os
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

import pytest
import toy
from toy import everything

from mcsettle.run import worker
from mcsettle.run.options import RunOptions
from mcsettle.run.pipeline import run_study
from mcsettle.storage import shard_record
from mcsettle.study.study import resolved_toml

pytest.importorskip("distributed")
pytestmark = [pytest.mark.usefixtures("fresh_cache"), pytest.mark.filterwarnings("ignore")]
PROCESSES = True  # others go on with what is computed here


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def dask(*arguments: str, log: Path) -> subprocess.Popen[bytes]:
    program = [sys.executable, "-m", "dask", *arguments]
    with log.open("ab") as file:
        return subprocess.Popen(program, stdout=file, stderr=file, start_new_session=True)


def stop(process: subprocess.Popen[bytes]) -> None:
    with contextlib.suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)
    process.wait()


def done_shards(out: Path) -> int:
    return len(list((out / shard_record.RECORDS).glob("*.json")))


def wait_for(out: Path, n: int, of: subprocess.Popen[bytes]) -> None:
    while done_shards(out) < n:
        assert of.poll() is None, "the run ended too early"
        time.sleep(0.05)


@pytest.mark.slow
def test_a_killed_worker_and_a_restarted_scheduler(tmp_path):
    """40 shards, two workers: one is killed, then the scheduler too; ≤ 2 shards are repeated for each."""
    study = toy.study(run={"realisations": 40}, settlement={"settlement_factor": 30})
    whole = run_study(study, tmp_path / "whole", RunOptions(shard_size=2)).folder
    path, out, log = tmp_path / "study.toml", tmp_path / "out", tmp_path / "log"
    path.write_text(resolved_toml(study), encoding="utf-8")
    port = free_port()
    address = f"tcp://127.0.0.1:{port}"
    head = ("scheduler", "--host", "127.0.0.1", "--port", str(port), "--no-dashboard")
    hand = ("worker", address, "--nthreads", "1", "--no-dashboard")
    running = [dask(*head, log=log), dask(*hand, log=log), dask(*hand, log=log)]
    program = "from mcsettle.cli.app import main; main()"
    try:
        client = subprocess.Popen(
            [sys.executable, "-c", program, "run", str(path), "--out", str(out),
             "--scheduler", address, "--shard-size", "2"]
        )  # fmt: skip
        wait_for(out, 8, client)
        stop(running[2])
        wait_for(out, 16, client)
        stop(running[0])
        running.append(dask(*head, log=log))
        stop(running[1])  # a worker of today's Dask goes with its scheduler
        running += [dask(*hand, log=log), dask(*hand, log=log)]
        assert client.wait(timeout=600) == 0
    finally:
        for process in running:
            stop(process)
    kept = {k: v for k, v in everything(out).items() if not k.startswith(worker.STEP_A)}
    assert kept == everything(whole)
    begun = [
        line["shard"]
        for file in (out / ".log").iterdir()
        for line in map(json.loads, file.read_text(encoding="utf-8").splitlines())
        if line["event"] == "begun"
    ]
    assert len(set(begun)) == 40
    assert len(begun) - 40 <= 2  # what the two killed workers had in hand
