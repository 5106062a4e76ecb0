"""Tables as Parquet files that say whose study they are of."""

from pathlib import Path
from typing import TYPE_CHECKING

from mcsettle.cli.terminal import inform

if TYPE_CHECKING:
    import pandas as pd


def write_tables(tables: "dict[str, pd.DataFrame]", folder: Path, study: str) -> None:
    """Each as ``NAME.parquet`` in ``folder``, with the mark ``study``."""
    import pyarrow as pa

    from mcsettle.storage.files import write_file
    from mcsettle.storage.marks import NAME
    from mcsettle.storage.parquet import encode

    for name, rows in tables.items():
        table = pa.Table.from_pandas(rows, preserve_index=False)
        marked = table.replace_schema_metadata({**(table.schema.metadata or {}), NAME: study})
        write_file(folder / f"{name}.parquet", encode(marked))
    inform(f"Wrote {' and '.join(f'{name}.parquet' for name in tables)} to {folder}")
