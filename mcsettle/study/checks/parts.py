"""What the checks of a study read: its tables as parsed, before anything is built."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from mcsettle.study.schema.base import Table
from mcsettle.study.schema.economics import EconomicsTable, EffectTable, MaintenanceTable
from mcsettle.study.schema.grounds import GroundsTable
from mcsettle.study.schema.profile import ProfileTable
from mcsettle.study.schema.published import CalibrationTable, ReferenceTable
from mcsettle.study.schema.run import LimitTable, RunTable, SettlementTable
from mcsettle.study.schema.spatial_variability import SpatialVariabilityTable
from mcsettle.study.schema.study import StudyTables
from mcsettle.study.schema.track import TrackTable
from mcsettle.study.schema.traffic import ScenarioTable, TrainTable, VehicleTable
from mcsettle.study.schema.variants import VariantTable

_SINGLE: Mapping[str, type[Table]] = {
    "track": TrackTable,
    "profile": ProfileTable,
    "settlement": SettlementTable,
    "spatial_variability": SpatialVariabilityTable,
    "limit": LimitTable,
    "economics": EconomicsTable,
    "calibration": CalibrationTable,
    "maintenance": MaintenanceTable,
    "run": RunTable,
    "grounds": GroundsTable,
}
_OPTIONAL = ("track", "profile", "settlement", "run")
_MANY: Mapping[str, type[Table]] = {
    "trains": TrainTable,
    "vehicles": VehicleTable,
    "scenarios": ScenarioTable,
    "variants": VariantTable,
    "reference": ReferenceTable,
    "effects": EffectTable,
}
_BY_NAME = {"trains", "vehicles"}


@dataclass(frozen=True)
class Parts:
    """The valid tables of a study; entries of lists keep their place in the file."""

    track: TrackTable | None = None
    profile: ProfileTable | None = None
    settlement: SettlementTable | None = None
    spatial_variability: SpatialVariabilityTable | None = None
    limit: LimitTable | None = None
    economics: EconomicsTable | None = None
    calibration: CalibrationTable | None = None
    run: RunTable | None = None
    maintenance: MaintenanceTable | None = None
    grounds: GroundsTable | None = None
    trains: Mapping[str, TrainTable] = field(default_factory=dict)
    vehicles: Mapping[str, VehicleTable] = field(default_factory=dict)
    train_names: tuple[str, ...] = ()
    scenario_names: tuple[str, ...] = ()
    variant_names: tuple[str, ...] = ()
    scenarios: Mapping[int, ScenarioTable] = field(default_factory=dict)
    variants: Mapping[int, VariantTable] = field(default_factory=dict)
    reference: Mapping[int, ReferenceTable] = field(default_factory=dict)
    effects: Mapping[int, EffectTable] = field(default_factory=dict)
    has_economics: bool = False  # valid or not
    has_line: bool = False


def parts_of(study: StudyTables) -> Parts:
    """The parts of a study whose tables are all valid."""
    tables: dict[str, Any] = {
        field.alias or key: getattr(study, key) for key, field in StudyTables.model_fields.items()
    }
    for name in _MANY.keys() - _BY_NAME:
        tables[name] = dict(enumerate(tables[name]))
    return Parts(
        **{name: tables[name] for name in (*_SINGLE, *_MANY)},
        train_names=tuple(study.train_tables),
        scenario_names=study.scenario_names,
        variant_names=study.variant_names,
        has_economics=study.economics is not None,
        has_line=study.line is not None,
    )


def valid_parts(data: Mapping[str, Any], faulty: set[tuple[Any, ...]]) -> Parts:
    """The tables of ``data`` that have no fault of their own (``faulty``: paths, two steps)."""
    valid: dict[str, Any] = {
        name: table.model_validate(data.get(name, {}))
        for name, table in _SINGLE.items()
        if not any(path[0] == name for path in faulty)
        and (data.get(name) is not None or name in _OPTIONAL)
    }
    entries = {name: _entries(data, name) for name in _MANY}
    for name, table in _MANY.items():
        valid[name] = {
            key: table.model_validate(entry)
            for key, entry in entries[name].items()
            if not {(name,), (name, key)} & faulty
        }
    valid["has_economics"] = data.get("economics") is not None
    valid["train_names"] = tuple(entries["trains"])
    for kind in ("scenario", "variant"):
        tables = [t for t in entries[f"{kind}s"].values() if isinstance(t, Mapping)]
        valid[f"{kind}_names"] = tuple(str(t.get("name", "")) for t in tables)
    return Parts(**valid)


def _entries(data: Mapping[str, Any], name: str) -> Mapping[Any, Any]:
    """Entries of a table or list of tables by key or index; empty where it is neither."""
    value = data.get(name)
    if name in _BY_NAME:
        return value if isinstance(value, Mapping) else {}
    return dict(enumerate(value)) if isinstance(value, tuple) else {}
