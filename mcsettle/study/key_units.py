"""Units of the inputs, from the schema of the study file: the name of a key is no unit."""

from collections.abc import Iterator
from typing import Any

from mcsettle.storage.tables import in_currency, input_column
from mcsettle.study.key_paths import steps_to
from mcsettle.study.schema.study import StudyTables, json_schema
from mcsettle.study.written import study_data

# What a parameter set says of itself beside the values of keys.
DERIVED = {"step_a.error_percent": "%"}


def input_units(study: StudyTables) -> dict[str, str]:
    """Units of the uncertain inputs of ``study``, by their columns in ``realisations``."""
    data = study_data(study)
    units = {path: unit_at(data, path) for entry in study.uncertain for path in entry.paths}
    units |= DERIVED if study.predicts_grounds else {}
    return {input_column(path): unit for path, unit in units.items()}


def unit_at(data: Any, path: str) -> str:
    """Unit of the input at the key ``path`` of ``data``, a study file as read; "1" of a plain number.

    >>> unit_at({"rail": {"damping_ns_per_m": 1.0, "poisson": 0.3}}, "rail.poisson")
    '1'
    """
    nodes = [json_schema()]
    for step in steps_to(data, path) or ():
        nodes = [node for above in nodes for node in _below(above, step)]
    units = (node["unit"] for above in nodes for node in _readings(above) if "unit" in node)
    return in_currency(next(units, "1"), data.get("economics", {}).get("currency", ""))


def _below(node: dict[str, Any], step: str | int) -> Iterator[dict[str, Any]]:
    """What may stand under a key, or at a place of a list."""
    for reading in _readings(node):
        if isinstance(step, int):
            further = [reading.get("items")]
        else:
            of_any_name = reading.get("patternProperties", {}).values()
            further = [reading.get("properties", {}).get(step), *of_any_name]
        yield from (node for node in further if isinstance(node, dict))


def _readings(node: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """A node of the schema with everything that it may be."""
    yield node
    if "$ref" in node:
        name = str(node["$ref"]).rpartition("/")[2]
        yield from _readings(json_schema()["$defs"][name])
    for key in ("anyOf", "oneOf", "allOf"):
        for one in node.get(key, ()):
            yield from _readings(one)
