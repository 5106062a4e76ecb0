"""``[spatial_variability]``: settlement susceptibility that varies along the track."""

from typing import Annotated, Literal

from pydantic import Field

from mcsettle.study.schema.base import Name, Table
from mcsettle.study.schema.quantities import Metres, Millimetres

Multiplier = Annotated[float, Field(ge=0, le=100)]


class SpatialVariabilityTable(Table):
    """``[spatial_variability]``, also of a variant, whose keys left out follow the study's own.

    ``cov`` is the coefficient of variation in the profile's band, 0: none. Either
    ``correlation_length_m`` or ``spectrum`` says how it is shared among the waves.
    """

    cov: Annotated[float, Field(ge=0, le=10)] | None = None
    correlation_length_m: Annotated[Metres, Field(ge=0.1, le=1000)] | None = None
    spectrum: Literal["profile"] | None = None
    profile_correlation: Annotated[float, Field(ge=-1, le=1)] | None = None
    distribution: Literal["gaussian", "lognormal"] | None = None
    layers: dict[Name, Multiplier] | None = None
    independent: bool | None = None
    reference_sd_mm: Annotated[Millimetres, Field(le=50)] | None = None
    persistence: Annotated[float, Field(ge=0, le=1)] | None = None

    def over(self, other: "SpatialVariabilityTable | None") -> "SpatialVariabilityTable":
        """These keys, those of ``other`` where there are none; one way of sharing replaces another."""
        if other is None:
            return self
        own, common = self.model_dump(exclude_none=True), other.model_dump(exclude_none=True)
        if {"correlation_length_m", "spectrum"} & own.keys():
            common = {
                k: v for k, v in common.items() if k not in ("correlation_length_m", "spectrum")
            }
        return type(self)(**(common | own))
