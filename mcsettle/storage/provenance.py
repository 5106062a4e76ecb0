"""What decides the bytes of a results folder, and the JSON that says so.

DIR/provenance.json        what the folder holds, written first; another study is refused
"""

import hashlib
import json
from collections.abc import Mapping
from dataclasses import MISSING, asdict, dataclass, fields
from typing import Any

from mcsettle.errors import InputError
from mcsettle.storage.location import Place, Where, place

PROVENANCE = "provenance.json"
SHARD = 2048  # realisations of a shard, unless a run says otherwise
LARGEST_TEXT = 4_000_000  # bytes of a text file that is read


@dataclass(frozen=True)
class Provenance:
    """What decides the bytes of a results folder; shards of different provenance do not mix."""

    package_version: str
    study_digest: str
    transfer_digest: str
    seed: int
    taichi_version: str
    precision: str
    lanes: int
    shard_realisations: int = SHARD
    code_digest: str = ""  # of the package's sources; "" in folders of versions that did not say it
    surrogate: str = ""  # from what Step A is predicted, and how well; "" where all is computed
    runtime: str = "taichi"  # what compiled the kernels; ``taichi_version`` is its version

    @property
    def digest(self) -> str:
        """SHA-256 [hex] of it."""
        text = json.dumps(asdict(self), sort_keys=True, separators=(",", ":"))
        return hashlib.sha256(text.encode()).hexdigest()


# What folders of earlier versions do not say, and what it was then.
UNSAID = {field.name: field.default for field in fields(Provenance) if field.default is not MISSING}


def same_study(folder: Where, provenance: Provenance) -> bool:
    """Whether ``folder`` holds results of this provenance; False where it holds none.

    Raises
    ------
    InputError
        If it holds results of another provenance: the message names the differences.
    """
    at = place(folder)
    held = provenance_of(at)
    if held is None:
        return False
    refuse_difference(asdict(held), asdict(provenance), f"'{at}'", "give another folder")
    return True


def provenance_of(at: Place) -> Provenance | None:
    """Provenance of a results folder, None where there is no such folder yet.

    Raises
    ------
    InputError
        It is damaged.
    """
    try:
        at.read(PROVENANCE, LARGEST_TEXT)
    except FileNotFoundError:
        return None
    return read_provenance(at)


def read_provenance(folder: Where) -> Provenance:
    """Provenance of a results folder.

    Raises
    ------
    InputError
        If the folder is not a results folder or its provenance cannot be read.
    """
    at = place(folder)
    try:
        data = read_json(at, PROVENANCE, LARGEST_TEXT)
    except FileNotFoundError as error:
        raise InputError(
            f"'{at}' is not a results folder: {PROVENANCE} cannot be read "
            f"({error.strerror}); give the folder of a run"
        ) from error
    try:
        provenance = Provenance(**data)
    except TypeError as error:
        raise InputError(
            f"'{at}/{PROVENANCE}' is damaged ({error}); start again in another folder"
        ) from error
    for entry in fields(Provenance):
        value = getattr(provenance, entry.name)
        least = 1 if entry.name == "shard_realisations" else 0
        if type(value) is not entry.type or (entry.type is int and not least <= value < 2**63):
            raise InputError(
                f"'{at}/{PROVENANCE}' is damaged ({entry.name} is {str(value)[:40]!r}); "
                "start again in another folder"
            )
    return provenance


def read_json(at: Place, name: str, largest: int) -> dict[str, Any]:
    """A JSON object of a results folder.

    Raises
    ------
    FileNotFoundError
        There is none.
    InputError
        It is damaged or too large.
    """
    try:
        data = json.loads(at.text(name, largest))
    except (ValueError, RecursionError) as error:
        remedy = "start again in another folder" if name == PROVENANCE else "resume the run"
        raise InputError(f"'{at}/{name}' is damaged ({error}); {remedy}") from error
    if not isinstance(data, dict):
        raise InputError(f"'{at}/{name}' is damaged (no JSON object); resume the run")
    return data


def refuse_difference(
    held: Mapping[str, Any], wanted: Mapping[str, Any], where: str, remedy: str
) -> None:
    """Refuse provenance that differs from what is wanted.

    Raises
    ------
    InputError
        The message names the differences.
    """
    differences = [
        f"{key.replace('_', ' ')} {held[key]} where this run has {wanted[key]}"
        for key in wanted
        if held[key] != wanted[key]
    ]
    if differences:
        raise InputError(f"{where} holds other results: {'; '.join(differences)}; {remedy}")
