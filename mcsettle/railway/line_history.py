"""The sections of a line and how their SDs went: dated runs, tampings, limits, what is left out."""

import itertools
from dataclasses import dataclass, replace
from datetime import date

import numpy as np

TOUCHING = 1.0  # m, between sections that follow one another


@dataclass(frozen=True, eq=False)
class LineHistory:
    """S sections in the order of the line, D dated runs.

    ``chainage_from``, ``chainage_to`` [S] m; ``dates`` [D] rising; ``sd`` [S, D] m, NaN where a run does
    not cover a section; ``amplitudes`` complex [S, D, K] m of the profiles, NaN where only an SD is
    known; ``tamped_on`` [S, D]: day (as ``date.toordinal``) of the last tamping between run d − 1 and run
    d, NaN without one; ``sd_error`` m, the standard error of one SD. ``sd_limit`` [S] m; ``scenario``,
    ``variant`` [S] names; ``excluded`` [S] why a section is left out, "" for none; ``track`` [S] names.
    """

    chainage_from: np.ndarray
    chainage_to: np.ndarray
    dates: tuple[date, ...]
    sd: np.ndarray
    amplitudes: np.ndarray
    tamped_on: np.ndarray
    sd_error: float
    sd_limit: np.ndarray
    scenario: np.ndarray
    variant: np.ndarray
    excluded: np.ndarray
    track: np.ndarray

    @property
    def days(self) -> np.ndarray:
        """Days [D] since the first run."""
        first = self.dates[0].toordinal()
        return np.array([float(d.toordinal() - first) for d in self.dates])

    @property
    def lengths(self) -> np.ndarray:
        """Lengths [S] m of the sections."""
        return self.chainage_to - self.chainage_from

    @property
    def spans(self) -> np.ndarray:
        """Number [S, D] of tampings before each run, counted from the first run: runs of one span."""
        return np.cumsum(~np.isnan(self.tamped_on), axis=1)

    @property
    def last_sd(self) -> np.ndarray:
        """The SD [S] m of each section's last run; NaN where there is none."""
        return _last(self.sd)

    @property
    def stretches(self) -> list[slice]:
        """Sections that follow one another without a gap, on one track."""
        apart = np.abs(self.chainage_from[1:] - self.chainage_to[:-1]) > TOUCHING
        apart |= self.track[1:] != self.track[:-1]
        ends = [0, *(np.flatnonzero(apart) + 1).tolist(), len(self.chainage_from)]
        return [slice(low, high) for low, high in itertools.pairwise(ends)]

    def before_last(self) -> "LineHistory":
        """The same line without its last run."""
        return replace(
            self,
            dates=self.dates[:-1],
            sd=self.sd[:, :-1],
            amplitudes=self.amplitudes[:, :-1],
            tamped_on=self.tamped_on[:, :-1],
        )


def _last(values: np.ndarray) -> np.ndarray:
    """The last number [S] of each row [S, D] that is not NaN."""
    known = ~np.isnan(values)
    at = values.shape[1] - 1 - np.argmax(known[:, ::-1], axis=1)
    return np.where(known.any(axis=1), values[np.arange(len(values)), at], np.nan)


def detected_tampings(sd: np.ndarray, sd_error: float, least_drop: float) -> np.ndarray:
    """Whether [S, D] an SD fell so far since the run before that the section must have been tamped.

    By more than four standard errors of a difference, and by the share ``least_drop`` of the SD.
    """
    drop = np.full(sd.shape, -np.inf)
    drop[:, 1:] = sd[:, :-1] - sd[:, 1:]
    before = np.concatenate([np.full((len(sd), 1), np.inf), sd[:, :-1]], axis=1)
    with np.errstate(invalid="ignore"):
        return (drop > 4.0 * np.sqrt(2.0) * sd_error) & (drop > least_drop * before)


def sd_error_of(sd: np.ndarray, days: np.ndarray, spans: np.ndarray, repeat_days: float) -> float:
    """Standard error [m] of one SD, from runs of one span at most ``repeat_days`` apart.

    Without such repeats, from the scatter of spans of three runs and more about straight lines, which
    counts curvature as error. NaN where neither is there.
    """
    close = np.diff(days) <= repeat_days
    same = spans[:, 1:] == spans[:, :-1]
    differences = np.diff(sd, axis=1)[same & close[None, :]]
    differences = differences[~np.isnan(differences)]
    if len(differences) >= 5:
        return float(np.sqrt(np.mean(differences**2) / 2.0))
    squares, freedom = 0.0, 0
    for row, span in zip(sd, spans, strict=True):
        for number in np.unique(span):
            known = (span == number) & ~np.isnan(row)
            if known.sum() >= 3:
                x, y = days[known], row[known]
                squares += float(np.sum((y - np.polyval(np.polyfit(x, y, 1), x)) ** 2))
                freedom += int(known.sum()) - 2
    return float(np.sqrt(squares / freedom)) if freedom >= 5 else float("nan")
