"""Intervals of quantiles from order statistics, of as many values as a sample is worth.

A share F below q that has the variance V in a sample of sets and tracks is known as well as one of
n = F (1 − F) / V independent values (Woodruff 1952; Korn and Graubard 1998 for small samples). The
quantile's limits are then order statistics j and k of n: P(fewer than j below) and P(at least k
below) are both 2.5 %, at the middles of their steps. Where even the outermost value is no limit,
(1 − p)ⁿ > 2.5 %, the sample cannot give one, and that side is open: for P5 and P95 it takes 72
independent values. SciPy has such limits for independent values only, not for crossed or
weighted ones.

References: Woodruff (1952), Journal of the American Statistical Association 47, 635–646; Korn and
Graubard (1998), Survey Methodology 24, 193–201.
"""

from collections.abc import Sequence

import numpy as np
from scipy import special

from mcsettle.estimate.estimate import CONFIDENCE

TAIL = 0.5 - 0.5 * CONFIDENCE
MANY = 1e9  # values where the variance is nothing


def worth(share: float, variance: float, sizes: Sequence[float]) -> float:
    """Independent values that know ``share`` as well as one with ``variance`` is known.

    ``sizes``: of the sets and of the tracks that the variance is an estimate from.
    """
    smallest = max(2.0, min((size for size in sizes if size > 1.0), default=2.0))
    # A variance from few values is itself uncertain: Student's quantile for the normal one.
    shrunk = (special.ndtri(TAIL) / special.stdtrit(smallest - 1.0, TAIL)) ** 2
    plain = share * (1.0 - share)
    return float(min(MANY, shrunk * plain / variance)) if variance > plain / MANY else MANY


def implied_error(ends: Sequence[float | None], value: float) -> float | None:
    """Standard error that a 95 % interval implies; from one side where the other is open."""
    sides = [abs(end - value) for end in ends if end is not None]
    return float(np.mean(sides)) / float(special.ndtri(1.0 - TAIL)) if sides else None


def order_positions(n: float, level: float) -> tuple[float | None, float | None]:
    """Levels at which the interval of a quantile of ``n`` independent values ends; None: open.

    ``n`` need not be whole.

    Examples
    --------
    >>> low, high = order_positions(100.0, 0.5)
    >>> round(100 * low, 1), round(100 * high, 1)
    (40.2, 59.8)
    >>> order_positions(71.0, 0.05)[0] is None, order_positions(72.0, 0.05)[0] is None
    (True, False)
    """
    low, high = _position(n, level), _position(n, 1.0 - level)
    return low, None if high is None else 1.0 - high


def _position(n: float, level: float) -> float | None:
    if n >= MANY:
        return level
    if n < 1.0 or (1.0 - level) ** n > TAIL:
        return None

    def excess(j: float) -> float:
        return float(special.betainc(j, n - j + 1.0, level)) - (1.0 - TAIL)

    from scipy import optimize  # takes long to import, and few need it

    last = max(n * level, 1.0)  # the median of the order statistics lies near it
    if excess(last) > 0.0:
        return (last - 0.5) / n
    return float((optimize.brentq(excess, 1.0, last) - 0.5) / n) if last > 1.0 else 0.5 / n
