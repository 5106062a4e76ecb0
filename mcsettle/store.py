"""Results on disk: tables as folders of Parquet shards, each written whole or not at all.

    DIR/provenance.json        what the folder holds, written first; another study is refused
    DIR/<table>/*.parquet      shards; a table's folder holds nothing but Parquet
    DIR/data_dictionary.csv    every column with its unit
    DIR/manifest.json          rows and SHA-256 of every file, written last: the folder is complete

DIR is a folder, or a prefix of an object store (``place``). Names come from content, never from the
clock, and the same data gives the same bytes. What is read is bounded, checked against the manifest
where there is one, and never evaluated.

Depends on: errors, files, parquet, place, tables.
"""

import hashlib
import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from typing import Any

import numpy as np
import pyarrow as pa

from mcsettle import parquet
from mcsettle.errors import InputError
from mcsettle.files import write_text as write_text
from mcsettle.place import Place, Where, place
from mcsettle.tables import TABLES, data_dictionary, schema_of

Values = Sequence[Any] | np.ndarray

PROVENANCE = "provenance.json"
MANIFEST = "manifest.json"
DICTIONARY = "data_dictionary.csv"
FORMAT = 1  # of the manifest
SHARD = 2048  # realisations of a shard, unless a run says otherwise
LARGEST_TEXT = 4_000_000  # bytes of a text file that is read
LARGEST_MANIFEST = 1_000_000_000


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

    @property
    def digest(self) -> str:
        """SHA-256 [hex] of it."""
        return hashlib.sha256(_json(asdict(self)).encode()).hexdigest()


def prepare(folder: Where, provenance: Provenance, finished: bool = False) -> None:
    """Make ``folder`` ready to receive shards of this provenance, new or begun before.

    An old manifest is taken away, unless nothing of what is ``finished`` will change: until the next
    one the folder is incomplete.

    Raises
    ------
    InputError
        If the folder cannot be written, or holds results of another provenance.
    """
    at = place(folder)
    text = json.dumps(asdict(provenance), indent=2, sort_keys=True) + "\n"
    if not same_study(at, provenance):
        at.write(PROVENANCE, text.encode())
    if not finished:
        at.remove(MANIFEST)


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
        found = Provenance(**data)
    except TypeError as error:
        raise InputError(
            f"'{at}/{PROVENANCE}' is damaged ({error}); start again in another folder"
        ) from error
    for entry in fields(Provenance):
        value = getattr(found, entry.name)
        if type(value) is not entry.type or (entry.type is int and not 0 <= value < 2**63):
            raise InputError(
                f"'{at}/{PROVENANCE}' is damaged ({entry.name} is {str(value)[:40]!r}); "
                "start again in another folder"
            )
    return found


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


def shard_name(
    variant: str, scenario: str, first: int, last: int, parameter_set: int | None = None
) -> str:
    """File name of the shard of realisations ``first`` to ``last``, both included.

    ``parameter_set`` is None in a study without uncertain inputs.

    Examples
    --------
    >>> shard_name("base", "A", 0, 255)
    'base--A--00000000-00000255.parquet'
    >>> shard_name("base", "A", 0, 63, 3)
    'base--A--set000003--00000000-00000063.parquet'
    """
    of_set = "" if parameter_set is None else f"set{parameter_set:06d}--"
    return f"{slug(variant)}--{slug(scenario)}--{of_set}{first:08d}-{last:08d}.parquet"


def slug(name: str) -> str:
    """The name if it is safe in a file name, else a safe form of it with a digest: no two collide.

    Examples
    --------
    >>> slug("A2"), slug("97 km/h")
    ('A2', '97-km-h-c3eaf3a0')
    """
    safe = re.sub(r"[^A-Za-z0-9._]+", "-", name).strip("-.")[:60]
    if safe == name:
        return name
    return f"{safe}-{hashlib.sha256(name.encode()).hexdigest()[:8]}".lstrip("-")


def write(
    folder: Where,
    table: str,
    name: str,
    columns: Mapping[str, Values],
    provenance: Provenance,
    first: int = 0,
    last: int = -1,
) -> str:
    """Write one shard of a table; the same arguments give the same bytes.

    Parameters
    ----------
    folder : Path, URL or Place
        Results folder, made ready by ``prepare``.
    table : str
        A key of ``TABLES``.
    name : str
        File name (``shard_name``).
    columns : mapping
        Values by column name, all of one length; None and NaN are null where null is allowed.
    provenance : Provenance
    first, last : int
        Range of realisation indices, both included.

    Returns
    -------
    str
        Hex SHA-256 of the file.

    Raises
    ------
    InputError
        If a column is missing, unknown, of the wrong type or null where it may not be, or the
        folder cannot be written.
    """
    metadata = {key: str(value) for key, value in asdict(provenance).items()}
    metadata["index_range"] = f"{first}-{last}"
    data = to_arrow(table, columns).replace_schema_metadata(metadata)
    encoded = parquet.encode(data)
    place(folder).write(f"{table}/{name}", encoded)
    return hashlib.sha256(encoded).hexdigest()


def to_arrow(table: str, columns: Mapping[str, Values]) -> pa.Table:
    """Arrow table with the schema of ``table``, from values by column name.

    Raises
    ------
    InputError
        As ``write``.
    """
    schema = schema_of(table, columns)
    if set(columns) != set(schema.names):
        odd = sorted(set(columns) ^ set(schema.names))
        raise InputError(f"table '{table}' wants the columns {schema.names}; differing: {odd}")
    arrays = []
    for field in schema:
        try:
            array = pa.array(columns[field.name], field.type, from_pandas=True)
        except (pa.ArrowInvalid, pa.ArrowTypeError) as error:
            raise InputError(f"column '{table}.{field.name}': {error}") from error
        if array.null_count and not field.nullable:
            raise InputError(
                f"column '{table}.{field.name}' has {array.null_count} empty values; it allows none"
            )
        arrays.append(array)
    if len({len(array) for array in arrays}) > 1:
        raise InputError(f"table '{table}': columns of different lengths")
    return pa.Table.from_arrays(arrays, schema=schema)


def read(folder: Where, table: str) -> pa.Table:
    """A whole table, its shards in the order of their names, checked.

    In a finished folder every file is compared with the manifest, and none may be missing.

    Raises
    ------
    InputError
        If there is no such table, or a file of it is missing, damaged, foreign, of another
        provenance, or repeats rows of another.
    """
    at = place(folder)
    provenance = read_provenance(at)
    names = at.names(table)
    listed = _listed(at)
    if listed is not None:
        _refuse_strays(at, names, [name for name in listed if name.startswith(f"{table}/")])
    if not names:
        raise InputError(f"'{at}' holds no table '{table}'; run the study first")
    parts = [_shard(_sound(at, name, listed), f"{at}/{name}", table, provenance) for name in names]
    try:
        data = pa.concat_tables(parts)
    except pa.ArrowInvalid as error:
        raise InputError(f"table '{table}' of '{at}' has shards of different columns") from error
    keys = TABLES[table].keys
    if data.group_by(keys).aggregate([]).num_rows != data.num_rows:
        raise InputError(
            f"table '{table}' of '{at}' has rows of the same {', '.join(keys)}; "
            "its shards overlap: remove those not of this run"
        )
    return data


def read_file(folder: Where, name: str, largest: int = LARGEST_TEXT) -> bytes:
    """A file of a finished folder, compared with the manifest where there is one.

    Raises
    ------
    InputError
        It is missing, damaged or too large.
    """
    at = place(folder)
    return _sound(at, name, _listed(at), largest)


def shard_columns(folder: Where, table: str, name: str) -> dict[str, list[Any]]:
    """Values by column of one sound shard, None where null."""
    columns: dict[str, list[Any]] = parquet.decode(
        place(folder).read(f"{table}/{name}"), f"{folder}/{table}/{name}"
    ).to_pydict()
    return columns


def shard_rows(folder: Where, table: str, name: str) -> int | None:
    """Rows of a shard that is there and sound, else None: what a resumed run has to repeat."""
    at = place(folder)
    try:
        return int(parquet.decode(at.read(f"{table}/{name}"), name).num_rows)
    except (FileNotFoundError, InputError):
        return None


def finish(folder: Where) -> None:
    """Write the data dictionary and then, last, the manifest.

    Raises
    ------
    InputError
        If a shard is damaged or the folder cannot be written.
    """
    at = place(folder)
    provenance = read_provenance(at)
    at.write(DICTIONARY, data_dictionary().encode())
    files = []
    for name in _visible(at):
        data = _sound(at, name, None)
        entry: dict[str, Any] = {"path": name}
        if name.endswith(".parquet"):
            entry["rows"] = _shard(data, f"{at}/{name}", name.split("/")[0], provenance).num_rows
        entry["sha256"] = hashlib.sha256(data).hexdigest()
        files.append(entry)
    manifest = {"schema_version": FORMAT, "provenance": asdict(provenance), "files": files}
    at.write(MANIFEST, (json.dumps(manifest, indent=2) + "\n").encode())
    at.tidy()


def is_finished(folder: Where) -> bool:
    """Whether the folder has a manifest: a run's last word."""
    try:
        return _listed(place(folder)) is not None
    except InputError:
        return False


def lists(folder: Where, table: str) -> bool:
    """Whether the manifest names a file of ``table``; False where there is none."""
    return any(name.startswith(f"{table}/") for name in _listed(place(folder)) or ())


def verify(folder: Where) -> int:
    """Compare the folder with its manifest; returns the number of files.

    Raises
    ------
    InputError
        If the manifest is missing, or a file is missing, damaged or not in it: the message names
        the file.
    """
    at = place(folder)
    listed = _listed(at)
    if listed is None:
        raise InputError(f"'{at}' has no {MANIFEST}: the run is not complete; resume it")
    found = _visible(at)
    _refuse_strays(at, found, list(listed))
    for name in found:
        _sound(at, name, listed)
    return len(listed)


def _listed(at: Place) -> dict[str, str] | None:
    """SHA-256 by name as the manifest has them; None without one."""
    try:
        data = read_json(at, MANIFEST, LARGEST_MANIFEST)
    except FileNotFoundError:
        return None
    own = asdict(read_provenance(at))
    try:
        if data["schema_version"] != FORMAT or data["provenance"] not in (own, _older(own)):
            raise ValueError("it is of another run or version")
        return {str(entry["path"]): str(entry["sha256"]) for entry in data["files"]}
    except (KeyError, TypeError, ValueError) as error:
        raise InputError(f"'{at}/{MANIFEST}' is damaged ({error}); resume the run") from error


def _older(provenance: Mapping[str, Any]) -> dict[str, Any]:
    """Provenance as it was written before shards had sizes."""
    return {key: value for key, value in provenance.items() if key != "shard_realisations"}


def _refuse_strays(at: Place, found: list[str], listed: list[str]) -> None:
    for name in sorted(set(listed) ^ set(found)):
        if name in listed:
            raise InputError(f"'{at}/{name}' is missing; resume the run to write it again")
        raise InputError(f"'{at}/{name}' is not in the manifest; remove it")


def _sound(
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


def _shard(data: bytes, where: str, table: str, provenance: Provenance) -> pa.Table:
    """One shard, checked; file metadata taken off so that shards can be joined."""
    if table not in TABLES:
        raise InputError(f"'{where}' is of no table of this version; remove it")
    rows = parquet.decode(data, where)
    stored = {
        key.decode(errors="replace"): value.decode(errors="replace")
        for key, value in (rows.schema.metadata or {}).items()
    }
    wanted = {key: str(value) for key, value in asdict(provenance).items()}
    held = {key: stored.get(key, "nothing") for key in wanted}
    if "shard_realisations" not in stored:  # written before shards had sizes
        held["shard_realisations"] = str(SHARD)
    refuse_difference(held, wanted, f"'{where}'", "remove it and resume the run")
    rows = rows.replace_schema_metadata(None)
    if not rows.schema.equals(schema_of(table, rows.schema.names)):
        raise InputError(f"'{where}' has other columns than table '{table}' of this version")
    return rows


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


def _visible(at: Place) -> list[str]:
    """Names the manifest lists: everything but itself and what is hidden, in order.

    In the order of paths, part by part.
    """
    names = (n for n in at.names() if not any(part.startswith(".") for part in n.split("/")))
    return sorted((name for name in names if name != MANIFEST), key=lambda name: name.split("/"))


def _json(data: Mapping[str, Any]) -> str:
    return json.dumps(data, sort_keys=True, separators=(",", ":"))
