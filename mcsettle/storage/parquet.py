"""Parquet as it is written and read here: the same rows give the same bytes, what is read has limits.

A text that repeats takes a few bytes in a file and all of its length in each row of a table, so the
texts of a file are looked at in their dictionaries, and counted, before they are spread over rows.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from mcsettle.errors import InputError

MOST_ROWS = 200_000_000  # of one file
MOST_COLUMNS = 1000
LARGEST_UNPACKED = 8 * 1024**3  # bytes of a table in memory
# What a small file may unpack to, and how much more for each of its bytes: rows that all failed for
# one reason take some hundred times their size on disk.
LEAST_UNPACKED, MOST_PER_BYTE = 256 * 1024**2, 200


def encode(table: pa.Table) -> bytes:
    """Bytes of ``table`` as one Parquet file, with a checksum on every page."""
    floats = [field.name for field in table.schema if pa.types.is_floating(field.type)]
    texts = [field.name for field in table.schema if pa.types.is_string(field.type)]
    sink = pa.BufferOutputStream()
    pq.write_table(
        table,
        sink,
        compression="zstd",
        use_dictionary=texts,
        use_byte_stream_split=floats,
        row_group_size=1 << 17,
        write_page_checksum=True,
    )
    data: bytes = sink.getvalue().to_pybytes()
    return data


def decode(data: bytes, where: str) -> pa.Table:
    """The table in the bytes of a Parquet file.

    Raises
    ------
    InputError
        They are damaged, no Parquet, or ask for more than a table here ever has.
    """
    most = min(LARGEST_UNPACKED, LEAST_UNPACKED + MOST_PER_BYTE * len(data))
    try:
        table = _limited(pa.BufferReader(data), None, MOST_ROWS, most, True)
        table.validate(full=True)
        return table
    except _TooLargeError as error:
        raise InputError(
            f"'{where}' asks for {error}; no table of a run is as large: remove it"
        ) from None
    except (OSError, pa.ArrowException, MemoryError, OverflowError, ValueError) as error:
        raise InputError(
            f"'{where}' is damaged or no Parquet file ({error}); remove it and resume the run"
        ) from error


def read_columns(path: Path, columns: Sequence[str], most_rows: int, largest: int) -> pa.Table:
    """Columns of the Parquet file at ``path``; texts stay in their dictionaries.

    Parameters
    ----------
    most_rows : that are read
    largest : bytes of them in memory

    Raises
    ------
    InputError
        They ask for more than that.
    OSError, pyarrow.ArrowException
        The file cannot be read, or is no valid Parquet file.
    """
    try:
        with path.open("rb") as source:
            return _limited(source, list(columns), most_rows, largest, False)
    except _TooLargeError as error:
        raise InputError(
            f"{path} asks for {error}; at most {most_rows} rows of {largest} bytes are read"
        ) from None


class _TooLargeError(Exception):
    """What a file asks for, where that is too much."""


def _limited(
    source: object, columns: list[str] | None, most_rows: int, largest: int, spread: bool
) -> pa.Table:
    """Columns of a file (None: all); ``spread``: texts are taken out of their dictionaries."""
    metadata = pq.read_metadata(source)
    schema = metadata.schema.to_arrow_schema()
    if any(pa.types.is_nested(field.type) for field in schema):
        raise pa.ArrowInvalid("it has tables within its columns")
    fields = [field for field in schema if columns is None or field.name in columns]
    texts = [field.name for field in fields if _is_text(field.type)]
    packed = sum(metadata.row_group(i).total_byte_size for i in range(metadata.num_row_groups))
    size = sum(_bits(field.type) for field in fields) * metadata.num_rows // 8
    if (
        not 0 <= metadata.num_rows <= most_rows
        or metadata.num_columns > MOST_COLUMNS
        or not 0 <= packed <= largest
        or size > largest
    ):
        raise _TooLargeError(
            f"{metadata.num_rows} rows of {metadata.num_columns} columns in {max(size, packed)} bytes"
        )
    file = pq.ParquetFile(
        source, metadata=metadata, read_dictionary=texts, page_checksum_verification=True
    )
    table = file.read(columns=columns, use_threads=False)
    size = sum(_unpacked_bytes(column) for column in table.columns)
    if size > largest:
        raise _TooLargeError(f"{size} bytes of text in {metadata.num_rows} rows")
    if not spread:
        return table
    plain = [
        pa.field(f.name, f.type.value_type, f.nullable, f.metadata)
        if pa.types.is_dictionary(f.type)
        else f
        for f in table.schema
    ]
    return table.cast(pa.schema(plain, table.schema.metadata))


def _is_text(kind: pa.DataType) -> bool:
    return bool(
        pa.types.is_string(kind)
        or pa.types.is_large_string(kind)
        or pa.types.is_binary(kind)
        or pa.types.is_large_binary(kind)
    )


def _bits(kind: pa.DataType) -> int:
    """Bits of one value in memory; of a text in a dictionary those of its place there."""
    if pa.types.is_null(kind):
        return 0
    return 32 if _is_text(kind) or pa.types.is_dictionary(kind) else int(kind.bit_width)


def _unpacked_bytes(column: pa.ChunkedArray) -> int:
    """Bytes that a column takes when its texts stand in every row."""
    if not (pa.types.is_dictionary(column.type) and _is_text(column.type.value_type)):
        return int(column.nbytes)
    total = 0
    for chunk in column.chunks:
        lengths = pc.binary_length(chunk.dictionary).fill_null(0).to_numpy().astype(np.int64)
        places = chunk.indices.drop_null().to_numpy()
        total += int(np.bincount(places, minlength=len(lengths)) @ lengths) + 4 * len(chunk)
    return total
