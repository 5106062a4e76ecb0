"""Reading a study file: its bytes, its TOML, and those of its tables that are sound."""

import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from mcsettle.errors import InputError
from mcsettle.storage.files import read_regular

LARGEST_FILE = 1_000_000  # bytes
MOST_DOTS = 2500  # in one line
MOST_KEYS = 1000  # of one table: each is answered with the known key that is nearest
DEEPEST = 12  # tables in one another; a study has half as many


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
        text = data.decode("utf-8-sig")  # editors on Windows write a byte order mark
        _refuse_long_keys(text)
        found = tomllib.loads(text)
        _refuse_monstrous(found)
    except UnicodeDecodeError as error:
        if data[:2] in (b"\xff\xfe", b"\xfe\xff"):
            raise InputError(f"{origin} is not UTF-8 but UTF-16 text: save it as UTF-8") from None
        line = data.count(b"\n", 0, error.start) + 1
        raise InputError(
            f"{origin} is not UTF-8 text (line {line}, byte 0x{data[error.start]:02x}): save it as UTF-8"
        ) from None
    except (ValueError, RecursionError) as error:
        reason = "nested too deeply" if isinstance(error, RecursionError) else str(error)
        raise InputError(f"{origin} is not valid TOML: {reason}") from None
    return found


def with_tuples(value: Any) -> Any:
    """``value`` with lists as tuples: what strict validation of frozen tables takes."""
    if isinstance(value, Mapping):
        return {key: with_tuples(inner) for key, inner in value.items()}
    return tuple(with_tuples(inner) for inner in value) if isinstance(value, list) else value


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
