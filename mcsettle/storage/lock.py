"""Who is at work in a results folder: a lock with its owner, given up when the owner dies.

Every run keeps a file under DIR/.locks that names it (host, process, start, role) and beside it one
that the operating system locks for as long as the process lives. A whole run (or ``gather``) works
alone; slices of a run (``--shards``) work beside each other. What is known to be dead counts for
nothing and is taken away; what cannot be told from here counts until it is removed (``--take-over``).
No clock is consulted.

Whether a process lives is asked, in this order, of the process table (same machine, same start of it,
same PID namespace), or of the operating system's lock (same kernel, such as another container; or the
same machine started anew). A machine that merely has the same host name cannot be told.
"""

import contextlib
import errno
import json
import os
import re
import socket
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from pathlib import Path

import filelock

from mcsettle.errors import InputError
from mcsettle.storage.files import inside, writable
from mcsettle.storage.location import Folder, Place

LOCKS = ".locks"
LARGEST = 10_000  # bytes of a lock file
_NAME = re.compile(rf"{re.escape(LOCKS)}/.+-[0-9]+-[0-9a-f]{{8}}\.(json|lock)")
GATE_PATIENCE = 10.0  # s; it is held for milliseconds
NO_LOCKS = (errno.ENOLCK, errno.ENOSYS, errno.EOPNOTSUPP)
PROBE_PATIENCE = 0.5  # s; another process may be asking at the same moment


@dataclass(frozen=True)
class Owner:
    """A process at work: ``boot`` and ``ticks`` tell it from a later one of the same number.

    ``machine`` tells machines of one host name apart, ``namespace`` containers of one machine.
    """

    role: str
    host: str
    pid: int
    boot: str
    ticks: int
    started: str
    machine: str = ""
    namespace: str = ""

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
        boot=_first_line("/proc/sys/kernel/random/boot_id"),
        ticks=_ticks(os.getpid()) or 0,
        started=datetime.now(UTC).isoformat(timespec="seconds"),  # for people only
        machine=_first_line("/etc/machine-id"),
        namespace=_namespace(),
    )


def is_lock(name: str) -> bool:
    """Whether a file below ``LOCKS`` is one of ours."""
    return name == f"{LOCKS}/gate" or _NAME.fullmatch(name) is not None


def owners(at: Place) -> list[Owner]:
    """Those at work in a folder, as far as can be told from here."""
    named = [(name, _read(at, name)) for name in _names(at)]
    return [
        owner for name, owner in named if owner and is_alive(owner, _path(at, name)) is not False
    ]


def is_alive(owner: Owner, path: Path | None) -> bool | None:
    """Whether a process lives; None where that cannot be told from here.

    ``path``: of the file that the operating system locks for it; None in an object store.
    """
    me = myself(owner.role)
    same_kernel = owner.boot == me.boot and owner.host == me.host
    if same_kernel and me.boot and owner.namespace == me.namespace:
        return _ticks(owner.pid) == owner.ticks
    # A lock that can be had proves a death only where both would meet in it.
    same_machine = owner.host == me.host and owner.machine == me.machine != ""
    untold = owner.host == me.host and not (owner.boot or me.boot)  # a system without such names
    unlocked = _is_unlocked(path)
    if unlocked and (owner.boot == me.boot != "" or same_machine or untold):
        return False
    return True if unlocked is False else None


@contextlib.contextmanager
def held(at: Place, role: str, take_over: bool = False) -> Iterator[Owner]:
    """Hold the lock of a results folder while working in it.

    Parameters
    ----------
    at : the results folder
    role : "run", "gather", or "shards i/n", which may be several
    take_over : take away locks of processes that cannot be asked, but are known to be gone

    Raises
    ------
    InputError
        Another process is at work there (the message names it), or the folder cannot be written.
    """
    me = myself(role)
    name = f"{LOCKS}/{me.host}-{me.pid}-{os.urandom(4).hex()}.json"
    with contextlib.ExitStack() as stack:
        with _gate(at):
            _refuse_others(at, me, take_over)
            path = _path(at, name)
            if path is not None:
                stack.callback(_unlink, path)
                lock = filelock.FileLock(path)
                with contextlib.suppress(
                    OSError, NotImplementedError
                ):  # a file system without locks
                    stack.enter_context(lock.acquire(timeout=0))
            at.write(name, json.dumps(asdict(me), indent=2).encode())
        try:
            yield me
        finally:
            with contextlib.suppress(InputError, OSError):  # a disk that has gone took it along
                at.remove(name)


def _refuse_others(at: Place, me: Owner, take_over: bool) -> None:
    for name in _names(at):
        other, path = _read(at, name), _path(at, name)
        alive = False if other is None else is_alive(other, path)
        if other is None or alive is False or (take_over and alive is None):
            at.remove(name)
            if path is not None:
                _unlink(path)
        elif other.alone or me.alone:
            remedy = "wait for it, or stop it"
            if alive is None:
                remedy += "; if it is gone for certain, give take_over="
            raise InputError(f"'{at}' is in use by {other}; {remedy}, or give another folder")


def _names(at: Place) -> list[str]:
    """Names of the files of owners."""
    return [name for name in at.names(LOCKS) if name.endswith(".json") and is_lock(name)]


def _read(at: Place, name: str) -> Owner | None:
    """The owner in a lock file; None where it is damaged or has just gone."""
    try:
        data = json.loads(at.read(name, LARGEST))
        owner = Owner(**data)
    except (FileNotFoundError, InputError, ValueError, TypeError, RecursionError):
        return None
    return owner if all(type(v) is type(getattr(myself(""), k)) for k, v in data.items()) else None


def _path(at: Place, name: str) -> Path | None:
    """The file that the operating system locks for the owner in ``name``."""
    return at.path / f"{name.removesuffix('.json')}.lock" if isinstance(at, Folder) else None


def _is_unlocked(path: Path | None) -> bool | None:
    """Whether nobody holds the lock of a file; None where there is no such file, or no locks."""
    if path is None or path.is_symlink() or not path.is_file():
        return None
    try:
        with filelock.FileLock(path).acquire(timeout=PROBE_PATIENCE):
            return True
    except filelock.Timeout:
        return False
    except (OSError, NotImplementedError):
        return None


def _unlink(path: Path) -> None:
    with contextlib.suppress(OSError):
        path.unlink(missing_ok=True)


@contextlib.contextmanager
def _gate(at: Place) -> Iterator[None]:
    """Let one process of this host at a time look at the locks and add its own.

    Raises
    ------
    InputError
        The folder cannot be written, or another process keeps the gate shut.
    """
    if not isinstance(at, Folder):
        yield
        return
    path = inside(at.path, f"{LOCKS}/gate")
    gate = filelock.FileLock(path)
    try:
        with writable(at):
            path.parent.mkdir(parents=True, exist_ok=True)
            _shut(gate)
    except InputError as error:
        if not isinstance(error.__cause__, filelock.Timeout):
            raise
        raise InputError(
            f"'{path}' has been locked for {GATE_PATIENCE:g} s by a process that does not go on (was "
            "one stopped?); 'fuser' names it: let it continue or end it, or give another folder"
        ) from None
    try:
        yield
    finally:
        gate.release()


def _shut(gate: filelock.BaseFileLock) -> None:
    """Wait for the gate; a file system without locks has none."""
    try:
        gate.acquire(timeout=GATE_PATIENCE)
    except NotImplementedError:
        pass
    except OSError as error:
        if error.errno not in NO_LOCKS:
            raise


def _first_line(path: str) -> str:
    """Text of a file of the operating system, such as the name of this start of the machine."""
    try:
        return Path(path).read_text(encoding="ascii").strip()
    except (OSError, ValueError):
        return ""


def _namespace() -> str:
    """Name of this process's PID namespace."""
    try:
        return os.readlink("/proc/self/ns/pid")
    except OSError:
        return ""


def _ticks(pid: int) -> int | None:
    """Start of a process in clock ticks since boot; None if there is none. No clock can shift it."""
    try:
        text = Path(f"/proc/{pid}/stat").read_text(encoding="ascii", errors="replace")
    except OSError:
        return None
    fields = text.rpartition(")")[2].split()
    return None if fields[0] == "Z" else int(fields[19])  # a zombie waits to be forgotten
