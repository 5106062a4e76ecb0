"""From the tables of a study to the objects of the model, and back to fully written-out tables.

A table overrides a named preset key by key. Each map below says which attribute of a domain object
a key stands for (a dotted path) and the factor that takes it into SI; read forwards it builds the
object, read backwards it writes every value of the preset into the table.
"""

import math
from collections.abc import Collection, Mapping
from dataclasses import fields, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

from mcsettle.railway.filters import Band
from mcsettle.railway.ground_profiles import Columns, Ground, read_grounds
from mcsettle.railway.measured_profiles import RecordChoice
from mcsettle.railway.read_record import RecordFormat
from mcsettle.railway.settlement_model import SettlementModel
from mcsettle.railway.softening_choices import SofteningSettings
from mcsettle.railway.text_files import SEPARATORS
from mcsettle.railway.track import TRACKS, BeamTrack, Layer, SectionTrack, Track
from mcsettle.railway.traffic import Service, Timetable, Train
from mcsettle.study.attributes import Paths, described, overridden
from mcsettle.study.build_ground import under_sleeper_pad, with_ground
from mcsettle.study.schema.grounds import GroundsTable
from mcsettle.study.schema.profile import ProfileTable, RecordTable
from mcsettle.study.schema.run import SettlementTable
from mcsettle.study.schema.track import LayerTable, SofteningTable, TrackTable
from mcsettle.study.schema.traffic import ScenarioTable
from mcsettle.study.schema.variants import VariantTable
from mcsettle.units import KMH, MM

LAYER_PATHS: Paths = {
    "height_m": ("height", 1.0),
    "width_m": ("width", 1.0),
    "youngs_modulus_pa": ("material.youngs_modulus", 1.0),
    "poisson": ("material.poisson", 1.0),
    "density_kg_per_m3": ("material.density", 1.0),
    "damping": ("material.damping", 1.0),
    "k0": ("k0", 1.0),
    "ballast_coefficient_per_mpa2": ("law.coefficient", 1.0),
    "ballast_log_slope": ("law.log_slope", 1.0),
    "settlement_a": ("law.a", 1.0),
    "settlement_b": ("law.b", 1.0),
    "settlement_m": ("law.m", 1.0),
    "strength_pa": ("law.strength", 1.0),
}
CURVE_PATHS: Paths = {
    "curve": ("kind", 1.0),
    "plasticity_index": ("plasticity_index", 1.0),
    "ocr": ("ocr", 1.0),
    "uniformity_coefficient": ("uniformity_coefficient", 1.0),
    "d50_mm": ("d50", MM),
}
RAIL_PATHS: Paths = {
    "youngs_modulus_pa": ("youngs_modulus", 1.0),
    "second_moment_m4": ("second_moment", 1.0),
    "area_m2": ("area", 1.0),
    "density_kg_per_m3": ("density", 1.0),
    "damping": ("damping", 1.0),
    "offset_m": ("offset", 1.0),
}
PAD_PATHS: Paths = {"stiffness_n_per_m2": ("stiffness", 1.0), "damping_ns_per_m2": ("damping", 1.0)}
SLEEPER_PATHS: Paths = {
    "length_m": ("length", 1.0),
    "height_m": ("height", 1.0),
    "width_m": ("width", 1.0),
    "spacing_m": ("spacing", 1.0),
    "youngs_modulus_pa": ("material.youngs_modulus", 1.0),
    "density_kg_per_m3": ("material.density", 1.0),
}
SUPPORT_PATHS: Paths = {
    "stiffness_n_per_m2": ("support_stiffness", 1.0),
    "loss_factor": ("support_damping", 1.0),
    "sleeper_length_m": ("sleeper_length", 1.0),
    "poisson": ("poisson", 1.0),
}
CURVE_PARAMETERS: Mapping[str, tuple[str, ...]] = {
    "constant": (),
    "ishibashi_zhang": ("plasticity_index",),
    "vucetic_dobry": ("plasticity_index",),
    "darendeli": ("plasticity_index", "ocr"),
    "menq": ("uniformity_coefficient", "d50_mm"),
    "seed_idriss_mean": (),
    "seed_idriss_upper": (),
}
SETTLEMENT_KEYS = tuple(key for key in SettlementTable.model_fields if key != "factor_digest")


def build_settlement(settings: SettlementTable, track: Track) -> SettlementModel:
    """The settlement model of ``track`` under the ``settings`` of its variant."""
    values = settings.model_dump(exclude={"integration_depth_m", "section_log_sd", "factor_digest"})
    if settings.long_run_strength is None:
        del values["long_run_strength"]
    return SettlementModel(tuple(layer.law for layer in track.layers), **values)


def build_track(table: TrackTable, variant: VariantTable | None = None) -> Track:
    """The track of a study, with the layers of ``variant`` laid over its own.

    Raises
    ------
    ValueError
        A key that the preset has no place for, or a geometry the track refuses.
    """
    preset = TRACKS[table.preset_name]
    layers = _layers(with_ground(preset.layers, table.ground), table.layers)
    if variant is not None:
        layers = _layers(layers, variant.layers)
    rail = overridden(preset.rail, table.rail, RAIL_PATHS)
    if isinstance(preset, BeamTrack):
        beam = overridden(preset, table.support, SUPPORT_PATHS)
        return replace(beam, layers=layers, rail=rail)
    sleeper = overridden(preset.sleeper, table.sleeper, SLEEPER_PATHS)
    if table.under_sleeper_pad is not None:
        layers = (under_sleeper_pad(table.under_sleeper_pad, sleeper), *layers)
    return replace(
        preset,
        layers=layers,
        rail=rail,
        pad=overridden(preset.pad, table.pad, PAD_PATHS),
        sleeper=sleeper,
        damping_convention=(variant and variant.damping_convention) or table.damping_convention,
    )


def layer_names(table: TrackTable) -> list[str]:
    """Layers that ``track.layers`` and variants may override: not those given in full."""
    kept = TRACKS[table.preset_name].layers
    return [layer.name for layer in kept if not (table.ground and layer.width is None)]


def build_softening(
    table: TrackTable, variant: VariantTable | None = None
) -> SofteningSettings | None:
    """How the layers of a study's track soften, those of ``variant`` over its own; None: linear."""
    soil = None if variant is None else variant.soil
    if (soil or table.soil) == "linear":
        return None
    track = build_track(table, variant)
    if not isinstance(track, SectionTrack):
        return None
    curves = []
    for layer, curve in zip(track.layers, SofteningSettings().layer_curves(track), strict=True):
        full: dict[str, LayerTable] = {layer.name: layer for layer in table.ground}
        for tables in (full, table.layers, {} if variant is None else variant.layers):
            if layer.name in tables:
                curve = overridden(curve, tables[layer.name], CURVE_PATHS)
        curves.append((layer.name, curve))
    settings = table.softening or SofteningTable()
    return SofteningSettings(**settings.model_dump(), curves=tuple(curves))


def build_record(table: ProfileTable, path: Path, digest: str) -> RecordChoice:
    """The record of a study's profile, its file being ``path``.

    Raises
    ------
    InputError
        A band or a filter that cannot be.
    """
    record = table.record or RecordTable()
    layout = RecordFormat(
        **{field.name: getattr(record, field.name) for field in fields(RecordFormat)}
    )
    passed = record.already_filtered is not None
    kind = "ideal" if record.filter == "ideal" and not passed else "butterworth"
    band = Band(table.shortest_m, table.longest_m, kind, record.filter_order, passed)
    return RecordChoice(path, digest, layout, record.run, record.repair, record.longest_gap_m, band)


@lru_cache(maxsize=4)
def _grounds(
    layers: Path, weights: Path, columns: Columns, leave_out: tuple[str, ...], changed: float
) -> tuple[Ground, ...]:
    del changed  # it tells a file that was written anew from the one that is known
    return read_grounds(layers, weights, columns, leave_out)


def build_grounds(table: GroundsTable, layers: Path, weights: Path) -> tuple[Ground, ...]:
    """The grounds of a study from its two files.

    Raises
    ------
    InputError
        A file that cannot be read or used.
    """
    columns = Columns(
        SEPARATORS[table.separator],
        table.ground_column,
        table.top_column,
        table.material_column,
        table.segment_column,
        table.probability_column,
        table.encoding,
        table.decimal or ".",
        table.level_unit or "m",
    )
    changed = layers.stat().st_mtime + weights.stat().st_mtime
    return _grounds(layers, weights, columns, table.leave_out, changed)


def build_timetable(scenario: ScenarioTable, trains: Mapping[str, Train]) -> Timetable:
    """The ordered day of ``scenario``; speeds become m/s."""
    services = tuple(
        Service(trains[entry.train], entry.speed_kmh * KMH, entry.per_day)
        for entry in scenario.timetable
    )
    return Timetable(services)


def settlement_settings(table: SettlementTable, variant: VariantTable) -> SettlementTable:
    """The settlement settings of ``variant``: its own keys, else the study's."""
    overrides = {
        key: value for key in SETTLEMENT_KEYS if (value := getattr(variant, key)) is not None
    }
    return table.model_copy(update=overrides | {"factor_digest": None})


def resolved_track(table: TrackTable, softens: bool) -> TrackTable:
    """``table`` with every value of its preset written out, and of the curves if a soil ``softens``."""
    track = build_track(table)
    tables: dict[str, Any] = {
        "preset": table.preset_name,
        "rail": described(track.rail, RAIL_PATHS),
        "layers": {
            layer.name: described(layer, LAYER_PATHS)
            for layer in track.layers
            if layer.name in layer_names(table)
        },
    }
    softening = build_softening(table.model_copy(update={"soil": "equivalent_linear"}))
    if softens and softening is not None:
        tables["softening"] = (table.softening or SofteningTable()).model_dump()
        for name, curve in softening.curves:
            if name not in tables["layers"]:
                continue
            kept = {"curve", *CURVE_PARAMETERS[curve.kind]}
            described_curve = described(curve, CURVE_PATHS)
            tables["layers"][name] |= {k: v for k, v in described_curve.items() if k in kept}
    if isinstance(track, SectionTrack):
        tables["pad"] = described(track.pad, PAD_PATHS)
        tables["sleeper"] = described(track.sleeper, SLEEPER_PATHS)
    else:
        tables["support"] = described(track, SUPPORT_PATHS)
    return TrackTable.model_validate(table.model_dump() | tables)


def resolved_variant(
    table: VariantTable, settlement: SettlementTable, uncertain: Collection[str] = ()
) -> VariantTable:
    """``table`` with the settlement keys it inherits written out, but for those ``uncertain``."""
    settings = settlement_settings(settlement, table).model_dump(exclude={"factor_digest"})
    stated = table.model_dump(exclude_none=True)
    inherited = {key: value for key, value in settings.items() if key not in uncertain}
    if table.settlement_factor is None and settlement.factor_digest is not None:
        inherited["factor_digest"] = settlement.factor_digest
    return VariantTable.model_validate(inherited | stated)


def _layers(layers: tuple[Layer, ...], tables: Mapping[str, LayerTable]) -> tuple[Layer, ...]:
    """Layers with the overrides of ``tables``, by name; a layer keeps its kind and its law."""
    return tuple(
        _layer(layer, tables[layer.name]) if layer.name in tables else layer for layer in layers
    )


def _layer(layer: Layer, table: LayerTable) -> Layer:
    if table.height_m is not None and math.isinf(layer.height):
        raise ValueError(f"layer '{layer.name}' is the half-space: leave out height_m")
    if table.width_m is not None and layer.width is None:
        raise ValueError(f"layer '{layer.name}' is unbounded ground: leave out width_m")
    return overridden(layer, table, LAYER_PATHS)
