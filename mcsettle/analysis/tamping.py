"""Tamping again and again: what each tamping recovers, and what the whole sequence costs.

A tamping brings the SD down to c0 + c1 · SD before, with scatter; it renews the ballast's count of
load cycles and not the ground's, so intervals differ from cycle to cycle. The present cost of such a
sequence stands beside Eq. (4), whose intervals are all alike; with perfect recovery and constant
traffic the two are one.

References
----------
SD after tamping as a linear function of SD before: C. Quiroga and E. Schnieder, *Monte Carlo
simulation of railway track geometry deterioration and restoration*, J. Risk and Reliability 226
(2012); M. Audley and J. Andrews, *The effects of tamping on railway track geometry degradation*,
J. Rail and Rapid Transit 227 (2013).
"""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from mcsettle.economics import perpetual_present_value
from mcsettle.errors import InputError
from mcsettle.railway.irregularity import random_amplitudes

SHAPES = ("scaled", "initial", "redrawn")
MOST_KEPT = 0.95  # of the SD before: a tamping that leaves more has not been one
_STREAM = 0x7A319


@dataclass(frozen=True)
class Recovery:
    """What a tamping leaves: SD after = ``intercept`` + ``slope`` · SD before + scatter [m].

    ``scatter`` is the standard deviation of a normal error; the SD after lies between ``floor`` and
    ``MOST_KEPT`` of the SD before. ``shape`` of the track after it: what was there, flatter
    (``scaled``), the initial one (``initial``), or a new one of the same spectrum (``redrawn``).
    ``damage``: by how much each tamping raises the settlement of the cycles after it (share).
    ``ground_renewed``: the ground's count of cycles begins anew too.
    """

    intercept: float
    slope: float
    scatter: float = 0.0
    floor: float = 1e-4
    shape: str = "scaled"
    damage: float = 0.0
    ground_renewed: bool = False

    def __post_init__(self) -> None:
        if not (0.0 <= self.slope < 1.0 and self.intercept >= 0.0 and self.scatter >= 0.0):
            raise InputError(
                f"recovery with intercept {self.intercept:g} m, slope {self.slope:g}, scatter "
                f"{self.scatter:g} m; none may be negative, and the slope is below 1"
            )
        if not (self.floor > 0.0 and self.damage >= 0.0):
            raise InputError("the floor must be positive and the damage not negative")
        if self.shape not in SHAPES:
            raise InputError(f"shape '{self.shape}' is unknown; choose one of {', '.join(SHAPES)}")

    def sd_after(
        self, before: np.ndarray, seed: int, indices: Iterable[int], tamping: int
    ) -> np.ndarray:
        """SD [R] m after tamping number ``tamping`` (from 1) of the realisations ``indices``.

        The scatter is addressed by (seed, index, tamping).
        """
        after = self.intercept + self.slope * np.asarray(before, dtype=float)
        if self.scatter > 0.0:
            errors = [random_amplitudes(seed ^ _STREAM, i, tamping)[-1].real for i in indices]
            after = after + self.scatter * np.array(errors)
        return np.clip(after, self.floor, MOST_KEPT * before)


@dataclass(frozen=True)
class TampingSequence:
    """Tampings of R realisations after one at day 0; years of 365 days.

    ``years`` [R, C]: times of the further tampings, rising, NaN after the last one. ``life``: years to
    renewal, after which all repeats (``inf``: never; then the last interval goes on for ever).
    ``open`` [R]: followed no further, so that later tampings are missing.
    """

    years: np.ndarray
    life: float
    open: np.ndarray

    @property
    def first(self) -> np.ndarray:
        """First interval [R] years (NaN: no tamping)."""
        return np.asarray(self.years[:, 0])

    @property
    def count(self) -> np.ndarray:
        """Tampings [R] of a life, that at its start included."""
        return 1 + np.sum(~np.isnan(self.years), axis=1)


def present_cost(
    sequence: TampingSequence, tamping_cost: float, discount_rate: float
) -> np.ndarray:
    """Present value [R] currency/track-km of tamping now and at the times of ``sequence``.

    Without renewal the last interval goes on for ever, Eq. (4) from the last tamping on. With one the
    life repeats: the sum over a life over 1 − e^{−rL}. Where a realisation is open what is missing
    counts nothing: a lower bound. Without discounting neither sum has an end: infinite.
    """
    if discount_rate == 0.0:
        return np.full(len(sequence.years), np.inf)
    factors = np.where(
        np.isnan(sequence.years), 0.0, np.exp(-discount_rate * np.nan_to_num(sequence.years))
    )
    own = tamping_cost * (1.0 + factors.sum(axis=1))
    if np.isfinite(sequence.life):
        return np.asarray(own / -np.expm1(-discount_rate * sequence.life))
    last, interval = _last(sequence.years)
    with np.errstate(invalid="ignore"):
        tail = np.exp(-discount_rate * last) * (
            perpetual_present_value(tamping_cost, discount_rate, interval) - tamping_cost
        )
    return np.asarray(own + np.where(sequence.open | np.isnan(interval), 0.0, tail))


def constant_cost(
    sequence: TampingSequence, tamping_cost: float, discount_rate: float
) -> np.ndarray:
    """Eq. (4) [R] currency/track-km with every interval as long as the first; NaN without a first one."""
    return perpetual_present_value(tamping_cost, discount_rate, sequence.first)


def present_cost_slope(
    sequence: TampingSequence, tamping_cost: float, discount_rate: float
) -> np.ndarray:
    """∂PV/∂T₁ [R] currency/track-km per year: the first interval moved, the later ones held.

    Every tamping of this life that follows moves with the first; Eq. (6) is the case of intervals all
    alike and no renewal. Without discounting, the limit: a life with a renewal costs the same whenever
    it is tamped, and without one the limit of Eq. (6) is −c over the last interval.
    """
    if discount_rate == 0.0:
        _, interval = _last(sequence.years)
        endless = np.isinf(sequence.life) & ~sequence.open
        return np.where(endless, -tamping_cost / interval, 0.0)
    total = present_cost(sequence, tamping_cost, discount_rate)
    if np.isfinite(sequence.life):  # later lives stay where they are
        total = total * -np.expm1(-discount_rate * sequence.life)
    return np.asarray(-discount_rate * (total - tamping_cost))


def _last(years: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Time of the last tamping [R] and the interval before it; NaN where there is none."""
    whole = np.concatenate([np.zeros((len(years), 1)), years], axis=1)
    n = np.sum(~np.isnan(whole), axis=1)
    rows = np.arange(len(years))
    last = whole[rows, n - 1]
    interval = np.where(n > 1, last - whole[rows, np.maximum(n - 2, 0)], np.nan)
    return last, interval
