"""Permanent strain per load cycle, Eqs. (1) and (2), in a form that does not cancel.

Both laws read strain = scale · σ_d^m · [φ(N + dN) − φ(N)], with σ_d in Pa:

    ballast (1)   scale = coefficient (1/MPa²),   φ(N) = log_slope · log10 N,   m = 2
    power   (2)   scale = a/100 · strength^(−m),  φ(N) = N^b

N is about 10⁵ to 10⁸ while dN is 1, so the difference is written with ``log1p`` and ``expm1``: the
plain difference loses eight digits.
"""

import math

import numpy as np
from numpy.typing import ArrayLike

from mcsettle.railway.settlement_model import SettlementModel
from mcsettle.railway.track import BallastLaw, Law
from mcsettle.units import MPA


def strain_scale(law: Law) -> float:
    """Factor of σ_d^m [1/Pa^m] in Eqs. (1), (2)."""
    if isinstance(law, BallastLaw):
        return law.coefficient / MPA**2
    return law.a / 100.0 * law.strength ** (-law.m)


def cycle_increment(
    law: Law, cycles: ArrayLike, d_cycles: ArrayLike, long_run: float = 0.0
) -> np.ndarray:
    """Growth φ(N + dN) − φ(N) of the cycle function, without cancellation.

    Parameters
    ----------
    law : Law
    cycles : array, cycles N already applied (> 0)
    d_cycles : array, cycles dN added (≥ 0)
    long_run : what each cycle adds in the long run (``long_run_rate``)

    Returns
    -------
    array, broadcast shape
    """
    n = np.asarray(cycles, dtype=float)
    growth = np.log1p(np.asarray(d_cycles, dtype=float) / n)
    if isinstance(law, BallastLaw):
        grown = law.log_slope / math.log(10.0) * growth
    else:
        grown = n**law.b * np.expm1(law.b * growth)
    return grown + long_run * np.asarray(d_cycles, dtype=float) if long_run else grown


def cycle_rate(law: Law, cycles: ArrayLike, long_run: float = 0.0) -> np.ndarray:
    """Derivative dφ/dN of the cycle function at N ``cycles`` (> 0); ``long_run``: see above."""
    n = np.asarray(cycles, dtype=float)
    if isinstance(law, BallastLaw):
        rate = law.log_slope / math.log(10.0) / n
    else:
        rate = law.b * n ** (law.b - 1.0)
    return rate + long_run if long_run else rate


def long_run_rate(law: Law, model: SettlementModel) -> float:
    """Linear term of the cycle function per cycle: λ times its slope at N_s cycles; 0 without one."""
    if model.long_run_cycles is None:
        return 0.0
    return model.long_run_strength * float(cycle_rate(law, model.long_run_cycles))


def strain_increment(
    law: Law,
    deviatoric_stress: ArrayLike,
    cycles: ArrayLike,
    d_cycles: ArrayLike = 1.0,
    long_run: float = 0.0,
) -> np.ndarray:
    """Permanent strain increment [-], Eq. (1) or (2), under ``deviatoric_stress`` [Pa].

    >>> law = BallastLaw()
    >>> f"{strain_increment(law, 0.1e6, 1e5, 1e5):.4e}"
    '4.5154e-04'
    """
    stress = np.asarray(deviatoric_stress, dtype=float)
    scale = strain_scale(law)
    return scale * stress**law.exponent * cycle_increment(law, cycles, d_cycles, long_run)
