"""Files written whole or not at all, and their digests.

A file is written under FOLDER/.tmp, synchronised and moved into place: a reader, or a run that was
killed, never leaves half a file under the name of a whole one.

Depends on: errors.
"""

import contextlib
import hashlib
import os
from collections.abc import Callable, Iterator
from pathlib import Path

from mcsettle.errors import InputError


def cache_folder() -> Path:
    """Folder of precomputed results: ``MCSETTLE_CACHE`` or the user's cache; made if missing.

    Raises
    ------
    InputError
        The folder cannot be made.
    """
    base = os.environ.get("MCSETTLE_CACHE") or os.environ.get("XDG_CACHE_HOME")
    folder = Path(base) if base else Path.home() / ".cache"
    if not os.environ.get("MCSETTLE_CACHE"):
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

    def fill(path: Path) -> None:
        path.write_bytes(text.encode("utf-8"))

    return write_whole(folder, name, fill)


def write_whole(folder: Path, name: str, fill: Callable[[Path], None]) -> Path:
    """Let ``fill`` write a file aside, synchronise it and move it to ``folder/name``.

    Raises
    ------
    InputError
        If the folder cannot be written.
    """
    target = folder / name
    # The process id keeps two writers of one shard apart; it does not outlive the move.
    aside = folder / ".tmp" / f"{name.replace('/', '--')}.{os.getpid()}"
    with writable(folder):
        aside.parent.mkdir(parents=True, exist_ok=True)
        target.parent.mkdir(parents=True, exist_ok=True)
        try:
            fill(aside)
            _synchronise(aside)
            os.replace(aside, target)
        finally:
            aside.unlink(missing_ok=True)
        with contextlib.suppress(OSError):  # a folder cannot be synchronised everywhere
            _synchronise(target.parent)
    return target


@contextlib.contextmanager
def writable(folder: Path) -> Iterator[None]:
    """Turn the operating system's refusals into one the user can act on."""
    try:
        yield
    except OSError as error:
        reason = error.strerror or str(error)
        raise InputError(
            f"the results folder '{folder}' cannot be written: {reason}; give one that can"
        ) from error


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
