"""``[settlement]``, ``[limit]`` and ``[run]``: what Step B does, and for how long."""

from typing import Annotated, Literal

from pydantic import Field

from mcsettle.study.schema.base import (
    CycleCount,
    Cycles,
    Digest,
    Exponent,
    History,
    LogSd,
    StressKind,
    Table,
)
from mcsettle.study.schema.quantities import Days, Metres, Millimetres, Years
from mcsettle.units import DAYS_PER_YEAR, MM


class SettlementTable(Table):
    """``[settlement]``: how stress and load cycles become settlement (Step B).

    ``factor_digest`` says which transfer functions the factor was found for; it changes nothing.
    """

    stress: StressKind = "traffic"
    cycles: CycleCount = "shared"
    ballast_cycles_before: Cycles = 100_000.0
    subgrade_cycles_before: Cycles = 100_000.0
    cycles_per_passage: Annotated[float, Field(ge=1e-9, le=1e6)] = 1.0
    settlement_factor: Annotated[float, Field(gt=0, le=1e6)] = 1.0
    integration_depth_m: Annotated[Metres, Field(le=100)] = 5.5
    equivalence_exponent: Exponent | Literal["law"] | None = None
    ballast_equivalence_exponent: Exponent | None = None
    equivalence_history: History | None = None
    long_run_cycles: Cycles | None = None
    long_run_strength: Annotated[float, Field(ge=0, le=1000)] | None = None
    section_log_sd: LogSd | None = None
    factor_digest: Digest | None = None


class LimitTable(Table):
    """``[limit]``: when the track is tamped, and how long a realisation is followed."""

    sd_limit_mm: Annotated[Millimetres, Field(le=100)]
    horizon_years: Annotated[Years, Field(le=1000)] = 50.0

    @property
    def sd_limit(self) -> float:
        """Intervention threshold on the standard deviation [m]."""
        return self.sd_limit_mm * MM

    @property
    def horizon_days(self) -> float:
        """Days after which a realisation is censored."""
        return self.horizon_years * DAYS_PER_YEAR


class RunTable(Table):
    """``[run]``: how many realisations, of how many draws of the inputs, and how they advance."""

    realisations: Annotated[int, Field(ge=1, le=10_000_000)] = 200
    parameter_sets: Annotated[int, Field(ge=1, le=1_000_000)] | None = None
    stepping: Literal["cycle_jump", "every_axle", "every_train"] = "cycle_jump"
    right_hand_side: Literal["spectral", "pointwise"] = "spectral"
    precision: Literal["f64", "f32"] = "f64"
    history_days: Annotated[tuple[Days, ...], Field(max_length=1000)] = (
        0.0, 30.0, 91.0, 182.0, 365.0, 730.0, 1095.0, 1825.0, 3650.0,
    )  # fmt: skip
