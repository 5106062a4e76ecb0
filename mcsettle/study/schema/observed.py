"""``[[observed]]``: what is known of the line itself."""

from typing import Annotated

from pydantic import Field

from mcsettle.estimate.observation import Observation, Quantity
from mcsettle.study.schema.base import Name, Table, Text
from mcsettle.study.schema.quantities import Days, Millimetres


class ObservedTable(Table):
    """``[[observed]]``: what was measured of a section on a day, or a tamping interval; its error."""

    scenario: Name
    section: Annotated[str, Field(max_length=200)] = ""
    day: Days | None = None
    sd_mm: Annotated[Millimetres, Field(le=100)] | None = None
    sd_error_mm: Annotated[Millimetres, Field(le=100)] | None = None
    settlement_mm: Annotated[Millimetres, Field(le=1000)] | None = None
    settlement_error_mm: Annotated[Millimetres, Field(le=1000)] | None = None
    increment_sd_mm: Annotated[Millimetres, Field(le=100)] | None = None
    increment_error_mm: Annotated[Millimetres, Field(le=100)] | None = None
    increment_correlation: Annotated[float, Field(ge=-1, le=1)] | None = None
    correlation_error: Annotated[float, Field(gt=0, le=2)] | None = None
    tamping_interval_days: Annotated[Days, Field(gt=0)] | None = None
    error_days: Annotated[Days, Field(gt=0)] | None = None
    sections: Annotated[int, Field(ge=1, le=1_000_000)] = 1
    source: Text = ""

    @property
    def is_interval(self) -> bool:
        """Whether a tamping interval was observed, and nothing on a day."""
        return self.tamping_interval_days is not None

    @property
    def observation(self) -> Observation:
        """The entry, sound, as the statistics take it."""
        pairs: dict[Quantity, tuple[float | None, float | None]] = {
            "settlement": (self.settlement_mm, self.settlement_error_mm),
            "increment": (self.increment_sd_mm, self.increment_error_mm),
            "repetition": (self.increment_correlation, self.correlation_error),
        }
        quantity: Quantity = next((q for q, (v, _) in pairs.items() if v is not None), "sd")
        value, error = pairs.get(quantity, (self.sd_mm, self.sd_error_mm))
        if self.is_interval:
            value, error = self.tamping_interval_days, self.error_days
        assert value is not None  # ``observed_faults``
        assert error is not None
        place = self.scenario, self.section, self.sections
        return Observation(self.day, value, error, *place, quantity)
