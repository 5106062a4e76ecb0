"""The studies that are installed with mcsettle, each with the data files that it reads."""

import tomllib
from collections.abc import Iterator, Mapping
from importlib.resources import files
from importlib.resources.abc import Traversable
from typing import Any

from mcsettle.errors import InputError

STUDIES = "mcsettle.studies"
CODE = (".py", ".pyc", ".md")  # what lies beside the studies and is not data


def example_titles() -> dict[str, str]:
    """Title of every installed study by its name, in alphabetical order."""
    studies = (file for file in files(STUDIES).iterdir() if file.name.endswith(".toml"))
    texts = {file.name.removesuffix(".toml"): file.read_text(encoding="utf-8") for file in studies}
    return {name: tomllib.loads(texts[name]).get("title", "") for name in sorted(texts)}


def example_files(name: str) -> dict[str, bytes]:
    """The study ``name`` and its data: contents by path relative to the study's folder, the study first.

    A data file that lies in a folder brings the whole folder: its licence and what it was made from.

    Raises
    ------
    InputError
        There is no such study.
    """
    names = list(example_titles())
    if name not in names:
        raise InputError(f'received "{name}", which is no example: accepted are {", ".join(names)}')
    study = files(STUDIES).joinpath(f"{name}.toml").read_bytes()
    texts = set(_texts(tomllib.loads(study.decode("utf-8"))))
    data = dict(_data(files(STUDIES)))
    folders = {path.partition("/")[0] for path in texts & data.keys() if "/" in path}
    read = {p: f for p, f in data.items() if p in texts or p.partition("/")[0] in folders}
    return {f"{name}.toml": study} | {path: read[path].read_bytes() for path in sorted(read)}


def _data(folder: Traversable, above: str = "") -> Iterator[tuple[str, Traversable]]:
    """Every data file in ``folder`` and below, by its path."""
    for entry in folder.iterdir():
        if entry.is_dir():
            yield from _data(entry, f"{above}{entry.name}/")
        elif not entry.name.endswith((*CODE, ".toml")):
            yield above + entry.name, entry


def _texts(value: Any) -> Iterator[str]:
    """Every text in a study: among them the files that it names."""
    if isinstance(value, str):
        yield value
    elif isinstance(value, Mapping):
        for inner in value.values():
            yield from _texts(inner)
    elif isinstance(value, list):
        for inner in value:
            yield from _texts(inner)
