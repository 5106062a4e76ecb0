"""``[economics]`` and ``[maintenance]``: what is compared, what a tamping costs and leaves."""

from typing import Annotated, Literal

from pydantic import Field

from mcsettle.study.schema.base import Cycles, Name, Positive, Table
from mcsettle.study.schema.currencies import Currency
from mcsettle.study.schema.quantities import Millimetres, PerCent, Speed, Years, in_plain, quantity

EffectKind = Literal["speed", "tonnage"]
TrainsAYear = Annotated[Positive, in_plain("1000/year")]
Tonnage = Annotated[Positive, in_plain("MGT/d")]


class EffectTable(Table):
    """``[[effects]]``: one scenario against one baseline, and what changes between them.

    ``train`` is the one whose speed changes, or that is added.
    """

    scenario: Name
    baseline: Name
    effect: EffectKind
    train: Name | None = None
    base_speed_kmh: Speed | None = None
    trains_thousand_per_year: TrainsAYear | None = None
    mgt_per_day: Tonnage | None = None


class EconomicsTable(Table):
    """``[economics]``: what a tamping costs, and what is compared with what (Eqs 4–9).

    ``effect`` and ``baseline`` are short for ``[[effects]]`` of every other scenario.
    """

    effect: EffectKind | None = None
    baseline: Name | None = None
    currency: Currency = "GBP"
    tamping_cost_per_track_km: Annotated[Positive, in_plain("currency/track-km")] = 5625.0
    discount_rate: Annotated[float, PerCent, Field(ge=0, lt=1)] = 0.035
    base_speed_kmh: Speed | None = None
    trains_thousand_per_year: TrainsAYear | None = None
    mgt_per_day: Tonnage | None = None
    price_base_year: Annotated[int, Field(ge=1900, le=2200)] | None = None


class MaintenanceTable(Table):
    """``[maintenance]``: what a tamping leaves, again and again, to renewal."""

    recovery: Literal["perfect", "linear"]
    intercept_mm: Annotated[float, quantity("mm"), Field(ge=0, le=50)] | None = None
    slope: Annotated[float, Field(ge=0, lt=1)] | None = None
    scatter_mm: Annotated[float, quantity("mm"), Field(ge=0, le=10)] = 0.0
    floor_mm: Annotated[Millimetres, Field(le=50)] = 0.1
    shape: Literal["scaled", "initial", "redrawn"] = "scaled"
    damage_per_tamping: Annotated[float, Field(ge=0, le=10)] = 0.0
    ballast_cycles_after: Cycles | None = None
    ground_renewed: bool = False
    cycles: Annotated[int, Field(ge=1, le=200)] = 20
    renewal_years: Annotated[Years, Field(le=200)] | None = None
