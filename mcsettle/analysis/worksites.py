"""Worksites of a tamping campaign: sections joined so that whole shifts are used, at least cost.

A campaign tamps every section that is due, in worksites of neighbours that are at least ``least_length``
long; a worksite of length L takes ⌈L / output⌉ shifts, paid whole. A section that is joined although it
is not due loses what its life was still worth: the share of its interval that is left, of the cost of its
own length. Each section lies in one worksite at most.

The choice is exact. The cheapest plan up to the end of a section either leaves that section alone or
ends a worksite there, and goes on from the cheapest plan up to where the worksite begins: one pass along
the line, in time proportional to its length (R. Bellman, *Dynamic Programming*, 1957).
"""

from dataclasses import dataclass, replace

import numpy as np


@dataclass(frozen=True)
class TampingPrices:
    """``cost_per_shift`` in money; ``output`` of a shift and ``least_length`` of a worksite, m."""

    cost_per_shift: float
    output: float
    least_length: float

    def shifts(self, length: np.ndarray) -> np.ndarray:
        """Shifts [W] that worksites of ``length`` [W] m take."""
        return np.maximum(1, np.ceil(length / self.output - 1e-9)).astype(int)


@dataclass(frozen=True)
class Worksite:
    """Sections ``first`` to ``last`` (both in); ``length`` m; ``cost`` of shifts, ``lost`` life."""

    first: int
    last: int
    length: float
    shifts: int
    cost: float
    lost: float

    def moved(self, by: int) -> "Worksite":
        """The same worksite where its sections have numbers higher ``by`` so many."""
        return replace(self, first=self.first + by, last=self.last + by)


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
    n, due = len(lengths), due & ~closed
    price_per_metre = prices.cost_per_shift / prices.output
    ends = np.concatenate([[0.0], np.cumsum(lengths)])
    lost = np.concatenate([[0.0], np.cumsum(np.where(due, 0.0, life_left * lengths))])
    lost, n_due = lost * price_per_metre, np.concatenate([[0], np.cumsum(due)])
    cheapest = np.zeros(n + 1)  # cost of the plan up to the beginning of each section
    begins = np.full(n + 1, -1)  # first section of the worksite that ends there; -1: none does
    open_from = 0  # first section behind the last closed one
    for last in range(n):
        cheapest[last + 1] = np.inf if due[last] else cheapest[last]
        if closed[last]:
            open_from = last + 1
            continue
        nearest = int(np.searchsorted(ends, ends[last] - longest))
        first = np.arange(max(open_from, nearest), last + 1)
        length = ends[last + 1] - ends[first]
        # Between closed sections a worksite may be as short as the stretch.
        complete = (first == open_from) & (last + 1 == n or closed[min(last + 1, n - 1)])
        allowed = (length >= prices.least_length - 1e-9) | complete
        allowed &= n_due[last + 1] > n_due[first]
        cost = prices.shifts(length) * prices.cost_per_shift + lost[last + 1] - lost[first]
        total = np.where(allowed, cheapest[first] + cost, np.inf)
        best = int(np.argmin(total))
        if total[best] < cheapest[last + 1]:
            cheapest[last + 1], begins[last + 1] = total[best], first[best]
    return _followed_back(begins, ends, lost, prices)


def _followed_back(
    begins: np.ndarray, ends: np.ndarray, lost: np.ndarray, prices: TampingPrices
) -> list[Worksite]:
    """The worksites of the cheapest plan, found from the end of the line, in the order of the line."""
    sites, end = [], len(begins) - 1
    while end > 0:
        first = int(begins[end])
        if first < 0:
            end -= 1
            continue
        length = float(ends[end] - ends[first])
        shifts = int(prices.shifts(np.array(length)))
        cost = shifts * prices.cost_per_shift
        sites.append(Worksite(first, end - 1, length, shifts, cost, float(lost[end] - lost[first])))
        end = first
    return sites[::-1]


def one_by_one(lengths: np.ndarray, due: np.ndarray, prices: TampingPrices) -> float:
    """Cost where each due section is tamped by itself when it reaches its limit: a shift at least."""
    return float(prices.shifts(lengths[due]).sum() * prices.cost_per_shift)
