"""Likelihood of observations of sections whose own track is unknown."""

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from mcsettle.errors import InputError
from mcsettle.estimate.observation import Course, Observation, by_section
from mcsettle.estimate.resampling import SetWeights, remembered

IMPOSSIBLE = -1e4  # log likelihood of observations a hundred standard errors off
_MEDIAN_SPREAD = float(np.sqrt(0.5 * np.pi))  # standard error of a median, times √n, over the sd


@dataclass(frozen=True)
class Likelihood:
    """Log likelihoods of the observations, before the average over the tracks.

    ``sections``: of each section observed [E, R], NaN where failed. ``medians``: each median of several
    sections and the intervals [E, R] that it is compared with, days.
    """

    sections: tuple[np.ndarray, ...]
    medians: tuple[tuple[Observation, np.ndarray], ...]

    @property
    def n_tracks(self) -> int:
        """Tracks R of every set."""
        parts = (*self.sections, *(days for _, days in self.medians))
        return int(parts[0].shape[1])

    def plain(self) -> np.ndarray:
        """Log likelihood [E] of the sets on their tracks as they are."""
        return self.of_tracks(np.ones((1, self.n_tracks)))[0]

    def of_tracks(self, counts: np.ndarray) -> np.ndarray:
        """Log likelihood [B, E] of the sets where the tracks are there ``counts`` [B, R] times."""
        total: np.ndarray | float = self.of_sections(counts)
        for median in self.of_medians(counts):
            total = total + median.log_likelihood()
        return np.asarray(total)

    def of_sections(self, counts: np.ndarray) -> np.ndarray | float:
        """The part [B, E] of ``of_tracks`` by single sections; 0 without any."""
        return sum((log_mean(logs, counts) for logs in self.sections), 0.0)

    def of_medians(self, counts: np.ndarray) -> Iterator["Median"]:
        """The medians of several sections as the resampled tracks [B, R] have them, [B, E]."""
        for observation, days in self.medians:
            if np.all(counts == 1.0):
                one = Median.of(observation, days)
                shape = (len(counts), len(days))
                parts = (np.broadcast_to(part, shape) for part in (one.middle, one.variance))
                yield Median(observation, *parts)
                continue
            drawn = (np.repeat(np.arange(days.shape[1]), row.astype(int)) for row in counts)
            medians = [Median.of(observation, days[:, tracks]) for tracks in drawn]
            yield Median(
                observation,
                np.stack([m.middle for m in medians]),
                np.stack([m.variance for m in medians]),
            )

    def weights(self) -> SetWeights:
        """Weights of the sets, computed anew for resampled tracks."""
        given = remembered(lambda counts: relative_weights(self.of_tracks(counts)))
        return SetWeights(given(np.ones((1, self.n_tracks)))[0], given, self.n_tracks)


def likelihood(
    observations: Iterable[Observation],
    courses: Mapping[str, Course],
    stretch: np.ndarray | float = 0.0,
) -> Likelihood:
    """Likelihood of observations, set by set and track by track.

    Parameters
    ----------
    observations : Observation
    courses : by scenario, what the sets make of it
    stretch : shape [E]; with all days of a set exp(stretch) times as long

    Raises
    ------
    InputError
        A scenario observed has no rows.
    """
    observations = tuple(observations)
    for observation in observations:
        if observation.scenario not in courses:
            raise InputError(f"scenario '{observation.scenario}' is observed and has no rows")
    return likelihood_of(observations, lambda o: courses[o.scenario].predicted(o, stretch))


def likelihood_of(
    observations: Iterable[Observation], predicted: Callable[[Observation], np.ndarray]
) -> Likelihood:
    """Likelihood of observations whose days or SDs [mm], [E, R], a model has ``predicted``."""
    sections, medians = [], []
    for group in by_section(observations):
        if group[0].sections > 1:
            medians.append((group[0], predicted(group[0])))
        else:
            sections.append(np.sum([log_of(o, predicted(o)) for o in group], axis=0))
    return Likelihood(tuple(sections), tuple(medians))


def log_mean(logs: np.ndarray, counts: np.ndarray) -> np.ndarray:
    """Logarithm [B, E] of the mean of exp over the tracks of [E, R]; NaN (failed) is left out.

    ``counts`` [B, R]: how often each track is there.
    """
    known = ~np.isnan(logs)
    filled = np.where(known, logs, -np.inf)
    highest = np.max(filled, axis=1)
    shift = np.where(np.isfinite(highest), highest, 0.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        total = counts @ np.exp(filled - shift[:, None]).T
        means = shift + np.log(total / (counts @ known.T.astype(float)))
    return np.where(total > 0.0, means, -np.inf)


def relative_weights(logs: np.ndarray) -> np.ndarray:
    """Weights [B, E] of log likelihoods, the largest of each row 1; zero where nothing is possible."""
    highest = np.max(logs, axis=1, keepdims=True)
    with np.errstate(invalid="ignore"):
        return np.where(highest > IMPOSSIBLE, np.exp(logs - highest), 0.0)


def log_of(observation: Observation, values: np.ndarray) -> np.ndarray:
    """Log likelihood of what was seen of one section, of each of ``values``.

    −½ ((value − observed) / error)²; −inf where censored (inf), NaN where failed.
    """
    with np.errstate(invalid="ignore"):
        square = ((values - observation.value) / observation.error) ** 2
        return np.where(np.isinf(values), -np.inf, -0.5 * square)


@dataclass(frozen=True)
class Median:
    """A median of several sections observed, and what sets expect of its logarithm: [...]."""

    observation: Observation
    middle: np.ndarray
    variance: np.ndarray

    @classmethod
    def of(cls, observation: Observation, days: np.ndarray) -> "Median":
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
            square = (_MEDIAN_SPREAD * sd) ** 2 * (1.0 / observation.sections + 1.0 / n)
            return cls(observation, middle, _relative_square(observation) + square)

    def log_likelihood(self, stretch: np.ndarray | None = None) -> np.ndarray:
        """Log likelihood [...]; of days exp(``stretch`` [..., G]) times as long, [..., G]."""
        middle, variance = self.middle, self.variance
        if stretch is not None:
            middle, variance = middle[..., None] + stretch, variance[..., None]
        observed = self.observation.value
        with np.errstate(invalid="ignore"):
            square = (middle - np.log(observed)) ** 2 / variance
            logs = -0.5 * (square + np.log(variance / _relative_square(self.observation)))
        return np.where(np.isfinite(middle), logs, -np.inf)


def _relative_square(observation: Observation) -> float:
    """Square of the relative error of an observed interval."""
    return (observation.error / observation.value) ** 2
