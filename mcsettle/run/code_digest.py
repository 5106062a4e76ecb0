"""Digest of the package's own sources: the version alone does not tell changed code.

Of all that decides the rows of a run; reports, analyses and the command line may change without.
"""

import functools
import hashlib
from pathlib import Path

import mcsettle
import mcsettle.kernels

# What may change and leave the rows of a run as they are.
_AFTER = ("analysis", "cli", "report", "verification")


@functools.cache
def code_digest() -> str:
    """SHA-256 [hex] of names and bytes of the sources, the same wherever they are installed."""
    total = hashlib.sha256()
    for name, path in sorted(_sources().items()):
        data = path.read_bytes()
        total.update(f"{name} {len(data)}\n".encode() + data)
    return total.hexdigest()


def _sources() -> dict[str, Path]:
    """Python sources and data files by their names in the installed package."""
    roots = {"": Path(mcsettle.__path__[0]), "kernels/": Path(mcsettle.kernels.__path__[0])}
    files = {
        f"{prefix}{path.relative_to(root).as_posix()}": path
        for prefix, root in roots.items()
        for path in root.rglob("*")
        if path.is_file() and (path.suffix == ".py" or path.parent.name == "data")
    }
    return {name: path for name, path in files.items() if name.split("/")[0] not in _AFTER}
