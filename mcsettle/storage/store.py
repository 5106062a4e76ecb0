"""Results on disk: tables as folders of Parquet shards, each written whole or not at all.

    DIR/provenance.json        what the folder holds, written first; another study is refused
    DIR/<table>/*.parquet      shards; a table's folder holds nothing but Parquet
    DIR/data_dictionary.csv    every column with its unit
    DIR/manifest.json          rows and SHA-256 of every file, written last: the folder is complete

DIR is a folder, or a prefix of an object store (``place``). Names come from content, never from the
clock, and the same data gives the same bytes. What is read is bounded, checked against the manifest
where there is one, and never evaluated.
"""

import hashlib
import itertools
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np
import pyarrow as pa

from mcsettle.errors import InputError
from mcsettle.storage import parquet
from mcsettle.storage.location import Where, place
from mcsettle.storage.manifest import (
    DICTIONARY,
    FORMAT,
    MANIFEST,
    listed_in,
    refuse_strays,
    sound,
    visible,
)
from mcsettle.storage.provenance import (
    LARGEST_TEXT,
    PROVENANCE,
    UNSAID,
    Provenance,
    read_provenance,
    refuse_difference,
    same_study,
)
from mcsettle.storage.tables import TABLES, data_dictionary, schema_of

Values = Sequence[Any] | np.ndarray

AT_A_TIME = 64  # shards held as they were read


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


def write(
    folder: Where,
    table: str,
    name: str,
    columns: Mapping[str, Values],
    provenance: Provenance,
    first: int = 0,
    last: int = -1,
    currency: str = "",
    units: Mapping[str, str] | None = None,
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
    currency : str
        Code of the currency of its prices, for the units of its columns.
    units : of the drawn inputs, by column

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
    data = to_arrow(table, columns, currency, units).replace_schema_metadata(metadata)
    encoded = parquet.encode(data)
    place(folder).write(f"{table}/{name}", encoded)
    return hashlib.sha256(encoded).hexdigest()


def to_arrow(
    table: str,
    columns: Mapping[str, Values],
    currency: str = "",
    units: Mapping[str, str] | None = None,
) -> pa.Table:
    """Arrow table with the schema of ``table``, from values by column name.

    Raises
    ------
    InputError
        As ``write``.
    """
    schema = schema_of(table, columns, currency, units)
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
    listed = listed_in(at)
    if listed is not None:
        refuse_strays(at, names, [name for name in listed if name.startswith(f"{table}/")])
    if not names:
        raise InputError(f"'{at}' holds no table '{table}'; run the study first")
    parts = (_shard(sound(at, name, listed), f"{at}/{name}", table, provenance) for name in names)
    try:
        data = _joined(parts)
    except pa.ArrowInvalid as error:
        raise InputError(f"table '{table}' of '{at}' has shards of different columns") from error
    keys = TABLES[table].keys
    distinct = _n_distinct(data, keys)
    pa.default_memory_pool().release_unused()
    if distinct != data.num_rows:
        raise InputError(
            f"table '{table}' of '{at}' has rows of the same {', '.join(keys)}; "
            "its shards overlap: remove those not of this run"
        )
    return data


def read_shard(folder: Where, table: str, name: str, provenance: Provenance) -> pa.Table:
    """One shard of a table of a run that is not closed yet, checked.

    Raises
    ------
    InputError
        It is missing, damaged, foreign or of another provenance.
    """
    at = place(folder)
    return _shard(sound(at, f"{table}/{name}", None), f"{at}/{table}/{name}", table, provenance)


def read_file(folder: Where, name: str, largest: int = LARGEST_TEXT) -> bytes:
    """A file of a finished folder, compared with the manifest where there is one.

    Raises
    ------
    InputError
        It is missing, damaged or too large.
    """
    at = place(folder)
    return sound(at, name, listed_in(at), largest)


def shard_columns(folder: Where, table: str, name: str) -> dict[str, list[Any]]:
    """Values by column of one sound shard, None where null."""
    columns: dict[str, list[Any]] = parquet.decode(
        place(folder).read(f"{table}/{name}"), f"{folder}/{table}/{name}"
    ).to_pydict()
    return columns


def finish(folder: Where, currency: str = "") -> None:
    """Write the data dictionary and then, last, the manifest; prices are in ``currency``.

    Raises
    ------
    InputError
        If a shard is damaged or the folder cannot be written.
    """
    at = place(folder)
    provenance = read_provenance(at)
    at.write(DICTIONARY, data_dictionary(currency).encode())
    files = []
    for name in visible(at):
        data = sound(at, name, None)
        entry: dict[str, Any] = {"path": name}
        table = name.partition("/")[0]
        if table in TABLES:
            entry["rows"] = _shard(data, f"{at}/{name}", table, provenance).num_rows
        entry["sha256"] = hashlib.sha256(data).hexdigest()
        files.append(entry)
    manifest = {"schema_version": FORMAT, "provenance": asdict(provenance), "files": files}
    at.write(MANIFEST, (json.dumps(manifest, indent=2) + "\n").encode())
    at.tidy()


def _joined(parts: Iterator[pa.Table]) -> pa.Table:
    """Shards as one table, few held as they are: each has a copy of all columns' units and meanings."""
    tables = []
    while some := list(itertools.islice(parts, AT_A_TIME)):
        tables.append(pa.concat_tables(some).combine_chunks())
    return pa.concat_tables(tables)


def _n_distinct(data: pa.Table, keys: Sequence[str]) -> int:
    """How many rows differ in ``keys``; grouping them would take ten times the memory."""
    code = np.zeros(data.num_rows, np.int64)
    for key in keys:
        column = data.column(key).combine_chunks().dictionary_encode("encode")
        code = code * len(column.dictionary) + column.indices.to_numpy()
    code.sort()  # np.unique takes ten times as long for whole numbers that hardly repeat
    return len(code) - int(np.count_nonzero(code[1:] == code[:-1]))


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
    held = {key: stored.get(key, str(UNSAID.get(key, "nothing"))) for key in wanted}
    refuse_difference(held, wanted, f"'{where}'", "remove it and resume the run")
    rows = rows.replace_schema_metadata(None)
    if not rows.schema.equals(schema_of(table, rows.schema.names)):
        raise InputError(f"'{where}' has other columns than table '{table}' of this version")
    return rows
