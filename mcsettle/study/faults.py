"""Faults of a study in the user's words: where, what was received, what is accepted."""

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from typing import Any, get_args

from pydantic import BaseModel, ValidationError

from mcsettle.errors import InputError

MOST_SHOWN = 20


@dataclass(frozen=True)
class Fault:
    """One fault: the key's path, what was received and what is accepted (a sentence)."""

    path: str
    message: str

    def __str__(self) -> str:
        return f"{self.path}: {self.message}" if self.path else self.message


def refusal(origin: str, faults: Sequence[Fault]) -> InputError:
    """The error that lists ``faults`` of the study read from ``origin`` on one screen."""
    count = f"{len(faults)} faults" if len(faults) > 1 else "1 fault"
    shown = [f"  {_shortened(str(fault), 300)}" for fault in faults[:MOST_SHOWN]]
    if len(faults) > MOST_SHOWN:
        shown.append(f"  … and {len(faults) - MOST_SHOWN} more")
    return InputError("\n".join([f"{origin} cannot be used ({count}):", *shown]))


def faults_of(error: ValidationError, model: type[BaseModel]) -> list[Fault]:
    """Every fault pydantic found, in the order of the file's keys; a misspelt key is not missing too."""
    entries = error.errors(include_url=False)
    meant = {
        (*entry["loc"][:-1], nearest(str(entry["loc"][-1]), _keys_at(model, entry["loc"][:-1])))
        for entry in entries
        if entry["type"] == "extra_forbidden"
    }
    return [
        _fault(entry, model)
        for entry in entries
        if not (entry["type"] == "missing" and entry["loc"] in meant)
        and not _short_by_faults(entry)
    ]


def _short_by_faults(entry: Any) -> bool:
    """Whether a list is too short only because its faulty entries, told themselves, do not count."""
    long_enough = entry.get("ctx", {}).get("min_length", 0)
    return entry["type"] == "too_short" and len(entry["input"]) >= long_enough


def dotted(location: Iterable[str | int]) -> str:
    """Key path as a user reads it: ``scenarios[2].timetable[1].speed_kmh`` (counted from 1)."""
    text = ""
    for step in location:
        text += f"[{step + 1}]" if isinstance(step, int) else f".{step}" if text else str(step)
    return text


def suggestion(received: str, accepted: Iterable[str]) -> str:
    """What is accepted instead of ``received``, the nearest first when one is near."""
    names = list(accepted)
    if near := nearest(received, names):
        return f"did you mean '{near}'?"
    return f"accepted: {', '.join(names)}" if names else "none is defined"


def nearest(received: str, accepted: Iterable[str]) -> str:
    """The accepted name that ``received`` is nearest to; empty where none is near."""
    return next(iter(get_close_matches(received, list(accepted), n=1, cutoff=0.6)), "")


def shown(value: Any) -> str:
    """A received value, short enough for one line."""
    return _shortened(repr(value).replace("\n", " "), 60)


def _fault(entry: Any, model: type[BaseModel]) -> Fault:
    location = [step for step in entry["loc"] if step != "[key]"]
    path, kind, context = dotted(location), entry["type"], entry.get("ctx", {})
    if kind == "extra_forbidden":
        keys = _keys_at(model, location[:-1])
        return Fault(path, f"is not a key here; {suggestion(str(location[-1]), keys)}")
    if kind == "missing":
        return Fault(path, "is missing and has no default")
    received = f"received {shown(entry['input'])}; "
    if kind == "literal_error":
        options = context["expected"].replace(" or ", ", ").split(", ")
        accepted = [part.strip("'\" ") for part in options]
        return Fault(path, received + suggestion(str(entry["input"]), accepted))
    if kind == "value_error":
        return Fault(path, f"received {shown(entry['input'])}, which {context['error']}")
    if kind == "string_pattern_mismatch":
        return Fault(path, received + "a name has letters, digits, '_', '-' and '.' only")
    if kind == "too_short":
        return Fault(path, "is empty; it needs at least one entry")
    return Fault(path, received + _accepted(entry["msg"]))


def _accepted(message: str) -> str:
    """Pydantic's sentence in this package's manner."""
    text = message.replace("Input should be a valid", "it must be a")
    text = text.replace("Input should be", "it must be")
    text = text.replace("tuple", "list").replace("dictionary", "table")
    text = re.sub(r"be a (?=[aeiou])", "be an ", text)
    return re.sub(r" or instance of \w+$", "", text)


def _keys_at(model: type[BaseModel], location: Sequence[str | int]) -> list[str]:
    """Keys that the table at ``location`` accepts."""
    here: Any = model
    for step in location:
        here = _inside(here, step)
    return [f.alias or key for key, f in here.model_fields.items()] if _is_table(here) else []


def _inside(annotation: Any, step: str | int) -> Any:
    """Annotation of what lies one step below ``annotation``."""
    if _is_table(annotation):
        for key, field in annotation.model_fields.items():
            if step in (key, field.alias):
                return _table_or_container(field.annotation)
        return None
    arguments = [a for a in get_args(annotation) if a is not Ellipsis]
    return _table_or_container(arguments[-1]) if arguments else None


def _table_or_container(annotation: Any) -> Any:
    """``X`` of ``X | None``; anything else as it is."""
    options = get_args(annotation)
    if type(None) in options:
        return next(option for option in options if option is not type(None))
    return annotation


def _is_table(annotation: Any) -> bool:
    return isinstance(annotation, type) and issubclass(annotation, BaseModel)


def _shortened(text: str, length: int) -> str:
    return text if len(text) <= length else text[: length - 1] + "…"
