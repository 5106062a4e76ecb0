"""Kriging: exact at its points, reproduces its trend, leaves out as if it had never known."""

import numpy as np
import pytest

from mcsettle.step_a.kriging import (
    all_terms,
    conditioned,
    fitted,
    independent,
    isotropic,
    left_out_errors,
    monomials,
    most_telling,
    remainder,
)

RNG = np.random.default_rng(3)
POINTS = RNG.normal(size=(18, 2))
AT = RNG.normal(size=(7, 2))
LENGTHS = np.array([1.5, 3.0])


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
def test_leaving_out_is_fitting_without(degree):
    terms = all_terms(2, degree)
    kriging = conditioned(POINTS, LENGTHS, terms)
    weights, deviations = kriging.left_out()
    for i in (0, 7, 17):
        rest = np.delete(np.arange(len(POINTS)), i)
        without = conditioned(POINTS[rest], LENGTHS, terms)
        assert np.allclose(weights[i, rest], without.weights(POINTS[[i]])[0], atol=1e-6)
        assert weights[i, i] == 0.0
        assert np.isclose(deviations[i], without.deviations(POINTS[[i]])[0], atol=1e-5)


def test_errors_are_those_of_brute_force():
    values = smooth(POINTS)
    kriging = conditioned(POINTS, LENGTHS, all_terms(2, 1))
    brute = []
    for i in range(len(POINTS)):
        rest = np.delete(np.arange(len(POINTS)), i)
        without = conditioned(POINTS[rest], LENGTHS, all_terms(2, 1))
        brute.append(np.linalg.norm(without.weights(POINTS[[i]]) @ values[rest] - values[i]))
    assert np.allclose(left_out_errors(kriging, values @ values.T), brute, rtol=1e-4)


@pytest.mark.parametrize("degree", [0, 2])
def test_covariance_has_the_deviations_on_its_diagonal(degree):
    kriging = conditioned(POINTS, LENGTHS, all_terms(2, degree))
    covariance = kriging.covariance(AT)
    assert np.allclose(np.sqrt(np.diag(covariance)), kriging.deviations(AT), atol=1e-8)
    assert np.allclose(covariance, covariance.T)
    assert np.linalg.eigvalsh(covariance).min() > -1e-9


def test_a_remainder_has_the_size_of_what_was_drawn():
    lengths, trend = np.array([0.7, 0.7]), all_terms(2, 0)
    factor = np.linalg.cholesky(isotropic(POINTS * 2.5 / 0.7) + 1e-9 * np.eye(len(POINTS)))
    values = 3.0 * factor @ RNG.normal(size=(len(POINTS), 4000))
    found = remainder(conditioned(POINTS, lengths, trend), values @ values.T / 4000)
    assert np.isclose(found, 3.0, rtol=0.03)  # 8 standard errors


def test_a_fit_chooses_what_predicts_best():
    values = smooth(POINTS)
    kriging = fitted(POINTS, values @ values.T)
    plain = conditioned(POINTS, np.full(2, 4.0), all_terms(2, 0))
    errors = [np.abs(k.weights(AT) @ values - smooth(AT)).max() for k in (kriging, plain)]
    assert errors[0] < 0.5 * errors[1]
    again = fitted(POINTS, values @ values.T)
    assert np.array_equal(kriging.lengths, again.lengths)
    assert kriging.terms == again.terms


def test_a_quadratic_needs_no_remainder():
    values = monomials(POINTS, all_terms(2, 2)) @ RNG.normal(size=(6, 4))
    kriging = fitted(POINTS, values @ values.T)
    assert kriging.terms == all_terms(2, 2)
    assert left_out_errors(kriging, values @ values.T).max() < 1e-6


def test_terms_that_the_points_cannot_tell_apart_are_left_out():
    two_speeds = np.column_stack([POINTS[:, 0], np.where(POINTS[:, 1] > 0.0, 1.0, -1.0)])
    terms = independent(two_speeds, all_terms(2, 2))
    assert terms == ((), (0,), (1,), (0, 0), (0, 1))


def test_next_points_are_spread_and_new():
    covariance = isotropic(POINTS)
    order = most_telling(covariance, [5], 6)
    assert len(set(order) | {5}) == 7
    assert most_telling(covariance, [5, *order[:3]], 3) == order[3:]
    assert len(most_telling(covariance, [5], 100)) == len(POINTS) - 1
    doubled = isotropic(np.concatenate([POINTS, POINTS]))
    first = most_telling(doubled, [0], 10)
    assert len({i % len(POINTS) for i in first}) == 10  # a point again teaches nothing


def test_the_most_telling_point_lowers_the_mean_variance_most():
    pool, terms = np.concatenate([POINTS, AT]), all_terms(2, 1)
    n = len(POINTS)
    (best,) = most_telling(conditioned(POINTS, LENGTHS, terms).covariance(pool), range(n), 1)
    means = [
        np.mean(conditioned(pool[[*range(n), c]], LENGTHS, terms).deviations(pool) ** 2)
        for c in range(n, len(pool))
    ]
    assert best == n + int(np.argmin(means))


def test_one_point_cannot_be_left_out():
    with pytest.raises(ValueError, match="1 training points"):
        fitted(POINTS[:1], np.eye(1))
