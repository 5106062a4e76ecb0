"""The record of a shard: written after its files, with their checksums. Without it nothing is done.

    DIR/.shards/NAME.json      what the shard consists of: rows and SHA-256 of each of its files

A shard is its rows in ``history`` and in ``realisations``. A file that is cut short, altered or
missing does not fit its record, and the shard is computed again. A shard that failed for good has a
record that says why; a later run tries it once more.
"""

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from mcsettle.errors import InputError
from mcsettle.storage import store
from mcsettle.storage.location import Place
from mcsettle.storage.parquet import decode
from mcsettle.storage.provenance import Provenance, read_json

RECORDS = ".shards"
SHARDED = ("history", "realisations")  # in the order they are written
LARGEST = 100_000  # bytes of a record


@dataclass(frozen=True)
class Record:
    """What a shard's record says: rows, failed rows, SHA-256 by table, and why it failed for good."""

    rows: int
    n_failed: int
    sha256: dict[str, str]
    failure: str = ""


def write_shard(
    at: Place,
    name: str,
    tables: Mapping[str, Mapping[str, Any]],
    provenance: Provenance,
    indices: range,
    failure: str = "",
    units: Mapping[str, str] | None = None,
) -> None:
    """Write the tables of a shard and then, last, its record; ``units`` of the drawn inputs.

    Raises
    ------
    InputError
        As ``store.write``.
    """
    digests = {
        table: store.write(
            at, table, name, tables[table], provenance, indices.start, indices.stop - 1, units=units
        )
        for table in SHARDED
    }
    data = {
        "provenance": provenance.digest,
        "rows": len(indices),
        "failed": sum(status == "failed" for status in tables["realisations"]["status"]),
        "sha256": digests,
    } | ({"failure": failure} if failure else {})
    text = json.dumps(data, indent=2, sort_keys=True) + "\n"
    at.write(record_name(name), text.encode())


def record_name(name: str) -> str:
    """Name of the record of the shard ``name``."""
    return f"{RECORDS}/{name.removesuffix('.parquet')}.json"


def read_record(at: Place, name: str, provenance: Provenance) -> Record | None:
    """The record of a shard; None where there is none, or none of this run."""
    try:
        data = read_json(at, record_name(name), LARGEST)
        if data["provenance"] != provenance.digest:
            return None
        digests = {table: str(data["sha256"][table]) for table in SHARDED}
        failure = str(data.get("failure", ""))
        return Record(int(data["rows"]), int(data["failed"]), digests, failure)
    except (FileNotFoundError, InputError, KeyError, TypeError, ValueError):
        return None


def fault(at: Place, name: str, record: Record, rows: int) -> str | None:
    """What is wrong with a shard that has a record: a sentence, or None where it is whole."""
    if record.rows != rows:
        return f"its record has {record.rows} rows, not {rows}"
    for table in SHARDED:
        try:
            data = at.read(f"{table}/{name}")
        except FileNotFoundError:
            return f"{table}/{name} is missing"
        except InputError as error:
            return str(error)
        if hashlib.sha256(data).hexdigest() != record.sha256[table]:
            return f"{table}/{name} was altered or cut short"
        try:
            held = decode(data, name).num_rows
        except InputError as error:
            return str(error)
        if table == "realisations" and held != rows:
            return f"{table}/{name} has {held} rows, not {rows}"
    return None


def is_whole(at: Place, name: str, provenance: Provenance, rows: int) -> bool:
    """Whether a shard is there, whole, and did not fail for good."""
    record = read_record(at, name, provenance)
    return record is not None and not record.failure and fault(at, name, record, rows) is None


def remove_shard(at: Place, name: str) -> None:
    """Remove a shard, its record first."""
    at.remove(record_name(name))
    for table in (*SHARDED, "effects"):
        at.remove(f"{table}/{name}")
