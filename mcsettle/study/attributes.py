"""Tables of a study over domain objects: which key stands for which attribute, forwards and back."""

import math
from collections.abc import Mapping
from dataclasses import is_dataclass, replace
from typing import Any, TypeVar

from pydantic import BaseModel

T = TypeVar("T")
Paths = Mapping[str, tuple[str, float]]


def overridden(domain_object: T, table: BaseModel, paths: Paths) -> T:
    """Copy of a domain object with the values that ``table`` gives.

    Raises
    ------
    ValueError
        ``table`` gives a value the object has no attribute for, or the object refuses one.
    """
    changes = {
        path: (key, value if isinstance(value, str) else value * factor)
        for key, (path, factor) in paths.items()
        if (value := getattr(table, key)) is not None
    }
    return _changed(domain_object, changes)


def described(domain_object: Any, paths: Paths) -> dict[str, Any]:
    """The keys ``paths`` gives to an object's values; absent and infinite ones left out."""
    values = {}
    for key, (path, factor) in paths.items():
        value = domain_object
        for attribute in path.split("."):
            value = getattr(value, attribute, None)
        if value is not None and value != math.inf:
            values[key] = value if isinstance(value, str) else value / factor
    return values


def _changed(target: T, changes: Mapping[str, tuple[str, Any]]) -> T:
    """Copy of a frozen dataclass with dotted paths replaced; values are (key, value)."""
    values: dict[str, Any] = {}
    nested: dict[str, dict[str, tuple[str, Any]]] = {}
    for path, (key, value) in changes.items():
        head, _, rest = path.partition(".")
        part = getattr(target, head, None)
        if rest and not (is_dataclass(part) and hasattr(part, rest)):
            raise ValueError(f"'{_name(target)}' has no {key}: leave it out")
        if rest:
            nested.setdefault(head, {})[rest] = (key, value)
        else:
            values[head] = value
    for head, inner in nested.items():
        values[head] = _changed(getattr(target, head), inner)
    return replace(target, **values) if values else target  # type: ignore[type-var]


def _name(target: object) -> str:
    return str(getattr(target, "name", type(target).__name__))
