"""Keys of a study file that named their currency, read as the keys that stand in their place.

``tamping_cost_sek_per_track_km = 60000`` is ``tamping_cost_per_track_km = 60000``, ``currency = "SEK"``.
"""

import re
from collections.abc import Mapping
from typing import Any

from mcsettle.study.faults import Fault, refusal, shown
from mcsettle.study.schema.currencies import CODES

COST = "tamping_cost_per_track_km"
_FORMER = re.compile(r"tamping_cost_([a-z]{3})_per_track_km")


def with_present_keys(data: Mapping[str, Any], origin: str) -> dict[str, Any]:
    """Study data whose tamping cost stands under its present key, wherever the key is named.

    Raises
    ------
    InputError
        Two costs, or two currencies.
    """
    table = data.get("economics")
    if not isinstance(table, Mapping):
        return dict(data)
    former = {key: code for key in table if (code := _code_in(key))}
    if not former:
        return dict(data)
    costs = [*former, *([COST] if COST in table else [])]
    key, code = next(iter(former.items()))
    if len(costs) > 1:
        said = f"is the same input as {costs[1]}: keep one, with currency beside it"
        raise refusal(origin, [Fault(f"economics.{key}", said)])
    if table.get("currency", code) != code:
        said = f"is a cost in {code} beside currency = {shown(table['currency'])}: write {COST}"
        raise refusal(origin, [Fault(f"economics.{key}", said)])
    renamed = {COST if name == key else name: value for name, value in table.items()}
    result = {**data, "economics": {**renamed, "currency": code}}
    return _with_paths(result, f"economics.{key}", f"economics.{COST}")


def former_cost(currency: str) -> str:
    """The former key of a tamping cost in ``currency``."""
    return f"tamping_cost_{currency.lower()}_per_track_km"


def _code_in(key: str) -> str:
    """The currency that a former key names; empty where it is none."""
    named = _FORMER.fullmatch(key)
    code = named[1].upper() if named else ""
    return code if code in CODES else ""


def _with_paths(data: dict[str, Any], former: str, present: str) -> dict[str, Any]:
    """``data`` with the key path ``present`` where inputs and sources say ``former``."""

    def renamed(value: Any) -> Any:
        if isinstance(value, list | tuple):
            return [renamed(entry) for entry in value]
        return present if value == former else value

    for table, keys in (("uncertain", ("input", "also")), ("correlations", ("inputs",))):
        if isinstance(data.get(table), list | tuple):
            data[table] = [
                {k: renamed(v) if k in keys else v for k, v in entry.items()}
                if isinstance(entry, Mapping)
                else entry
                for entry in data[table]
            ]
    if isinstance(data.get("sources"), Mapping):
        data["sources"] = {renamed(key): text for key, text in data["sources"].items()}
    return data
