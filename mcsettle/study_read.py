"""Reading a study file: its bytes, its TOML, and those of its tables that are sound.

Depends on: errors, study_checks, study_schema.
"""

import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from mcsettle.errors import InputError
from mcsettle.study_checks import Parts
from mcsettle.study_schema import (
    CalibrationTable,
    EconomicsTable,
    LimitTable,
    MaintenanceTable,
    ProfileTable,
    ReferenceTable,
    ScenarioTable,
    Table,
    TrackTable,
    TrainTable,
    VariantTable,
)

LARGEST_FILE = 1_000_000  # bytes
_SINGLE: Mapping[str, type[Table]] = {
    "track": TrackTable,
    "profile": ProfileTable,
    "limit": LimitTable,
    "economics": EconomicsTable,
    "calibration": CalibrationTable,
    "maintenance": MaintenanceTable,
}
_OPTIONAL = ("track", "profile")
_MANY: Mapping[str, type[Table]] = {
    "trains": TrainTable,
    "scenarios": ScenarioTable,
    "variants": VariantTable,
    "reference": ReferenceTable,
}


def toml_data(path: Path) -> dict[str, Any]:
    """The nested mappings and lists of the TOML file at ``path``.

    Raises
    ------
    InputError
        The file cannot be read, is too large, or is no TOML.
    """
    text = _file_text(path)
    try:
        return tomllib.loads(text)
    except (ValueError, RecursionError) as error:
        reason = "nested too deeply" if isinstance(error, RecursionError) else str(error)
        raise InputError(f"{path} is not valid TOML: {reason}") from None


def with_tuples(value: Any) -> Any:
    """``value`` with lists as tuples: what strict validation of frozen tables takes."""
    if isinstance(value, Mapping):
        return {key: with_tuples(inner) for key, inner in value.items()}
    return tuple(with_tuples(inner) for inner in value) if isinstance(value, list) else value


def sound_parts(data: Mapping[str, Any], wrong: set[tuple[Any, ...]]) -> Parts:
    """The tables of ``data`` that have no fault of their own (``wrong``: paths, two steps)."""
    sound: dict[str, Any] = {
        name: table.model_validate(data.get(name, {}))
        for name, table in _SINGLE.items()
        if not any(path[0] == name for path in wrong)
        and (data.get(name) is not None or name in _OPTIONAL)
    }
    entries = {name: _entries(data, name) for name in _MANY}
    for name, table in _MANY.items():
        sound[name] = {
            key: table.model_validate(entry)
            for key, entry in entries[name].items()
            if not {(name,), (name, key)} & wrong
        }
    sound["train_names"] = tuple(entries["trains"])
    for kind in ("scenario", "variant"):
        tables = [t for t in entries[f"{kind}s"].values() if isinstance(t, Mapping)]
        sound[f"{kind}_names"] = tuple(str(t.get("name", "")) for t in tables)
    return Parts(**sound)


def _entries(data: Mapping[str, Any], name: str) -> Mapping[Any, Any]:
    """Entries of a table or list of tables by key or index; empty where it is neither."""
    value = data.get(name)
    if isinstance(value, Mapping):
        return value if name == "trains" else {}
    return dict(enumerate(value)) if isinstance(value, tuple) and name != "trains" else {}


def _file_text(path: Path) -> str:
    try:
        size = path.stat().st_size
        if path.is_dir():
            raise InputError(f"{path} is a folder; a study is one TOML file")
        if size > LARGEST_FILE:
            raise InputError(f"{path} has {size} bytes; a study has at most {LARGEST_FILE}")
        return path.read_bytes()[: LARGEST_FILE + 1].decode("utf-8")
    except FileNotFoundError:
        raise InputError(f"{path} does not exist; 'mcsettle init' writes a study") from None
    except UnicodeDecodeError as error:
        raise InputError(f"{path} is not UTF-8 text (byte {error.start})") from None
    except (OSError, ValueError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"{path} cannot be read: {error}") from None
