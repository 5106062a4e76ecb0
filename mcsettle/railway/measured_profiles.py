"""Ensembles of initial profiles around a measured record.

What is random is chosen: nothing but measurement noise (``section``), the phases at the section's
own spectrum (``phases``), or the place on the line (``sections``: realisation r is section r). As
everywhere, a realisation is addressed by (seed, index).
"""

import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

import numpy as np

from mcsettle.errors import InputError
from mcsettle.railway.filters import Band, versine_loss
from mcsettle.railway.irregularity import random_amplitudes
from mcsettle.railway.read_record import RecordFormat, read_runs
from mcsettle.railway.record import Run, chosen_run
from mcsettle.railway.record_findings import Finding, findings, repaired, to_repair
from mcsettle.railway.record_sections import Sections, cut, worse_rail
from mcsettle.railway.spectra import fra
from mcsettle.railway.text_files import refused

_NOISE_STREAM = 0x4E015E  # keeps the noise apart from the phases
_PHASE_STREAM = 0x9A5E


@dataclass(frozen=True)
class RecordChoice:
    """A record and what is taken of it: everything that decides the sections.

    ``path`` of the file and its ``digest`` (SHA-256); ``run`` None for the first; ``repair`` names
    the findings to repair; gaps up to ``longest_gap`` [m] are bridged.
    """

    path: Path
    digest: str
    layout: RecordFormat
    run: str | None
    repair: tuple[str, ...]
    longest_gap: float
    band: Band


@dataclass(frozen=True)
class Record:
    """A record made ready: the run as it was read, what was found in it, its sections.

    ``remarks``: what the way of measuring leaves out, and what is left over at the end.
    """

    run: Run
    findings: tuple[Finding, ...]
    sections: Sections
    remarks: tuple[str, ...] = ()


def prepared(choice: RecordChoice, window: float, wavenumbers: np.ndarray) -> Record:
    """Read, repair, filter and cut the record of ``choice``; kept for the next call.

    Raises
    ------
    InputError
        Whatever the record does not allow.
    """
    return _prepared(choice, window, tuple(float(k) for k in wavenumbers))


@lru_cache(maxsize=4)
def _prepared(choice: RecordChoice, window: float, wavenumbers: tuple[float, ...]) -> Record:
    run, valid = read_and_repaired(choice)
    found = tuple(findings(run))
    sections = sections_of(valid, window, np.array(wavenumbers), choice)
    return Record(run, found, sections, tuple(_remarks(sections, window, choice)))


def sections_of(run: Run, window: float, wavenumbers: np.ndarray, choice: RecordChoice) -> Sections:
    """Sections of a repaired ``run``; of two rails the worse one, section by section."""
    chord = choice.layout.versine_chord_m
    sections = cut(run, window, wavenumbers, choice.band, chord)
    if run.other_rail is None:
        return sections
    other = replace(run, level=run.other_rail)
    return worse_rail(sections, cut(other, window, wavenumbers, choice.band, chord))


def read_and_repaired(choice: RecordChoice) -> tuple[Run, Run]:
    """The run of ``choice`` as it is in the file, and repaired.

    Raises
    ------
    InputError
        Lists the faults of the file and what has to be repaired in the rows that can be read.
    """
    runs, faults = read_runs(choice.path, choice.layout)
    if faults:
        if runs:
            try:
                unrepaired = to_repair(chosen_run(runs, choice.run), choice.repair)
            except InputError as error:
                unrepaired = str(error)
            faults += [] if unrepaired is None else [f"as far as it can be read, {unrepaired}"]
        raise refused(choice.path, faults)
    run = chosen_run(runs, choice.run)
    return run, repaired(run, choice.repair, choice.longest_gap)


def _remarks(sections: Sections, window: float, choice: RecordChoice) -> Iterator[str]:
    """What is left over at the end of a record, filtered twice, or not shown by its chord."""
    last = float((sections.ends[-1] - sections.starts[-1]) * sections.step)
    if last < window * (1.0 - 1e-9):
        yield (
            f"the last section is {last:.4g} m long ({sections.chainage_from[-1]:.6g} to "
            f"{sections.chainage_to[-1]:.6g} m): its SD is that of this piece, its shape that of the "
            f"last {window:g} m"
        )
    if sections.left_over > sections.step:
        yield (
            f"{sections.left_over:.4g} m at the end (from {sections.chainage_to[-1]:.6g} m on) are in "
            "no section: they are shorter than two of the longest waves"
        )
    column = choice.layout.level_column
    if re.search(r"(?<![A-Za-z0-9])D1(?![A-Za-z0-9])", column) and not choice.band.passed:
        yield (
            f"the column '{column}' is band-passed to D1 (3 to 25 m) by its name, and is filtered again: "
            "say already_filtered = 'en13848_d1', shortest_m = 3, longest_m = 25"
        )
    chord = choice.layout.versine_chord_m
    if chord is not None:
        share, waves = versine_loss(chord, choice.band, lambda k: fra(k, 1.0))
        lengths = " and ".join(f"{wave:.3g}" for wave in waves[:4]) or "none"
        yield (
            f"offsets from chords of {chord:g} m show nothing of waves of {lengths} m: {share:.1%} of "
            "the variance in the band is lost on an FRA spectrum, and noise is enlarged beside them"
        )


def ensemble(
    sections: Sections, kind: str, section: int, noise: float, seed: int, indices: Iterable[int]
) -> np.ndarray:
    """Initial amplitudes complex [R, K] m of the realisations ``indices``.

    Parameters
    ----------
    sections : Sections
    kind : str
        ``section``, ``phases`` or ``sections``.
    section : int
        Which section, from 1 (not with ``sections``).
    noise : float, m
        SD of the measurement's error in the band: added to every realisation, alike at every
        wavelength. The SD of the measured section contains one such error already.
    seed : int
    indices : iterable of int

    Raises
    ------
    InputError
        No such section, or more realisations than sections where nothing else tells them apart.
    """
    wanted = list(indices)
    n = len(sections.sd)
    if kind == "sections":
        if wanted and max(wanted) >= n and noise == 0.0:
            raise InputError(
                f"the record has {n} sections, and realisation {max(wanted)} is asked for: with "
                f"ensemble = 'sections' ask for at most {n} realisations, or give noise_mm"
            )
        rows = [sections.amplitudes[index % n] for index in wanted]
    else:
        if not 1 <= section <= n:
            raise InputError(f"section {section} is asked for; the record has 1 to {n}")
        rows = [sections.amplitudes[section - 1]] * len(wanted)
    profiles = np.array(rows).reshape(len(wanted), sections.amplitudes.shape[1])
    if kind == "phases":
        turns = [random_amplitudes(seed ^ _PHASE_STREAM, i, profiles.shape[1]) for i in wanted]
        profiles = np.array(
            [np.abs(row) * turn / np.abs(turn) for row, turn in zip(profiles, turns, strict=True)]
        ).reshape(profiles.shape)
    if noise > 0.0:
        flat = noise / np.sqrt(profiles.shape[1])
        profiles = profiles + flat * np.array(
            [random_amplitudes(seed ^ _NOISE_STREAM, i, profiles.shape[1]) for i in wanted]
        ).reshape(profiles.shape)
    return profiles
