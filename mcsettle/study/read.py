"""Reading a study file: its bytes, its TOML, and those of its tables that are sound."""

import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from mcsettle.errors import InputError
from mcsettle.storage.files import read_regular
from mcsettle.study.checks.parts import Parts
from mcsettle.study.schema.base import Table
from mcsettle.study.schema.economics import EconomicsTable, MaintenanceTable
from mcsettle.study.schema.profile import ProfileTable
from mcsettle.study.schema.published import CalibrationTable, ReferenceTable
from mcsettle.study.schema.run import LimitTable
from mcsettle.study.schema.track import TrackTable
from mcsettle.study.schema.traffic import ScenarioTable, TrainTable, VehicleTable
from mcsettle.study.schema.variants import VariantTable

LARGEST_FILE = 1_000_000  # bytes
MOST_DOTS = 2500  # in one line
MOST_KEYS = 1000  # of one table: each is answered with the known key that is nearest
DEEPEST = 12  # tables in one another; a study has half as many
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
    "vehicles": VehicleTable,
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
    return parsed_toml(_file_bytes(path), str(path))


def parsed_toml(data: bytes, origin: str) -> dict[str, Any]:
    """The nested mappings and lists of the bytes of a TOML file; ``origin`` names it in messages.

    Raises
    ------
    InputError
        They are no UTF-8, no TOML, too many, or nested deeper than any study.
    """
    if len(data) > LARGEST_FILE:
        raise InputError(f"{origin} has {len(data)} bytes; a study has at most {LARGEST_FILE}")
    try:
        text = data.decode("utf-8")
        _refuse_long_keys(text)
        found = tomllib.loads(text)
        _refuse_monstrous(found)
    except UnicodeDecodeError as error:
        raise InputError(f"{origin} is not UTF-8 text (byte {error.start})") from None
    except (ValueError, RecursionError) as error:
        reason = "nested too deeply" if isinstance(error, RecursionError) else str(error)
        raise InputError(f"{origin} is not valid TOML: {reason}") from None
    return found


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
    by_name = name in ("trains", "vehicles")
    if isinstance(value, Mapping):
        return value if by_name else {}
    return dict(enumerate(value)) if isinstance(value, tuple) and not by_name else {}


def _refuse_long_keys(text: str) -> None:
    """Refuse dotted keys whose parsing would take minutes (the parser is quadratic in their parts)."""
    if any(line.count(".") > MOST_DOTS for line in text.splitlines()):
        raise ValueError(f"a line has more than {MOST_DOTS} dots")


def _refuse_monstrous(data: dict[str, Any]) -> None:
    """Refuse tables nested deeper, or with more keys, than any study has them."""
    level: list[Any] = [data]
    for _ in range(DEEPEST):
        most = max((len(value) for value in level if isinstance(value, dict)), default=0)
        if most > MOST_KEYS:
            raise ValueError(f"a table has {most} keys; at most {MOST_KEYS}")
        inner = [
            v for value in level for v in (value.values() if isinstance(value, dict) else value)
        ]
        level = [value for value in inner if isinstance(value, dict | list)]
    if level:
        raise ValueError(f"nested too deeply: more than {DEEPEST} tables in one another")


def _file_bytes(path: Path) -> bytes:
    try:
        if path.is_dir():
            raise InputError(f"{path} is a folder; a study is one TOML file")
        size = path.stat().st_size
        if size > LARGEST_FILE:
            raise InputError(f"{path} has {size} bytes; a study has at most {LARGEST_FILE}")
        return read_regular(path, LARGEST_FILE)
    except FileNotFoundError:
        raise InputError(f"{path} does not exist; 'mcsettle init' writes a study") from None
    except (OSError, ValueError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"{path} cannot be read: {error}") from None
