"""Observations of the line: each of one quantity on a day or a tamping interval, within the horizon."""

from collections.abc import Collection, Iterator

from mcsettle.study.faults import Fault, dotted, suggestion
from mcsettle.study.schema.observed import ObservedTable
from mcsettle.study.schema.study import StudyTables

_SD = ("day", "sd_mm", "sd_error_mm")
_INTERVAL = ("tamping_interval_days", "error_days")
_GROWN = (
    ("day", "settlement_mm", "settlement_error_mm"),
    ("day", "increment_sd_mm", "increment_error_mm"),
    ("day", "increment_correlation", "correlation_error"),
)
_KINDS = (_SD, *_GROWN, _INTERVAL)
_KEYS = tuple(dict.fromkeys(key for kind in _KINDS for key in kind))


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


def unfitted_faults(
    study: StudyTables, variants: Collection[str], fitted: Collection[str]
) -> Iterator[Fault]:
    """Faults of observations that only Step B at a variant's own factor can be compared with."""
    grown = [
        dotted(("observed", place))
        for place, entry in enumerate(study.observed)
        if any(getattr(entry, kind[1]) is not None for kind in _GROWN)
    ]
    without = [name for name in variants if name not in fitted]
    if grown and without:
        yield Fault(
            grown[0],
            "settlement, increments and their correlation need a settlement factor that every "
            "parameter set fits ([[uncertain]] with fitted = true), in every variant; "
            f"{', '.join(without)} has none",
        )
    repeated = [
        place for place, e in enumerate(study.observed) if e.increment_correlation is not None
    ]
    if repeated and study.profile.file is not None:
        yield Fault(
            f"{dotted(('observed', repeated[0]))}.increment_correlation",
            "needs profiles drawn from a spectrum: a tamping leaves a new one; leave out profile.file",
        )


def _reasons(entry: ObservedTable, horizon_days: float) -> Iterator[str]:
    given = [key for key in _KEYS if getattr(entry, key) is not None]
    if set(given) not in [set(kind) for kind in _KINDS]:
        yield (
            f"received {', '.join(given) or 'nothing'}; an observation is either "
            + ", or ".join(", ".join(kind) for kind in _KINDS)
        )
        return
    if entry.sections > 1 and not entry.is_interval:
        yield "sections = … belongs to the median of several tamping intervals; an SD is of one section"
    if not entry.observation.is_recorded and not entry.day:
        yield "day must be above 0: what grew since the start is nothing on day 0"
    if late := entry.observation.beyond(horizon_days):
        yield late
