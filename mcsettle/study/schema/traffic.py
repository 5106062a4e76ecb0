"""``[vehicles]``, ``[trains]`` and ``[[scenarios]]``."""

from typing import Annotated, Literal

from pydantic import Field

from mcsettle.study.schema.base import Name, Positive, Table, Text
from mcsettle.study.schema.quantities import (
    DashpotDamping,
    Inertia,
    Mass,
    Metres,
    Speed,
    SpringStiffness,
    Tonnes,
    in_plain,
)


class CarTable(Table):
    """What describes a car; keys left out follow the vehicle that is named."""

    model: Literal["complete", "bogies", "wheelsets"] | None = None
    axles_per_bogie: Annotated[int, Field(ge=1, le=4)] | None = None
    bodies: Annotated[int, Field(ge=1, le=20)] | None = None
    car_length_m: Metres | None = None
    bogie_spacing_m: Metres | None = None
    axle_spacing_m: Metres | None = None
    axle_load_t: Tonnes | None = None
    body_mass_kg: Mass | None = None
    body_inertia_kg_m2: Inertia | None = None
    bogie_mass_kg: Mass | None = None
    bogie_inertia_kg_m2: Inertia | None = None
    wheelset_mass_kg: Mass | None = None
    primary_stiffness_n_per_m: SpringStiffness | None = None
    primary_damping_ns_per_m: DashpotDamping | None = None
    secondary_stiffness_n_per_m: SpringStiffness | None = None
    secondary_damping_ns_per_m: DashpotDamping | None = None


class VehicleTable(CarTable):
    """``[vehicles.<name>]``: a vehicle of your own, like another one or in full."""

    like: Name | None = None
    source: Text = ""


class ConsistTable(CarTable):
    """One entry of a consist: cars in a row; ``axle_loads_t`` from the leading wheelset back."""

    vehicle: Name
    count: Annotated[int, Field(ge=1, le=200)] = 1
    axle_loads_t: Annotated[tuple[Tonnes, ...], Field(min_length=2, max_length=84)] | None = None


class TrainTable(CarTable):
    """``[trains.<name>]``: cars all alike (vehicle, cars), a consist, or a shipped train by name."""

    library: Name | None = None
    vehicle: Name | None = None
    cars: Annotated[int, Field(ge=1, le=200)] | None = None
    consist: Annotated[tuple[ConsistTable, ...], Field(min_length=1, max_length=200)] | None = None


class ServiceTable(Table):
    """One entry of a timetable: a train, its speed, and how often it runs in a row each day."""

    train: Name
    speed_kmh: Speed
    per_day: Annotated[int, in_plain("1/d"), Field(ge=1, le=10_000)]


class ScenarioTable(Table):
    """``[[scenarios]]``: one timetable; tonnages replace the sums over its trains (economics)."""

    name: Name
    title: Text = ""
    timetable: Annotated[tuple[ServiceTable, ...], Field(min_length=1, max_length=100)]
    mgt_per_day: Annotated[Positive, in_plain("MGT/d")] | None = None
    mgt_per_year: Annotated[Positive, in_plain("MGT/year")] | None = None
