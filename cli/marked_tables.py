"""Tables as Parquet files that say whose study they are of."""

from pathlib import Path
from typing import TYPE_CHECKING

from mcsettle.cli.terminal import inform

if TYPE_CHECKING:
    import pandas as pd
    import pyarrow as pa


def marked_table(rows: "pd.DataFrame", study: str) -> "pa.Table":
    """``rows`` with the mark ``study`` in their metadata."""
    import pyarrow as pa

    from mcsettle.storage.marks import NAME

    table = pa.Table.from_pandas(rows, preserve_index=False)
    return table.replace_schema_metadata({**(table.schema.metadata or {}), NAME: study})


def write_tables(tables: "dict[str, pd.DataFrame]", folder: Path, study: str) -> None:
    """Each as ``NAME.parquet`` in ``folder``, with the mark ``study``."""
    from mcsettle.storage.files import write_file
    from mcsettle.storage.parquet import encode

    for name, rows in tables.items():
        write_file(folder / f"{name}.parquet", encode(marked_table(rows, study)))
    inform(f"Wrote {' and '.join(f'{name}.parquet' for name in tables)} to {folder}")
