"""A study written back as TOML: plain tables, strings, numbers, lists of numbers and of tables."""

import json
import re
from collections.abc import Mapping
from typing import Any

_BARE = re.compile(r"[A-Za-z0-9_-]+")


def toml_text(data: Mapping[str, Any]) -> str:
    """TOML of nested mappings whose leaves are text, numbers, booleans or lists of them.

    >>> print(toml_text({"seed": 1, "limit": {"sd_limit_mm": 1.5}}), end="")
    seed = 1
    <BLANKLINE>
    [limit]
    sd_limit_mm = 1.5
    """
    lines: list[str] = []
    _table(data, (), lines)
    return "\n".join(lines).strip("\n") + "\n"


def _table(data: Mapping[str, Any], path: tuple[str, ...], lines: list[str]) -> None:
    nested = {key: value for key, value in data.items() if _is_nested(value, path)}
    for key, value in data.items():
        if key not in nested:
            lines.append(f"{_key(key)} = {_value(value)}")
    for key, value in nested.items():
        inner = (*path, key)
        name = ".".join(_key(step) for step in inner)
        for entry in [value] if isinstance(value, Mapping) else value:
            if not (entry and _only_tables(entry)):
                lines += ["", f"[{name}]" if isinstance(value, Mapping) else f"[[{name}]]"]
            _table(entry, inner, lines)


def _is_nested(value: Any, path: tuple[str, ...]) -> bool:
    """Tables, and at the top level lists of tables, get a heading; the rest stays on one line."""
    if isinstance(value, Mapping):
        return True
    return not path and isinstance(value, list | tuple) and _has_tables(value)


def _only_tables(entry: Mapping[str, Any]) -> bool:
    """Whether a heading of its own would be empty."""
    return all(isinstance(value, Mapping) for value in entry.values())


def _has_tables(value: list[Any] | tuple[Any, ...]) -> bool:
    return bool(value) and isinstance(value[0], Mapping)


def _key(key: str) -> str:
    return key if _BARE.fullmatch(key) else _string(key)


def _value(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return _string(value)
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{_key(k)} = {_value(v)}" for k, v in value.items()) + " }"
    if isinstance(value, list | tuple) and _has_tables(value):
        return "[\n" + "".join(f"    {_value(entry)},\n" for entry in value) + "]"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(_value(entry) for entry in value) + "]"
    return repr(value)


def _string(text: str) -> str:
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")
