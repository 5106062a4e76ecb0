"""Worksites: what is due is tamped, shifts are paid whole, joining where it pays; by enumeration."""

from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mcsettle.analysis.worksites import TampingPrices, one_by_one, worksites

PRICES = TampingPrices(cost_per_shift=9000.0, output=1600.0, least_length=400.0)


def plan(due: list[int], n: int = 20, left: float = 0.5, closed: tuple[int, ...] = ()):
    flags, shut = np.zeros(n, bool), np.zeros(n, bool)
    flags[due], shut[list(closed)] = True, True
    return worksites(np.full(n, 200.0), flags, np.full(n, left), shut, PRICES)


def test_neighbours_share_a_shift():
    """Sections 3 and 5: joined they take one shift of three sections, apart two shifts."""
    (site,) = plan([3, 5])
    assert (site.first, site.last, site.shifts) == (3, 5, 1)
    assert site.lost == pytest.approx(0.5 * 200.0 * 9000.0 / 1600.0)
    assert one_by_one(np.full(20, 200.0), np.isin(np.arange(20), [3, 5]), PRICES) == 18000.0


def test_far_sections_stay_apart_and_short_sites_are_made_long_enough():
    first, second = plan([2, 18])
    assert first.last - first.first == second.last - second.first == 1  # 400 m
    assert first.first <= 2 <= first.last


def test_nothing_crosses_what_is_closed():
    first, second = plan([3, 5], closed=(4,))
    assert first.last == 3
    assert second.first == 5
    (alone,) = plan([5], closed=(4, 6))  # too short, and all there is
    assert (alone.first, alone.last) == (5, 5)


def test_nothing_due_is_nothing_done():
    assert plan([]) == []


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 2**31))
def test_no_other_set_of_worksites_costs_less(seed):
    """Against every way to tamp each of seven sections or not."""
    rng = np.random.default_rng(seed)
    n, prices = 7, TampingPrices(9000.0, 500.0, 300.0)
    lengths = rng.choice([100.0, 200.0, 150.0], n)
    due, left = rng.random(n) < 0.35, rng.random(n)
    sites = worksites(lengths, due, left, np.zeros(n, bool), prices)
    cost = sum(site.cost + site.lost for site in sites)
    per_metre = prices.cost_per_shift / prices.output
    best = np.inf
    # A cut after a section parts two worksites that touch; 0: untouched, 1: tamped, 2: tamped, cut.
    for choice in product((0, 1, 2), repeat=n):
        tamped = np.array(choice) > 0
        if np.any(due & ~tamped):
            continue
        total, length, valid = 0.0, 0.0, True
        for i in range(n):
            if not tamped[i]:
                continue
            length += lengths[i]
            total += 0.0 if due[i] else left[i] * lengths[i] * per_metre
            if choice[i] == 2 or i + 1 == n or not tamped[i + 1]:
                whole = length > lengths.sum() - 1e-6
                valid &= bool(length >= prices.least_length - 1e-9 or whole)
                total += prices.shifts(length) * prices.cost_per_shift
                length = 0.0
        best = min(best, total) if valid else best
    if due.any():
        assert cost == pytest.approx(best)
