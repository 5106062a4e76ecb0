"""Kriging: exact at its points, reproduces its trend, leaves out as if it had never known."""

import numpy as np
import pytest

from mcsettle.step_a.kriging import (
    all_terms,
    conditioned,
    fitted,
    independent,
    inputs_within,
    left_out_loss,
    monomials,
    next_spread,
)

RNG = np.random.default_rng(3)
POINTS = RNG.normal(size=(18, 2))
AT = RNG.normal(size=(7, 2))
LENGTHS = np.array([1.5, 3.0])
SINGLES = [np.array([i]) for i in range(len(POINTS))]


def smooth(points):
    x, y = points.T
    return np.stack([np.sin(x) + 0.3 * y, np.exp(0.4 * x - 0.2 * y), x * y], axis=1)


@pytest.mark.parametrize("degree", [0, 1, 2])
def test_a_prediction_is_exact_at_the_points(degree):
    kriging = conditioned(POINTS, LENGTHS, all_terms(2, degree))
    values = smooth(POINTS)
    assert np.allclose(kriging.weights(POINTS) @ values, values, rtol=1e-7, atol=1e-7)
    assert np.all(kriging.deviations(POINTS) < 1e-4)
    assert np.all(kriging.deviations(AT) > 1e-2)


@pytest.mark.parametrize("degree", [0, 1, 2])
def test_a_polynomial_of_the_trend_is_reproduced(degree):
    terms = all_terms(2, degree)
    factors = RNG.normal(size=len(terms))
    kriging = conditioned(POINTS, LENGTHS, terms)
    predicted = kriging.weights(AT) @ (monomials(POINTS, terms) @ factors)
    assert np.allclose(predicted, monomials(AT, terms) @ factors, atol=1e-8)


@pytest.mark.parametrize("degree", [0, 1, 2])
@pytest.mark.parametrize("group", [[4], [0, 7, 11]])
def test_leaving_out_is_fitting_without(degree, group):
    terms = all_terms(2, degree)
    kriging = conditioned(POINTS, LENGTHS, terms)
    rest = np.setdiff1d(np.arange(len(POINTS)), group)
    without = conditioned(POINTS[rest], LENGTHS, terms)
    weights, deviations = kriging.left_out(np.array(group))
    assert np.allclose(weights[:, rest], without.weights(POINTS[group]), atol=1e-6)
    assert np.all(weights[:, group] == 0.0)
    assert np.allclose(deviations, without.deviations(POINTS[group]), atol=1e-5)


def test_the_loss_is_that_of_brute_force():
    values = smooth(POINTS)
    kriging = conditioned(POINTS, LENGTHS, all_terms(2, 1))
    groups = [np.array([0, 1]), *SINGLES[2:]]
    brute = []
    for group in groups:
        rest = np.setdiff1d(np.arange(len(POINTS)), group)
        without = conditioned(POINTS[rest], LENGTHS, all_terms(2, 1))
        error = without.weights(POINTS[group]) @ values[rest] - values[group]
        brute.append(np.sqrt(np.sum(error**2) / len(group)))
    assert np.isclose(left_out_loss(kriging, values @ values.T, groups), np.mean(brute), rtol=1e-5)


def test_a_fit_chooses_what_predicts_best():
    values = smooth(POINTS)
    kriging = fitted(POINTS, values @ values.T, SINGLES)
    plain = conditioned(POINTS, np.full(2, 4.0), all_terms(2, 0))
    errors = [np.abs(k.weights(AT) @ values - smooth(AT)).max() for k in (kriging, plain)]
    assert errors[0] < 0.5 * errors[1]
    again = fitted(POINTS, values @ values.T, SINGLES)
    assert np.array_equal(kriging.lengths, again.lengths)
    assert kriging.terms == again.terms


def test_a_quadratic_needs_no_remainder():
    values = monomials(POINTS, all_terms(2, 2)) @ RNG.normal(size=(6, 4))
    kriging = fitted(POINTS, values @ values.T, SINGLES)
    assert kriging.terms == all_terms(2, 2)
    assert left_out_loss(kriging, values @ values.T, SINGLES) < 1e-6


def test_terms_that_the_points_cannot_tell_apart_are_left_out():
    two_speeds = np.column_stack([POINTS[:, 0], np.where(POINTS[:, 1] > 0.0, 1.0, -1.0)])
    terms = independent(two_speeds, all_terms(2, 2))
    assert terms == ((), (0,), (1,), (0, 0), (0, 1))


def test_next_points_are_spread_and_new():
    order = next_spread(POINTS, [5], 6)
    assert len(set(order) | {5}) == 7
    assert next_spread(POINTS, [5, *order[:3]], 3) == order[3:]
    assert len(next_spread(POINTS, [5], 100)) == len(POINTS) - 1
    doubled = np.concatenate([POINTS, POINTS])
    first = next_spread(doubled, [0], 10)
    assert len({i % len(POINTS) for i in first}) == 10  # a point again teaches nothing


def test_one_group_cannot_be_left_out():
    with pytest.raises(ValueError, match="1 groups"):
        fitted(POINTS, np.eye(len(POINTS)), [np.arange(len(POINTS))])


def test_a_linear_trend_has_its_own_slopes_at_each_speed():
    places = RNG.normal(size=(9, 1))
    points = np.concatenate([np.column_stack([places, np.full(9, v)]) for v in (-1.0, 1.0)])
    groups = [np.array([i, i + 9]) for i in range(9)]
    assert inputs_within(points, groups) == {1}
    values = (points[:, 0] * (2.0 + points[:, 1]))[:, None]
    kriging = fitted(points, values @ values.T, groups)
    assert (0, 1) in kriging.terms
    assert left_out_loss(kriging, values @ values.T, groups) < 1e-6
    alone = [np.array([i]) for i in range(9)]
    assert inputs_within(points[:9], alone) == set()
