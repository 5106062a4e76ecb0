"""Permanent strain per load cycle, Eqs. (1) and (2), in a form that does not cancel.

Both laws read strain = scale · σ_d^m · [φ(N + dN) − φ(N)], with σ_d in Pa:

    ballast (1)   scale = coefficient (1/MPa²),   φ(N) = log_slope · log10 N,   m = 2
    power   (2)   scale = a/100 · strength^(−m),  φ(N) = N^b

N is about 10⁵ to 10⁸ while dN is 1, so the difference is written with ``log1p`` and ``expm1``: the
plain difference loses eight digits.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from mcsettle.railway.track import BallastLaw, Law
from mcsettle.units import MPA

STRESS_DEFINITIONS = ("traffic", "total")
CYCLE_COUNTS = ("shared", "per_vehicle")


@dataclass(frozen=True)
class SettlementModel:
    """How stress becomes settlement in one scenario.

    ``laws``: one per track layer (None: the layer does not settle). ``stress``: "traffic" leaves the
    geostatic part out of σ_d, "total" keeps it. ``cycles``: "shared" counts one N for all vehicles,
    "per_vehicle" one for each train of the timetable. Cycle counts are axle passages;
    ``settlement_factor`` multiplies every settlement increment.
    """

    laws: tuple[Law | None, ...]
    stress: str = "traffic"
    cycles: str = "shared"
    ballast_cycles_before: float = 1e5
    subgrade_cycles_before: float = 1e5
    cycles_per_passage: float = 1.0
    settlement_factor: float = 1.0

    def __post_init__(self) -> None:
        if self.stress not in STRESS_DEFINITIONS:
            raise ValueError(f"stress is '{self.stress}'; choose one of {STRESS_DEFINITIONS}")
        if self.cycles not in CYCLE_COUNTS:
            raise ValueError(f"cycles is '{self.cycles}'; choose one of {CYCLE_COUNTS}")
        if not any(self.laws):
            raise ValueError("no layer of the track has a settlement law")
        for name in ("ballast_cycles_before", "subgrade_cycles_before"):
            if not 1.0 <= getattr(self, name) < math.inf:
                raise ValueError(f"{name} is {getattr(self, name)}; it must be at least 1")
        for name in ("cycles_per_passage", "settlement_factor"):
            if not 0.0 < getattr(self, name) < math.inf:
                raise ValueError(f"{name} is {getattr(self, name)}; it must be positive")

    @property
    def settling_layers(self) -> tuple[int, ...]:
        """Indices of the layers that have a law: the settlement groups, in order."""
        return tuple(i for i, law in enumerate(self.laws) if law is not None)

    @property
    def group_laws(self) -> tuple[Law, ...]:
        """The laws of the settlement groups."""
        return tuple(law for law in self.laws if law is not None)

    def cycles_before(self, law: Law) -> float:
        """Cycles a layer of this law has seen at the start: since tamping, or since renewal."""
        is_ballast = isinstance(law, BallastLaw)
        return self.ballast_cycles_before if is_ballast else self.subgrade_cycles_before


def strain_scale(law: Law) -> float:
    """Factor of σ_d^m [1/Pa^m] in Eqs. (1), (2)."""
    if isinstance(law, BallastLaw):
        return law.coefficient / MPA**2
    return law.a / 100.0 * law.strength ** (-law.m)


def cycle_increment(law: Law, cycles: ArrayLike, d_cycles: ArrayLike) -> np.ndarray:
    """Growth φ(N + dN) − φ(N) of the cycle function, without cancellation.

    Parameters
    ----------
    law : Law
    cycles : array, cycles N already applied (> 0)
    d_cycles : array, cycles dN added (≥ 0)

    Returns
    -------
    array, broadcast shape
    """
    n = np.asarray(cycles, dtype=float)
    growth = np.log1p(np.asarray(d_cycles, dtype=float) / n)
    if isinstance(law, BallastLaw):
        return law.log_slope / math.log(10.0) * growth
    return n**law.b * np.expm1(law.b * growth)


def cycle_rate(law: Law, cycles: ArrayLike) -> np.ndarray:
    """Derivative dφ/dN of the cycle function at N ``cycles`` (> 0)."""
    n = np.asarray(cycles, dtype=float)
    if isinstance(law, BallastLaw):
        return law.log_slope / math.log(10.0) / n
    return law.b * n ** (law.b - 1.0)


def strain_increment(
    law: Law, deviatoric_stress: ArrayLike, cycles: ArrayLike, d_cycles: ArrayLike = 1.0
) -> np.ndarray:
    """Permanent strain increment [-], Eq. (1) or (2), under ``deviatoric_stress`` [Pa].

    >>> law = BallastLaw()
    >>> f"{strain_increment(law, 0.1e6, 1e5, 1e5):.4e}"
    '4.5154e-04'
    """
    stress = np.asarray(deviatoric_stress, dtype=float)
    scale = strain_scale(law)
    return scale * stress**law.exponent * cycle_increment(law, cycles, d_cycles)
