"""SDs on later days from SDs observed before: a predictive band, and whether it holds.

The posterior of the settlement factor and of which track it is (``inference``) weighs every
realisation at every factor of a grid; the prediction for a day is the mixture of their SDs, each with
the error of a measurement. Observations held out are compared with it: in the long run as many must
fall inside a band as its level says.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import ndtr

from mcsettle.analysis.posterior import (
    FIRST_REACH,
    HIGHEST,
    LOWEST,
    Ensemble,
    least_squares,
    posterior_grid,
)
from mcsettle.errors import InputError
from mcsettle.estimate.observation import Observation
from mcsettle.study.study import Study
from mcsettle.types import Progress
from mcsettle.units import MM

LEVELS = (0.05, 0.5, 0.95)
HALVINGS = 60


@dataclass(frozen=True)
class Prediction:
    """One day: predicted SD at ``LEVELS``, what was observed, whether it was held out, in mm.

    ``percentile``: share of the prediction below the observation.
    """

    day: float
    quantiles: tuple[float, ...]
    observed: float
    held_out: bool
    percentile: float

    @property
    def inside(self) -> bool:
        """Whether the observation lies in the band of 90 %."""
        return LEVELS[0] <= self.percentile <= LEVELS[-1]


def forecast(
    study: Study,
    scenario: str,
    observations: Sequence[Observation],
    hold_out: int,
    variant: str | None = None,
    progress: Progress | None = None,
    processes: int = 1,
) -> list[Prediction]:
    """Fit the factor to all but the last ``hold_out`` observations; predict every day observed.

    Raises
    ------
    InputError
        Nothing is left to fit to, or nothing is held out; or as ``inference.infer_factor``.
    """
    if not 0 < hold_out < len(observations):
        raise InputError(
            f"--hold-out {hold_out} of {len(observations)} observations; hold out at least one and "
            "leave at least one to fit to"
        )
    name = variant or study.variant_names[0]
    rows = tuple(sorted(observations, key=lambda o: o.day or 0.0))
    fitted = Ensemble(study, scenario, name, rows[:-hold_out], progress, processes)
    logs, weights, _ = posterior_grid(fitted, least_squares(fitted), FIRST_REACH)
    if logs[0] < np.log(LOWEST) or logs[-1] > np.log(HIGHEST):
        raise InputError(
            "the observations that are left to fit to do not tell the factor from none at all: hold out "
            "fewer, or wait for growth beyond their errors"
        )
    whole = Ensemble(study, scenario, name, rows, progress, processes)
    sd = whole.on(logs)
    errors = np.array([row.error for row in rows]) * MM
    bands = predicted(sd, weights, errors)
    observed = np.array([row.value for row in rows]) * MM
    shares = percentiles(sd, weights, errors, observed)
    return [
        Prediction(
            row.day or 0.0,
            tuple(float(q) / MM for q in bands[place]),
            row.value,
            place >= len(rows) - hold_out,
            float(shares[place]),
        )
        for place, row in enumerate(rows)
    ]


def posterior_weights(sd: np.ndarray, observed: np.ndarray, error: np.ndarray) -> np.ndarray:
    """Weights [F, R], adding up to 1, of factors and tracks with SDs ``sd`` [F, R, O] m.

    Gaussian errors [O] m of the observations [O] m, factors and tracks alike before.
    """
    misses = np.clip((sd - observed) / error, -1e6, 1e6)
    square = np.sum(misses**2, axis=2)
    weights = np.exp(-0.5 * (square - np.min(square)))
    return np.asarray(weights / np.sum(weights))


def percentiles(
    sd: np.ndarray, weights: np.ndarray, error: np.ndarray, observed: np.ndarray
) -> np.ndarray:
    """Share [D] of the prediction below ``observed`` [D] m: the mixture's distribution function.

    ``sd`` [F, R, D] m, ``weights`` [F, R], ``error`` [D] m of one measurement.
    """
    return np.einsum("fr,frd->d", weights, ndtr((observed - sd) / error))


def predicted(
    sd: np.ndarray, weights: np.ndarray, error: np.ndarray, levels: Sequence[float] = LEVELS
) -> np.ndarray:
    """Quantiles [D, L] m of the prediction, by halving intervals of its distribution function."""
    known = np.where(np.isfinite(sd), sd, np.nan)
    bottom = np.nanmin(known, axis=(0, 1)) - 10.0 * error
    top = np.nanmax(known, axis=(0, 1)) + 10.0 * error
    found = np.empty((sd.shape[2], len(levels)))
    for place, level in enumerate(levels):
        low, high = bottom.copy(), top.copy()
        for _ in range(HALVINGS):
            middle = 0.5 * (low + high)
            below = percentiles(sd, weights, error, middle) < level
            low, high = np.where(below, middle, low), np.where(below, high, middle)
        found[:, place] = 0.5 * (low + high)
    return found
