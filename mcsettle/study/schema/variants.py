"""``[[variants]]``: other readings of the same study."""

from typing import Annotated, Literal

from pydantic import Field

from mcsettle.study.schema.base import (
    CycleCount,
    Cycles,
    Digest,
    Exponent,
    History,
    LogSd,
    Name,
    Share,
    Soil,
    Spectrum,
    StressKind,
    Table,
    Text,
)
from mcsettle.study.schema.quantities import Metres
from mcsettle.study.schema.spatial_variability import SpatialVariabilityTable
from mcsettle.study.schema.track import LayerTable, LoadPerRail


class VariantTrainTable(Table):
    """``[variants.trains.<name>]``: what a variant reads otherwise in a train of the study."""

    car_length_m: Metres


class VariantTable(Table):
    """``[[variants]]``: another reading of the same study; keys left out follow the study's own.

    ``form_of`` names the question that this variant is a model form of; it changes no result.
    """

    name: Name
    title: Text = ""
    form_of: Name | None = None
    soil: Soil | None = None
    damping_convention: Literal["damping_ratio", "loss_factor"] | None = None
    spectrum: Spectrum | None = None
    fra_class: Annotated[int, Field(ge=1, le=6)] | None = None
    stress: StressKind | None = None
    cycles: CycleCount | None = None
    ballast_cycles_before: Cycles | None = None
    subgrade_cycles_before: Cycles | None = None
    cycles_per_passage: Annotated[float, Field(ge=1e-9, le=1e6)] | None = None
    settlement_factor: Annotated[float, Field(gt=0, le=1e6)] | None = None
    integration_depth_m: Annotated[Metres, Field(le=100)] | None = None
    equivalence_exponent: Exponent | Literal["law"] | None = None
    ballast_equivalence_exponent: Exponent | None = None
    equivalence_history: History | None = None
    long_run_cycles: Cycles | None = None
    long_run_strength: Annotated[float, Field(ge=0, le=1000)] | None = None
    section_log_sd: LogSd | None = None
    rail_bending_share: Share | None = None
    load_per_rail: LoadPerRail | None = None
    spatial_variability: SpatialVariabilityTable | None = None
    trains: dict[Name, VariantTrainTable] = Field(default={})
    factor_digest: Digest | None = None
    layers: dict[Name, LayerTable] = Field(default={})
