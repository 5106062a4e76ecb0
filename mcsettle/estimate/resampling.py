"""Resampling of parameter sets crossed with realisations, and of weighted sets.

Sets and tracks are resampled separately, because all rows of a set share its inputs and all rows of a
realisation its track (the pigeonhole bootstrap). Sets may be weighted by what was observed
(``observed``): a resample then draws sets with their weights, as for any self-normalised importance
sample. Where the weights themselves come from the tracks that are resampled, every resample computes
them anew: tracks that happen to last long move the weight to sets that last less long, and an interval
that keeps the weights counts that variation twice.

References: Owen (2007), The pigeonhole bootstrap, Annals of Applied Statistics 1, 386–411; Kong (1992),
A note on importance sampling using standardized weights, University of Chicago TR 348.
"""

import copy
import hashlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import TypeVar

import numpy as np
from scipy import special

from mcsettle.errors import InputError
from mcsettle.estimate.estimate import CONFIDENCE

RESAMPLES = 500
LARGEST = 20_000  # tracks that are resampled one by one; of more, so many blocks of them
T = TypeVar("T")


@dataclass(frozen=True)
class SetWeights:
    """Relative weights [E] of the parameter sets, and what they are for resampled tracks.

    ``of_tracks`` takes counts of the tracks [B, R] and gives the weights [B, E]; None: whatever the
    tracks, they are the same. ``shift_of`` gives the logarithm [B, E] of the factor by which intervals
    would have been longer, had the sets fitted their factors to those tracks (``refit``); what is
    estimated goes as the ``exponent``-th power of the intervals.
    """

    values: np.ndarray
    of_tracks: Callable[[np.ndarray], np.ndarray] | None = None
    n_tracks: int = 0
    shift_of: Callable[[np.ndarray], np.ndarray] | None = None
    exponent: float = 0.0

    def given(self, counts: np.ndarray) -> np.ndarray:
        """Weights [B, E] where the tracks are there ``counts`` [B, R] times."""
        if self.of_tracks is None or counts.shape[1] != self.n_tracks:
            return np.broadcast_to(self.values, (len(counts), len(self.values)))
        return self.of_tracks(counts)

    def factors(self, by_set: np.ndarray, by_track: np.ndarray) -> np.ndarray:
        """What refitting makes of an estimate in every resample of sets [B, E] and tracks [B, R]."""
        if self.shift_of is None or self.exponent == 0.0 or by_track.shape[1] != self.n_tracks:
            return np.ones(len(by_set))
        total = np.sum(by_set, axis=1)
        shift = np.sum(by_set * self.shift_of(by_track), axis=1) / np.where(total > 0.0, total, 1.0)
        return np.asarray(np.exp(self.exponent * shift))


Weights = np.ndarray | SetWeights | None


def remembered(of: Callable[[np.ndarray], T]) -> Callable[[np.ndarray], T]:
    """``of`` counts [B, R] with its last answer kept: every number of a summary resamples alike."""
    known: dict[bytes, T] = {}

    def given(counts: np.ndarray) -> T:
        key = hashlib.sha256(counts.tobytes()).digest()
        if key not in known:
            known.clear()
            known[key] = of(counts)
        return known[key]

    return given


def as_interval(weights: Weights, exponent: float = 1.0) -> Weights:
    """The weights for what goes as this power of the intervals."""
    if isinstance(weights, SetWeights):
        return replace(weights, exponent=exponent)
    return weights


def plain_weights(weights: Weights) -> np.ndarray | None:
    """The weights [E] of the sample itself; None where all sets are alike."""
    return weights.values if isinstance(weights, SetWeights) else weights


def effective(weights: np.ndarray) -> float:
    """How many of the weights [n] carry the sum, (Σw)²/Σw²; 0 if all are zero."""
    square = float(np.sum(np.square(weights)))
    return float(np.sum(weights)) ** 2 / square if square > 0.0 else 0.0


class Resampling:
    """Weights of resampled sets [B, E] and tracks [B, R]; the first row is the sample itself.

    Of more than ``LARGEST`` tracks under one set, blocks of neighbours are resampled, [B, G]: tracks are
    independent, so blocks are too. Elsewhere every track is a block.
    ``sets_kept`` [B, E] are the weights of the same sets on the resampled tracks, ``factors`` [B] those
    by which an estimate would differ with the sets' settlement factors fitted to them.

    Parameters
    ----------
    shape : (E, R)
    seed : of the resampling
    set_weights : relative weights of the parameter sets, none negative (default: all alike)
    """

    def __init__(self, shape: tuple[int, ...], seed: int = 0, set_weights: Weights = None) -> None:
        n_sets, n_tracks = shape
        n_blocks = min(n_tracks, LARGEST) if n_sets == 1 else n_tracks
        self.by_set, self.by_track = _counts((n_sets, n_blocks), seed)
        self.blocks = np.arange(n_tracks) * n_blocks // n_tracks if n_tracks else np.zeros(0, int)
        self.sizes = [float(n) for n in shape]
        self.sets_kept = np.ones_like(self.by_set)
        self.factors = np.ones(len(self.by_set))
        if set_weights is not None:
            own = set_weights if isinstance(set_weights, SetWeights) else SetWeights(set_weights)
            weights = _checked(own.values, shape[0])
            self.sizes[0] = effective(weights)
            self.sets_kept = _levelled(own.given(self.by_track))
            self.sets_kept[0] = weights
            self.by_set = self.by_set * self.sets_kept
            self.factors = own.factors(self.by_set, self.by_track)
        self.alpha = tail(self.sizes)

    def by_block(self, values: np.ndarray) -> np.ndarray:
        """Sums [E, G] of values [E, R] over the tracks of each block."""
        n_blocks = self.by_track.shape[1]
        if values.shape[1] == n_blocks:
            return values
        starts = np.searchsorted(self.blocks, np.arange(n_blocks))
        return np.asarray(np.add.reduceat(values, starts, axis=1))

    def of_sets(self, chosen: np.ndarray) -> "Resampling":
        """The same resamples of the sets ``chosen`` [E] alone."""
        resampling = copy.copy(self)
        resampling.by_set, resampling.sets_kept = self.by_set[:, chosen], self.sets_kept[:, chosen]
        return resampling


@lru_cache(maxsize=4)
def _counts(shape: tuple[int, ...], seed: int) -> tuple[np.ndarray, ...]:
    """How often each set [B, E] and each track [B, R] is there; the first row is the sample itself."""
    rng = np.random.default_rng(seed)
    parts = []
    for n in shape:
        drawn = rng.multinomial(n, np.full(n, 1.0 / n), size=RESAMPLES).astype(float)
        parts.append(np.vstack([np.ones(n), drawn]))
        parts[-1].setflags(write=False)  # all numbers of a summary resample alike
    return tuple(parts)


def tail(sizes: Sequence[float]) -> float:
    """Share of the resampled values to leave out on each side, for [E, R].

    A percentile interval is too short for a small sample, as a normal one is that should be
    Student's; reading it further out mends that (Hesterberg 2015, American Statistician 69).
    """
    n = max(2.0, min((size for size in sizes if size > 1.0), default=2.0))
    return float(
        special.ndtr(special.stdtrit(n - 1, 0.5 - 0.5 * CONFIDENCE) * np.sqrt(n / (n - 1.0)))
    )


def _levelled(weights: np.ndarray) -> np.ndarray:
    """Weights [B, E] with mean 1 in every row; rows without any weight stay zero."""
    total = np.sum(weights, axis=1, keepdims=True)
    return np.asarray(weights * (weights.shape[1] / np.where(total > 0.0, total, 1.0)))


def _checked(weights: np.ndarray, n_sets: int) -> np.ndarray:
    """Weights [E] with mean 1."""
    values = np.asarray(weights, dtype=float)
    sound = values.shape == (n_sets,) and bool(np.all(np.isfinite(values) & (values >= 0.0)))
    if not sound or not np.sum(values) > 0.0:
        raise InputError(f"weights of {n_sets} parameter sets: none negative, not all of them zero")
    return np.asarray(values * (n_sets / np.sum(values)))
