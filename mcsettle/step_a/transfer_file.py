"""Transfer functions on disk: one npz file without pickles, written whole or not at all."""

import contextlib
import hashlib
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mcsettle.errors import InputError
from mcsettle.step_a.transfer import DepthGrid, TransferFunctions
from mcsettle.storage.files import refuse_link, write_cached
from mcsettle.storage.npz import DAMAGED, refuse_large

FORMAT = "mcsettle transfer functions 1"
_GRID = ("z", "weights", "layer")
_ARRAYS = (
    "wavenumbers",
    "quasi_static",
    "dynamic",
    "force",
    "track_compliance",
    "geostatic",
    "rail_deflection",
)
_TEXTS = ("train", "digest")


def save(transfer: TransferFunctions, path: str | Path) -> None:
    """Write ``transfer`` to ``path`` (npz), replacing what is there in one step.

    A reader sees the old file or the new one, never a part. The bytes depend on the content alone.

    Raises
    ------
    OSError
        If the folder cannot be written.
    """
    path = Path(path)
    members: dict[str, Any] = {name: np.asarray(getattr(transfer, name)) for name in _ARRAYS}
    members |= {f"grid_{name}": np.asarray(getattr(transfer.grid, name)) for name in _GRID}
    members |= {name: np.array(getattr(transfer, name)) for name in _TEXTS}
    members |= {"speed": np.array(transfer.speed), "format": np.array(FORMAT)}
    if transfer.following is not None:
        members["following"] = np.asarray(transfer.following)
    members["checksum"] = np.array(_checksum(members))
    write_cached(path, lambda file: np.savez(file, **members))


def load(path: str | Path) -> TransferFunctions:
    """Read the transfer functions that ``save`` wrote.

    Raises
    ------
    FileNotFoundError
        If there is no such file.
    InputError
        If the file is damaged or of another format.
    """
    try:
        refuse_link(Path(path))
        refuse_large(Path(path))
        with open(path, "rb") as raw, np.load(raw, allow_pickle=False) as file:
            members = {name: file[name] for name in file.files}
    except FileNotFoundError:
        raise
    except (*DAMAGED, KeyError) as error:
        raise InputError(f"{path} is damaged or no file of transfer functions: {error}") from error
    stored = str(members.pop("checksum", ""))
    found = str(members.get("format", "nothing"))
    if found != FORMAT:
        raise InputError(f"{path} holds '{found}', expected '{FORMAT}'; compute it anew")
    if stored != _checksum(members):
        raise InputError(f"{path} is damaged: its checksum does not match; compute it anew")
    try:
        transfer = TransferFunctions(
            train=str(members["train"]),
            speed=float(members["speed"]),
            grid=DepthGrid(*(members[f"grid_{name}"] for name in _GRID)),
            digest=str(members["digest"]),
            following=members.get("following"),
            **{name: members[name] for name in _ARRAYS},
        )
        _refuse_shapes(transfer)
        return transfer
    except (KeyError, TypeError, ValueError) as error:
        raise InputError(f"{path} is damaged ({error}); compute it anew") from error


def _refuse_shapes(transfer: TransferFunctions) -> None:
    """Refuse arrays whose shapes do not fit each other.

    Raises
    ------
    ValueError
        The message names the first.
    """
    j, k, z = len(transfer.rail_deflection), len(transfer.wavenumbers), len(transfer.grid.z)
    shapes = {
        "wavenumbers": (k,),
        "quasi_static": (j, 4, z),
        "dynamic": (j, k, 4, z),
        "force": (j, k),
        "track_compliance": (k,),
        "geostatic": (4, z),
        "rail_deflection": (j,),
    }
    for name, shape in shapes.items():
        if getattr(transfer, name).shape != shape:
            raise ValueError(f"'{name}' has the shape {getattr(transfer, name).shape}, not {shape}")
    for name in _GRID:
        if getattr(transfer.grid, name).shape != (z,):
            raise ValueError(f"the depths' '{name}' has another shape than 'z'")


def _checksum(members: dict[str, NDArray[Any]]) -> str:
    """SHA-256 over name, type, shape and bytes of every member, in the order of the names."""
    total = hashlib.sha256()
    for name in sorted(members):
        array = np.ascontiguousarray(members[name])
        total.update(f"{name} {array.dtype.str} {members[name].shape}\n".encode())
        total.update(array.tobytes())
    return total.hexdigest()


def keep_newest(folder: Path, pattern: str, most: int) -> None:
    """Remove the files of ``folder`` that were used longest ago, until ``most`` bytes remain.

    The newest one stays, whatever its size.
    """
    found = []
    for path in folder.glob(pattern):
        with contextlib.suppress(OSError):  # another process may have removed it
            state = path.stat()
            found.append((state.st_mtime_ns, state.st_size, path))
    held = 0
    for place, (_, size, path) in enumerate(sorted(found, reverse=True)):
        held += size
        if held > most and place > 0:
            with contextlib.suppress(OSError):
                path.unlink()
