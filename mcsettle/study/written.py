"""A study written out: plain mappings under the file's keys, and the digest of what decides results."""

import hashlib
import json
from collections.abc import Collection
from typing import Any

from mcsettle.study.former_keys import COST, former_cost
from mcsettle.study.schema.study import StudyTables

_NO_EFFECT_ON_RESULTS = {
    "title",
    "start_date",
    "reference",
    "calibration",
    "maintenance",
    "line",
    "files_outside",
    "sources",
    "stated",
}
# Tables and lists that are left out where they are empty.
_OPTIONAL = (
    *("reference", "uncertain", "correlations", "observed"),
    *("sources", "vehicles", "include", "effects"),
)


def study_data(study: StudyTables, exclude: Collection[str] = ()) -> dict[str, Any]:
    """``study`` as nested mappings and lists under the file's keys, every default filled in.

    Empty tables and None are left out, and so are the tables ``exclude``.
    """
    data = study.model_dump(mode="json", by_alias=True, exclude_none=True, exclude=set(exclude))
    data["track"] = {key: value for key, value in data["track"].items() if value not in ({}, [])}
    data["variants"] = [_without_empty(entry, ("layers", "trains")) for entry in data["variants"]]
    data = _without_empty(data, _OPTIONAL)
    for key, optional in (("reference", ("note",)), ("uncertain", ("also", "fitted"))):
        if key in data:
            data[key] = [_without_empty(entry, optional) for entry in data[key]]
    return data


def study_digest(study: StudyTables, fitted: bool) -> str:
    """SHA-256 [hex] of all that decides a result: not titles, references, sample size.

    ``fitted``: whether the parameter sets fit a factor to the observations, which decide it then.
    """
    data = study_data(study, _NO_EFFECT_ON_RESULTS)
    if not fitted:
        data.pop("observed", None)
    data["run"].pop("realisations")
    data["run"].pop("parameter_sets", None)
    if "economics" in data:
        prices = data["economics"]
        prices.pop("price_base_year", None)
        # As written before a study named its currency: results of then are still of this study.
        prices[former_cost(prices.pop("currency"))] = prices.pop(COST)
    for entry in [*data["scenarios"], *data["variants"], data["settlement"]]:
        entry.pop("title", None)
        entry.pop("form_of", None)
        entry.pop("factor_digest", None)
    for key in ("uncertain", "correlations", "observed"):
        for entry in data.get(key, []):
            entry.pop("source", None)
    if study.profile.file is not None:  # what is in the file decides, not what it is called
        data["profile"].pop("file")
    for key in ("layers", "weights") if study.grounds_table is not None else ():
        data["grounds"].pop(key)
    text = json.dumps(data, sort_keys=True, separators=(",", ":"), allow_nan=False)
    return hashlib.sha256(text.encode()).hexdigest()


def _without_empty(table: dict[str, Any], optional: Collection[str]) -> dict[str, Any]:
    """``table`` without those of its keys ``optional`` that hold nothing."""
    return {key: value for key, value in table.items() if value or key not in optional}
