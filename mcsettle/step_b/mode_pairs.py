"""Which pairs of modes feed which: the products of the second-order form (``mcsettle.step_b.spectral``).

Of a mode number n, every mode i takes part in three pairs at most: the sum of i and n − i, and the
differences of i + n and i, and of i and i − n. The pairs of n form chains therefore, and neighbours in a
chain share a mode, U = x + iy. Two such pairs together are

    c U_a U + d U_b U* = x (q + r) + iy (q − r),  q = c U_a,  r = d U_b,

or the same with U_a*: 12 multiplications instead of 16. ``Terms`` takes the pairs of a chain by twos.
"""

import functools
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

Pair = tuple[bool, int, int]  # whether a sum, then its modes, the larger first


@dataclass(frozen=True)
class Terms:
    """The pairs as the kernels take them, those of one mode number n = 1 … 2 n_max after the other.

    ``joined`` [J, 3] two pairs: the mode they share, its partner in the first pair, its partner in the
    second, which is a difference that the shared mode is taken from. ``single`` [S, 2] the pairs left
    over. ``joined_start`` [2 n_max, 3] of every n: where those begin whose first pair is a sum, where
    those whose first pair is a difference, and where they end; ``single_start`` the same of single sums
    and differences. ``order`` [P + M]: the row in ``ModePairs``, sums before differences, of both pairs
    of every joined row, then of the single ones.
    """

    joined: np.ndarray
    joined_start: np.ndarray
    single: np.ndarray
    single_start: np.ndarray
    order: np.ndarray


@dataclass(frozen=True)
class ModePairs:
    """Pairs of the consecutive mode numbers from ``first``, by target, so that sums run over slices.

    ``sums`` [P, 2] indices (i ≤ j) with n_i + n_j = n, ``sum_start`` [K + 1] first row of each target;
    ``differences`` [M, 2] indices with n_i − n_j = n, ``difference_start`` [K + 1]. Behind the rows of
    the band stand those of the mode numbers beside it: ``outer_sums`` and ``outer_differences``
    [2 n_max + 1] first row of each mode number from 1, no rows in the band, nor where nobody asks.
    """

    first: int
    sums: np.ndarray
    sum_start: np.ndarray
    differences: np.ndarray
    difference_start: np.ndarray
    outer_sums: np.ndarray
    outer_differences: np.ndarray

    @cached_property
    def terms(self) -> Terms:
        """The same pairs by twos, where they share a mode."""
        joined: list[tuple[int, int, int]] = []
        single: list[tuple[int, int]] = []
        of_joined: list[Pair] = []
        of_single: list[Pair] = []
        starts: list[list[int]] = []
        count = len(self.sum_start) - 1
        beside = (
            len(self.sums) > self.sum_start[-1] or len(self.differences) > self.difference_start[-1]
        )
        for n in range(1, 2 * (self.first + count - 1) + 1):
            asked = beside or self.first <= n < self.first + count
            twos, ones = _by_twos(_chains(n, self.first, count) if asked else ())
            starts.append([])
            for of_sums in (True, False):
                starts[-1] += [len(joined), len(single)]
                for first, second in (two for two in twos if two[0][0] is of_sums):
                    shared = second[2]
                    joined.append((shared, first[1] + first[2] - shared, second[1]))
                    of_joined += [first, second]
                of_single += [pair for pair in ones if pair[0] is of_sums]
                single += [pair[1:] for pair in ones if pair[0] is of_sums]
            starts[-1] += [len(joined), len(single)]
        rows = {(True, int(j), int(i)): p for p, (i, j) in enumerate(self.sums)}
        rows |= {
            (False, int(i), int(j)): len(rows) + p for p, (i, j) in enumerate(self.differences)
        }
        where = np.array(starts, dtype=np.int32)
        return Terms(
            np.array(joined, dtype=np.int32).reshape(-1, 3),
            np.ascontiguousarray(where[:, 0::2]),
            np.array(single, dtype=np.int32).reshape(-1, 2),
            np.ascontiguousarray(where[:, 1::2]),
            np.array([rows[pair] for pair in of_joined + of_single], dtype=np.int64),
        )


def mode_pairs(modes: np.ndarray, outer: bool = False) -> ModePairs:
    """Pairs of the consecutive mode numbers ``modes`` [K] that couple into the band.

    With ``outer`` those that couple into the mode numbers 1 … 2 n_max beside the band, too.
    """
    first, count = int(modes[0]), len(modes)
    if not np.array_equal(modes, np.arange(first, first + count)):
        raise ValueError("the modes of the band must be consecutive integers")
    return _mode_pairs(first, count, outer)


@functools.lru_cache(maxsize=8)
def _mode_pairs(first: int, count: int, outer: bool) -> ModePairs:
    def sums(n: int) -> list[tuple[int, int]]:
        partners = [(i, n - 2 * first - i) for i in range(count)]
        return [(i, j) for i, j in partners if i <= j < count]

    def differences(n: int) -> list[tuple[int, int]]:
        return [(i, i - n) for i in range(count) if i - n >= 0]

    band = range(first, first + count)
    every = range(1, 2 * (first + count - 1) + 1)
    beside = [n for n in every if n not in band] if outer else []
    tables = []
    for pairs in (sums, differences):
        rows, start = _flatten([pairs(n) for n in band])
        more, outer_start = _flatten([pairs(n) if n in beside else [] for n in every])
        tables.append((np.concatenate([rows, more]), start, outer_start + start[-1]))
    (s, s_start, s_outer), (d, d_start, d_outer) = tables
    return ModePairs(first, s, s_start, d, d_start, s_outer, d_outer)


def _chains(n: int, first: int, count: int) -> Iterator[list[Pair]]:
    """The pairs of mode number n, chain by chain: neighbours share a mode.

    A chain goes down in steps of n to a mode below n, over the sum, and up again.
    """
    for low in range(min(n, count)):
        other = n - 2 * first - low
        if not 0 <= other < low:
            chain = [(False, i + n, i) for i in range(low, count - n, n)][::-1]
            if low <= other < count:
                chain.append((True, other, low))
            if low < other < count:
                chain += [(False, i + n, i) for i in range(other, count - n, n)]
            yield chain


def _by_twos(chains: Iterable[list[Pair]]) -> tuple[list[tuple[Pair, Pair]], list[Pair]]:
    """Neighbours by twos, the second a difference that the shared mode is taken from; those left over."""
    twos, ones = [], []
    for chain in chains:
        for a, b in zip(chain[::2], chain[1::2], strict=False):
            is_second = not a[0] and a[2] in b[1:]
            twos.append((b, a) if is_second else (a, b))
        ones += chain[len(chain) // 2 * 2 :]
    return twos, ones


def _flatten(groups: list[list[tuple[int, int]]]) -> tuple[np.ndarray, np.ndarray]:
    rows = [pair for group in groups for pair in group]
    start = np.cumsum([0] + [len(group) for group in groups])
    return np.array(rows, dtype=np.int32).reshape(-1, 2), start.astype(np.int32)
