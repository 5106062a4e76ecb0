"""Errors of a surrogate in days and effects: every training ground predicted from the others."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from multiprocessing import parent_process

import numpy as np

from mcsettle.estimate.weighted_quantiles import weighted_quantiles
from mcsettle.railway.scene import Scene
from mcsettle.step_a.transfer import TransferFunctions
from mcsettle.step_a.transfers import StepA
from mcsettle.step_b.build_case import build_case
from mcsettle.step_b.case import support_of
from mcsettle.step_b.cycle_jump import CycleJump

TRACKS = range(16)  # on which days are compared
TOLERANCE = 1e-5  # of these days
LEVEL = 0.95

Transfers = Mapping[tuple[str, str], tuple[TransferFunctions, ...]]
Days = dict[tuple[str, str], np.ndarray]  # by variant and scenario, of each track


@dataclass(frozen=True, eq=False)
class LeftOut:
    """One training ground predicted from the others.

    ``deviation``: the largest of its passages as ``kriging`` gives it; ``days`` [n] relative errors in
    percent, ``points`` [m] errors of the reduction of the interval in percentage points.
    """

    deviation: float
    days: np.ndarray
    points: np.ndarray


@dataclass(frozen=True)
class Quantiles:
    """Errors of a population of grounds: medians and 95 % quantiles, in percent and in points."""

    days_median: float
    days_p95: float
    points_p95: float


def left_out(exact: Days, predicted: Days, deviation: float, baseline: str) -> LeftOut:
    """Errors of days of the same tracks by predicted transfer functions.

    ``baseline``: scenario with which effects compare the others of its variant.
    """
    days, points = [], []
    both = {pair: np.stack([exact[pair], predicted[pair]]) for pair in exact}
    for (variant, scenario), of_pair in both.items():
        days.append(100.0 * np.abs(of_pair[1] / of_pair[0] - 1.0))
        base = both.get((variant, baseline))
        if base is not None and scenario != baseline:
            reduction = 100.0 * (1.0 - of_pair / base)
            points.append(np.abs(reduction[1] - reduction[0]))
    return LeftOut(deviation, _finite(days), _finite(points))


def days_of(scenes: Sequence[Scene], transfers: Transfers) -> Days:
    """Days to the limit in every scene that has ``transfers``."""
    pairs = {(scene.variant, scene.scenario): scene for scene in scenes}
    return {pair: intervals_of(pairs[pair], transfers) for pair in pairs if pair in transfers}


def days_anywhere(scenes: Sequence[Scene], transfers: Transfers) -> Days:
    """``days_of`` in whatever process, a spawned one on one core."""
    if parent_process() is not None:
        from mcsettle.kernels import runtime

        runtime.start(1)
    return days_of(scenes, transfers)


def intervals_of(scene: Scene, transfers: Transfers, tracks: range = TRACKS) -> np.ndarray:
    """Days [R] to the limit of the realisations ``tracks``; NaN where the horizon comes first."""
    case = build_case(scene, StepA(dict(transfers)))
    profiles = scene.profiles.sample(tracks)
    support = support_of(scene, tracks, profiles)
    engine = CycleJump(case, tolerance=TOLERANCE)
    return engine.run(profiles, np.zeros(0), support=support).days


def quantiles(errors: Sequence[LeftOut], shares: np.ndarray) -> Quantiles:
    """Quantiles over grounds that stand for ``shares`` [N] of a population."""
    days, points = (_pooled([getattr(e, of) for e in errors], shares) for of in ("days", "points"))
    return Quantiles(quantile(*days, 0.5), quantile(*days, LEVEL), quantile(*points, LEVEL))


def errors_per_deviation(errors: Sequence[LeftOut], shares: np.ndarray) -> tuple[float, float]:
    """95 % quantiles of the errors over the deviation of their ground: of days and of points."""
    days, points = (
        _pooled([getattr(e, name) / max(e.deviation, 1e-12) for e in errors], shares)
        for name in ("days", "points")
    )
    return quantile(*days, LEVEL), quantile(*points, LEVEL)


def quantile(values: np.ndarray, weights: np.ndarray, level: float) -> float:
    """Smallest of ``values`` [n] with at least ``level`` of the ``weights`` [n]; 0 of none."""
    return float(np.nan_to_num(weighted_quantiles(values, weights, (level,))[0]))


def _pooled(values: Sequence[np.ndarray], shares: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Values of all grounds, and weights such that each ground has its share."""
    weights = [
        np.full(len(v), share / max(len(v), 1)) for v, share in zip(values, shares, strict=True)
    ]
    return np.concatenate(values), np.concatenate(weights)


def _finite(parts: list[np.ndarray]) -> np.ndarray:
    values = np.concatenate(parts) if parts else np.zeros(0)
    return values[np.isfinite(values)]
