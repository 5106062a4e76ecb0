"""Results on disk: tables as folders of Parquet shards, each written whole or not at all.

    DIR/provenance.json        what the folder holds, written first; another study is refused
    DIR/<table>/*.parquet      shards; a table's folder holds nothing but Parquet
    DIR/data_dictionary.csv    every column with its unit
    DIR/manifest.json          rows and SHA-256 of every file, written last: the folder is complete

A file is written under DIR/.tmp, synchronised and moved into place. Names come from content, never
from the clock, and the same data gives the same bytes.

Depends on: errors, files, tables.
"""

import contextlib
import hashlib
import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from mcsettle.errors import InputError
from mcsettle.files import sha256, writable, write_whole
from mcsettle.files import write_text as write_text
from mcsettle.tables import TABLES, data_dictionary, schema_of

Values = Sequence[Any] | np.ndarray

PROVENANCE = "provenance.json"
MANIFEST = "manifest.json"
DICTIONARY = "data_dictionary.csv"


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


def prepare(folder: Path, provenance: Provenance) -> None:
    """Make ``folder`` ready to receive shards of this provenance, new or begun before.

    An old manifest is taken away: until the next one the folder is incomplete.

    Raises
    ------
    InputError
        If the folder cannot be written, or holds results of another provenance.
    """
    if (folder / PROVENANCE).exists():
        held, wanted = asdict(read_provenance(folder)), asdict(provenance)
        _refuse_difference(held, wanted, f"'{folder}'", "give another folder")
    text = json.dumps(asdict(provenance), indent=2, sort_keys=True) + "\n"
    write_text(folder, PROVENANCE, text)
    with writable(folder):
        (folder / MANIFEST).unlink(missing_ok=True)


def read_provenance(folder: Path) -> Provenance:
    """Provenance of a results folder.

    Raises
    ------
    InputError
        If the folder is not a results folder or its provenance cannot be read.
    """
    path = folder / PROVENANCE
    try:
        return Provenance(**json.loads(path.read_text(encoding="utf-8")))
    except OSError as error:
        raise InputError(
            f"'{folder}' is not a results folder: {PROVENANCE} cannot be read "
            f"({error.strerror}); give the folder of a run"
        ) from error
    except (ValueError, TypeError) as error:
        raise InputError(f"'{path}' is damaged ({error}); start again in another folder") from error


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
    folder: Path,
    table: str,
    name: str,
    columns: Mapping[str, Values],
    provenance: Provenance,
    first: int = 0,
    last: int = -1,
) -> Path:
    """Write one shard of a table; the same arguments give the same bytes.

    Parameters
    ----------
    folder : Path
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
    Path
        The file written.

    Raises
    ------
    InputError
        If a column is missing, unknown, of the wrong type or null where it may not be, or the
        folder cannot be written.
    """
    metadata = {key: str(value) for key, value in asdict(provenance).items()}
    metadata["index_range"] = f"{first}-{last}"
    data = to_arrow(table, columns).replace_schema_metadata(metadata)
    floats = [field.name for field in data.schema if pa.types.is_floating(field.type)]
    texts = [field.name for field in data.schema if pa.types.is_string(field.type)]

    def fill(path: Path) -> None:
        pq.write_table(
            data,
            path,
            compression="zstd",
            use_dictionary=texts,
            use_byte_stream_split=floats,
            row_group_size=1 << 17,
        )

    return write_whole(folder, f"{table}/{name}", fill)


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


def read(folder: Path, table: str) -> pa.Table:
    """A whole table, its shards in the order of their names, checked.

    Raises
    ------
    InputError
        If there is no such table, or a file of it is damaged, foreign, of another provenance, or
        repeats rows of another.
    """
    provenance = read_provenance(folder)
    paths = sorted((folder / table).glob("*"))
    if not paths:
        raise InputError(f"'{folder}' holds no table '{table}'; run the study first")
    data = pa.concat_tables([_read_shard(path, table, provenance) for path in paths])
    keys = TABLES[table].keys
    if data.group_by(keys).aggregate([]).num_rows != data.num_rows:
        raise InputError(
            f"table '{table}' of '{folder}' has rows of the same {', '.join(keys)}; "
            "its shards overlap: remove those not of this run"
        )
    return data


def shard_columns(path: Path) -> dict[str, list[Any]]:
    """Values by column of one sound shard, None where null."""
    columns: dict[str, list[Any]] = pq.ParquetFile(path).read().to_pydict()
    return columns


def shard_rows(path: Path) -> int | None:
    """Rows of a shard that is there and sound, else None: what a resumed run has to repeat."""
    try:
        return int(pq.read_table(path).num_rows)
    except (OSError, pa.ArrowException):
        return None


def finish(folder: Path) -> Path:
    """Write the data dictionary and then, last, the manifest; returns the manifest's path.

    Raises
    ------
    InputError
        If a shard is damaged or the folder cannot be written.
    """
    provenance = read_provenance(folder)
    write_text(folder, DICTIONARY, data_dictionary())
    files = []
    for file in _files(folder):
        entry: dict[str, Any] = {"path": file.relative_to(folder).as_posix()}
        if file.suffix == ".parquet":
            entry["rows"] = _read_shard(file, file.parent.name, provenance).num_rows
        entry["sha256"] = sha256(file)
        files.append(entry)
    manifest = {"schema_version": 1, "provenance": asdict(provenance), "files": files}
    path = write_text(folder, MANIFEST, json.dumps(manifest, indent=2) + "\n")
    with contextlib.suppress(OSError):  # not empty: another writer, or what a killed one left
        (folder / ".tmp").rmdir()
    return path


def verify(folder: Path) -> int:
    """Compare the folder with its manifest; returns the number of files.

    Raises
    ------
    InputError
        If the manifest is missing, or a file is missing, damaged or not in it: the message names
        the file.
    """
    path = folder / MANIFEST
    if not path.exists():
        raise InputError(f"'{folder}' has no {MANIFEST}: the run is not complete; resume it")
    listed = {f["path"]: f["sha256"] for f in json.loads(path.read_text(encoding="utf-8"))["files"]}
    found = {p.relative_to(folder).as_posix(): p for p in _files(folder)}
    for name in sorted(set(listed) | set(found)):
        if name not in found:
            raise InputError(f"'{folder}/{name}' is missing; resume the run to write it again")
        if name not in listed:
            raise InputError(f"'{folder}/{name}' is not in the manifest; remove it")
        if sha256(found[name]) != listed[name]:
            raise InputError(f"'{folder}/{name}' is damaged; remove it and resume the run")
    return len(listed)


def _read_shard(path: Path, table: str, provenance: Provenance) -> pa.Table:
    """One shard, checked; file metadata taken off so that shards can be joined."""
    try:
        data = pq.ParquetFile(path).read()
    except (OSError, pa.ArrowException) as error:
        raise InputError(
            f"'{path}' is damaged or no Parquet file ({error}); remove it and resume the run"
        ) from error
    stored = {k.decode(): v.decode() for k, v in (data.schema.metadata or {}).items()}
    held = {key: stored.get(key, "nothing") for key in asdict(provenance)}
    wanted = {key: str(value) for key, value in asdict(provenance).items()}
    _refuse_difference(held, wanted, f"'{path}'", "remove it and resume the run")
    data = data.replace_schema_metadata(None)
    if not data.schema.equals(schema_of(table, data.schema.names)):
        raise InputError(f"'{path}' has other columns than table '{table}' of this version")
    return data


def _refuse_difference(
    held: Mapping[str, Any], wanted: Mapping[str, Any], where: str, remedy: str
) -> None:
    """Refuse provenance that differs, naming the differences."""
    differences = [
        f"{key.replace('_', ' ')} {held[key]} where this run has {wanted[key]}"
        for key in wanted
        if held[key] != wanted[key]
    ]
    if differences:
        raise InputError(f"{where} holds other results: {'; '.join(differences)}; {remedy}")


def _files(folder: Path) -> list[Path]:
    """Files the manifest lists: everything but itself and what is hidden, in the order of names."""
    paths = (p for p in folder.rglob("*") if p.is_file())
    hidden = (p for p in paths if not any(s.startswith(".") for s in p.relative_to(folder).parts))
    return sorted(p for p in hidden if p != folder / MANIFEST)
