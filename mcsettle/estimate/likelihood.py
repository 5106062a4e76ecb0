"""Likelihood of observations of sections whose own track is unknown."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import pandas as pd
from scipy import special

from mcsettle.errors import InputError
from mcsettle.estimate.resampling import SetWeights, remembered
from mcsettle.study.schema.observed import ObservedTable
from mcsettle.study.study import Study

INTERVAL = "tamping_interval_days"


_MEDIAN_SPREAD = float(np.sqrt(0.5 * np.pi))  # standard error of a median, times √n, over the sd


@dataclass(frozen=True)
class Likelihood:
    """Log likelihoods of the observations, before the average over the tracks.

    ``sections``: of each section observed [E, R], NaN where failed. ``medians``: each median of several
    sections and the intervals [E, R] that it is compared with, days.
    """

    sections: tuple[np.ndarray, ...]
    medians: tuple[tuple[ObservedTable, np.ndarray], ...]

    @property
    def n_tracks(self) -> int:
        """Tracks R of every set."""
        parts = (*self.sections, *(days for _, days in self.medians))
        return int(parts[0].shape[1])

    def of_tracks(self, counts: np.ndarray) -> np.ndarray:
        """Log likelihood [B, E] of the sets where the tracks are there ``counts`` [B, R] times."""
        total: np.ndarray | float = self.of_sections(counts)
        for median in self.of_medians(counts):
            total = total + median.log_likelihood()
        return np.asarray(total)

    def of_sections(self, counts: np.ndarray) -> np.ndarray | float:
        """The part [B, E] of ``of_tracks`` by single sections; 0 without any."""
        return sum((_log_mean_of(logs, counts) for logs in self.sections), 0.0)

    def of_medians(self, counts: np.ndarray) -> Iterator["Median"]:
        """The medians of several sections as the resampled tracks [B, R] have them, [B, E]."""
        for entry, days in self.medians:
            if np.all(counts == 1.0):
                one = Median.of(entry, days)
                shape = (len(counts), len(days))
                parts = (np.broadcast_to(part, shape) for part in (one.middle, one.variance))
                yield Median(entry, *parts)
                continue
            drawn = (np.repeat(np.arange(days.shape[1]), row.astype(int)) for row in counts)
            found = [Median.of(entry, days[:, own]) for own in drawn]
            yield Median(
                entry, np.stack([m.middle for m in found]), np.stack([m.variance for m in found])
            )

    def weights(self) -> SetWeights:
        """Weights of the sets, computed anew for resampled tracks."""
        given = remembered(lambda counts: _relative(self.of_tracks(counts)))
        return SetWeights(given(np.ones((1, self.n_tracks)))[0], given, self.n_tracks)


def likelihood(
    study: Study,
    variant: str,
    realisations: pd.DataFrame,
    history: pd.DataFrame,
    stretch: np.ndarray | float = 0.0,
) -> Likelihood:
    """Likelihood of the study's observations, set by set and track by track; as ``conditioned``.

    ``stretch`` [E]: with all days of a set exp(stretch) times as long.
    """
    longer = np.reshape(np.exp(stretch), (-1, 1))
    own = realisations[realisations["variant"] == variant]
    sections, medians = [], []
    for entries in sections_of(study.observed):
        logs: np.ndarray | None = None
        for entry in entries:
            rows = own[own["scenario"] == entry.scenario]
            if rows.empty:
                raise InputError(f"scenario '{entry.scenario}' is observed and has no rows")
            if entry.sections > 1:
                medians.append((entry, longer * _days(rows)))
                continue
            if entry.is_interval:
                found = log_interval(entry, longer * _days(rows))
            else:
                past = history[
                    (history["variant"] == variant) & (history["scenario"] == entry.scenario)
                ]
                found = log_sd(entry, sd_on(past, rows, (entry.day or 0.0) / longer[:, 0]))
            logs = found if logs is None else logs + found
        if logs is not None:
            sections.append(logs)
    return Likelihood(tuple(sections), tuple(medians))


def _log_mean_of(logs: np.ndarray, counts: np.ndarray) -> np.ndarray:
    """``log_mean`` [B, E] of [E, R] where the tracks are there ``counts`` [B, R] times."""
    known = ~np.isnan(logs)
    filled = np.where(known, logs, -np.inf)
    highest = np.max(filled, axis=1)
    shift = np.where(np.isfinite(highest), highest, 0.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        total = counts @ np.exp(filled - shift[:, None]).T
        found = shift + np.log(total / (counts @ known.T.astype(float)))
    return np.where(total > 0.0, found, -np.inf)


def _relative(logs: np.ndarray) -> np.ndarray:
    """Weights [B, E] of log likelihoods, the largest of each row 1; zero where nothing is possible."""
    highest = np.max(logs, axis=1, keepdims=True)
    with np.errstate(invalid="ignore"):
        return np.where(highest > IMPOSSIBLE, np.exp(logs - highest), 0.0)


def sections_of(observed: tuple[ObservedTable, ...]) -> list[list[ObservedTable]]:
    """Observations by section of line; the median of several sections stands alone."""
    groups: dict[str, list[ObservedTable]] = {}
    alone = []
    for entry in observed:
        if entry.sections > 1:
            alone.append([entry])
        else:
            groups.setdefault(entry.section, []).append(entry)
    return [*groups.values(), *alone]


def log_interval(entry: ObservedTable, days: np.ndarray) -> np.ndarray:
    """Log likelihood of one section's interval, of each of ``days`` (inf: censored, NaN: failed)."""
    return _gauss(days, entry.tamping_interval_days or 0.0, entry.error_days or 1.0)


def log_sd(entry: ObservedTable, sd_mm: np.ndarray) -> np.ndarray:
    """Log likelihood of one observed SD, of each of ``sd_mm`` (NaN: failed)."""
    return _gauss(sd_mm, entry.sd_mm or 0.0, entry.sd_error_mm or 1.0)


def log_median(entry: ObservedTable, days: np.ndarray) -> np.ndarray:
    """Log likelihood [...] of the median interval of several sections, days [..., R]."""
    return Median.of(entry, days).log_likelihood()


@dataclass(frozen=True)
class Median:
    """A median of several sections observed, and what sets expect of its logarithm: [...]."""

    entry: ObservedTable
    middle: np.ndarray
    variance: np.ndarray

    @classmethod
    def of(cls, entry: ObservedTable, days: np.ndarray) -> "Median":
        """The expectation of sets with the intervals ``days`` [..., R].

        The median of the set's own R realisations is known no better than they allow; that is in
        the spread, and so in every conditioned band.
        """
        with np.errstate(invalid="ignore", divide="ignore"):
            logs = np.log(np.where(np.isnan(days), np.inf, days))
            ordered = np.sort(logs, axis=-1)
            n = days.shape[-1]
            low, middle, high = (ordered[..., min(n - 1, int(p * n))] for p in (0.16, 0.5, 0.84))
            upper = np.where(np.isfinite(high), high, 2.0 * middle - low)
            sd = np.maximum(0.5 * (upper - low), 1e-6)
            square = (_MEDIAN_SPREAD * sd) ** 2 * (1.0 / entry.sections + 1.0 / n)
            return cls(entry, middle, _of_error(entry) + square)

    def log_likelihood(self, stretch: np.ndarray | None = None) -> np.ndarray:
        """Log likelihood [...]; of days exp(``stretch`` [..., G]) times as long, [..., G]."""
        middle, variance = self.middle, self.variance
        if stretch is not None:
            middle, variance = middle[..., None] + stretch, variance[..., None]
        observed = self.entry.tamping_interval_days or 1.0
        with np.errstate(invalid="ignore"):
            square = (middle - np.log(observed)) ** 2 / variance
            found = -0.5 * (square + np.log(variance / _of_error(self.entry)))
        return np.where(np.isfinite(middle), found, -np.inf)


def _of_error(entry: ObservedTable) -> float:
    """Square of the relative error of an observed interval."""
    return ((entry.error_days or 1.0) / (entry.tamping_interval_days or 1.0)) ** 2


def log_mean(logs: np.ndarray) -> np.ndarray:
    """Logarithm of the mean of exp over the last axis; NaN (failed) is left out."""
    n = np.sum(~np.isnan(logs), axis=-1)
    with np.errstate(divide="ignore"):
        total = special.logsumexp(np.where(np.isnan(logs), -np.inf, logs), axis=-1)
        return np.asarray(np.where(n > 0, total - np.log(np.maximum(n, 1)), -np.inf))


def _gauss(values: np.ndarray, observed: float, error: float) -> np.ndarray:
    """−½ ((value − observed) / error)²; −inf beyond any reach, NaN where failed."""
    with np.errstate(invalid="ignore"):
        return np.where(np.isinf(values), -np.inf, -0.5 * ((values - observed) / error) ** 2)


IMPOSSIBLE = -1e4  # log likelihood of observations a hundred standard errors off


def sd_on(history: pd.DataFrame, rows: pd.DataFrame, day: np.ndarray | float) -> np.ndarray:
    """SD [E, R] mm of every realisation on ``day`` (of each set: [E]), linear between the days recorded.

    Beyond its last day (the limit) a track goes on as steeply as it came there: what is observed
    there was not tamped either.
    """
    keys = ["parameter_set", "realisation"]
    order = rows.sort_values(keys)
    ordered = history.sort_values([*keys, "day"])
    days, sd = ordered["day"].to_numpy(), ordered["sd_mm"].to_numpy()
    names = ordered[keys].to_numpy()
    starts = np.flatnonzero(np.any(np.diff(names, axis=0, prepend=-1) != 0, axis=1))
    ends = np.append(starts[1:], len(names))
    held = {tuple(names[a]): slice(a, b) for a, b in zip(starts, ends, strict=True)}
    n_sets = order["parameter_set"].nunique()
    wanted = np.repeat(np.broadcast_to(day, n_sets), len(order) // n_sets)
    parts = (held.get(tuple(key)) for key in order[keys].to_numpy())
    values = [
        np.nan if part is None else _at(days[part], sd[part], float(on))
        for part, on in zip(parts, wanted, strict=True)
    ]
    return np.array(values).reshape(n_sets, -1)


def _at(days: np.ndarray, sd: np.ndarray, day: float) -> float:
    if day <= days[-1] or len(days) < 2:
        return float(np.interp(day, days, sd))
    slope = (sd[-1] - sd[-2]) / (days[-1] - days[-2])
    return float(sd[-1] + slope * (day - days[-1]))


def _days(rows: pd.DataFrame) -> np.ndarray:
    """Intervals [E, R] days; inf where censored, NaN where failed."""
    order = rows.sort_values(["parameter_set", "realisation"])
    days = order[INTERVAL].to_numpy(dtype=float, na_value=np.nan)
    censored = (order["status"] == "censored").to_numpy()
    return np.where(censored, np.inf, days).reshape(order["parameter_set"].nunique(), -1)
