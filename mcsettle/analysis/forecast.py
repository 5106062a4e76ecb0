"""SDs on later days from SDs observed before: a predictive band, and whether it holds.

The posterior of the settlement factor and of which track it is (``posterior``) weighs every
realisation at every factor of a grid; the prediction for a day is the mixture of their SDs, each with
the error of a measurement. Observations held out are compared with it: in the long run as many must
fall inside a band as its level says.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq
from scipy.special import ndtr

from mcsettle.analysis.posterior import FACTORS, STAGE, fitted, sd_model
from mcsettle.errors import InputError
from mcsettle.estimate.estimate import LEVELS
from mcsettle.estimate.observation import Observation
from mcsettle.study.study import Study
from mcsettle.types import Progress, silent

LIGHT = 1e-9  # of the largest weight: factors and tracks below it are left out


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
    progress: Progress = silent,
    processes: int = 1,
) -> list[Prediction]:
    """Fit the factor to all but the last ``hold_out`` observations; predict every day observed.

    Raises
    ------
    InputError
        Nothing is left to fit to, or nothing is held out; or as ``posterior.infer_factor``.
    """
    if not 0 < hold_out < len(observations):
        raise InputError(
            f"{hold_out} of {len(observations)} observations held out; hold out at least one and "
            "leave at least one to fit to"
        )
    rows = sorted(observations, key=lambda o: o.day or 0.0)
    scene = study.scene(variant or study.variant_names[0], scenario)
    every = sd_model(scene, rows, progress, processes)
    progress(STAGE, 0, 2)
    posterior = fitted(every.of(every.observations[:-hold_out]), study.run.realisations)
    progress(STAGE, 1, 2)
    logs = np.linspace(posterior.middles[0], posterior.middles[-1], FACTORS[-1])
    sd = np.stack(every.predicted(logs, posterior.middles, study.run.realisations), axis=2)
    progress(STAGE, 2, 2)
    errors, observed = (np.array([getattr(o, of) for o in rows]) for of in ("error", "value"))
    bands = predicted(sd, posterior.track_weights, errors)
    shares = percentiles(sd, posterior.track_weights, errors, observed)
    return [
        Prediction(
            row.day or 0.0,
            tuple(bands[place].tolist()),
            row.value,
            place >= len(rows) - hold_out,
            float(shares[place]),
        )
        for place, row in enumerate(rows)
    ]


def percentiles(
    sd: np.ndarray, weights: np.ndarray, error: np.ndarray, observed: np.ndarray
) -> np.ndarray:
    """Share [D] of the prediction below ``observed`` [D]: the mixture's distribution function.

    ``sd`` [F, R, D], ``weights`` [F, R], ``error`` [D] of one measurement, all of one unit.
    """
    return np.einsum("fr,frd->d", weights, ndtr((observed - sd) / error))


def predicted(
    sd: np.ndarray, weights: np.ndarray, error: np.ndarray, levels: Sequence[float] = LEVELS
) -> np.ndarray:
    """Quantiles [D, L] of the prediction, by the roots of its distribution function."""
    heavy = weights > LIGHT * np.max(weights)
    shares = weights[heavy] / np.sum(weights[heavy])
    columns = zip(sd[heavy].T, error, strict=True)
    return np.array([[_quantile(c, shares, e, level) for level in levels] for c, e in columns])


def _quantile(sd: np.ndarray, shares: np.ndarray, error: float, level: float) -> float:
    finite = sd[np.isfinite(sd)]
    low, high = np.min(finite) - 10.0 * error, np.max(finite) + 10.0 * error

    def excess(x: float) -> float:
        return float(shares @ ndtr((x - sd) / error)) - level

    return float(high if excess(high) <= 0.0 else brentq(excess, low, high, xtol=1e-12))
