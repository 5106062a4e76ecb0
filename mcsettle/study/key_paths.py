"""Key paths of a study file: ``track.layers.subgrade.settlement_b`` and what it leads to.

A step is a key, the name of an entry in a list of named tables (``scenarios.v201``), or a place in a
list, counted from 1 (``scenarios.v201.timetable.1.speed_kmh``). Names may hold dots themselves.
"""

from collections.abc import Iterator, Mapping
from typing import Any

Steps = tuple[str | int, ...]


def steps_to(data: Any, path: str) -> Steps | None:
    """Steps (keys and places counted from 0) that ``path`` takes through ``data``; None: nowhere.

    >>> steps_to({"scenarios": [{"name": "a"}, {"name": "b", "x": 1}]}, "scenarios.b.x")
    ('scenarios', 1, 'x')
    """
    parts = path.split(".")
    for length in range(len(parts), 0, -1):
        step = _step(data, ".".join(parts[:length]))
        if step is None:
            continue
        rest = ".".join(parts[length:])
        further = steps_to(data[step], rest) if rest else ()
        if further is not None:
            return (step, *further)
    return None


def value_at(data: Any, steps: Steps) -> Any:
    """What stands at the end of ``steps``."""
    for step in steps:
        data = data[step]
    return data


def replaced(data: Any, steps: Steps, value: Any) -> Any:
    """Copy of ``data`` with ``value`` at the end of ``steps``; what is not on the way is shared."""
    if not steps:
        return value
    copy: Any = dict(data) if isinstance(data, Mapping) else list(data)
    copy[steps[0]] = replaced(data[steps[0]], steps[1:], value)
    return copy


def number_paths(data: Any, path: str = "") -> Iterator[str]:
    """Key paths of every number in ``data`` (not of truth values)."""
    if isinstance(data, Mapping):
        for key, value in data.items():
            yield from number_paths(value, f"{path}.{key}" if path else str(key))
    elif isinstance(data, list | tuple):
        for place, value in enumerate(data):
            if isinstance(value, Mapping):
                yield from number_paths(value, f"{path}.{value.get('name', place + 1)}")
    elif is_number(data):
        yield path


def leaves(data: Any, path: str = "") -> Iterator[tuple[str, Any]]:
    """Key path and value of every input of ``data``; a list of plain values is one."""
    if isinstance(data, Mapping):
        for key, value in data.items():
            if key != "name" or not path:
                yield from leaves(value, f"{path}.{key}" if path else str(key))
    elif isinstance(data, list | tuple) and data and isinstance(data[0], Mapping):
        for place, value in enumerate(data):
            yield from leaves(value, f"{path}.{value.get('name', place + 1)}")
    else:
        yield path, data


def is_number(value: Any) -> bool:
    """Whether ``value`` is a number and no truth value."""
    return isinstance(value, int | float) and not isinstance(value, bool)


def _step(data: Any, name: str) -> str | int | None:
    if isinstance(data, Mapping):
        return name if name in data else None
    if not isinstance(data, list | tuple):
        return None
    for place, entry in enumerate(data):
        if isinstance(entry, Mapping) and entry.get("name") == name:
            return place
    if name.isdecimal() and 1 <= int(name) <= len(data):
        return int(name) - 1
    return None
