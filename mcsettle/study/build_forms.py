"""What a study adds to the model: support that varies, rails that bend, loads on each rail."""

import numpy as np

from mcsettle.railway.rail_loads import RailLoads
from mcsettle.railway.spatial_variability import SpatialVariability, SupportVariation, field_waves
from mcsettle.railway.spectra import spectrum
from mcsettle.railway.track import Track
from mcsettle.study.schema.profile import ProfileTable
from mcsettle.study.schema.spatial_variability import SpatialVariabilityTable
from mcsettle.study.schema.track import TrackTable
from mcsettle.study.schema.variants import VariantTable
from mcsettle.units import MM


def build_rail_loads(table: TrackTable, variant: VariantTable) -> RailLoads:
    """What of bending and load presses on the rails of ``variant``."""
    share = variant.rail_bending_share
    share = table.rail_bending_share if share is None else share
    return RailLoads(share or 0.0, (variant.load_per_rail or table.load_per_rail) == "whole")


def variability_table(
    table: SpatialVariabilityTable | None, variant: VariantTable
) -> SpatialVariabilityTable | None:
    """The table that holds for ``variant``: its own keys over the study's."""
    keys = variant.spatial_variability
    return table if keys is None else keys.over(table)


def build_variability(
    table: SpatialVariabilityTable | None, track: Track
) -> SpatialVariability | None:
    """The field of ``table`` in the layers of ``track``; None where nothing varies."""
    if table is None or not table.cov:
        return None
    layers = table.layers or {}
    return SpatialVariability(
        cov=table.cov,
        correlation_length=table.correlation_length_m,
        profile_correlation=table.profile_correlation or 0.0,
        distribution=table.distribution or "gaussian",
        multipliers=tuple(layers.get(layer.name, 1.0) for layer in track.layers),
        independent=bool(table.independent),
        reference_sd=None if table.reference_sd_mm is None else table.reference_sd_mm * MM,
        persistence=1.0 if table.persistence is None else table.persistence,
    )


def build_support(
    table: SpatialVariabilityTable | None,
    track: Track,
    profile: ProfileTable,
    modes: np.ndarray,
    variant: VariantTable,
    section_log_sd: float,
) -> SupportVariation:
    """How the support of ``variant`` differs; ``modes`` [K]: mode numbers of the profile."""
    settings = build_variability(variability_table(table, variant), track)
    settling = tuple(i for i, layer in enumerate(track.layers) if layer.law is not None)
    if settings is None:
        return SupportVariation(None, None, settling, section_log_sd)
    shape = spectrum(variant.spectrum or profile.spectrum, variant.fra_class or profile.fra_class)
    waves = field_waves(settings, modes, profile.window_m, shape)
    return SupportVariation(settings, waves, settling, section_log_sd)
