"""``[line]``: the sections of a line, their dated runs, and what differs along it."""

from datetime import date
from typing import Annotated, Literal

from pydantic import Field

from mcsettle.study.schema.base import Column, FileName, Name, Table, Text
from mcsettle.study.schema.profile import RecordTable
from mcsettle.study.schema.quantities import Days, Metres, Millimetres, in_plain

Chainage = Annotated[float, in_plain("m"), Field(ge=-1e7, le=1e7)]
Date = Annotated[date, Field(strict=False)]  # a TOML date, or its ISO text


class LineRunTable(Table):
    """``[[line.runs]]``: one dated run of the recording car, a file as ``[line.record]`` describes it."""

    file: FileName
    date: Date
    run: Column | None = None
    track: Name | None = None


class TampingTable(Table):
    """``[[line.tampings]]``: a stretch that was tamped, and when."""

    chainage_from_m: Chainage
    chainage_to_m: Chainage
    date: Date
    track: Name | None = None


class StretchTable(Table):
    """``[[line.stretches]]``: what differs along the line; later ones are laid over earlier ones."""

    chainage_from_m: Chainage
    chainage_to_m: Chainage
    scenario: Name | None = None
    variant: Name | None = None
    sd_limit_mm: Annotated[Millimetres, Field(le=50)] | None = None
    exclude: Text | None = None
    track: Name | None = None


class TampingPlanTable(Table):
    """``[line.plan]``: shifts of a tamping machine; defaults as the paper's £9k and 1.6 km."""

    cost_per_shift: Annotated[float, Field(gt=0, le=1e9)] = 9000.0
    output_m_per_shift: Annotated[Metres, in_plain("m/shift"), Field(le=50_000)] = 1600.0
    least_length_m: Annotated[Metres, Field(le=10_000)] = 400.0
    join_within_days: Annotated[Days, Field(le=3650)] = 365.0


class LineTable(Table):
    """``[line]``: dated runs as records of the level, or a table of dated SDs, of one line."""

    runs: Annotated[tuple[LineRunTable, ...], Field(max_length=200)] = ()
    record: RecordTable = RecordTable()
    sd_file: FileName | None = None
    scenario: Name | None = None
    variant: Name | None = None
    sd_error_mm: Annotated[Millimetres, Field(le=5)] | None = None
    repeat_days: Annotated[Days, Field(le=365)] = 30.0
    align_within_m: Annotated[float, in_plain("m"), Field(ge=0, le=200)] = 25.0
    growth: Literal["average", "model"] = "average"
    least_drop: Annotated[float, Field(gt=0, lt=1)] = 0.1
    tampings: Annotated[tuple[TampingTable, ...], Field(max_length=10_000)] = ()
    stretches: Annotated[tuple[StretchTable, ...], Field(max_length=10_000)] = ()
    plan: TampingPlanTable = TampingPlanTable()
