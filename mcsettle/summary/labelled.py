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

    ``units``: of the columns of the drawn inputs, and of any that has a closer one than its table says.
    The ``status`` of the effects is ``effect_status``, their other texts are left out. Effects have the
    dimension ``baseline`` too where a scenario has several.

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
        rows, dims = table.astype({"scenario": str, "variant": str}), DIMS
        if rows.duplicated(DIMS).any():
            rows, dims = rows.astype({"baseline": str}), ["scenario", "baseline", *DIMS[1:]]
        part = xarray.Dataset.from_dataframe(
            rows.set_index(dims).drop(columns=["baseline", "effect"], errors="ignore")
        )
        for column in part.data_vars:
            metadata = schema.field(str(column)).metadata
            unit = units.get(str(column), metadata[b"unit"].decode())
            part[column].attrs = {"long_name": metadata[b"description"].decode()}
            if unit:
                part[column].attrs["units"] = unit
        parts.append(part.rename({"status": "effect_status"}) if name == "effects" else part)
    data = xarray.merge(parts, join="outer", compat="no_conflicts")
    present = {"scenario": scenarios, "variant": variants, "baseline": scenarios}
    order = {
        dim: [n for n in names if n in data[dim].values]
        for dim, names in present.items()
        if dim in data.dims
    }
    return data.sel(order).transpose("scenario", ..., *DIMS[1:])
