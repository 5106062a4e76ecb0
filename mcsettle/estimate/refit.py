"""What a fitted factor would have been on other tracks: errors of ensembles whose sets fit their own.

Each set draws its factor from what the observations leave of it on its own tracks (``factor_fit``).
Tracks that happen to last long get a higher factor, so that the intervals come out much as before: a
resample that kept the factors would count a variation that the fit takes away. To first order another
factor stretches time: all days of a set are multiplied by exp(δ), in every scenario alike. With the
likelihood L of the observations as a function of δ,

    shift(e, counts) = mean of δ under L(δ; e, counts) − the same on the tracks as they are,

is how far the fit of set e would have moved on resampled tracks, and the integral of L over δ the
evidence, in proportion to which the weight of the set changes. The prior is taken as flat in log(factor)
across the posterior.
"""

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from mcsettle.estimate.conditioning import FIT_TRACKS
from mcsettle.estimate.likelihood import Likelihood, likelihood
from mcsettle.estimate.observation import Course, Observation
from mcsettle.estimate.resampling import SetWeights, remembered

POINTS = 25  # of the grid of δ of each set
REACH = 6.0  # standard deviations of the posterior on each side
WIDEST, PASSES = 3.0, 4  # half-width of the first grid in δ; grids, the last of which is kept
LARGEST = 4_000_000  # numbers held at a time


def refitted_weights(
    observations: Sequence[Observation], courses: Mapping[str, Course], values: np.ndarray
) -> SetWeights:
    """The weights ``values`` of a variant whose sets have fitted their factors, and their shifts.

    Parameters
    ----------
    observations : Observation
    courses : by scenario, of the factors as fitted
    values : ndarray, shape [E], by the evidence of the fits
    """
    n_tracks = next(iter(courses.values())).days.shape[1]
    fitted_on = {name: course.first(FIT_TRACKS) for name, course in courses.items()}

    def at(stretch: np.ndarray) -> Likelihood:
        return likelihood(observations, fitted_on, stretch)

    return weights_of_fits(at, values, n_tracks)


def weights_of_fits(
    at: Callable[[np.ndarray], Likelihood], values: np.ndarray, n_tracks: int
) -> SetWeights:
    """``refitted_weights`` for a likelihood by days that are exp(δ) as long, ``at(δ [E])``."""
    grid = _grid(at, len(values))
    base, along = at(np.zeros(len(values))), [at(delta) for delta in grid.T]

    def fits_of(counts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Posterior mean of δ, and log evidence, both [B, E]."""
        own = counts[:, :FIT_TRACKS]
        step = max(1, LARGEST // grid.size)
        parts = [_fits(base, along, grid, own[b : b + step]) for b in range(0, len(own), step)]
        means, logs = (np.concatenate(part) for part in zip(*parts, strict=True))
        return means, logs

    fits = remembered(fits_of)
    first = [part[0] for part in fits(np.ones((1, n_tracks)))]

    def of_tracks(counts: np.ndarray) -> np.ndarray:
        with np.errstate(invalid="ignore"):
            change = fits(counts)[1] - first[1]
        return np.asarray(values * np.exp(np.where(np.isfinite(change), change, -np.inf)))

    def shift_of(counts: np.ndarray) -> np.ndarray:
        return np.nan_to_num(fits(counts)[0] - first[0])

    return SetWeights(values, of_tracks, n_tracks, shift_of)


def _grid(at: Callable[[np.ndarray], Likelihood], n_sets: int) -> np.ndarray:
    """Values of δ [E, G] across the posterior of every set on its tracks as they are."""
    centre, half = np.zeros(n_sets), np.full(n_sets, WIDEST)
    unit = np.linspace(-1.0, 1.0, POINTS)
    for _ in range(PASSES - 1):
        grid = centre[:, None] + half[:, None] * unit
        logs = np.stack([at(delta).plain() for delta in grid.T], axis=1)
        mean, _, sd = _moments(grid, logs)
        sound = np.isfinite(mean)  # else no factor brings the set near the observations
        centre = np.where(sound, mean, centre)
        half = np.where(sound, np.maximum(REACH * sd, 3.0 * half / (POINTS - 1)), half)
    return centre[:, None] + half[:, None] * unit


def _fits(
    base: Likelihood, along: Sequence[Likelihood], grid: np.ndarray, counts: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Posterior mean and log evidence [B, E] where tracks count ``counts``.

    ``along`` are the likelihoods at every δ of the grid [E, G], ``base`` that of the days as they are.
    """
    logs = np.zeros((len(counts), *grid.shape))
    for g, found in enumerate(along):
        logs[:, :, g] = found.of_sections(counts)
    for median in base.of_medians(counts):
        logs += median.log_likelihood(grid)
    mean, log_evidence, _ = _moments(grid, logs)
    return mean, log_evidence


def _moments(grid: np.ndarray, logs: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Mean, log integral (up to a constant) and standard deviation of δ, over the last axis.

    NaN and −inf where no δ makes the observations possible.
    """
    highest = np.max(logs, axis=-1, keepdims=True)
    with np.errstate(invalid="ignore", divide="ignore"):
        density = np.exp(np.where(np.isfinite(highest), logs - highest, -np.inf))
        total = np.sum(density, axis=-1)
        mean = np.sum(density * grid, axis=-1) / total
        sd = np.sqrt(np.sum(density * (grid - mean[..., None]) ** 2, axis=-1) / total)
        return mean, np.where(total > 0.0, highest[..., 0] + np.log(total), -np.inf), sd
