"""The results as labelled arrays: an ``xarray.Dataset`` with units."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

import pandas as pd

from mcsettle.errors import InputError
from mcsettle.storage.tables import schema_of

if TYPE_CHECKING:
    import xarray

DIMS = ["scenario", "variant", "parameter_set", "realisation"]


def labelled(
    tables: dict[str, pd.DataFrame],
    scenarios: tuple[str, ...],
    variants: tuple[str, ...],
    currency: str,
    units: Mapping[str, str],
) -> "xarray.Dataset":
    """Every column of ``realisations`` and ``effects`` over ``DIMS``, NaN where a row is missing.

    ``units``: of the columns of the drawn inputs.
    The ``status`` of the effects is ``effect_status``, their other texts are left out.

    Raises
    ------
    InputError
        The extra ``xarray`` is not installed.
    """
    try:
        import xarray
    except ImportError:
        raise InputError(
            "labelled arrays need the extra 'xarray': pip install 'mcsettle[xarray]'"
        ) from None
    parts = []
    for name, table in tables.items():
        if table.empty:
            continue
        schema = schema_of(name, table.columns, currency, units)
        rows = table.astype({"scenario": str, "variant": str}).set_index(DIMS)
        part = xarray.Dataset.from_dataframe(
            rows.drop(columns=["baseline", "effect"], errors="ignore")
        )
        for column in part.data_vars:
            metadata = schema.field(str(column)).metadata
            unit = metadata[b"unit"].decode()
            part[column].attrs = {"long_name": metadata[b"description"].decode()}
            if unit:
                part[column].attrs["units"] = unit
        parts.append(part.rename({"status": "effect_status"}) if name == "effects" else part)
    data = xarray.merge(parts, join="outer", compat="no_conflicts")
    present = {"scenario": scenarios, "variant": variants}
    order = {dim: [n for n in names if n in data[dim].values] for dim, names in present.items()}
    return data.sel(order).transpose(*DIMS)
