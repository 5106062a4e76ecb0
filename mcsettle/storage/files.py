"""Files written whole or not at all, the cache folder, and files of others read with limits.

A file is written under FOLDER/.tmp, synchronised and moved into place: a reader, or a run that was
killed, never leaves half a file under the name of a whole one.
"""

import contextlib
import hashlib
import os
import re
import socket
import stat
from collections.abc import Callable, Iterator
from pathlib import Path, PurePosixPath
from typing import BinaryIO

from mcsettle.errors import InputError

ASIDE = ".tmp"  # unfinished files of a results folder
UNFINISHED = ".part"  # how their names end
LONGEST_NAME = 150  # bytes of a name that is written out in that of its unfinished file
URL = re.compile(r"([A-Za-z][A-Za-z0-9+.-]+):/{1,3}(?=[^/])")  # C:/ is none


def is_url(where: object) -> bool:
    """Whether ``where`` is a URL, served or not; one that went through pathlib has lost a slash.

    Examples
    --------
    >>> is_url("s3://bucket/run"), is_url("s3:/bucket/run"), is_url("results/s3"), is_url("C:/run")
    (True, True, False, False)
    """
    return URL.match(str(where)) is not None


def cache_folder() -> Path:
    """Folder of precomputed results: ``MCSETTLE_CACHE`` or the user's cache; made if missing.

    Where ``MCSETTLE_CACHE`` is a URL, the user's cache holds the copies of what is there.

    Raises
    ------
    InputError
        The folder cannot be made.
    """
    own = os.environ.get("MCSETTLE_CACHE")
    own = None if own and is_url(own) else own
    base = own or os.environ.get("XDG_CACHE_HOME")
    try:
        folder = Path(base) if base else Path.home() / ".cache"
    except RuntimeError:  # no HOME, and a user whom the system does not know
        raise InputError(
            "this user has no home; set MCSETTLE_CACHE to a folder for the cache"
        ) from None
    if not own:
        folder = folder / "mcsettle"
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(
            f"the cache folder {folder} cannot be made ({error.strerror}); "
            "set MCSETTLE_CACHE to a folder that can be written"
        ) from None
    return folder


def write_bytes(folder: Path, name: str, data: bytes) -> Path:
    """Write ``data`` to ``folder/name``, a results folder's or a cache's, whole or not at all.

    Raises
    ------
    InputError
        If the folder cannot be written, or a link leads out of it.
    """
    target, aside = inside(folder, name), inside(folder, f"{ASIDE}/{unfinished(name)}")
    with writable(folder):
        _make(aside.parent)
        _make(target.parent)
        _replace(target, aside, lambda file: file.write(data))
    return target


def write_file(path: Path, data: bytes) -> Path:
    """Write ``data`` to a file of the user's, whole or not at all; its folder is made.

    Where ``path`` is a link, the file that it leads to is written. Nothing else is left in the folder.

    Raises
    ------
    InputError
        If the folder cannot be written.
    """
    target = path.resolve()
    with writable(target.parent):
        _make(target.parent)
        _replace(target, _hidden(target), lambda file: file.write(data))
    return path


def write_cached(path: Path, fill: Callable[[BinaryIO], object]) -> None:
    """Let ``fill`` write a file of a cache, whole or not at all, for all whom the umask lets read it.

    Raises
    ------
    OSError
        If the folder cannot be written.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    _replace(path, _hidden(path), fill)


def unfinished(name: str) -> str:
    """Name of a file while it is written.

    Host and process keep two writers of one file apart; neither outlives the move.
    """
    stem = name.replace("/", "--")
    if len(os.fsencode(stem)) > LONGEST_NAME:
        stem = hashlib.sha256(os.fsencode(stem)).hexdigest()
    return f"{stem}.{socket.gethostname()[:40]}.{os.getpid()}{UNFINISHED}"


def _hidden(path: Path) -> Path:
    """Where a file is written that has no folder of unfinished ones."""
    return path.with_name(f".{unfinished(path.name)}")


def inside(folder: Path, name: str) -> Path:
    """Path of ``folder/name``, where no link stands between the two; the file itself may be one.

    Raises
    ------
    InputError
        A link, or the name, leads out of the folder.
    """
    parts = PurePosixPath(name).parts
    if not parts or ".." in parts or PurePosixPath(name).is_absolute():
        raise InputError(f"'{folder}' has no file called {name!r}")
    path = folder
    for part in parts[:-1]:
        path = path / part
        refuse_link(path)
    return path / parts[-1]


def refuse_link(path: Path) -> None:
    """Refuse a link: what a folder from elsewhere links to is not its own.

    Raises
    ------
    InputError
        There is one.
    """
    if path.is_symlink():
        raise InputError(
            f"'{path}' is a link; none is followed inside a results folder or a cache: remove it, or "
            "put the files themselves there"
        )


def _replace(target: Path, aside: Path, fill: Callable[[BinaryIO], object]) -> None:
    """Let ``fill`` write a file aside, synchronise it and move it into place."""
    try:
        aside.unlink(missing_ok=True)  # of an earlier process of this number
        with aside.open("xb") as file:
            fill(file)
            file.flush()
            os.fsync(file.fileno())  # by the handle that wrote it, as every system takes it
        os.replace(aside, target)
    finally:
        with contextlib.suppress(OSError):  # a disk that has just gone tells so above
            aside.unlink(missing_ok=True)
    with contextlib.suppress(OSError):  # a folder cannot be synchronised everywhere
        _synchronise(target.parent)


@contextlib.contextmanager
def writable(folder: object) -> Iterator[None]:
    """Turn the operating system's refusals into one the user can act on."""
    try:
        yield
    except OSError as error:
        reason = error.strerror or str(error)
        raise InputError(
            f"the results folder '{folder}' cannot be written: {reason}; give one that can, or mend "
            "it: the same command goes on from what is there"
        ) from error


def read_regular(path: Path, largest: int) -> bytes:
    """Bytes of a regular file of at most ``largest`` bytes: no pipe, no device, nothing endless.

    Raises
    ------
    OSError
        If it cannot be read.
    InputError
        It is no regular file, or is too large.
    """
    state = path.stat()
    if not stat.S_ISREG(state.st_mode):
        raise InputError(f"'{path}' is not a regular file; remove it")
    if state.st_size > largest:
        raise InputError(f"'{path}' has {state.st_size} bytes; at most {largest} are read")
    with path.open("rb") as file:
        return file.read(largest + 1)


PACKED = {
    b"\x1f\x8b": "gzip",
    b"BZh": "bzip2",
    b"PK\x03\x04": "zip",
    b"\xfd7zXZ": "xz",
    b"\x28\xb5\x2f\xfd": "zstd",
    b"\x04\x22\x4d\x18": "lz4",
}


def packed_as(path: Path) -> str | None:
    """Name of the compression of the file at ``path``; None where its first bytes are of none."""
    with path.open("rb") as file:
        start = file.read(8)
    return next((kind for mark, kind in PACKED.items() if start.startswith(mark)), None)


def n_lines(path: Path) -> int:
    """Lines of the file at ``path``, however they end."""
    feeds = returns = 0
    with path.open("rb") as file:
        while block := file.read(1 << 22):
            feeds, returns = feeds + block.count(b"\n"), returns + block.count(b"\r")
    return max(feeds, returns)


def _make(folder: Path) -> None:
    """Make a folder so that it outlives a power cut."""
    if folder.is_dir():
        return
    _make(folder.parent)
    folder.mkdir(exist_ok=True)
    with contextlib.suppress(OSError):
        _synchronise(folder.parent)


def _synchronise(folder: Path) -> None:
    """Have the operating system put the names in a folder on the disk."""
    handle = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def sha256(path: Path) -> str:
    """Hex SHA-256 of a file."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
