"""What the tables of a study must satisfy together: names that meet, geometry, physics.

Each check looks only at tables that are themselves sound (the others are None or left out), so that
one reading of a study reports all of its faults. Warnings are remarks on a study that will run.
"""

from collections import Counter
from collections.abc import Iterator, Mapping

from mcsettle.railway.filters import D1
from mcsettle.railway.track import BeamTrack, rayleigh_speed
from mcsettle.step_a.critical_speed import NEAR_CRITICAL
from mcsettle.study.build_trains import build_train, vehicle_named
from mcsettle.study.checks_track import _geometry, _model_forms, _sound_track
from mcsettle.study.faults import Fault, dotted, shown, suggestion
from mcsettle.study.parts import Parts
from mcsettle.study.schema import (
    ProfileTable,
    ScenarioTable,
    VariantTable,
)
from mcsettle.units import KMH, MGT, TONNE

LONG_WINDOW = 400.0  # m, from which the SD is that of a section of the window


def faults_between(parts: Parts) -> list[Fault]:
    """Every fault that shows only when tables are read together."""
    checks = (
        _names,
        _geometry,
        _model_forms,
        _trains,
        _profile,
        _economics,
        _maintenance,
        _speeds,
        _stepping,
    )
    return [fault for check in checks for fault in check(parts)]


def warnings_of(parts: Parts) -> list[str]:
    """Remarks on a study that will run: speeds near or above a wave speed."""
    remarks = []
    for path, speed, name, limit, _ in _speed_limits(parts):
        if speed > NEAR_CRITICAL * limit:
            relation = "above" if speed > limit else f"above {NEAR_CRITICAL:.0%} of"
            remarks.append(
                f"{path}: {speed / KMH:g} km/h is {relation} the Rayleigh speed of '{name}' "
                f"({limit / KMH:.0f} km/h)"
            )
    return remarks


def _names(parts: Parts) -> Iterator[Fault]:
    yield from _duplicates("scenarios", parts.scenarios)
    yield from _duplicates("variants", parts.variants)
    for index, scenario in parts.scenarios.items():
        for entry, service in enumerate(scenario.timetable):
            path = dotted(("scenarios", index, "timetable", entry, "train"))
            yield from _unknown(path, "train", service.train, parts.train_names)
    for index, row in parts.reference.items():
        path = dotted(("reference", index, "scenario"))
        yield from _unknown(path, "scenario", row.scenario, parts.scenario_names)
    if parts.economics is not None:
        name = parts.economics.baseline
        yield from _unknown("economics.baseline", "scenario", name, parts.scenario_names)
    if parts.calibration is not None and not parts.calibration.study:
        name = parts.calibration.scenario
        yield from _unknown("calibration.scenario", "scenario", name, parts.scenario_names)
        if parts.calibration.variant is not None:
            name = parts.calibration.variant
            yield from _unknown("calibration.variant", "variant", name, parts.variant_names)


def _duplicates(
    key: str, entries: Mapping[int, ScenarioTable] | Mapping[int, VariantTable]
) -> Iterator[Fault]:
    counts = Counter(entry.name for entry in entries.values())
    for index, entry in entries.items():
        if counts[entry.name] > 1:
            path = dotted((key, index, "name"))
            yield Fault(path, f"received {shown(entry.name)} more than once; names must differ")


def _unknown(
    path: str, kind: str, name: str, known: list[str] | tuple[str, ...]
) -> Iterator[Fault]:
    if name not in known:
        yield Fault(
            path, f"received {shown(name)}, which is no {kind} here; {suggestion(name, known)}"
        )


def _trains(parts: Parts) -> Iterator[Fault]:
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


def _profile(parts: Parts) -> Iterator[Fault]:
    profile, limit = parts.profile, parts.limit
    if profile is None:
        return
    yield from _record(profile)
    if profile.longest_m <= profile.shortest_m:
        message = (
            f"received {profile.longest_m:g}; it must exceed shortest_m = {profile.shortest_m:g}"
        )
        yield Fault("profile.longest_m", message)
    if profile.window_m < 2.0 * profile.longest_m:
        message = (
            f"received {profile.window_m:g}; it must hold longest_m = {profile.longest_m:g} twice"
        )
        yield Fault("profile.window_m", message)
    if limit is not None and profile.sd_mm is not None and limit.sd_limit_mm <= profile.sd_mm:
        message = (
            f"received {limit.sd_limit_mm:g}; it must exceed profile.sd_mm = {profile.sd_mm:g}"
        )
        yield Fault("limit.sd_limit_mm", message)


def _record(profile: ProfileTable) -> Iterator[Fault]:
    """A record's keys need a record; D1 fixes the band; the spectrum's keys need a spectrum."""
    record = profile.record
    if profile.file is None:
        if record is not None:
            yield Fault("profile.record", "has no meaning without profile.file; leave it out")
        return
    for key in ("spectrum", "fra_class"):
        if key in profile.model_fields_set and getattr(profile, key) != (
            ProfileTable.model_fields[key].default
        ):
            yield Fault(f"profile.{key}", "has no meaning with profile.file; leave it out")
    if record is None:
        return
    if record.filter == "en13848_d1" and (profile.shortest_m, profile.longest_m) != D1:
        yield Fault(
            "profile.record.filter",
            f"received 'en13848_d1' with the band {profile.shortest_m:g} to {profile.longest_m:g} m; "
            f"D1 is shortest_m = {D1[0]:g}, longest_m = {D1[1]:g}",
        )
    if record.run is not None and record.run_column is None:
        yield Fault("profile.record.run", "names a run; say which column does: run_column")


def _economics(parts: Parts) -> Iterator[Fault]:
    """The effect needs one speed a scenario, and a change against the baseline."""
    economics = parts.economics
    if economics is None:
        return
    changes = {}
    for index, scenario in parts.scenarios.items():
        path = dotted(("scenarios", index, "timetable"))
        speeds = sorted({service.speed_kmh for service in scenario.timetable})
        if economics.effect == "speed" and len(speeds) > 1:
            message = (
                f"received the speeds {speeds}; with economics.effect = 'speed' it must be one"
            )
            yield Fault(path, message)
        elif economics.effect == "speed":
            changes[scenario.name] = (path, speeds[0])
        elif all(_is_sound(service.train, parts) for service in scenario.timetable):
            changes[scenario.name] = (path, _tonnage(scenario, parts))
    base = changes.get(economics.baseline)
    for name, (path, value) in changes.items():
        if base is not None and name != economics.baseline and value == base[1]:
            message = f"has the same {economics.effect} as the baseline '{economics.baseline}': "
            yield Fault(path, message + f"there is no effect of {economics.effect} to price")


def _maintenance(parts: Parts) -> Iterator[Fault]:
    """What a recovery says together with the limit, and that it is followed by cycle jumps."""
    table, limit = parts.maintenance, parts.limit
    if table is None:
        return
    numbers = {"intercept_mm": table.intercept_mm, "slope": table.slope}
    for key, value in numbers.items():
        if (value is None) == (table.recovery == "linear"):
            said = "is missing" if value is None else "has no meaning"
            yield Fault(f"maintenance.{key}", f"{said} with recovery = '{table.recovery}'")
    if table.recovery == "linear" and limit is not None and None not in numbers.values():
        after = (table.intercept_mm or 0.0) + (table.slope or 0.0) * limit.sd_limit_mm
        if after >= limit.sd_limit_mm:
            yield Fault(
                "maintenance.intercept_mm",
                f"with slope {table.slope:g} a tamping at {limit.sd_limit_mm:g} mm leaves {after:g} mm; "
                "it must leave less than the limit",
            )
    if parts.run is not None and parts.run.stepping != "cycle_jump":
        yield Fault("maintenance", "takes [run] stepping = 'cycle_jump'")


def _is_sound(train: str, parts: Parts) -> bool:
    try:
        build_train(train, parts.trains[train], parts.vehicles)
    except (KeyError, ValueError):
        return False
    return True


def _tonnage(scenario: ScenarioTable, parts: Parts) -> float:
    """Gross tonnes a day of ``scenario``; its trains are sound tables."""
    if scenario.mgt_per_day is not None:
        return scenario.mgt_per_day * MGT / TONNE
    total = 0.0
    for service in scenario.timetable:
        train = build_train(service.train, parts.trains[service.train], parts.vehicles)
        total += train.mass / TONNE * service.per_day
    return total


def _speeds(parts: Parts) -> Iterator[Fault]:
    if _allowed(parts):
        return
    for path, speed, name, limit, lowest in _speed_limits(parts):
        if lowest and speed > limit:
            yield Fault(
                path,
                f"received {speed / KMH:g}; '{name}' has Rayleigh speed {limit / KMH:.0f} km/h: "
                "stay below, or set track.allow_supercritical = true",
            )


def _stepping(parts: Parts) -> Iterator[Fault]:
    """What single precision, and updating passage by passage, do not do."""
    if parts.run is None:
        return
    run = parts.run
    if run.precision != "f64" and run.stepping == "cycle_jump":
        yield Fault(
            "run.precision",
            f"received '{run.precision}'; takes stepping 'every_axle' or 'every_train'",
        )
    if run.stepping == "cycle_jump":
        return
    given = f"received '{parts.run.stepping}'"
    if parts.profile is not None and parts.profile.window_m >= LONG_WINDOW:
        yield Fault(
            "run.stepping",
            f"{given}; windows of {LONG_WINDOW:g} m and more (profile.window_m = "
            f"{parts.profile.window_m:g}) take 'cycle_jump'",
        )
    if parts.run.right_hand_side == "pointwise" and parts.run.stepping == "every_train":
        yield Fault(
            "run.stepping",
            f"{given}; right_hand_side = 'pointwise' takes 'every_axle' or 'cycle_jump'",
        )


def _allowed(parts: Parts) -> bool:
    return parts.track is not None and parts.track.allow_supercritical


def _speed_limits(parts: Parts) -> Iterator[tuple[str, float, str, float, bool]]:
    """(path, speed, layer, its Rayleigh speed, whether lowest) for every service, SI."""
    track = _sound_track(parts)
    if track is None or isinstance(track, BeamTrack):
        return
    limits = [(layer.name, rayleigh_speed(layer.material)) for layer in track.layers]
    for index, scenario in parts.scenarios.items():
        for entry, service in enumerate(scenario.timetable):
            path = dotted(("scenarios", index, "timetable", entry, "speed_kmh"))
            for depth, (name, limit) in enumerate(limits):
                yield path, service.speed_kmh * KMH, name, limit, depth == len(limits) - 1
