"""The dated runs of a line read from its files: tables of SDs, or records laid over one another."""

import io
from dataclasses import dataclass
from datetime import date
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from mcsettle.errors import InputError
from mcsettle.railway.dates import date_of
from mcsettle.railway.measured_profiles import RecordChoice, read_and_repaired, sections_of
from mcsettle.railway.record import Run
from mcsettle.railway.record_sections import Sections
from mcsettle.railway.run_alignment import aligned
from mcsettle.railway.text_files import SEPARATORS, decoded
from mcsettle.study.build import build_record
from mcsettle.study.input_files import digest_of
from mcsettle.study.schema.line import LineRunTable, LineTable
from mcsettle.units import MM

if TYPE_CHECKING:
    from mcsettle.study.study import Study

SD_COLUMNS = ("chainage_from_m", "chainage_to_m", "date", "sd_mm")
MOST_ROWS = 5_000_000


@dataclass(frozen=True, eq=False)
class LineRuns:
    """SDs [S, D] m and amplitudes [S, D, K] m of the sections of all tracks; NaN where not known.

    ``track`` [S] names, "" where there is one without a name.
    """

    track: np.ndarray
    chainage_from: np.ndarray
    chainage_to: np.ndarray
    dates: tuple[date, ...]
    sd: np.ndarray
    amplitudes: np.ndarray


@dataclass(frozen=True, eq=False)
class _Piece:
    """A stretch of one track on the grid of its latest record, and what its runs say of it."""

    track: str
    reference: Run
    sections: Sections
    sd: np.ndarray
    amplitudes: np.ndarray


def runs_from_sds(study: "Study", table: LineTable, name: str) -> tuple[LineRuns, list[str]]:
    """Sections of a table of dated SDs: one row for a section and a date."""
    path = study.locate(name)
    try:
        text = io.StringIO(decoded(path.read_bytes(), table.record.encoding))
        sign = SEPARATORS[table.record.separator]
        data = pd.read_csv(text, nrows=MOST_ROWS, sep=sign, decimal=table.record.decimal)
    except InputError as error:
        raise InputError(_listed(name, [str(error)])) from None
    except (OSError, ValueError) as error:
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
    data["track"] = data["track"].astype(str) if "track" in data else ""
    keys = ["track", "chainage_from_m", "chainage_to_m"]
    sd = data.pivot_table(index=keys, columns="date", values="sd_mm", aggfunc="mean").sort_index()
    sections = sd.index.to_frame()
    n_modes = len(study.wavenumbers)
    runs = LineRuns(
        sections["track"].to_numpy(dtype=object),
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


def runs_from_records(study: "Study", table: LineTable) -> tuple[LineRuns, list[str]]:
    """Sections of dated records of the level, each stretch on the chainage of its latest record."""
    entries, read, faults = sorted(table.runs, key=lambda run: run.date), [], []
    for entry in entries:
        try:
            read.append(_run(study, table, entry))
        except InputError as error:
            faults.append(f"line.runs, '{entry.file}' of {entry.date}: {error}")
    if faults:
        raise InputError("\n".join(faults))
    dates = tuple(dict.fromkeys(entry.date for entry in entries))
    pieces: list[_Piece] = []
    remarks: list[str] = []
    for entry, (run, choice) in reversed(list(zip(entries, read, strict=True))):
        track, window = entry.track or "", study.profile.window_m
        below = [p for p in pieces if p.track == track and _common(p.reference, run) >= window]
        for piece in below:
            remarks += _lay(study, table, piece, entry, run, choice, dates.index(entry.date))
        outside = run.length - sum(_common(piece.reference, run) for piece in below)
        if below and outside >= window:
            remarks.append(
                f"{outside:.4g} m of '{entry.file}' of {entry.date} lie beyond the later records of "
                "their track and are in no section"
            )
        if not below:
            sections = sections_of(run, window, study.wavenumbers, choice)
            shape = (len(sections.sd), len(dates))
            piece = _Piece(
                track, run, sections, np.full(shape, np.nan),
                np.full((*shape, len(study.wavenumbers)), np.nan, dtype=complex),
            )  # fmt: skip
            piece.sd[:, dates.index(entry.date)] = sections.sd
            piece.amplitudes[:, dates.index(entry.date)] = sections.amplitudes
            pieces.append(piece)
    order = list(dict.fromkeys(entry.track or "" for entry in table.runs))
    pieces.sort(key=lambda p: (order.index(p.track), float(p.sections.chainage_from[0])))
    runs = LineRuns(
        np.concatenate([np.full(len(p.sd), p.track, dtype=object) for p in pieces]),
        np.concatenate([p.sections.chainage_from for p in pieces]),
        np.concatenate([p.sections.chainage_to for p in pieces]),
        dates,
        np.concatenate([p.sd for p in pieces]),
        np.concatenate([p.amplitudes for p in pieces]),
    )
    return runs, remarks


def _common(reference: Run, run: Run) -> float:
    """Length [m] that both runs cover, by their chainage."""
    low = max(reference.chainage[0], run.chainage[0])
    return max(0.0, float(min(reference.chainage[-1], run.chainage[-1]) + run.step - low))


def _lay(
    study: "Study",
    table: LineTable,
    piece: _Piece,
    entry: LineRunTable,
    run: Run,
    choice: RecordChoice,
    place: int,
) -> list[str]:
    """Fill the run ``place`` of ``piece`` from ``run``, aligned; returns what was done, in words."""
    remarks, window = [], study.profile.window_m
    if table.align_within_m > 0.0:
        try:
            alignment = aligned(piece.reference, run, choice.band, table.align_within_m)
            run = alignment.run
            remarks.append(f"run of {entry.date} {alignment.text}")
        except InputError as error:
            remarks.append(f"run of {entry.date} is left as recorded: {error}")
    trimmed = _on_grid(run, float(piece.sections.begins[0]), window)
    if trimmed.length + trimmed.step < window:
        return remarks
    part = sections_of(trimmed, window, study.wavenumbers, choice)
    at = np.rint((piece.sections.begins - part.begins[0]) / window).astype(int)
    covered = (at >= 0) & (at < len(part.sd)) & np.isnan(piece.sd[:, place])
    piece.sd[covered, place] = part.sd[at[covered]]
    piece.amplitudes[covered, place] = part.amplitudes[at[covered]]
    return remarks


def _run(study: "Study", table: LineTable, entry: LineRunTable) -> tuple[Run, RecordChoice]:
    """One dated run, repaired as ``[line.record]`` says."""
    path = study.locate(entry.file)
    record = table.record.model_copy(update={"run": entry.run or table.record.run})
    profile = study.profile.model_copy(update={"file": entry.file, "record": record})
    choice = build_record(profile, path, digest_of(path, None))
    return read_and_repaired(choice)[1], choice


def _on_grid(run: Run, origin: float, window: float) -> Run:
    """``run`` from the first point on at which a section can begin: ``origin`` plus whole windows."""
    first = origin + window * np.ceil((run.chainage[0] - origin) / window - 1e-6)
    return run.rows(run.chainage >= first - 0.5 * run.step)


def _listed(name: str, faults: list[str]) -> str:
    return f"line.sd_file '{name}':\n" + "\n".join(f"  {fault}" for fault in faults)
