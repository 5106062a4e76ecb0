"""``[profile]``: the irregularity before traffic, random or from a measured record."""

from typing import Annotated, Literal

from pydantic import Field

from mcsettle.study.schema.base import Column, FileName, Spectrum, Table
from mcsettle.study.schema.quantities import Metres, Millimetres
from mcsettle.units import MM


class RecordTable(Table):
    """``[profile.record]``: how the measured record is written, and what is taken of it."""

    chainage_column: Column = "chainage_m"
    level_column: Column = "level_mm"
    run_column: Column | None = None
    chainage_unit: Literal["m", "km", "ft", "yd", "mi"] | None = None
    level_unit: Literal["mm", "m", "cm", "in"] | None = None
    positive: Literal["down", "up"] = "down"
    separator: Literal["comma", "semicolon", "tab", "space"] = "comma"
    decimal: Literal[".", ","] = "."
    skip_rows: Annotated[int, Field(ge=0, le=10_000)] = 0
    run: Column | None = None
    repair: Annotated[
        tuple[Literal["missing", "unordered", "repeated", "gaps", "spikes"], ...],
        Field(max_length=5),
    ] = ()
    longest_gap_m: Annotated[Metres, Field(le=100)] = 5.0
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
