"""Files that a study names: where they may lie, and what they hold.

A name starts from the study's own folder and stays inside it, links followed, unless the study says
``files_outside = true``: a study from elsewhere reads nothing that does not come with it.
"""

from functools import lru_cache
from pathlib import Path

from mcsettle.errors import InputError
from mcsettle.railway.record import file_digest


def input_file(folder: Path | None, name: str, outside: bool = False) -> Path:
    """Path of the file ``name`` of a study that lies in ``folder`` (None: the working folder).

    Raises
    ------
    InputError
        The name leads out of the folder and ``outside`` is not set, or is no name of a file.
    """
    base = (folder or Path.cwd()).resolve()
    try:
        path = (base / name).resolve()
    except (OSError, ValueError, RuntimeError) as error:
        raise InputError(f"received {name!r}, which is no file name: {error}") from None
    if not outside and not path.is_relative_to(base):
        raise InputError(
            f"received {name!r}, which leads out of the study's folder; put the file there, or say "
            "files_outside = true at the top of the study"
        )
    return path


def digest_of(path: Path, expected: str | None, missing: bool = True) -> str:
    """SHA-256 of the file at ``path``; with ``missing`` a known digest stands for a lost file.

    Raises
    ------
    InputError
        There is no such file, or it is not the one expected.
    """
    try:
        known = path.stat()
        found = _digest(path, known.st_size, known.st_mtime_ns) if path.is_file() else None
    except (OSError, ValueError):
        found = None
    if found is None:
        if expected is not None and missing:
            return expected
        raise InputError(f"{path} does not exist or is no file that can be read")
    if expected is not None and found != expected:
        raise InputError(
            f"{path} is not the file that the study was made with (SHA-256 {found[:12]}…, expected "
            f"{expected[:12]}…); put the old one back, or leave out sha256"
        )
    return found


@lru_cache(maxsize=64)
def _digest(path: Path, size: int, modified: int) -> str:
    del size, modified  # they tell a changed file from the one that is known
    return file_digest(path)
