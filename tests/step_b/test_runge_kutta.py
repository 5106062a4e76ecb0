"""Row-by-row Runge–Kutta on equations with known solutions."""

import numpy as np
import pytest

from mcsettle.step_b.runge_kutta import integrate
from mcsettle.step_b.sd_map import Roughness

WHOLE = Roughness(None)
RATES = np.array([0.2, 0.5, 1.3, 3.0])
START, LIMIT = 1.0, 2.0
CROSSING = np.log(LIMIT / START) / RATES


def state(n=4, sd=START):
    """One mode of standard deviation ``sd`` and the column of uniform settlement."""
    return np.tile(np.array([np.sqrt(2) * sd * np.exp(0.3j), 0.0]), (n, 1))


def exponential(time, u, rows):
    """Amplitude grows at the row's rate, settlement at 1 per unit of time."""
    return np.stack([RATES[rows] * u[:, 0], np.ones(len(u))], axis=1)


def wavy(time, u, rows):
    """Rate that changes with time: U = U₀ exp(rate (time + sin(3 time)/3))."""
    return np.stack([RATES[rows] * (1 + np.cos(3 * time)) * u[:, 0], np.ones(len(u))], axis=1)


def test_exponential_growth_crosses_when_it_should():
    path = integrate(exponential, state(), 10.0, LIMIT, WHOLE, np.zeros(0), 1e-10)
    assert path.reached.all()
    assert not path.failed.any()
    # Local errors of 1e-10 over some tens of steps, and the fourth-order interpolant within one.
    np.testing.assert_allclose(path.time, CROSSING, rtol=1e-7)
    np.testing.assert_allclose(WHOLE.sd(path.state[:, :-1]), LIMIT, rtol=1e-9)
    np.testing.assert_allclose(path.state[:, -1].real, path.time, rtol=1e-12)


def test_error_follows_the_tolerance():
    """Per step the error is below the tolerance; it falls by most of each factor of 100."""
    end, errors = 2.0, []
    exact = state()[:, 0] * np.exp(RATES * (end + np.sin(3 * end) / 3))
    for tolerance in (1e-4, 1e-6, 1e-8, 1e-10):
        path = integrate(wavy, state(), end, 1e9, WHOLE, np.zeros(0), tolerance)
        errors.append(np.abs(path.state[:, 0] / exact - 1.0).max())
        assert errors[-1] < 100 * tolerance
        assert not path.reached.any()
        np.testing.assert_array_equal(path.time, end)
    assert np.all(np.array(errors[:-1]) / errors[1:] > 10)


def test_crossing_error_follows_the_tolerance():
    errors = []
    for tolerance in (1e-4, 1e-6, 1e-8):
        path = integrate(wavy, state(), 10.0, LIMIT, WHOLE, np.zeros(0), tolerance)
        exponent = RATES * (path.time + np.sin(3 * path.time) / 3)
        errors.append(np.abs(exponent / np.log(LIMIT) - 1.0).max())
    assert errors[0] < 1e-2
    assert errors[1] < errors[0] / 5
    assert errors[2] < errors[1] / 5


def test_samples_lie_on_the_solution_and_end_with_it():
    samples = np.array([0.0, 0.05, 0.2, 0.5, 1.0, 3.0, 9.0])
    path = integrate(exponential, state(), 10.0, LIMIT, WHOLE, samples, 1e-10)
    exact = START * np.exp(np.outer(RATES, samples))
    before = samples <= CROSSING[:, None]
    assert before.any(axis=0)[:-1].all()
    np.testing.assert_allclose(path.sd[before], exact[before], rtol=1e-7)
    assert np.isnan(path.sd[~before]).all()


def test_sampling_does_not_disturb():
    without = integrate(wavy, state(), 10.0, LIMIT, WHOLE, np.zeros(0), 1e-8)
    sampled = integrate(wavy, state(), 10.0, LIMIT, WHOLE, np.linspace(0, 10, 200), 1e-8)
    np.testing.assert_array_equal(sampled.time, without.time)
    np.testing.assert_array_equal(sampled.state, without.state)
    after = np.linspace(0, 10, 200) > sampled.time[:, None]
    np.testing.assert_array_equal(np.isnan(sampled.sd), after)


def test_rows_do_not_know_each_other():
    samples = np.array([0.1, 0.4])
    together = integrate(wavy, state(), 10.0, LIMIT, WHOLE, samples, 1e-8)
    for row in range(4):

        def alone(time, u, rows, row=row):
            return wavy(time, u, rows + row)

        path = integrate(alone, state(1), 10.0, LIMIT, WHOLE, samples, 1e-8)
        np.testing.assert_array_equal(path.time, together.time[row : row + 1])
        np.testing.assert_array_equal(path.state, together.state[row : row + 1])
        np.testing.assert_array_equal(path.sd, together.sd[row : row + 1])
        np.testing.assert_array_equal(path.steps, together.steps[row : row + 1])


def test_over_the_limit_at_the_start_stops_there():
    u = state()
    u[2] *= 3.0
    path = integrate(exponential, u, 10.0, LIMIT, WHOLE, np.array([0.0, 0.1]), 1e-8)
    assert path.reached.all()
    assert path.time[2] == 0.0
    assert path.steps[2] == 0
    np.testing.assert_array_equal(path.state[2], u[2])
    assert path.sd[2, 0] == pytest.approx(3 * START)
    assert np.isnan(path.sd[2, 1])


def test_a_row_of_nan_fails_alone():
    def broken(time, u, rows):
        slope = exponential(time, u, rows)
        slope[(rows == 1) & (time > 0.1)] = np.nan
        return slope

    path = integrate(broken, state(), 10.0, LIMIT, WHOLE, np.zeros(0), 1e-10)
    np.testing.assert_array_equal(path.failed, [False, True, False, False])
    np.testing.assert_array_equal(path.reached, ~path.failed)
    np.testing.assert_allclose(path.time[~path.failed], CROSSING[~path.failed], rtol=1e-7)


def test_a_row_that_blows_up_fails_alone():
    """d|U|/dt = |U|² has no solution past t = 1/|U₀|: the steps collapse before it."""

    def explosive(time, u, rows):
        slope = exponential(time, u, rows)
        square = np.abs(u[:, :1]) * u[:, :1]
        slope[:, :1] = np.where(rows[:, None] == 2, square, slope[:, :1])
        return slope

    path = integrate(explosive, state(), 5.0, np.inf, WHOLE, np.zeros(0), 1e-8)
    np.testing.assert_array_equal(path.failed, [False, False, True, False])
    assert path.time[2] == pytest.approx(1 / np.sqrt(2), rel=1e-3)
    others = ~path.failed
    np.testing.assert_array_equal(path.time[others], 5.0)
    np.testing.assert_allclose(
        np.abs(path.state[others, 0]), np.sqrt(2) * np.exp(5 * RATES[others]), rtol=1e-5
    )


def test_too_many_steps_is_a_failure():
    path = integrate(exponential, state(), 10.0, LIMIT, WHOLE, np.zeros(0), 1e-10, max_steps=3)
    assert path.failed.any()
    assert not (path.failed & path.reached).any()


def test_a_first_step_that_overflows_is_tried_shorter():
    """Growth of e^40 and more within the first step: rejected, not failed, not warned of."""

    def fierce(time, u, rows):
        slope = exponential(time, u, rows)
        slope[:, :1] = 800.0 * (1 + np.abs(u[:, :1]) ** 6) * u[:, :1]
        return slope

    path = integrate(fierce, state(), 10.0, LIMIT, WHOLE, np.zeros(0), 1e-6)
    assert path.reached.all()
    # ∫ dr / 800 r (1 + r⁶) with r = √2 SD, from √2 to 2√2
    r6 = np.array([8.0, 512.0])
    exact = np.diff(np.log(r6 / (1 + r6)))[0] / 6 / 800
    np.testing.assert_allclose(path.time, exact, rtol=1e-3)
