"""Trains that can be built, and speeds below the wave speeds of the ground."""

from collections.abc import Iterator

from mcsettle.railway.track import BeamTrack, rayleigh_speed
from mcsettle.railway.vehicle import Vehicle
from mcsettle.railway.vehicle_remarks import vehicle_remarks
from mcsettle.study.build_trains import build_train, vehicle_named
from mcsettle.study.checks.parts import Parts
from mcsettle.study.checks.track import valid_track
from mcsettle.study.faults import Fault, dotted
from mcsettle.study.schema.traffic import ScenarioTable
from mcsettle.units import KMH, MGT, TONNE


def train_faults(parts: Parts) -> Iterator[Fault]:
    """Trains and vehicles that cannot be built."""
    for name, table in parts.trains.items():
        try:
            build_train(name, table, parts.vehicles)
        except ValueError as error:
            yield Fault(f"trains.{name}", str(error))
    for name in parts.vehicles:
        try:
            vehicle_named(name, parts.vehicles)
        except ValueError as error:
            yield Fault(f"vehicles.{name}", str(error))


def vehicle_remarks_of(parts: Parts) -> Iterator[str]:
    """What of the vehicles that run does not agree with itself, each vehicle once."""
    cars: dict[Vehicle, str] = {}
    for name, table in parts.trains.items():
        for car in build_train(name, table, parts.vehicles).cars:
            cars.setdefault(car, name)
    for car, train in cars.items():
        for remark in vehicle_remarks(car):
            yield f"trains.{train}: vehicle '{car.name}': {remark}"


def speed_faults(parts: Parts) -> Iterator[Fault]:
    """Speeds above the Rayleigh speed of the lowest layer, unless the study allows them."""
    if parts.track is not None and parts.track.allow_supercritical:
        return
    for path, speed, name, limit, lowest in speed_limits(parts):
        if lowest and speed > limit:
            yield Fault(
                path,
                f"received {speed / KMH:g}; '{name}' has Rayleigh speed {limit / KMH:.0f} km/h: "
                "stay below, or set track.allow_supercritical = true",
            )


def speed_limits(parts: Parts) -> Iterator[tuple[str, float, str, float, bool]]:
    """(path, speed, layer, its Rayleigh speed, whether lowest) for every service, SI."""
    track = valid_track(parts)
    if track is None or isinstance(track, BeamTrack):
        return
    limits = [(layer.name, rayleigh_speed(layer.material)) for layer in track.layers]
    for index, scenario in parts.scenarios.items():
        for entry, service in enumerate(scenario.timetable):
            path = dotted(("scenarios", index, "timetable", entry, "speed_kmh"))
            for depth, (name, limit) in enumerate(limits):
                yield path, service.speed_kmh * KMH, name, limit, depth == len(limits) - 1


def is_buildable(train: str, parts: Parts) -> bool:
    """Whether ``train`` has a valid table."""
    try:
        build_train(train, parts.trains[train], parts.vehicles)
    except (KeyError, ValueError):
        return False
    return True


def tonnage(scenario: ScenarioTable, parts: Parts) -> float:
    """Gross tonnes a day of ``scenario``; its trains are sound tables."""
    if scenario.mgt_per_day is not None:
        return scenario.mgt_per_day * MGT / TONNE
    total = 0.0
    for service in scenario.timetable:
        train = build_train(service.train, parts.trains[service.train], parts.vehicles)
        total += train.mass / TONNE * service.per_day
    return total
