"""Arrays on disk, named by the digest of all they depend on, checked when read, written atomically."""

import hashlib
import json
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any, BinaryIO, TypeVar

import numpy as np

from mcsettle.step_a.fem25d.reduced_basis import Band, Bases
from mcsettle.storage.files import refuse_link, write_cached
from mcsettle.storage.npz import DAMAGED, refuse_large
from mcsettle.storage.shared_cache import bring, kept, share

FORMAT = 6  # raise whenever the same settings would give other numbers
T = TypeVar("T")
ARRAYS = ("stiffness", "mass", "load", "output0", "output1", "centreline")


def digest_of(description: dict[str, Any]) -> str:
    """SHA-256 hex digest of the canonical JSON of a description."""
    text = json.dumps(description, sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()


def write_bases(path: Path, bases: Bases) -> None:
    """Write the bases of a section to one ``.npz``, complete or not at all."""
    arrays: dict[str, np.ndarray] = {
        "bounds": np.array([[b.lower, b.upper, b.solves] for b in bases.bands]),
        "errors": bases.errors,
        "heights": bases.heights,
    }
    for i, band in enumerate(bases.bands):
        arrays.update({f"{name}_{i}": getattr(band, name) for name in ARRAYS})
    write_arrays(path, arrays)


def write_arrays(path: Path, arrays: dict[str, np.ndarray]) -> None:
    """Write arrays, the name they go by and their checksum to one ``.npz``, complete or not at all."""
    arrays = arrays | {"name": np.array(path.stem)}
    checksum = np.array(_checksum(arrays))

    def fill(file: BinaryIO) -> None:
        np.savez(file, checksum=checksum, **arrays)  # type: ignore[arg-type]

    if kept(path, lambda: write_cached(path, fill)):
        share(path)


def read_bases(path: Path) -> Bases | None:
    """Bases from disk; None if there is no file or (with a warning) a damaged one."""
    return read_arrays(
        path,
        "track response",
        lambda arrays: Bases(_bands(arrays), arrays["errors"], arrays["heights"]),
    )


def read_arrays(path: Path, what: str, make: Callable[[dict[str, np.ndarray]], T]) -> T | None:
    """``make`` of the stored arrays; None if there is no file or (with a warning) a damaged one."""
    bring(path)
    if not path.exists():
        return None
    try:
        refuse_link(path)
        refuse_large(path)
        with path.open("rb") as stream, np.load(stream, allow_pickle=False) as file:
            arrays = {name: file[name] for name in file.files}
        if str(arrays.pop("checksum")) != _checksum(arrays):
            raise ValueError("its checksum does not match")
        if str(arrays.pop("name", path.stem)) != path.stem:
            raise ValueError("it is another file under this name")
        return make(arrays)
    except (*DAMAGED, KeyError) as error:
        warnings.warn(
            f"the stored {what} {path} is damaged ({error}); it is computed again",
            RuntimeWarning,
            stacklevel=4,
        )
        return None


def _bands(arrays: dict[str, np.ndarray]) -> tuple[Band, ...]:
    bands = []
    for i, (low, up, solves) in enumerate(arrays["bounds"]):
        stored = {name: arrays[f"{name}_{i}"] for name in ARRAYS}
        bands.append(Band(lower=float(low), upper=float(up), solves=int(solves), **stored))
    return tuple(bands)


def _checksum(arrays: dict[str, np.ndarray]) -> str:
    total = hashlib.sha256()
    for name in sorted(arrays):
        a = np.ascontiguousarray(arrays[name])
        total.update(f"{name}{a.dtype.str}{a.shape}".encode())
        total.update(a.tobytes())
    return total.hexdigest()
