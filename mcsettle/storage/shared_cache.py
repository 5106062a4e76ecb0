"""A cache in an object store: what Step A has computed anywhere is fetched, what is new is put there.

Where ``MCSETTLE_CACHE`` is a URL, the files of the cache folder of this machine are copies of the
objects below it. They are found by the digest of all they depend on, and checked when they are read.
"""

import os
import warnings
from collections.abc import Callable
from pathlib import Path

from mcsettle.storage.files import cache_folder, is_url, write_cached
from mcsettle.storage.location import Place, place

LARGEST = 1024**3  # bytes of a file of the cache


def bring(path: Path) -> None:
    """Fetch ``path``, a file of the cache folder, if it is missing here and is in the shared cache.

    Raises
    ------
    InputError
        The shared cache cannot be reached.
    """
    shared = _shared(path)
    if shared is None or path.exists():
        return
    try:
        data = shared.read(path.name, LARGEST)
    except FileNotFoundError:
        return
    kept(path, lambda: write_cached(path, lambda file: file.write(data)))


def kept(path: Path, write: Callable[[], object]) -> bool:
    """Let ``write`` put ``path`` into the cache folder; whether it could.

    The cache is a courtesy: where it is full, read-only or somebody else's, the run goes on, and what
    it has computed is computed again the next time.
    """
    try:
        write()
    except OSError as error:
        warnings.warn(
            f"'{path}' cannot be kept ({error.strerror or error}); it is computed again the next time: "
            "make room there, or name another cache folder (MCSETTLE_CACHE)",
            RuntimeWarning,
            stacklevel=3,
        )
        return False
    return True


def share(path: Path) -> None:
    """Put ``path``, a file of the cache folder, into the shared cache, if there is one.

    Raises
    ------
    InputError
        The shared cache cannot be reached.
    """
    shared = _shared(path)
    if shared is not None:
        shared.write(path.name, path.read_bytes())


def _shared(path: Path) -> Place | None:
    url = os.environ.get("MCSETTLE_CACHE", "")
    return place(url) if is_url(url) and path.parent == cache_folder() else None
