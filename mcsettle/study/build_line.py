"""From ``[line]`` to the history of its sections: files read, runs aligned, tampings laid in."""

from dataclasses import dataclass
from datetime import date
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from mcsettle.errors import InputError
from mcsettle.railway.dates import date_of
from mcsettle.railway.line_history import LineHistory, detected_tampings, sd_error_of
from mcsettle.railway.measured_profiles import RecordChoice, read_and_repaired, sections_of
from mcsettle.railway.record import Run
from mcsettle.railway.record_sections import Sections
from mcsettle.railway.run_alignment import aligned
from mcsettle.study.build import build_record
from mcsettle.study.input_files import digest_of
from mcsettle.study.schema.line import LineRunTable, LineTable
from mcsettle.units import MM

if TYPE_CHECKING:
    from mcsettle.study.study import Study

SD_COLUMNS = ("chainage_from_m", "chainage_to_m", "date", "sd_mm")
MOST_ROWS = 5_000_000


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
        parts, remarks = _from_sds(study, table, table.sd_file)
    else:
        parts, remarks = _from_records(study, table)
    return _with_choices(study, table, parts, remarks)


@dataclass(frozen=True, eq=False)
class _Runs:
    chainage_from: np.ndarray
    chainage_to: np.ndarray
    dates: tuple[date, ...]
    sd: np.ndarray
    amplitudes: np.ndarray


def _from_sds(study: "Study", table: LineTable, name: str) -> tuple[_Runs, list[str]]:
    """Sections of a table of dated SDs: one row for a section and a date."""
    path = study.locate(name)
    try:
        data = pd.read_csv(path, nrows=MOST_ROWS, encoding="utf-8-sig")
    except (OSError, ValueError, UnicodeDecodeError) as error:
        raise InputError(f"line.sd_file '{name}' cannot be read: {error}") from None
    faults = [
        f"no column '{column}'; there are {', '.join(map(str, data.columns[:20]))}"
        for column in SD_COLUMNS
        if column not in data
    ]
    if faults:
        raise InputError(_listed(name, faults))
    order, dates = table.record.dates or "iso", {}
    for text in data["date"].astype(str).unique():
        try:
            dates[text] = date_of(text, order)
        except ValueError as error:
            faults.append(f"column 'date': {error}")
    for column in ("chainage_from_m", "chainage_to_m", "sd_mm"):
        numbers = pd.to_numeric(data[column], errors="coerce")
        wrong = data.index[numbers.isna()]
        if len(wrong):
            line, value = int(wrong[0]) + 2, data.loc[wrong[0], column]
            faults.append(
                f"column '{column}': {len(wrong)} are no numbers, first '{value}', line {line}"
            )
        data[column] = numbers
    if not faults and not (data["sd_mm"] > 0.0).all():
        faults.append(f"column 'sd_mm': {int((data['sd_mm'] <= 0.0).sum())} are not positive")
    if not faults and not (data["chainage_to_m"] > data["chainage_from_m"]).all():
        faults.append("chainage_to_m must lie beyond chainage_from_m in every row")
    if faults:
        raise InputError(_listed(name, faults))
    data["date"] = data["date"].astype(str).map(dates)
    keys = ["chainage_from_m", "chainage_to_m"]
    sd = data.pivot_table(index=keys, columns="date", values="sd_mm", aggfunc="mean").sort_index()
    sections = sd.index.to_frame()
    n_modes = len(study.wavenumbers)
    runs = _Runs(
        sections["chainage_from_m"].to_numpy(dtype=float),
        sections["chainage_to_m"].to_numpy(dtype=float),
        tuple(sorted(set(dates.values()))),
        sd.to_numpy(dtype=float) * MM,
        np.full((*sd.shape, n_modes), np.nan, dtype=complex),
    )
    remark = (
        "profiles are unknown: each section has a random one of the study's spectrum and its SD"
    )
    return runs, [remark]


def _from_records(study: "Study", table: LineTable) -> tuple[_Runs, list[str]]:
    """Sections of dated records of the level, on the chainage of the last one."""
    entries = sorted(table.runs, key=lambda run: run.date)
    read, faults = [], []
    for entry in entries:
        try:
            read.append(_run(study, table, entry))
        except InputError as error:
            faults.append(f"line.runs, '{entry.file}' of {entry.date}: {error}")
    if faults:
        raise InputError("\n".join(faults))
    *earlier, newest = entries
    reference, choice = read[-1]
    last = _cut(study, reference, choice)
    remarks, sections = [], []
    for entry, (run, choice) in zip(earlier, read, strict=False):
        if table.align_within_m > 0.0:
            try:
                alignment = aligned(reference, run, choice.band, table.align_within_m)
                run = alignment.run
                remarks.append(f"run of {entry.date} {alignment.text}")
            except InputError as error:
                remarks.append(f"run of {entry.date} is left as recorded: {error}")
        trimmed = _on_grid(run, float(last.begins[0]), study.profile.window_m)
        sections.append(_cut(study, trimmed, choice))
    sds, amplitudes = [], []
    for part in (*sections, last):
        at = np.rint((last.begins - part.begins[0]) / study.profile.window_m)
        covered = (at >= 0) & (at < len(part.sd))
        index = np.where(covered, at, 0).astype(int)
        sds.append(np.where(covered, part.sd[index], np.nan))
        amplitudes.append(np.where(covered[:, None], part.amplitudes[index], np.nan))
    runs = _Runs(
        last.chainage_from,
        last.chainage_to,
        tuple(entry.date for entry in (*earlier, newest)),
        np.stack(sds, axis=1),
        np.stack(amplitudes, axis=1),
    )
    return runs, remarks


def _run(study: "Study", table: LineTable, entry: LineRunTable) -> tuple[Run, RecordChoice]:
    """One dated run, repaired as ``[line.record]`` says."""
    path = study.locate(entry.file)
    record = table.record.model_copy(update={"run": entry.run or table.record.run})
    profile = study.profile.model_copy(update={"file": entry.file, "record": record})
    choice = build_record(profile, path, digest_of(path, None))
    return read_and_repaired(choice)[1], choice


def _cut(study: "Study", run: Run, choice: RecordChoice) -> Sections:
    return sections_of(run, study.profile.window_m, study.wavenumbers, choice)


def _on_grid(run: Run, origin: float, window: float) -> Run:
    """``run`` from the first point on at which a section can begin: ``origin`` plus whole windows."""
    first = origin + window * np.ceil((run.chainage[0] - origin) / window - 1e-6)
    return run.rows(run.chainage >= first - 0.5 * run.step)


def _with_choices(study: "Study", table: LineTable, runs: _Runs, remarks: list[str]) -> Line:
    """The history with limits, traffic, tampings and what is left out, section by section."""
    n, middle = len(runs.sd), 0.5 * (runs.chainage_from + runs.chainage_to)
    scenario = np.full(n, table.scenario or study.scenario_names[0], dtype=object)
    variant = np.full(n, table.variant or study.variant_names[0], dtype=object)
    limit, excluded = np.full(n, study.limit.sd_limit), np.full(n, "", dtype=object)
    for stretch in table.stretches:
        inside = (middle >= stretch.chainage_from_m) & (middle < stretch.chainage_to_m)
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
        float(sd_error), limit, scenario, variant, excluded,
    )  # fmt: skip
    return Line(history, tuple(remarks))


def _listed(name: str, faults: list[str]) -> str:
    return f"line.sd_file '{name}':\n" + "\n".join(f"  {fault}" for fault in faults)
