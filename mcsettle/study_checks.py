"""What the tables of a study must satisfy together: names that meet, geometry, physics.

Each check looks only at tables that are themselves sound (the others are None or left out), so that
one reading of a study reports all of its faults. Warnings are remarks on a study that will run.

Depends on: filters, study_build, study_faults, study_paths, study_schema, study_trains, track, traffic,
units, waves.
"""

from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

from mcsettle.filters import D1
from mcsettle.study_build import CURVE_PATHS, LAYER_PATHS, build_track, layer_names
from mcsettle.study_faults import Fault, dotted, shown, suggestion
from mcsettle.study_paths import described
from mcsettle.study_schema import (
    CalibrationTable,
    EconomicsTable,
    LayerTable,
    LimitTable,
    MaintenanceTable,
    ProfileTable,
    ReferenceTable,
    RunTable,
    ScenarioTable,
    TrackTable,
    TrainTable,
    VariantTable,
    VehicleTable,
)
from mcsettle.study_trains import build_train, vehicle_named
from mcsettle.track import TRACKS, BeamTrack, Track
from mcsettle.units import KMH, MGT, TONNE
from mcsettle.waves import rayleigh_speed

NEAR_CRITICAL = 0.8
LONG_WINDOW = 400.0  # m, from which the SD is that of a section of the window


@dataclass(frozen=True)
class Parts:
    """The sound tables of a study; entries of lists keep their place in the file."""

    track: TrackTable | None = None
    profile: ProfileTable | None = None
    limit: LimitTable | None = None
    economics: EconomicsTable | None = None
    calibration: CalibrationTable | None = None
    run: RunTable | None = None
    maintenance: MaintenanceTable | None = None
    trains: Mapping[str, TrainTable] = field(default_factory=dict)
    vehicles: Mapping[str, VehicleTable] = field(default_factory=dict)
    train_names: tuple[str, ...] = ()
    scenario_names: tuple[str, ...] = ()
    variant_names: tuple[str, ...] = ()
    scenarios: Mapping[int, ScenarioTable] = field(default_factory=dict)
    variants: Mapping[int, VariantTable] = field(default_factory=dict)
    reference: Mapping[int, ReferenceTable] = field(default_factory=dict)


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


def _geometry(parts: Parts) -> Iterator[Fault]:
    if parts.track is None:
        return
    table = parts.track
    if table.preset is not None and (table.preset == "beam") != (table.model == "beam"):
        accepted = "'beam'" if table.model == "beam" else "'case_study' or 'validation'"
        message = (
            f"received {shown(table.preset)}; with model = {shown(table.model)} it is {accepted}"
        )
        yield Fault("track.preset", message)
        return
    unused: tuple[str, ...] = ("support",)
    if table.model == "beam":
        unused = ("pad", "sleeper", "under_sleeper_pad")
    for key in unused:
        part = getattr(table, key)
        if part is not None and part.model_dump(exclude_none=True):
            yield Fault(
                f"track.{key}", f"has no meaning with model = {shown(table.model)}; leave it out"
            )
    yield from _soil(table, parts)
    yield from _without_effect(table, parts)
    known = layer_names(table)
    yield from _unknown_layers("track.layers", table.layers, known)
    yield from _buildable("track", table, None)
    for index, variant in parts.variants.items():
        path = dotted(("variants", index))
        yield from _unknown_layers(f"{path}.layers", variant.layers, known)
        if variant.layers:
            yield from _buildable(path, table, variant)


def _model_forms(parts: Parts) -> Iterator[Fault]:
    """What a variant may vary of the profile and the damping, and where that has no meaning."""
    for index, variant in parts.variants.items():
        path = dotted(("variants", index))
        for key in ("spectrum", "fra_class"):
            if getattr(variant, key) is None:
                continue
            if parts.profile is not None and parts.profile.file is not None:
                yield Fault(f"{path}.{key}", "has no meaning with profile.file; leave it out")
            elif parts.maintenance is not None:
                said = (
                    "the tampings of [maintenance] have the study's spectrum; leave one of them out"
                )
                yield Fault(f"{path}.{key}", said)
        beam = parts.track is not None and parts.track.model == "beam"
        if beam and variant.damping_convention is not None:
            yield Fault(f"{path}.damping_convention", "has no meaning with model = 'beam'")


def _soil(table: TrackTable, parts: Parts) -> Iterator[Fault]:
    """Softening needs the section model; its keys need a soil that softens."""
    groups: list[tuple[str, str | None, str, Mapping[str, LayerTable]]]
    groups = [("track", table.soil, table.soil, table.layers)]
    for index, variant in parts.variants.items():
        path = dotted(("variants", index))
        groups.append((path, variant.soil, variant.soil or table.soil, variant.layers))
    softens = any(soil != "linear" for _, _, soil, _ in groups)
    unused = "has no meaning with soil = 'linear'; leave it out"
    if table.softening is not None and not softens:
        yield Fault("track.softening", unused)
    for path, given, soil, layers in groups:
        if given == "equivalent_linear" and table.model == "beam":
            message = f"received {shown(given)}; with model = 'beam' it is 'linear'"
            yield Fault(f"{path}.soil", message)
        if soil != "linear" or (path == "track" and softens):
            continue  # curves of the track are those of a variant that softens
        for name, layer in layers.items():
            for key in CURVE_PATHS:
                if getattr(layer, key) is not None:
                    yield Fault(f"{path}.layers.{name}.{key}", unused)


def _without_effect(table: TrackTable, parts: Parts) -> Iterator[Fault]:
    """What the beam model does not know, where it differs from the preset's."""
    if table.model != "beam":
        return
    preset = TRACKS[table.preset_name]
    unused = "has no effect with model = 'beam', whose stiffness is track.support; leave it out"
    if table.damping_convention != "damping_ratio":
        yield Fault("track.damping_convention", unused)
    if table.rail.offset_m not in (None, preset.rail.offset):
        yield Fault("track.rail.offset_m", unused)
    own = {layer.name: described(layer, LAYER_PATHS) for layer in preset.layers}
    groups = [("track", table.layers)]
    groups += [(dotted(("variants", i)), v.layers) for i, v in parts.variants.items()]
    for path, layers in groups:
        for name, layer in layers.items():
            for key in ("youngs_modulus_pa", "poisson", "damping"):
                value = getattr(layer, key)
                if name in own and value is not None and value != own[name].get(key):
                    yield Fault(f"{path}.layers.{name}.{key}", unused)


def _unknown_layers(
    path: str, tables: Mapping[str, LayerTable], known: list[str]
) -> Iterator[Fault]:
    for name in tables:
        if name not in known:
            yield Fault(f"{path}.{name}", f"is no layer of this track; {suggestion(name, known)}")


def _buildable(path: str, table: TrackTable, variant: VariantTable | None) -> Iterator[Fault]:
    try:
        build_track(table, variant)
    except ValueError as error:
        yield Fault(path, str(error))


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


def _sound_track(parts: Parts) -> Track | None:
    if parts.track is None:
        return None
    try:
        return build_track(parts.track)
    except ValueError:
        return None
