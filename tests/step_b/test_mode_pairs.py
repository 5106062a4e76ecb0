"""Pairs of modes: against all pairs of the band, and by twos against one at a time."""

import numpy as np
import pytest

from mcsettle.step_b.mode_pairs import mode_pairs

BANDS = [np.arange(6, 67), np.arange(1, 5), np.array([9]), np.arange(20, 31), np.arange(2, 40)]


@pytest.mark.parametrize("modes", BANDS, ids=len)
def test_mode_pairs_by_brute_force(modes):
    pairs = mode_pairs(modes)
    for target, n in enumerate(modes):
        sums = pairs.sums[pairs.sum_start[target] : pairs.sum_start[target + 1]]
        everything = [(i, j) for i, a in enumerate(modes) for j, b in enumerate(modes)]
        expected = {(i, j) for i, j in everything if i <= j and modes[i] + modes[j] == n}
        assert len(sums) == len(expected)
        assert set(map(tuple, sums.tolist())) == expected
        rows = slice(pairs.difference_start[target], pairs.difference_start[target + 1])
        differences = pairs.differences[rows]
        expected = {(i, j) for i, j in everything if modes[i] - modes[j] == n}
        assert len(differences) == len(expected)
        assert set(map(tuple, differences.tolist())) == expected
    assert pairs.sum_start[-1] == len(pairs.sums)
    assert pairs.difference_start[-1] == len(pairs.differences)


def test_modes_must_be_consecutive():
    with pytest.raises(ValueError, match="consecutive"):
        mode_pairs(np.array([6, 7, 9]))


@pytest.mark.parametrize("outer", [False, True])
@pytest.mark.parametrize("modes", BANDS, ids=len)
def test_pairs_by_twos_add_up_to_the_pairs(modes, outer):
    """Every pair once, and at each mode number the same sum of products."""
    pairs = mode_pairs(modes, outer)
    terms, n_pairs = pairs.terms, len(pairs.sums) + len(pairs.differences)
    np.testing.assert_array_equal(np.sort(terms.order), np.arange(n_pairs))
    rng = np.random.default_rng(0)
    u, c = (rng.normal(size=(n, 2)) @ [1.0, 1j] for n in (len(modes), n_pairs))
    products = c * np.concatenate(
        [u[pairs.sums].prod(axis=1), u[pairs.differences[:, 0]] * u[pairs.differences[:, 1]].conj()]
    )
    target = np.concatenate([modes[pairs.sums].sum(axis=1), -np.diff(pairs.differences)[:, 0]])
    own = c[terms.order]
    for n in range(1, 2 * modes[-1] + 1):
        total = 0.0
        begin, middle, end = terms.joined_start[n - 1]
        for p in range(begin, end):
            shared, i, j = terms.joined[p]
            q = own[2 * p] * (u[i] if p < middle else u[i].conj())
            r = own[2 * p + 1] * u[j]
            total += u[shared].real * (q + r) + 1j * u[shared].imag * (q - r)
        begin, middle, end = terms.single_start[n - 1]
        for p in range(begin, end):
            i, j = terms.single[p]
            total += own[2 * len(terms.joined) + p] * u[i] * (u[j] if p < middle else u[j].conj())
        assert total == pytest.approx(products[target == n].sum(), abs=1e-12 * n_pairs)


def test_most_pairs_share_a_mode():
    """1604 of the 2324 pairs of the usual band (docs/performance.md)."""
    terms = mode_pairs(np.arange(6, 67)).terms
    assert (2 * len(terms.joined), len(terms.order)) == (1604, 2324)
