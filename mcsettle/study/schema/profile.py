"""``[profile]``: the irregularity before traffic, random or from a measured record."""

from typing import Annotated, Literal

from pydantic import Field

from mcsettle.railway.record_findings import Kind
from mcsettle.study.schema.base import Column, FileName, Spectrum, Table
from mcsettle.study.schema.quantities import Metres, Millimetres, in_plain
from mcsettle.units import MM

Mark = Annotated[str, Field(min_length=1, max_length=40)]  # what stands where nothing was read


class RecordTable(Table):
    """``[profile.record]``: how the measured record is written, and what is taken of it."""

    chainage_column: Column = "chainage_m"
    level_column: Column = "level_mm"
    run_column: Column | None = None
    offset_column: Column | None = None
    second_level_column: Column | None = None
    rails: Literal["mean", "worse"] | None = None
    chainage_unit: Literal["m", "km", "ft", "yd", "mi", "km+m", "km.m", "mi.yd", "mi.ch"] | None = (
        None
    )
    level_unit: Literal["mm", "m", "cm", "in"] | None = None
    positive: Literal["down", "up"] = "down"
    separator: Literal["comma", "semicolon", "tab", "space"] = "comma"
    decimal: Literal[".", ","] = "."
    thousands: Literal[",", ".", "'", " "] | None = None
    encoding: (
        Literal["utf-8", "utf-16", "cp1252", "cp1250", "iso-8859-1", "iso-8859-15", "cp850"] | None
    ) = None
    missing_values: Annotated[tuple[Mark | float, ...], Field(max_length=20)] | None = None
    skip_rows: Annotated[int, Field(ge=0, le=10_000)] = 0
    skip_after_heading: Annotated[int, Field(ge=0, le=100)] | None = None
    dates: Literal["iso", "day_first", "month_first"] | None = None
    run: Column | None = None
    repair: Annotated[tuple[Kind, ...], Field(max_length=10)] = ()
    longest_gap_m: Annotated[Metres, Field(le=100)] = 5.0
    already_filtered: Literal["en13848_d1"] | None = None
    versine_chord_m: Annotated[Metres, Field(ge=1, le=100)] | None = None
    spacing_m: Annotated[Metres, Field(ge=0.001, le=50)] | None = None
    start_m: Annotated[float, in_plain("m"), Field(ge=-1e7, le=1e7)] | None = None
    filter: Literal["ideal", "butterworth", "en13848_d1"] = "ideal"
    filter_order: Annotated[int, Field(ge=1, le=12)] = 4
    ensemble: Literal["section", "phases", "sections"] = "section"
    section: Annotated[int, Field(ge=1, le=1_000_000)] = 1
    noise_mm: Annotated[Millimetres, Field(le=10)] | None = None
    sha256: Annotated[str, Field(pattern=r"^[0-9a-f]{64}$")] | None = None


class ProfileTable(Table):
    """``[profile]``: the track irregularity before traffic, random or measured."""

    file: FileName | None = None
    record: RecordTable | None = None
    spectrum: Spectrum = "fra"
    fra_class: Annotated[int, Field(ge=1, le=6)] = 6
    sd_mm: Annotated[Millimetres, Field(le=50)] | None = None
    window_m: Annotated[Metres, Field(ge=70, le=2000)] = 200.0
    shortest_m: Annotated[Metres, Field(ge=1)] = 3.0
    longest_m: Annotated[Metres, Field(le=200)] = 35.0

    @property
    def sd(self) -> float | None:
        """Standard deviation every realisation is scaled to [m]; None: left as drawn."""
        return None if self.sd_mm is None else self.sd_mm * MM
