"""Trains of a study: vehicles by name or in full, cars all alike or a consist.

Vehicles are the study's own, the paper's two, and those shipped with the package
(``data/vehicles.toml``, each with its source).
"""

import tomllib
from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from importlib import resources
from typing import Any

from mcsettle.railway.traffic import Train
from mcsettle.railway.vehicle import VEHICLES, Suspension, Vehicle
from mcsettle.study.attributes import Paths, described, overridden
from mcsettle.study.faults import suggestion
from mcsettle.study.schema.traffic import ConsistTable, TrainTable, VehicleTable
from mcsettle.units import TONNE

VEHICLE_PATHS: Paths = {
    "model": ("model", 1.0),
    "axles_per_bogie": ("axles_per_bogie", 1),
    "bodies": ("bodies", 1),
    "car_length_m": ("length", 1.0),
    "bogie_spacing_m": ("bogie_spacing", 1.0),
    "axle_spacing_m": ("axle_spacing", 1.0),
    "axle_load_t": ("axle_load", TONNE),
    "body_mass_kg": ("body_mass", 1.0),
    "body_inertia_kg_m2": ("body_inertia", 1.0),
    "bogie_mass_kg": ("bogie_mass", 1.0),
    "bogie_inertia_kg_m2": ("bogie_inertia", 1.0),
    "wheelset_mass_kg": ("wheelset_mass", 1.0),
    "primary_stiffness_n_per_m": ("primary.stiffness", 1.0),
    "primary_damping_ns_per_m": ("primary.damping", 1.0),
    "secondary_stiffness_n_per_m": ("secondary.stiffness", 1.0),
    "secondary_damping_ns_per_m": ("secondary.damping", 1.0),
}


OPTIONAL = ("model", "axles_per_bogie", "bodies")
ONE_AXLE_LACKS = ("axle_spacing_m", "bogie_mass_kg", "bogie_inertia_kg_m2")
USUAL = {"axles_per_bogie": 2, "bodies": 1}


def build_train(
    name: str, table: TrainTable, vehicles: Mapping[str, VehicleTable] | None = None
) -> Train:
    """The train ``name``: cars all alike, or those of its consist, each with its overrides.

    ``vehicles`` are the study's own.

    Raises
    ------
    ValueError
        No such vehicle, or a suspension stage it does not have.
    """
    own = vehicles or {}
    if table.consist is None:
        if table.vehicle is None or table.cars is None:
            raise ValueError("needs vehicle and cars, or a consist")
        car = overridden(vehicle_named(table.vehicle, own), table, VEHICLE_PATHS)
        return Train(name, (car,) * table.cars)
    alone = {"vehicle", "cars", *VEHICLE_PATHS}
    if table.model_dump(exclude_none=True, include=alone):
        raise ValueError("has a consist: say vehicle, count and what differs in its entries")
    cars = [car for entry in table.consist for car in [_car(entry, own)] * entry.count]
    return Train(name, tuple(cars))


def vehicle_named(
    name: str, own: Mapping[str, VehicleTable], above: tuple[str, ...] = ()
) -> Vehicle:
    """The vehicle ``name``: the study's own, else the paper's, else a shipped one.

    Raises
    ------
    ValueError
        There is none, it is like itself, or it lacks something.
    """
    if name in above:
        raise ValueError(f"vehicle '{name}' is like itself ({' → '.join((*above, name))})")
    if name not in own and name in VEHICLES:
        return VEHICLES[name]
    table = own.get(name) or shipped_vehicles().get(name)
    if table is None:
        known = [*own, *VEHICLES, *shipped_vehicles()]
        raise ValueError(f"'{name}' is no vehicle; {suggestion(name, known)}")
    if table.like is None:
        return _in_full(name, table)
    base = vehicle_named(table.like, own, (*above, name))
    return replace(overridden(base, table, VEHICLE_PATHS), name=name)


def resolved_train(table: TrainTable, vehicles: Mapping[str, VehicleTable]) -> TrainTable:
    """``table`` with every value of its vehicles written out (its own values untouched)."""
    if table.consist is None:
        return TrainTable.model_validate(_written(table, vehicles))
    consist = tuple(_written(entry, vehicles) for entry in table.consist)
    return TrainTable.model_validate({"consist": consist})


@cache
def shipped_vehicles() -> Mapping[str, VehicleTable]:
    """Vehicles shipped with the package, by name."""
    tables = shipped_library()["vehicles"]
    return {name: VehicleTable.model_validate(table) for name, table in tables.items()}


@cache
def shipped_library() -> Mapping[str, Any]:
    """The shipped tables ``vehicles`` and ``trains``, as a TOML file gives them."""
    text = resources.files("mcsettle").joinpath("data/vehicles.toml").read_text(encoding="utf-8")
    return tomllib.loads(text)


def _car(entry: ConsistTable, own: Mapping[str, VehicleTable]) -> Vehicle:
    car = overridden(vehicle_named(entry.vehicle, own), entry, VEHICLE_PATHS)
    if entry.axle_loads_t is None:
        return car
    if entry.axle_load_t is not None:
        raise ValueError("a car takes axle_load_t or axle_loads_t, not both")
    loads = tuple(load * TONNE for load in entry.axle_loads_t)
    if len(loads) != car.n_axles:
        raise ValueError(
            f"axle_loads_t has {len(loads)} entries; '{entry.vehicle}' has {car.n_axles} axles"
        )
    return replace(car, axle_load=sum(loads) / len(loads), axle_loads=loads)


def _in_full(name: str, table: VehicleTable) -> Vehicle:
    """A vehicle that is like no other one; without a primary stage its wheelsets are rigid."""
    stages: dict[str, Suspension | None] = {}
    missing = []
    for stage in ("primary", "secondary"):
        keys = (f"{stage}_stiffness_n_per_m", f"{stage}_damping_ns_per_m")
        given = [key for key in keys if getattr(table, key) is not None]
        if len(given) == 1 or (stage == "secondary" and not given):
            missing += [key for key in keys if key not in given]
        stages[stage] = Suspension(*(getattr(table, k) for k in keys)) if len(given) == 2 else None
    values: dict[str, Any] = {}
    for key, (path, factor) in VEHICLE_PATHS.items():
        value = getattr(table, key)
        if "." in path or (key in OPTIONAL and value is None):
            continue
        if value is None and table.axles_per_bogie == 1 and key in ONE_AXLE_LACKS:
            values[path] = 0.0
        elif value is None:
            missing.append(key)
        else:
            values[path] = value if isinstance(value, str) else value * factor
    if missing:
        raise ValueError(f"vehicle '{name}' needs {', '.join(missing)}; or say what it is like")
    return Vehicle(name=name, **values, **stages)  # type: ignore[arg-type]


def _written(
    entry: TrainTable | ConsistTable, vehicles: Mapping[str, VehicleTable]
) -> dict[str, Any]:
    own = entry.model_dump(exclude_none=True)
    values = described(vehicle_named(str(entry.vehicle), vehicles), VEHICLE_PATHS)
    # What a vehicle does not have, and what most have, is not written out.
    values = {
        key: int(value) if key in USUAL else value
        for key, value in values.items()
        if USUAL.get(key) != value and not (key in ONE_AXLE_LACKS and value == 0.0)
    }
    if "axle_loads_t" in own:
        del values["axle_load_t"]
    return values | own
