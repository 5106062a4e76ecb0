"""What every table of a study file is made of: the frozen table, and the kinds of its plain values."""

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field

Name = Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9_.\-]*$", max_length=40)]
Text = Annotated[str, Field(max_length=2000)]
FileName = Annotated[str, Field(min_length=1, max_length=500)]
Column = Annotated[str, Field(min_length=1, max_length=100)]
KeyPath = Annotated[str, Field(min_length=1, max_length=200)]
Digest = Annotated[str, Field(pattern=r"^[0-9a-f]{16}$")]
Fraction = Annotated[float, Field(ge=0, lt=0.5)]
Positive = Annotated[float, Field(gt=0)]
Cycles = Annotated[float, Field(ge=1, le=1e12)]
Soil = Literal["linear", "equivalent_linear"]
Spectrum = Literal["fra", "fra_one_corner", "german_low", "german_high"]
StressKind = Literal["traffic", "total"]
CycleCount = Literal["shared", "per_vehicle", "equivalent"]
Exponent = Annotated[float, Field(ge=0, le=30)]
History = Literal["mix", "reference"]
Share = Annotated[float, Field(ge=0, le=1)]
LogSd = Annotated[float, Field(ge=0, le=3)]


class Table(BaseModel):
    """A table of the study file: unknown keys are refused, values never change after reading."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)
