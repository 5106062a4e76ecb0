"""Who set an input: the study's author, the run, the paper, a shipped vehicle or train, or the program.

An input that the author wrote is the study's, whatever its value. What was left to the program is the
paper's, the library's or a default, by the rules of ``register.toml``. Results of earlier versions do not
say what the author wrote: there a value that equals the program's own is said to be of either.
"""

import tomllib
from collections.abc import Mapping
from fnmatch import fnmatchcase
from functools import cache
from importlib.resources import files
from typing import Any

from pydantic import BaseModel

from mcsettle.railway.vehicle import VEHICLES
from mcsettle.study.build import SETTLEMENT_KEYS, resolved_track
from mcsettle.study.build_trains import resolved_train, shipped_vehicles
from mcsettle.study.key_paths import leaves
from mcsettle.study.schema.economics import EconomicsTable
from mcsettle.study.schema.profile import ProfileTable
from mcsettle.study.schema.run import LimitTable, RunTable, SettlementTable
from mcsettle.study.schema.track import SofteningTable, TrackTable
from mcsettle.study.schema.traffic import TrainTable
from mcsettle.study.study import Study

FILE = "study file"
OF_THE_RUN = ("seed", "run.realisations", "run.parameter_sets", "run.stepping")  # its options
OWN = ("scenarios.", "vehicles.")  # tables that the program adds nothing to
DERIVED = ("economics.", "effects.")  # figures that follow from the baseline's timetable
DIGESTS = (".sha256", ".factor_digest")
Origin = tuple[str, str]  # who set it, and the source


class Origins:
    """Who set each input of one study."""

    def __init__(self, study: Study) -> None:
        self.study, self.stated, self.defaults = study, frozenset(study.stated), _defaults(study)

    def of(self, path: str, value: Any) -> Origin:
        """Who set the ``value`` at the key path ``path``, and its source."""
        study = self.study
        named = [key for key in study.sources if path == key or path.startswith(f"{key}.")]
        if named:
            text = study.sources[max(named, key=len)]
            return ("paper" if text.lower().startswith("paper") else "study"), text
        if path in self.stated or path.startswith(OWN):
            return "study", FILE
        inherited = self._inherited(path, value)
        if inherited is not None:
            return self.of(inherited, value)
        others = self._left_to_the_program(path, value)
        if others is None or (path.startswith("variants.") and not self.stated):
            return "study", "follows from the study file" if self.stated else FILE
        if self.stated or others[0] == "study":
            return others
        return f"study or {others[0]}", f"{FILE}, or {others[1]}"

    def _left_to_the_program(self, path: str, value: Any) -> Origin | None:
        """Who gave ``value`` if the author did not; None: it follows from what the author wrote."""
        default = self.defaults.get(path)
        if default is not None and not _equal(default, value):
            chosen = self.stated and path in OF_THE_RUN
            return ("run", "for this run, not in the study file") if chosen else None
        if (default is None and path.startswith(DERIVED)) or path.endswith(DIGESTS):
            return None
        return self._of_vehicle(path) or self._by_rule(path)

    def _inherited(self, path: str, value: Any) -> str | None:
        """Key of ``[settlement]`` that a variant follows at ``path``; None where it has its own value."""
        steps = path.split(".")
        if steps[0] != "variants" or steps[-1] not in SETTLEMENT_KEYS:
            return None
        inherited = getattr(self.study.settlement, steps[-1])
        return (
            f"settlement.{steps[-1]}"
            if inherited is not None and _equal(inherited, value)
            else None
        )

    def _of_vehicle(self, path: str) -> Origin | None:
        """Origin of what a train takes from a vehicle that is not one of the paper's."""
        names = [n for n in self.study.train_tables if path.startswith(f"trains.{n}.")]
        if not names:
            return None
        name = max(names, key=len)
        train, rest = self.study.train_tables[name], path.removeprefix(f"trains.{name}.").split(".")
        vehicle = train.consist[int(rest[1]) - 1].vehicle if train.consist else str(train.vehicle)
        if rest[-1] in ("vehicle", "cars", "count"):
            return "library", "a shipped train"
        if vehicle in self.study.vehicle_tables:
            return "study", f"vehicles.{vehicle}"
        if vehicle in VEHICLES:
            return None
        return "library", f"vehicle {vehicle}: {shipped_vehicles()[vehicle].source}"

    def _by_rule(self, path: str) -> Origin:
        preset = self.study.track_table.preset_name
        for rule in _rules():
            if fnmatchcase(path, rule["input"]) and rule.get("preset", preset) == preset:
                return rule["set_by"], rule["source"]
        return "default", "program's default"


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
        resolved = _dump(resolved_train(plain, study.vehicle_tables))
        data["trains"][name] = {k: v for k, v in resolved.items() if k not in ("vehicle", "cars")}
    if study.economics is not None:
        data["economics"] = _dump(EconomicsTable())
    return dict(leaves(data))


def _dump(table: BaseModel) -> dict[str, Any]:
    return table.model_dump(mode="json", by_alias=True, exclude_none=True)


def _equal(one: Any, other: Any) -> bool:
    numbers = all(isinstance(v, int | float) and not isinstance(v, bool) for v in (one, other))
    if numbers:
        return bool(abs(one - other) <= 1e-12 * max(abs(one), abs(other)))
    return bool(one == other)


@cache
def _rules() -> list[Mapping[str, Any]]:
    text = files("mcsettle.report").joinpath("register.toml").read_text(encoding="utf-8")
    return list(tomllib.loads(text)["rule"])
