"""Parquet as it is written and read here: the same rows give the same bytes, what is read has limits."""

import pyarrow as pa
import pyarrow.parquet as pq

from mcsettle.errors import InputError

MOST_ROWS = 200_000_000  # of one file
MOST_COLUMNS = 1000
LARGEST_UNPACKED = 8 * 1024**3  # bytes that a file may ask for


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
    try:
        file = pq.ParquetFile(pa.BufferReader(data), page_checksum_verification=True)
        held = file.metadata
        unpacked = sum(held.row_group(i).total_byte_size for i in range(held.num_row_groups))
        if (
            held.num_rows > MOST_ROWS
            or held.num_columns > MOST_COLUMNS
            or not 0 <= unpacked <= LARGEST_UNPACKED
        ):
            raise InputError(
                f"'{where}' asks for {held.num_rows} rows of {held.num_columns} columns in "
                f"{unpacked} bytes; no table of a run is as large: remove it"
            )
        table = file.read()
        table.validate(full=True)
    except (OSError, pa.ArrowException, MemoryError, OverflowError, ValueError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(
            f"'{where}' is damaged or no Parquet file ({error}); remove it and resume the run"
        ) from error
    return table
