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
from pathlib import Path

from mcsettle.errors import InputError

ASIDE = ".tmp"  # unfinished files of a results folder
URL = re.compile(r"(s3|gs|gcs|abfs|abfss):/{1,2}(?=[^/])")


def is_url(where: object) -> bool:
    """Whether ``where`` names an object store; a URL that went through pathlib lost one slash.

    Examples
    --------
    >>> is_url("s3://bucket/run"), is_url("s3:/bucket/run"), is_url("results/s3")
    (True, True, False)
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
    folder = Path(base) if base else Path.home() / ".cache"
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


def write_text(folder: Path, name: str, text: str) -> Path:
    """Write a text file ``folder/name``, UTF-8, whole or not at all.

    Raises
    ------
    InputError
        If the folder cannot be written.
    """
    return write_bytes(folder, name, text.encode("utf-8"))


def write_bytes(folder: Path, name: str, data: bytes) -> Path:
    """Write ``data`` to ``folder/name``, whole or not at all.

    Raises
    ------
    InputError
        If the folder cannot be written.
    """

    def fill(path: Path) -> None:
        with path.open("wb") as file:
            file.write(data)

    return write_whole(folder, name, fill)


def write_whole(folder: Path, name: str, fill: Callable[[Path], None]) -> Path:
    """Let ``fill`` write a file aside, synchronise it and move it to ``folder/name``.

    Raises
    ------
    InputError
        If the folder cannot be written.
    """
    target = folder / name
    # Host and process keep two writers of one file apart; neither outlives the move.
    own = f"{socket.gethostname()[:40]}.{os.getpid()}"
    aside = folder / ASIDE / f"{name.replace('/', '--')}.{own}"
    with writable(folder):
        _make(aside.parent)
        _make(target.parent)
        try:
            fill(aside)
            _synchronise(aside)
            os.replace(aside, target)
        finally:
            with contextlib.suppress(OSError):  # a disk that has just gone tells so above
                aside.unlink(missing_ok=True)
        with contextlib.suppress(OSError):  # a folder cannot be synchronised everywhere
            _synchronise(target.parent)
    return target


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
    held = path.stat()
    if not stat.S_ISREG(held.st_mode):
        raise InputError(f"'{path}' is no regular file; remove it")
    if held.st_size > largest:
        raise InputError(f"'{path}' has {held.st_size} bytes; at most {largest} are read")
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


def _synchronise(path: Path) -> None:
    """Have the operating system put a file or folder on the disk."""
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def sha256(path: Path) -> str:
    """Hex SHA-256 of a file."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
