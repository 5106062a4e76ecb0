"""The manifest of a results folder: every file with its checksum, written last.

DIR/manifest.json          rows and SHA-256 of every file: the folder is complete
"""

import hashlib
from collections.abc import Mapping
from dataclasses import asdict

from mcsettle.errors import InputError
from mcsettle.storage.location import Place, Where, place
from mcsettle.storage.provenance import PROVENANCE, UNSAID, read_json, read_provenance
from mcsettle.storage.tables import TABLES

MANIFEST = "manifest.json"
DICTIONARY = "data_dictionary.csv"
STUDY_FILE = "study.toml"
INPUTS = "inputs"  # copies of the files that the study names
FILES = (DICTIONARY, PROVENANCE, STUDY_FILE)
FORMAT = 1  # of the manifest
LARGEST_MANIFEST = 1_000_000_000


def lists(folder: Where, table: str) -> bool:
    """Whether the manifest names a file of ``table``; False where there is none."""
    return any(name.startswith(f"{table}/") for name in listed_in(place(folder)) or ())


def verify(folder: Where) -> int:
    """Compare the folder with its manifest; returns the number of files.

    Raises
    ------
    InputError
        If the manifest is missing, or a file is missing, damaged or not in it: the message names
        the file.
    """
    at = place(folder)
    listed = listed_in(at)
    if listed is None:
        raise InputError(f"'{at}' has no {MANIFEST}: the run is not complete; resume it")
    refuse_strays(at, visible(at), [name for name in listed if _is_ours(name)])
    for name in listed:
        sound(at, name, listed)
    return len(listed)


def listed_in(at: Place) -> dict[str, str] | None:
    """SHA-256 by name as the manifest has them; None without one."""
    try:
        data = read_json(at, MANIFEST, LARGEST_MANIFEST)
    except FileNotFoundError:
        return None
    of_folder = asdict(read_provenance(at))
    try:
        if data["schema_version"] != FORMAT or {**UNSAID, **data["provenance"]} != of_folder:
            raise ValueError("it is of another run or version")
        return {str(entry["path"]): str(entry["sha256"]) for entry in data["files"]}
    except (KeyError, TypeError, ValueError) as error:
        raise InputError(f"'{at}/{MANIFEST}' is damaged ({error}); resume the run") from error


def refuse_strays(at: Place, present: list[str], listed: list[str]) -> None:
    """Refuse a folder whose files ``present`` are not those ``listed``.

    Raises
    ------
    InputError
        The message names the first that is missing, or not listed.
    """
    for name in sorted(set(listed) ^ set(present)):
        if name in listed:
            raise InputError(f"'{at}/{name}' is missing; resume the run to write it again")
        raise InputError(f"'{at}/{name}' is not in the manifest; remove it")


def sound(
    at: Place, name: str, listed: Mapping[str, str] | None, largest: int | None = None
) -> bytes:
    """Bytes of a file, equal to what the manifest says of it."""
    try:
        data = at.read(name) if largest is None else at.read(name, largest)
    except FileNotFoundError as error:
        raise InputError(f"'{at}/{name}' is missing; resume the run") from error
    if listed is not None and hashlib.sha256(data).hexdigest() != listed.get(name):
        raise InputError(f"'{at}/{name}' is damaged; remove it and resume the run")
    return data


def visible(at: Place) -> list[str]:
    """Names the manifest lists, in the order of paths, part by part.

    Those of the tables and of the study's input files, and the few files beside them; the manifest
    itself, hidden files and what else somebody keeps there are not ours to list.
    """
    names = [name for folder in (*TABLES, INPUTS) for name in at.names(folder)]
    names = [name for name in names if _is_ours(name)]
    names += set(at.entries()) & set(FILES)
    return sorted(names, key=lambda name: name.split("/"))


def _is_ours(name: str) -> bool:
    """Whether a file of a results folder is one that a run writes."""
    parts = name.split("/")
    if len(parts) == 1:
        return name in FILES
    return parts[0] in (*TABLES, INPUTS) and not any(part.startswith(".") for part in parts)
