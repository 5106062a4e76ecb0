"""``[[observed]]``: what is known of the line itself."""

from typing import Annotated

from pydantic import Field

from mcsettle.estimate.observation import Observation
from mcsettle.study.schema.base import Name, Table, Text
from mcsettle.study.schema.quantities import Days, Millimetres


class ObservedTable(Table):
    """``[[observed]]``: the SD of a section on a day, or a tamping interval, with its error."""

    scenario: Name
    section: Annotated[str, Field(max_length=200)] = ""
    day: Days | None = None
    sd_mm: Annotated[Millimetres, Field(le=100)] | None = None
    sd_error_mm: Annotated[Millimetres, Field(le=100)] | None = None
    tamping_interval_days: Annotated[Days, Field(gt=0)] | None = None
    error_days: Annotated[Days, Field(gt=0)] | None = None
    sections: Annotated[int, Field(ge=1, le=1_000_000)] = 1
    source: Text = ""

    @property
    def is_interval(self) -> bool:
        """Whether a tamping interval was observed, and no SD."""
        return self.tamping_interval_days is not None

    @property
    def observation(self) -> Observation:
        """The entry, sound, as the statistics take it."""
        value, error = self.sd_mm, self.sd_error_mm
        if self.is_interval:
            value, error = self.tamping_interval_days, self.error_days
        assert value is not None  # ``observed_faults``
        assert error is not None
        return Observation(self.day, value, error, self.scenario, self.section, self.sections)
