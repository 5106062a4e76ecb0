"""``[[variants]]``: other readings of the same study."""

from typing import Annotated, Literal

from pydantic import Field

from mcsettle.study.schema.base import (
    CycleCount,
    Cycles,
    Digest,
    Name,
    Soil,
    Spectrum,
    StressKind,
    Table,
    Text,
)
from mcsettle.study.schema.quantities import Metres
from mcsettle.study.schema.track import LayerTable


class VariantTable(Table):
    """``[[variants]]``: another reading of the same study; keys left out follow the study's own."""

    name: Name
    title: Text = ""
    soil: Soil | None = None
    damping_convention: Literal["damping_ratio", "loss_factor"] | None = None
    spectrum: Spectrum | None = None
    fra_class: Annotated[int, Field(ge=1, le=6)] | None = None
    stress: StressKind | None = None
    cycles: CycleCount | None = None
    ballast_cycles_before: Cycles | None = None
    subgrade_cycles_before: Cycles | None = None
    cycles_per_passage: Annotated[float, Field(gt=0, le=1e6)] | None = None
    settlement_factor: Annotated[float, Field(gt=0, le=1e6)] | None = None
    integration_depth_m: Annotated[Metres, Field(le=100)] | None = None
    factor_digest: Digest | None = None
    layers: dict[Name, LayerTable] = Field(default={})
