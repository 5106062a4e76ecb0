"""Worksites of a tamping campaign: sections joined so that whole shifts are used, at least cost.

A campaign tamps every section that is due, in worksites of neighbours that are at least ``least_length``
long; a worksite of length L takes ⌈L / output⌉ shifts, paid whole. A section that is joined although it
is not due loses what its life was still worth: the share of its interval that is left, of the cost of its
own length. Each section lies in one worksite at most; which ones is an exact choice (integer linear
programming, SciPy's ``milp``).
"""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import Bounds, LinearConstraint, milp
from scipy.sparse import csc_matrix


@dataclass(frozen=True)
class TampingPrices:
    """``cost_per_shift`` in money; ``output`` of a shift and ``least_length`` of a worksite, m."""

    cost_per_shift: float
    output: float
    least_length: float

    def shifts(self, length: float) -> int:
        """Shifts that a worksite of ``length`` [m] takes."""
        return max(1, int(np.ceil(length / self.output - 1e-9)))


@dataclass(frozen=True)
class Worksite:
    """Sections ``first`` to ``last`` (both in); ``length`` m; ``cost`` of shifts, ``lost`` life."""

    first: int
    last: int
    length: float
    shifts: int
    cost: float
    lost: float


def worksites(
    lengths: np.ndarray,
    due: np.ndarray,
    life_left: np.ndarray,
    closed: np.ndarray,
    prices: TampingPrices,
    longest: float = 10_000.0,
) -> list[Worksite]:
    """The worksites of least cost that tamp every section that is ``due`` [S].

    Parameters
    ----------
    lengths : ndarray, shape [S], m, of sections in the order of the line
    due : ndarray of bool, shape [S]
    life_left : ndarray, shape [S]
        Share of its interval that a section would still have lasted, 0 to 1.
    closed : ndarray of bool, shape [S]
        No worksite crosses or touches the section (left out: switches, bridges); never due.
    prices : TampingPrices
    longest : float, m, of a worksite that is looked at

    Returns
    -------
    list of Worksite, in the order of the line; a due section that no worksite of the least length
    can reach (between closed ones) has one of its own.
    """
    candidates = _candidates(lengths, due & ~closed, life_left, closed, prices, longest)
    if not candidates:
        return []
    rows, columns = [], []
    for column, site in enumerate(candidates):
        rows += list(range(site.first, site.last + 1))
        columns += [column] * (site.last - site.first + 1)
    shape = (len(lengths), len(candidates))
    covers = csc_matrix((np.ones(len(rows)), (rows, columns)), shape=shape)
    least = (due & ~closed).astype(float)
    result = milp(
        np.array([site.cost + site.lost for site in candidates]),
        constraints=LinearConstraint(covers, least, np.ones(len(lengths))),
        integrality=np.ones(len(candidates), dtype=np.int64),
        bounds=Bounds(0, 1),
    )
    if result.x is None:
        raise ValueError(f"no set of worksites covers the due sections: {result.message}")
    return [site for site, taken in zip(candidates, result.x, strict=True) if taken > 0.5]


def one_by_one(lengths: np.ndarray, due: np.ndarray, prices: TampingPrices) -> float:
    """Cost where each due section is tamped by itself when it reaches its limit: a shift at least."""
    return float(sum(prices.shifts(length) for length in lengths[due]) * prices.cost_per_shift)


def _candidates(
    lengths: np.ndarray,
    due: np.ndarray,
    life_left: np.ndarray,
    closed: np.ndarray,
    prices: TampingPrices,
    longest: float,
) -> list[Worksite]:
    """Worksites that begin and end with what is due, or are as short as the least length allows."""
    sites = []
    price_per_metre = prices.cost_per_shift / prices.output
    stretch = np.cumsum(closed)
    for first in range(len(lengths)):
        if closed[first]:
            continue
        length, lost, some = 0.0, 0.0, False
        for last in range(first, len(lengths)):
            if closed[last] or stretch[last] != stretch[first] or length > longest:
                break
            length += float(lengths[last])
            some |= bool(due[last])
            if not due[last]:
                lost += float(life_left[last] * lengths[last]) * price_per_metre
            whole = last + 1 == len(lengths) or closed[last + 1]
            long_enough = length >= prices.least_length - 1e-9
            isolated = whole and (first == 0 or closed[first - 1])
            if some and (long_enough or isolated):
                shifts = prices.shifts(length)
                cost = shifts * prices.cost_per_shift
                sites.append(Worksite(first, last, length, shifts, cost, lost))
    return sites
