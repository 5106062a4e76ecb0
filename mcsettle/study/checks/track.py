"""Faults of track, ground and model forms that only several tables together show."""

from collections.abc import Iterator, Mapping

from mcsettle.railway.track import TRACKS, Track
from mcsettle.study.attributes import described
from mcsettle.study.build import CURVE_PATHS, LAYER_PATHS, build_track, layer_names
from mcsettle.study.checks.parts import Parts
from mcsettle.study.faults import Fault, dotted, shown, suggestion
from mcsettle.study.schema.track import LayerTable, TrackTable
from mcsettle.study.schema.variants import VariantTable


def track_faults(parts: Parts) -> Iterator[Fault]:
    """Presets, keys and layers of ``[track]`` that do not go together, or give no track."""
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


def variant_faults(parts: Parts) -> Iterator[Fault]:
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


def valid_track(parts: Parts, variant: VariantTable | None = None) -> Track | None:
    """The track of the study, or of a variant; None where it cannot be built."""
    if parts.track is None:
        return None
    try:
        return build_track(parts.track, variant)
    except (KeyError, ValueError):
        return None
