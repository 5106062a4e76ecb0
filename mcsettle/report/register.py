"""The assumptions register: every input, its value or distribution, its source, who set it.

Who set a value is found by comparing it with what the program would have taken: equal to a preset
or default, it is the paper's or a default by the rules of ``register.toml``; different, it is the
study's, unless the study's ``[sources]`` says where it comes from.
"""

import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from fnmatch import fnmatchcase
from functools import cache
from importlib.resources import files
from typing import Any

from mcsettle.report.page import Table
from mcsettle.report.words import cut
from mcsettle.study.build import SETTLEMENT_KEYS, resolved_track
from mcsettle.study.build_trains import resolved_train
from mcsettle.study.key_paths import is_number
from mcsettle.study.key_units import unit_at
from mcsettle.study.schema.economics import EconomicsTable
from mcsettle.study.schema.profile import ProfileTable
from mcsettle.study.schema.run import LimitTable, RunTable, SettlementTable
from mcsettle.study.schema.track import SofteningTable, TrackTable
from mcsettle.study.schema.traffic import TrainTable
from mcsettle.study.study import Study
from mcsettle.study.written import study_data

OMITTED = {
    "schema_version",
    "title",
    "start_date",
    "reference",
    "calibration",
    "sources",
    "uncertain",
    "correlations",
    "observed",
    "files_outside",
}
SHORT = 3  # list entries shown


@dataclass(frozen=True)
class Entry:
    """One input: ``set_by`` is paper, default or study; ``given`` a number or truth value as such."""

    path: str
    value: str
    unit: str
    distribution: str
    set_by: str
    source: str
    given: float | bool | None = None


def entries(study: Study) -> list[Entry]:
    """Every input of ``study`` in the order of its file."""
    data = study_data(study)
    drawn = {path: table for table in study.uncertain for path in table.paths}
    defaults, found = _defaults(study), []
    for path, value in _leaves({k: v for k, v in data.items() if k not in OMITTED}):
        table = drawn.get(path)
        set_by, source = _origin(study, path, value, defaults.get(path))
        words = "" if table is None else _distribution(table.model_dump(exclude_none=True))
        if table is not None:
            set_by = "study"
            source = table.source or source
        unit = unit_at(data, path)
        unit = unit if is_number(value) and unit != "1" else ""
        given = value if isinstance(value, bool | int | float) else None
        found.append(Entry(path, _shown(value), unit, words, set_by, source, given))
    return found


def register_table(study: Study) -> Table:
    """The register as a table."""
    rows = tuple(
        (e.path, e.value, e.unit, cut(e.distribution, 200), e.set_by, cut(e.source, 300))
        for e in entries(study)
    )
    head = ("input", "value", "unit", "distribution", "set by", "source")
    note = (
        "Set by: paper, a value of the paper's tables or text; default, this program's choice where "
        "the paper is silent; study, the study file. An input with a distribution has its "
        "central value in the second column."
    )
    return Table("Assumptions register", head, rows, 6, note, small=True)


def _leaves(data: Any, path: str = "") -> Iterator[tuple[str, Any]]:
    """Key path and value of every input; a list of plain values is one."""
    if isinstance(data, Mapping):
        for key, value in data.items():
            if key != "name" or not path:
                yield from _leaves(value, f"{path}.{key}" if path else str(key))
    elif isinstance(data, list | tuple) and data and isinstance(data[0], Mapping):
        for place, value in enumerate(data):
            yield from _leaves(value, f"{path}.{value.get('name', place + 1)}")
    else:
        yield path, data


def _origin(study: Study, path: str, value: Any, default: Any) -> tuple[str, str]:
    """Who set the value at ``path``, and its source."""
    named = [key for key in study.sources if path == key or path.startswith(f"{key}.")]
    if named:
        text = study.sources[max(named, key=len)]
        return ("paper" if text.lower().startswith("paper") else "study"), text
    inherited = _inherited(study, path, value)
    if inherited is not None:
        return _origin(study, inherited, value, _default_settlement(inherited))
    if path.startswith(("scenarios.", "variants.")):
        return "study", "study file"
    if default is None or not _equal(default, value):
        return "study", "study file"
    for rule in _rules():
        if fnmatchcase(path, rule["input"]) and _applies(rule, study):
            return rule["set_by"], rule["source"]
    return "default", "program's default"


def _inherited(study: Study, path: str, value: Any) -> str | None:
    """Key of ``[settlement]`` that a variant follows at ``path``; None where it has its own value."""
    steps = path.split(".")
    if steps[0] != "variants" or steps[-1] not in SETTLEMENT_KEYS:
        return None
    own = getattr(study.settlement, steps[-1])
    return f"settlement.{steps[-1]}" if own is not None and _equal(own, value) else None


def _default_settlement(path: str) -> Any:
    return _dump(SettlementTable()).get(path.rpartition(".")[2])


def _applies(rule: Mapping[str, Any], study: Study) -> bool:
    return "preset" not in rule or rule["preset"] == study.track_table.preset_name


def _defaults(study: Study) -> dict[str, Any]:
    """What the program would have taken for every key path, had the study not named it."""
    table = study.track_table
    softening = None if table.softening is None else SofteningTable()
    track = TrackTable(model=table.model, preset=table.preset, soil=table.soil, softening=softening)
    data: dict[str, Any] = {
        "seed": 1,
        "track": _dump(resolved_track(track, study.softens)),
        "profile": _dump(ProfileTable()),
        "settlement": _dump(SettlementTable()),
        "limit": {"horizon_years": LimitTable(sd_limit_mm=1.0).horizon_years},
        "run": _dump(RunTable()),
        "trains": {},
    }
    for name, t in study.train_tables.items():
        if t.consist is not None:  # every car of it is the study's own choice
            continue
        plain = TrainTable(vehicle=t.vehicle, cars=t.cars)
        own = _dump(resolved_train(plain, study.vehicle_tables))
        data["trains"][name] = {k: v for k, v in own.items() if k not in ("vehicle", "cars")}
    if study.economics is not None:
        data["economics"] = _dump(EconomicsTable())
    return dict(_leaves(data))


def _dump(table: Any) -> dict[str, Any]:
    found: dict[str, Any] = table.model_dump(mode="json", by_alias=True, exclude_none=True)
    return found


def _equal(one: Any, other: Any) -> bool:
    numbers = all(isinstance(v, int | float) and not isinstance(v, bool) for v in (one, other))
    if numbers:
        return bool(abs(one - other) <= 1e-12 * max(abs(one), abs(other)))
    return bool(one == other)


def _shown(value: Any) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{value:.6g}".replace("-", "−")
    if isinstance(value, list | tuple):
        parts = [_shown(v) for v in value]
        more = f", … {parts[-1]} ({len(parts)} values)" if len(parts) > SHORT + 1 else ""
        return ", ".join(parts[: SHORT if more else None]) + more
    return cut(str(value), 80)


def _distribution(table: Mapping[str, Any]) -> str:
    others = {"input", "also", "distribution", "source", "fitted"}
    given = [f"{k.replace('_', ' ')} {_shown(v)}" for k, v in table.items() if k not in others]
    shared = table.get("also", ())
    text = f"{table['distribution'].replace('_', '-')}: {', '.join(given)}"
    return text + (f"; one draw with {', '.join(shared)}" if shared else "")


@cache
def _rules() -> list[dict[str, Any]]:
    text = files("mcsettle.report").joinpath("register.toml").read_text(encoding="utf-8")
    rules: list[dict[str, Any]] = tomllib.loads(text)["rule"]
    return rules
