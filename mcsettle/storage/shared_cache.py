"""A cache in an object store: what Step A has computed anywhere is fetched, what is new is put there.

Where ``MCSETTLE_CACHE`` is a URL, the files of the cache folder of this machine are copies of the
objects below it. They are found by the digest of all they depend on, and checked when they are read.
"""

import os
from pathlib import Path

from mcsettle.storage.files import cache_folder, is_url, write_bytes
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
    write_bytes(path.parent, path.name, data)


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
