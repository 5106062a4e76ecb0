"""From ``[line]`` to the history of its sections: files read, runs aligned, tampings laid in."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mcsettle.errors import InputError
from mcsettle.railway.line_history import LineHistory, detected_tampings, sd_error_of
from mcsettle.study.line_runs import LineRuns, runs_from_records, runs_from_sds
from mcsettle.study.schema.line import LineTable
from mcsettle.units import MM

if TYPE_CHECKING:
    from mcsettle.study.study import Study


@dataclass(frozen=True)
class Line:
    """The history of a line, and what has to be known of how it was read."""

    history: LineHistory
    remarks: tuple[str, ...]


def build_line(study: "Study") -> Line:
    """Read the runs of ``study``'s line.

    Raises
    ------
    InputError
        There is no ``[line]``, a file cannot be used, or the error of an SD cannot be estimated.
    """
    table = study.line
    if table is None or (table.sd_file is None) == (not table.runs):
        raise InputError(
            "a study of a line takes [line] with either [[line.runs]], records of the level, or "
            "sd_file, a table of dated SDs"
        )
    if table.sd_file is not None:
        parts, remarks = runs_from_sds(study, table, table.sd_file)
    else:
        parts, remarks = runs_from_records(study, table)
    return _with_choices(study, table, parts, remarks)


def _with_choices(study: "Study", table: LineTable, runs: LineRuns, remarks: list[str]) -> Line:
    """The history with limits, traffic, tampings and what is left out, section by section."""
    _check_tracks(table, runs)
    n, middle = len(runs.sd), 0.5 * (runs.chainage_from + runs.chainage_to)
    scenario = np.full(n, table.scenario or study.scenario_names[0], dtype=object)
    variant = np.full(n, table.variant or study.variant_names[0], dtype=object)
    limit, excluded = np.full(n, study.limit.sd_limit), np.full(n, "", dtype=object)
    for stretch in table.stretches:
        inside = (middle >= stretch.chainage_from_m) & (middle < stretch.chainage_to_m)
        inside &= True if stretch.track is None else runs.track == stretch.track
        for values, chosen in ((scenario, stretch.scenario), (variant, stretch.variant),
                               (excluded, stretch.exclude)):  # fmt: skip
            if chosen is not None:
                values[inside] = chosen
        if stretch.sd_limit_mm is not None:
            limit[inside] = stretch.sd_limit_mm * MM
    tamped_on = np.full(runs.sd.shape, np.nan)
    days = np.array([day.toordinal() for day in runs.dates])
    for tamping in table.tampings:
        inside = (middle >= tamping.chainage_from_m) & (middle < tamping.chainage_to_m)
        inside &= True if tamping.track is None else runs.track == tamping.track
        run = int(np.searchsorted(days, tamping.date.toordinal()))
        if run < len(days):
            tamped_on[inside, run] = float(tamping.date.toordinal())
    spans = np.cumsum(~np.isnan(tamped_on), axis=1)
    since = (days - days[0]).astype(float)
    error = table.sd_error_mm
    sd_error = error * MM if error else sd_error_of(runs.sd, since, spans, table.repeat_days)
    if not sd_error > 0.0:
        raise InputError(
            "the error of an SD cannot be estimated from these runs (no repeats within "
            f"{table.repeat_days:g} days, no section with three runs); give [line] sd_error_mm"
        )
    found = detected_tampings(runs.sd, sd_error, table.least_drop) & np.isnan(tamped_on)
    for row, run in zip(*np.nonzero(found), strict=True):
        tamped_on[row, run] = 0.5 * (days[run - 1] + days[run])
    if not error:
        remarks = [*remarks, f"standard error of an SD, from the runs: {sd_error / MM:.3f} mm"]
    if found.any():
        remarks = [
            *remarks,
            f"{int(found.any(axis=1).sum())} sections fell so far between two runs that they were "
            "taken as tamped half-way between them; name the tampings ([[line.tampings]]) to say when",
        ]
    if (excluded != "").any():
        remarks = [*remarks, f"{int((excluded != '').sum())} sections are left out, as stated"]
    history = LineHistory(
        runs.chainage_from, runs.chainage_to, runs.dates, runs.sd, runs.amplitudes, tamped_on,
        float(sd_error), limit, scenario, variant, excluded, runs.track,
    )  # fmt: skip
    return Line(history, tuple(remarks))


def _check_tracks(table: LineTable, runs: LineRuns) -> None:
    """Refuse tracks of stretches and tampings that no run is of."""
    known = list(dict.fromkeys(runs.track))
    named = {part.track for part in table.stretches} | {part.track for part in table.tampings}
    named -= {None, *known}
    if named:
        there = ", ".join(filter(None, known)) or "none has a name"
        raise InputError(
            f"[line] names the track {', '.join(map(repr, sorted(filter(None, named))))}; the tracks of "
            f"its runs: {there}"
        )
