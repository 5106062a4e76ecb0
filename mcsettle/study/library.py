"""What a study takes from elsewhere by name: shipped trains, and files with own vehicles and tracks.

Everything is written into the study before it is checked, so that a resolved study stands alone:
``include`` disappears, a ``library`` key is replaced by what it names, laid under the table's own keys.
Which inputs its author wrote, in the study or a file that it includes, is kept beside them (``stated``).
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from mcsettle.errors import InputError
from mcsettle.study.build_trains import shipped_library
from mcsettle.study.faults import Fault, dotted, refusal, suggestion
from mcsettle.study.input_files import input_file
from mcsettle.study.key_paths import leaves
from mcsettle.study.read import toml_data

KINDS = ("vehicles", "trains", "tracks")
MOST_FILES = 20
Shelf = dict[str, dict[str, Any]]
# Tables that the program adds nothing to: all that is in them is the author's.
COMPLETE = {
    *("schema_version", "title", "start_date", "reference", "calibration", "sources", "uncertain"),
    *("correlations", "observed", "files_outside", "include", "scenarios", "stated"),
}


def stated_inputs(data: Mapping[str, Any], origin: str, folder: Path | None) -> tuple[str, ...]:
    """Key paths of the inputs in a sound study and its included files, not in what is shipped."""
    without = expanded(data, origin, folder, {name: {} for name in shipped_library()["trains"]})
    own = {key: value for key, value in without.items() if key not in COMPLETE}
    return tuple(path for path, _ in leaves(own))


def expanded(
    data: Mapping[str, Any],
    origin: str,
    folder: Path | None,
    shipped: Mapping[str, Any] | None = None,
) -> dict[str, Any]:
    """Study data with included files and library names written out.

    ``shipped``: trains that come with the program (None: those that do).

    Raises
    ------
    InputError
        A file that cannot be read or holds something else, a name given twice, or an unknown one.
    """
    result, faults = dict(data), list[Fault]()
    shelf = _included(data, folder, faults)
    if not isinstance(data.get("include", []), list | tuple):
        return result  # the schema says what is wrong
    result.pop("include", None)
    own = data.get("vehicles", {})
    if shelf["vehicles"] and isinstance(own, Mapping):
        result["vehicles"] = shelf["vehicles"] | dict(own)
    present = shipped_library()["trains"] if shipped is None else shipped
    trains = {**present, **shelf["trains"]}
    if isinstance(data.get("trains"), Mapping):
        result["trains"] = {
            name: _named(table, trains, f"trains.{name}.library", faults)
            for name, table in data["trains"].items()
        }
    if isinstance(data.get("track"), Mapping):
        result["track"] = _named(data["track"], shelf["tracks"], "track.library", faults)
    if faults:
        raise refusal(origin, faults)
    return result


def _included(data: Mapping[str, Any], folder: Path | None, faults: list[Fault]) -> Shelf:
    """Tables of the files that ``data`` includes."""
    shelf: Shelf = {kind: {} for kind in KINDS}
    names = data.get("include", [])
    for place, name in enumerate(names[:MOST_FILES] if isinstance(names, list | tuple) else []):
        path = dotted(("include", place))
        if not isinstance(name, str):
            faults.append(Fault(path, "is no file name"))
            continue
        try:
            found = toml_data(input_file(folder, name, data.get("files_outside") is True))
            faults += [Fault(path, text) for text in _taken(found, shelf)]
        except InputError as error:
            faults.append(Fault(path, str(error)))
    return shelf


def _taken(found: Mapping[str, Any], shelf: Shelf) -> list[str]:
    """Put the tables of a file on the ``shelf``; what is wrong with them, in words."""
    wrong = []
    for kind, tables in found.items():
        if kind not in KINDS or not isinstance(tables, Mapping):
            wrong.append(f"holds '{kind}'; an included file holds tables {', '.join(KINDS)}")
            continue
        for name, table in tables.items():
            if name in shelf[kind]:
                wrong.append(f"gives {kind}.{name} a second time")
            shelf[kind][name] = table
    return wrong


def _named(table: Any, shelf: Mapping[str, Any], path: str, faults: list[Fault]) -> Any:
    """``table`` laid over the one that its ``library`` key names."""
    if not isinstance(table, Mapping) or not isinstance(table.get("library"), str):
        return table
    name = table["library"]
    if name not in shelf:
        said = f"received '{name}', which is not there; {suggestion(name, shelf)}"
        faults.append(Fault(path, said))
        return table
    return _laid_over({k: v for k, v in table.items() if k != "library"}, shelf[name])


def _laid_over(own: Mapping[str, Any], base: Any) -> dict[str, Any]:
    merged = dict(base) if isinstance(base, Mapping) else {}
    for key, value in own.items():
        below = merged.get(key)
        both = isinstance(value, Mapping) and isinstance(below, Mapping)
        merged[key] = _laid_over(value, below) if both else value
    return merged
