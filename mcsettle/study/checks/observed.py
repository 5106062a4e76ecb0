"""Observations of the line: each an SD on a day or a tamping interval, within the horizon."""

from collections.abc import Iterator

from mcsettle.study.faults import Fault, dotted, suggestion
from mcsettle.study.schema.observed import ObservedTable
from mcsettle.study.schema.study import StudyTables

_SD = ("day", "sd_mm", "sd_error_mm")
_INTERVAL = ("tamping_interval_days", "error_days")


def observed_faults(study: StudyTables) -> Iterator[Fault]:
    """Faults of the observations of a study that is valid without them."""
    if study.observed and not study.uncertain:
        yield Fault(
            "observed", "without [[uncertain]] inputs there is nothing that observations could tell"
        )
    names = study.scenario_names
    for place, entry in enumerate(study.observed):
        path = dotted(("observed", place))
        if entry.scenario not in names:
            said = f"'{entry.scenario}' is no scenario; {suggestion(entry.scenario, names)}"
            yield Fault(f"{path}.scenario", said)
        yield from (Fault(path, said) for said in _reasons(entry, study.limit.horizon_days))


def _reasons(entry: ObservedTable, horizon_days: float) -> Iterator[str]:
    given = [key for key in (*_SD, *_INTERVAL) if getattr(entry, key) is not None]
    if set(given) not in (set(_SD), set(_INTERVAL)):
        yield (
            f"received {', '.join(given) or 'nothing'}; an observation is either {', '.join(_SD)}, "
            f"or {', '.join(_INTERVAL)}"
        )
        return
    if entry.sections > 1 and not entry.is_interval:
        yield "sections = … belongs to the median of several tamping intervals; an SD is of one section"
    if late := entry.observation.beyond(horizon_days):
        yield late
