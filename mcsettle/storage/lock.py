"""Who is at work in a results folder: a lock with its owner, given up when the owner dies.

Every run keeps a file under DIR/.locks that names it: host, process, start, role. A whole run (or
``gather``) works alone; slices of a run (``--shards``) work beside each other. A file whose process
is dead counts for nothing and is taken away; one of another host cannot be asked, so it counts until
it is removed (``--take-over``). On one host the operating system decides (an advisory file lock that
dies with its owner); no clock is consulted.
"""

import contextlib
import fcntl
import json
import os
import socket
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from pathlib import Path

from mcsettle.errors import InputError
from mcsettle.storage.files import writable
from mcsettle.storage.location import Folder, Place

LOCKS = ".locks"
LARGEST = 10_000  # bytes of a lock file


@dataclass(frozen=True)
class Owner:
    """A process at work: ``boot`` and ``ticks`` tell it from a later one of the same number."""

    role: str
    host: str
    pid: int
    boot: str
    ticks: int
    started: str

    @property
    def alone(self) -> bool:
        """Whether it works alone in the folder."""
        return not self.role.startswith("shards")

    def __str__(self) -> str:
        return f"process {self.pid} on {self.host} ({self.role}, since {self.started})"


def myself(role: str) -> Owner:
    """The owner that this process is."""
    return Owner(
        role=role,
        host=socket.gethostname(),
        pid=os.getpid(),
        boot=_boot(),
        ticks=_ticks(os.getpid()) or 0,
        started=datetime.now(UTC).isoformat(timespec="seconds"),  # for people only
    )


def owners(at: Place) -> list[Owner]:
    """Those at work in a folder, as far as can be told from here."""
    found = (_read(at, name) for name in at.names(LOCKS) if name.endswith(".json"))
    return [owner for owner in found if owner is not None and not is_dead(owner)]


def is_dead(owner: Owner) -> bool:
    """Whether a process of this host is gone; False for one of another host: nobody can tell."""
    if owner.host != socket.gethostname():
        return False
    if owner.boot != _boot():
        return True
    return _ticks(owner.pid) != owner.ticks


@contextlib.contextmanager
def held(at: Place, role: str, take_over: bool = False) -> Iterator[Owner]:
    """Hold the lock of a results folder while working in it.

    Parameters
    ----------
    at : the results folder
    role : "run", "gather", or "shards i/n", which may be several
    take_over : take away locks of other hosts, whose processes are known to be gone

    Raises
    ------
    InputError
        Another process is at work there (the message names it), or the folder cannot be written.
    """
    me = myself(role)
    name = f"{LOCKS}/{me.host}-{me.pid}-{os.urandom(4).hex()}.json"
    with _gate(at):
        _refuse_others(at, me, take_over)
        at.write(name, json.dumps(asdict(me), indent=2).encode())
    try:
        yield me
    finally:
        with contextlib.suppress(InputError, OSError):  # a disk that has gone took it along
            at.remove(name)


def _refuse_others(at: Place, me: Owner, take_over: bool) -> None:
    for name in at.names(LOCKS):
        if not name.endswith(".json"):
            continue
        other = _read(at, name)
        if other is None or is_dead(other) or (take_over and other.host != me.host):
            at.remove(name)
        elif other.alone or me.alone:
            remedy = "wait for it, or stop it"
            if other.host != me.host:
                remedy += "; if it is gone for certain, give --take-over"
            raise InputError(f"'{at}' is in use by {other}; {remedy}, or give another folder")


def _read(at: Place, name: str) -> Owner | None:
    """The owner in a lock file; None where it is damaged or has just gone."""
    try:
        data = json.loads(at.read(name, LARGEST))
        owner = Owner(**data)
    except (FileNotFoundError, InputError, ValueError, TypeError, RecursionError):
        return None
    return owner if all(type(v) is type(getattr(myself(""), k)) for k, v in data.items()) else None


@contextlib.contextmanager
def _gate(at: Place) -> Iterator[None]:
    """Let one process of this host at a time look at the locks and add its own."""
    if not isinstance(at, Folder):
        yield
        return
    folder: Path = at.path / LOCKS
    with writable(at):
        folder.mkdir(parents=True, exist_ok=True)
        handle = os.open(folder / "gate", os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o666)
    try:
        with contextlib.suppress(OSError):  # a file system without locks
            fcntl.flock(handle, fcntl.LOCK_EX)
        yield
    finally:
        os.close(handle)


def _boot() -> str:
    """Name of this start of the machine."""
    try:
        return Path("/proc/sys/kernel/random/boot_id").read_text(encoding="ascii").strip()
    except OSError:
        return ""


def _ticks(pid: int) -> int | None:
    """Start of a process in clock ticks since boot; None if there is none. No clock can shift it."""
    try:
        text = Path(f"/proc/{pid}/stat").read_text(encoding="ascii", errors="replace")
    except OSError:
        return None
    fields = text.rpartition(")")[2].split()
    return None if fields[0] == "Z" else int(fields[19])
