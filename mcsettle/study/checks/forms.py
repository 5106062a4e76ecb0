"""Faults of the model forms: support that varies, cycles that count by load, loads on the rails."""

from collections.abc import Iterator

import numpy as np

from mcsettle.errors import InputError
from mcsettle.railway.irregularity import profile_modes
from mcsettle.railway.spatial_variability import (
    LARGEST_GAUSSIAN,
    FieldWaves,
    SpatialVariability,
    field_waves,
    negative_share,
    refuse_unreachable,
)
from mcsettle.railway.spectra import spectrum
from mcsettle.railway.track import BallastLaw, Track
from mcsettle.study.build import SETTLEMENT_KEYS, layer_names
from mcsettle.study.build_forms import build_variability
from mcsettle.study.build_trains import build_train
from mcsettle.study.checks.parts import Parts
from mcsettle.study.checks.track import valid_track
from mcsettle.study.faults import Fault, dotted, suggestion
from mcsettle.study.schema.profile import ProfileTable
from mcsettle.study.schema.spatial_variability import SpatialVariabilityTable
from mcsettle.study.schema.variants import VariantTable

EQUIVALENCE = ("equivalence_exponent", "ballast_equivalence_exponent", "equivalence_history")


def variability_faults(parts: Parts) -> Iterator[Fault]:
    """Fields of susceptibility that cannot be, of the study and of each variant with keys of its own."""
    table = parts.spatial_variability
    if table is not None and not any(v.spatial_variability for v in parts.variants.values()):
        yield from _variability("spatial_variability", table, parts, None)
    for index, variant in parts.variants.items():
        keys = variant.spatial_variability
        if keys is not None:
            path = dotted(("variants", index, "spatial_variability"))
            yield from _variability(path, keys.over(table), parts, variant)
        elif table is not None and any(v.spatial_variability for v in parts.variants.values()):
            yield from _variability("spatial_variability", table, parts, variant)


def counting_faults(parts: Parts) -> Iterator[Fault]:
    """Keys of equivalent cycles and of the long-run term that are missing or do not go together."""
    if parts.settlement is None:
        return
    for path, values, track in _settlements(parts):
        counting = values["cycles"]
        if counting == "equivalent":
            for key in ("equivalence_exponent", "equivalence_history"):
                if values[key] is None:
                    yield Fault(
                        f"{path}.{key}", f"is missing with cycles = 'equivalent'; {_WANTS[key]}"
                    )
            by_law = values["equivalence_exponent"] == "law"
            logarithmic = track is None or any(
                isinstance(layer.law, BallastLaw) for layer in track.layers
            )
            if by_law and logarithmic and values["ballast_equivalence_exponent"] is None:
                yield Fault(
                    f"{path}.ballast_equivalence_exponent",
                    "is missing: the logarithmic law of the ballast has no exponent of its own; give a "
                    "number, such as 5",
                )
        else:
            for key in EQUIVALENCE:
                if values[key] is not None:
                    yield Fault(
                        f"{path}.{key}",
                        "has no meaning without cycles = 'equivalent'; leave it out",
                    )
        if values["long_run_strength"] is not None and values["long_run_cycles"] is None:
            yield Fault(
                f"{path}.long_run_strength", "has no meaning without long_run_cycles; leave it out"
            )
        if values["long_run_cycles"] is not None and counting == "per_vehicle":
            yield Fault(
                f"{path}.long_run_cycles",
                "the long run is one of all cycles together; received with cycles = 'per_vehicle', takes "
                "'shared' or 'equivalent'",
            )


_WANTS = {
    "equivalence_exponent": "give a number (charges use 1.5 to 3), or 'law' for m/b of each layer's law",
    "equivalence_history": "say what N before counts: 'reference' (axles of the first service of the "
    "baseline, or of the first scenario) or 'mix' (axles of the scenario's own day)",
}


def load_faults(parts: Parts) -> Iterator[Fault]:
    """The whole load on each rail needs linear soil; a variant's trains are trains of the study."""
    table = parts.track
    for index, variant in parts.variants.items():
        path = dotted(("variants", index))
        for name, changes in variant.trains.items():
            if name not in parts.train_names:
                said = f"is no train of this study; {suggestion(name, parts.train_names)}"
                yield Fault(f"{path}.trains.{name}", said)
            elif name in parts.trains:
                changed = parts.trains[name].model_copy(update=changes.model_dump())
                try:
                    build_train(name, changed, parts.vehicles)
                except ValueError as error:
                    yield Fault(f"{path}.trains.{name}", str(error))
        if table is None:
            continue
        whole = (variant.load_per_rail or table.load_per_rail) == "whole"
        if whole and (variant.soil or table.soil) != "linear":
            where = f"{path}.load_per_rail" if variant.load_per_rail else "track.load_per_rail"
            yield Fault(where, "received 'whole' on soil that softens; takes soil = 'linear'")


def _settlements(parts: Parts) -> Iterator[tuple[str, dict[str, object], Track | None]]:
    """Path, values and track of the settlement keys of the study and of every variant with its own."""
    assert parts.settlement is not None
    common = {key: getattr(parts.settlement, key) for key in SETTLEMENT_KEYS}
    if not parts.variants:
        yield "settlement", common, valid_track(parts, None)
    said = False
    for index, variant in parts.variants.items():
        stated = {key: getattr(variant, key) for key in SETTLEMENT_KEYS}
        stated = {key: value for key, value in stated.items() if value is not None}
        if stated.keys() & {"cycles", "long_run_cycles", "long_run_strength", *EQUIVALENCE}:
            yield dotted(("variants", index)), common | stated, valid_track(parts, variant)
        elif not said:
            said = True
            yield "settlement", common, valid_track(parts, variant)


def _variability(
    path: str, table: SpatialVariabilityTable, parts: Parts, variant: VariantTable | None
) -> Iterator[Fault]:
    if table.cov is None:
        yield Fault(f"{path}.cov", "is missing; give the coefficient of variation in the profile's band, "
                    "such as 0.2")  # fmt: skip
        return
    if (table.correlation_length_m is None) == (table.spectrum is None):
        said = "has neither" if table.spectrum is None else "has both"
        yield Fault(
            path,
            f"{said} correlation_length_m (m, of an exponential correlation) and spectrum (= 'profile'); "
            "give one of them",
        )
        return
    if parts.track is not None:
        known = _names(parts)
        for name in table.layers or {}:
            if name not in known:
                yield Fault(
                    f"{path}.layers.{name}", f"is no layer of the track; {suggestion(name, known)}"
                )
    profile = parts.profile
    if profile is None:
        return
    if profile.file is not None:
        for key in ("spectrum", "profile_correlation"):
            if getattr(table, key):
                yield Fault(
                    f"{path}.{key}",
                    "a measured profile has no random numbers that the field could share; leave it out",
                )
                return
    track = valid_track(parts, variant)
    settings = None if track is None else build_variability(table, track)
    if track is None or settings is None:
        return
    yield from _field(path, settings, profile, track, variant)


def _names(parts: Parts) -> list[str]:
    assert parts.track is not None
    return [*layer_names(parts.track), *(layer.name for layer in parts.track.ground)]


def _field(
    path: str,
    settings: SpatialVariability,
    profile: ProfileTable,
    track: Track,
    variant: VariantTable | None,
) -> Iterator[Fault]:
    """A field without waves or layers, or whose susceptibility would be negative."""
    try:
        modes = profile_modes(profile.window_m, profile.shortest_m, profile.longest_m)
    except InputError:  # other checks say so
        return
    name = (variant and variant.spectrum) or profile.spectrum
    shape = spectrum(name, (variant and variant.fra_class) or profile.fra_class)
    waves = field_waves(settings, modes, profile.window_m, shape)
    settling = [i for i, layer in enumerate(track.layers) if layer.law is not None]
    multipliers = settings.coupling(settling)
    if not multipliers.any():
        yield Fault(
            f"{path}.layers", "no layer that settles has a field; give one a multiplier above 0"
        )
        return
    k = 2.0 * np.pi * modes / profile.window_m
    drawn = float(np.sqrt(np.sum(shape(k)) * 2.0 * np.pi / profile.window_m))
    own_sd = drawn if profile.sd is None else profile.sd
    scale = 1.0 if settings.reference_sd is None else own_sd / settings.reference_sd
    largest = float(multipliers.max())
    if settings.distribution == "lognormal":
        if largest > 1.0:
            said = (
                f"received a multiplier of {largest:g}; a lognormal field takes at most 1 "
                "(raise cov instead: a susceptibility must not be negative)"
            )
            yield Fault(f"{path}.layers", said)
        try:
            refuse_unreachable(waves, scale * settings.cov)
        except InputError as error:
            yield Fault(f"{path}.cov", str(error))
        return
    yield from _gaussian(path, settings.cov * scale * largest, scale * largest, waves)


def _gaussian(path: str, band: float, factor: float, waves: FieldWaves) -> Iterator[Fault]:
    point = band * waves.point_share
    if point <= LARGEST_GAUSSIAN * (1.0 + 1e-12):
        return
    scaled = f", {band:.3g} after reference_sd_mm and layers" if abs(factor - 1.0) > 1e-12 else ""
    largest = LARGEST_GAUSSIAN / (waves.point_share * factor)
    yield Fault(
        f"{path}.cov",
        f"received {band / factor:g}{scaled}: at a point, all waves together, that is {point:.3g}, and "
        f"a gaussian susceptibility would be negative in {negative_share(point):.1%} of the track; takes "
        f"at most {largest:.3g}, or distribution = 'lognormal'",
    )
