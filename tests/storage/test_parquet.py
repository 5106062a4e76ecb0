"""What is read from Parquet is bounded by what it takes in memory, not by what it takes in a file."""

import io

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from mcsettle.errors import InputError
from mcsettle.storage import parquet


def written(table: pa.Table, **options) -> bytes:
    sink = io.BytesIO()
    pq.write_table(table, sink, **options)
    return sink.getvalue()


def one_text(rows: int, length: int) -> pa.Table:
    """The same text in every row: a few bytes in a file."""
    column = pa.DictionaryArray.from_arrays(pa.array(np.zeros(rows, np.int32)), ["a" * length])
    return pa.table({"run": column, "level_mm": np.zeros(rows)})


def small_tables() -> dict[str, pa.Table]:
    return {
        "texts": pa.table({"a": ["x", None, "déjà"] * 5, "b": ["", "y", None] * 5}),
        "numbers": pa.table({"a": np.arange(9.0), "b": pa.array([1, None, 3] * 3, pa.int32())}),
        "others": pa.table({"a": pa.nulls(3), "b": [True, None, False], "c": [b"x", b"", None]}),
        "empty": pa.table({"a": pa.array([], pa.string()), "b": pa.array([], pa.float64())}),
    }


@pytest.mark.parametrize("name", small_tables())
def test_what_was_written_is_read(name):
    table = small_tables()[name].replace_schema_metadata({"seed": "1"})
    read = parquet.decode(parquet.encode(table), name)
    assert read.equals(table, check_metadata=True)
    assert read.schema.equals(table.schema)


def test_a_text_that_fills_the_memory_is_refused_before_it_does():
    data = written(one_text(200_000, 10_000))
    assert len(data) < 3000
    before = pa.default_memory_pool().max_memory()
    with pytest.raises(
        InputError, match=r"asks for 2002\d* bytes of text in 200000 rows; no table"
    ):
        parquet.decode(data, "bomb.parquet")
    assert pa.default_memory_pool().max_memory() - before < 100_000_000


def test_numbers_that_fill_the_memory_are_refused_before_they_do():
    """Zeros of 64 columns: 480 MB of a file of some kB, which its own size does not excuse."""
    rows = 10**6
    zeros = pa.array(np.zeros(rows))
    data = written(pa.table({f"x{i}": zeros for i in range(60)}))
    before = pa.default_memory_pool().max_memory()
    with pytest.raises(InputError, match="asks for 1000000 rows of 60 columns in 480000000 bytes"):
        parquet.decode(data, "bomb.parquet")
    assert pa.default_memory_pool().max_memory() <= before + 1_000_000


def test_too_many_columns_are_refused():
    data = written(pa.table({f"x{i}": [1.0] for i in range(parquet.MOST_COLUMNS + 1)}))
    with pytest.raises(InputError, match="asks for 1 rows of 1001 columns"):
        parquet.decode(data, "bomb.parquet")


def test_a_table_in_a_cell_is_refused():
    with pytest.raises(InputError, match="tables within its columns"):
        parquet.decode(written(pa.table({"x": [[1, 2]]})), "x.parquet")


def test_a_page_whose_bytes_were_changed_is_damaged():
    """The checksum of the page tells, even where the values would still be read."""
    values = np.arange(1000.0) + 0.5
    sink = pa.BufferOutputStream()
    table = pa.table({"x": values})
    pq.write_table(table, sink, compression="none", use_dictionary=False, write_page_checksum=True)
    data = bytearray(sink.getvalue().to_pybytes())
    data[data.index(values[500].tobytes())] ^= 1
    with pytest.raises(InputError, match="is damaged"):
        parquet.decode(bytes(data), "x.parquet")


def test_columns_of_a_file_keep_their_texts_together(tmp_path):
    path = tmp_path / "x.parquet"
    path.write_bytes(written(one_text(100_000, 100)))
    table = parquet.read_columns(path, ["run"], 100_000, 20_000_000)
    assert table.column_names == ["run"]
    assert pa.types.is_dictionary(table["run"].type)
    assert table.nbytes < 1_000_000
    for most_rows, largest in ((99_999, 20_000_000), (100_000, 5_000_000)):
        with pytest.raises(InputError, match=f"at most {most_rows} rows of {largest} bytes"):
            parquet.read_columns(path, ["run"], most_rows, largest)
