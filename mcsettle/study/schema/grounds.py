"""``[grounds]``: many possible grounds from files, and the soils they are made of."""

from typing import Annotated, Literal

from pydantic import Field

from mcsettle.study.schema.base import Column, FileName, Fraction, Positive, Table, Text
from mcsettle.study.schema.quantities import Density, Metres, Pascals


class SoilTable(Table):
    """``[grounds.materials.<code>]``: a soil of a list of grounds; ``no_law`` says why it has none."""

    youngs_modulus_pa: Pascals
    poisson: Annotated[float, Field(gt=-1, lt=0.5)]
    density_kg_per_m3: Density
    damping: Fraction
    k0: Annotated[float, Field(gt=0, le=3)] = 0.5
    settlement_a: Positive | None = None
    settlement_b: Annotated[float, Field(gt=0, lt=1)] | None = None
    settlement_m: Positive | None = None
    strength_pa: Pascals | None = None
    no_law: Text = ""
    source: Text = ""


class GroundsTable(Table):
    """``[grounds]``: many possible layered grounds with probabilities, each a parameter set."""

    layers: FileName
    weights: FileName
    separator: Literal["comma", "semicolon", "tab"] = "semicolon"
    decimal: Literal[".", ","] | None = None
    encoding: (
        Literal["utf-8", "utf-16", "cp1252", "cp1250", "iso-8859-1", "iso-8859-15", "cp850"] | None
    ) = None
    level_unit: Literal["m", "dm", "cm", "mm", "ft"] | None = None
    ground_column: Column = "soilprofile_id"
    top_column: Column = "top_level"
    material_column: Column = "soil_name"
    segment_column: Column = "segment_id"
    probability_column: Column = "probability"
    leave_out: Annotated[tuple[Column, ...], Field(max_length=100)] = ()
    fine_m: Annotated[Metres, Field(ge=0.1, le=5)] = 0.5
    fine_depth_m: Annotated[Metres, Field(ge=0.1, le=50)] = 6.0
    coarse_m: Annotated[Metres, Field(ge=0.1, le=10)] = 1.0
    depth_m: Annotated[Metres, Field(ge=0.5, le=100)] = 10.0
    materials: Annotated[dict[Column, SoilTable], Field(min_length=1, max_length=1000)]
    sha256: Annotated[tuple[str, ...], Field(max_length=2)] | None = None
