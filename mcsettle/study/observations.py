"""``[[observed]]`` of a study: what is known of the line itself, and checks.

An observation is the SD of one section on a day, or a tamping interval: of one section, or the median of
several. Observations do not decide the rows of a run; they weight its parameter sets (``observed``).
"""

from collections.abc import Iterator, Sequence
from typing import Annotated

from pydantic import Field

from mcsettle.study import quantities as u
from mcsettle.study.faults import Fault, dotted, suggestion
from mcsettle.study.schema import Name, Table, Text

_SD = ("day", "sd_mm", "sd_error_mm")
_INTERVAL = ("tamping_interval_days", "error_days")


class ObservedTable(Table):
    """``[[observed]]``: the SD of a section on a day, or a tamping interval, with its error."""

    scenario: Name
    section: Annotated[str, Field(max_length=200)] = ""
    day: u.Days | None = None
    sd_mm: Annotated[u.Millimetres, Field(le=100)] | None = None
    sd_error_mm: Annotated[u.Millimetres, Field(le=100)] | None = None
    tamping_interval_days: Annotated[u.Days, Field(gt=0)] | None = None
    error_days: Annotated[u.Days, Field(gt=0)] | None = None
    sections: Annotated[int, Field(ge=1, le=1_000_000)] = 1
    source: Text = ""

    @property
    def is_interval(self) -> bool:
        """Whether a tamping interval was observed, and no SD."""
        return self.tamping_interval_days is not None


def observed_faults(
    entries: Sequence[ObservedTable],
    scenario_names: Sequence[str],
    horizon_days: float,
    uncertain: bool,
) -> Iterator[Fault]:
    """Faults of the observations of a study that is sound without them."""
    if entries and not uncertain:
        yield Fault(
            "observed", "without [[uncertain]] inputs there is nothing that observations could tell"
        )
    for place, entry in enumerate(entries):
        path = dotted(("observed", place))
        if entry.scenario not in scenario_names:
            said = (
                f"'{entry.scenario}' is no scenario; {suggestion(entry.scenario, scenario_names)}"
            )
            yield Fault(f"{path}.scenario", said)
        yield from (Fault(path, said) for said in _unsound(entry, horizon_days))


def _unsound(entry: ObservedTable, horizon_days: float) -> Iterator[str]:
    given = [key for key in (*_SD, *_INTERVAL) if getattr(entry, key) is not None]
    if set(given) not in (set(_SD), set(_INTERVAL)):
        yield (
            f"received {', '.join(given) or 'nothing'}; an observation is either {', '.join(_SD)}, "
            f"or {', '.join(_INTERVAL)}"
        )
        return
    if entry.sections > 1 and not entry.is_interval:
        yield "sections = … belongs to the median of several tamping intervals; an SD is of one section"
    latest = entry.tamping_interval_days if entry.is_interval else entry.day
    if latest is not None and latest >= horizon_days:
        yield (
            f"received day {latest:g}; a realisation is followed for {horizon_days:g} days "
            "([limit] horizon_years): observe earlier, or set a later horizon"
        )
