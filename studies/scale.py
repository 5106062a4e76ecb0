"""What sharing a run costs: seconds of one process, two parts, two Dask workers; memory by shards.

    python studies/scale.py walls                             some minutes; on a quiet machine
    python studies/scale.py walls --rows 480 --shards 12      shards of half a minute; 15 minutes
    python studies/scale.py memory                            50, 500 and 2000 shards; ten minutes

The study is ``toy.toml`` train by train, so a shard of few rows takes seconds; everything runs with one
thread a process, in processes of its own, and the folders are compared byte for byte. ``memory`` takes
shards of one row, and the highest resident memory of client and scheduler, closing apart. Markdown on
stdout.

Depends on: mcsettle; the extra ``distributed``.
"""

import argparse
import json
import os
import socket
import statistics
import subprocess
import sys
import tempfile
import time
import tomllib
from pathlib import Path
from typing import NamedTuple

from mcsettle.storage.files import sha256
from mcsettle.study.study import Study, resolved_toml

TOY = Path(__file__).with_name("toy.toml")
MCSETTLE = (sys.executable, "-c", "from mcsettle.cli.app import main; main()")
Running = subprocess.Popen[bytes]
DASK = (sys.executable, "-m", "dask")


class Spent(NamedTuple):
    """Seconds of wall and of CPU, children included."""

    wall: float
    cpu: float


def written(folder: Path, realisations: int, stepping: str) -> Path:
    """The toy study with so many tracks and this stepping, as a file."""
    data = tomllib.loads(TOY.read_text(encoding="utf-8"))
    data["run"] |= {"realisations": realisations, "stepping": stepping}
    path = folder / "study.toml"
    path.write_text(resolved_toml(Study.from_mapping(data)), encoding="utf-8")
    return path


def together(*commands: tuple[str, ...]) -> Spent:
    """Run ``mcsettle`` commands side by side."""
    began, running = time.monotonic(), []
    for command in commands:
        running.append(subprocess.Popen([*MCSETTLE, *command], stderr=subprocess.DEVNULL))
    cpu = 0.0
    for process in running:
        _, status, used = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
        if process.returncode:
            sys.exit(f"{' '.join(process.args[3:])} ended with {process.returncode}")
        cpu += used.ru_utime + used.ru_stime
    return Spent(time.monotonic() - began, cpu)


def contents(folder: Path) -> dict[str, str]:
    """Digests of all files that are results."""
    names = (path.relative_to(folder) for path in folder.rglob("*") if path.is_file())
    return {str(n): sha256(folder / n) for n in names if not str(n).startswith(".")}


def shard_seconds(folder: Path) -> float:
    """Median seconds of wall of a shard."""
    logs = (folder / ".log").glob("*.jsonl")
    lines = [json.loads(line) for log in logs for line in log.read_text().splitlines()]
    return statistics.median(line["seconds"] for line in lines if line["event"] == "done")


def walls(folder: Path, rows: int, shards: int) -> None:
    """One process, two parts at a time and their closing, two Dask workers."""
    study = str(written(folder, rows * shards // 2, "every_train"))

    def run(name: str, *more: str) -> tuple[str, ...]:
        out = str(folder / name)
        size = ("--shard-size", str(rows), "--threads", "1")
        return ("run", study, "--out", out, *size, *more)

    together(("run", study, "--out", str(folder / "warm"), "--realisations", "32"))
    one = together(run("one"))
    parts = together(run("parts", "--shards", "1/2"), run("parts", "--shards", "2/2"))
    closing = together(("gather", str(folder / "parts")))
    dask = together(run("dask", "--scheduler", "local:2"))
    same = contents(folder / "one") == contents(folder / "parts") == contents(folder / "dask")
    print(
        f"{shards} shards of {rows} tracks train by train, {shard_seconds(folder / 'one'):.1f} s each; "
    )
    print(
        f"load of the machine {os.getloadavg()[2]:.1f}; folders {'equal' if same else 'DIFFER'}\n"
    )
    print("| | wall s | CPU s |\n|---|---|---|")
    told = {"one process": one, "two parts at a time": parts, "their `gather`": closing,
            "client and two Dask workers": dask}  # fmt: skip
    for name, spent in told.items():
        print(f"| {name} | {spent.wall:.1f} | {spent.cpu:.1f} |")
    whole = Spent(parts.wall + closing.wall, parts.cpu + closing.cpu)
    print(f"\nTwo parts and gather: {one.wall / whole.wall:.2f} times as fast as one process. ")
    print(f"Two workers against two parts and gather: wall {dask.wall / whole.wall - 1:+.1%}, ")
    print(
        f"CPU {dask.cpu / whole.cpu - 1:+.1%}; against one process: CPU {dask.cpu / one.cpu - 1:+.1%}."
    )


def peak(pid: int) -> float:
    """Highest resident memory [MiB] that a process has had."""
    text = Path(f"/proc/{pid}/status").read_text(encoding="ascii")
    line = next((line for line in text.splitlines() if line.startswith("VmHWM")), "VmHWM: 0")
    return int(line.split()[1]) / 1024


def memory(folder: Path, counts: list[int]) -> None:
    """Highest resident memory of client and scheduler, by the number of shards."""
    print("| shards | client until the last one, MiB | and its closing | scheduler | s |")
    print("|---|---|---|---|---|")
    for n in counts:
        own = folder / str(n)
        own.mkdir()
        study = str(written(own, n // 2, "cycle_jump"))
        with socket.socket() as probe:
            probe.bind(("127.0.0.1", 0))
            address = f"tcp://127.0.0.1:{probe.getsockname()[1]}"
        head = (*DASK, "scheduler", "--port", address.rpartition(":")[2], "--no-dashboard")
        hand = (*DASK, "worker", address, "--nthreads", "1", "--no-dashboard")
        quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
        running = [subprocess.Popen(command, **quiet) for command in (head, hand, hand)]
        try:
            command = ("run", study, "--out", str(own / "out"), "--shard-size", "1")
            began = time.monotonic()
            client = subprocess.Popen([*MCSETTLE, *command, "--scheduler", address], **quiet)
            held = watched(client, running[0], own / "out" / ".shards", n)
        finally:
            for process in reversed(running):
                process.terminate()
                process.wait()
        if client.returncode:
            sys.exit(f"the run of {n} shards ended with {client.returncode}")
        told = " | ".join(f"{value:.0f}" for value in (*held, time.monotonic() - began))
        print(f"| {n} | {told} |", flush=True)


def watched(client: Running, head: Running, records: Path, n: int) -> tuple[float, float, float]:
    """Peaks [MiB] of a client while fewer than ``n`` shards have records, of all of it, of ``head``."""
    found = (0.0, 0.0, 0.0)
    while client.poll() is None:
        sending = not records.is_dir() or len(os.listdir(records)) < n
        held = max(found[1], peak(client.pid))
        found = (held if sending else found[0], held, peak(head.pid))
        time.sleep(0.2)
    return found


def main() -> None:
    """What is asked for."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("what", choices=("walls", "memory"))
    parser.add_argument("--rows", type=int, default=64, help="tracks of a shard")
    parser.add_argument("--shards", type=int, default=8, help="of the whole run; even")
    parser.add_argument("--counts", type=int, nargs="+", default=[50, 500, 2000])
    asked = parser.parse_args()
    os.environ["OPENBLAS_NUM_THREADS"] = "1"
    with tempfile.TemporaryDirectory() as name:
        if asked.what == "walls":
            walls(Path(name), asked.rows, asked.shards)
        else:
            memory(Path(name), asked.counts)


if __name__ == "__main__":
    main()
