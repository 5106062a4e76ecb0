"""Forms of growth beside Step B: closed forms, which of them a line follows, coverage of its dates."""

from datetime import date, timedelta

import numpy as np
import pytest

from mcsettle.analysis.described_growth import DescribedCourses, by_hand
from mcsettle.analysis.line_forecast import line_forecast
from mcsettle.railway.line_history import LineHistory

ERROR, LIMIT, HORIZON = 0.03e-3, 1.5e-3, 3650.0
RUNS = np.array([0.0, 200.0, 400.0, 600.0])


def made(power: float, seed: int, n: int = 60) -> tuple[LineHistory, np.ndarray]:
    """A line whose SDs grow with time to a power, and the true days [S] from the last run on."""
    rng = np.random.default_rng(seed)
    start = 0.9e-3 * np.exp(0.2 * rng.normal(size=n))
    rate = 0.25e-3 * np.exp(0.4 * rng.normal(size=n))
    sd = start[:, None] + rate[:, None] * (RUNS / 365.0) ** power
    days = 365.0 * (np.maximum(LIMIT - start, 0.0) / rate) ** (1.0 / power) - RUNS[-1]
    shape, names = sd.shape, np.full(n, "", dtype=object)
    history = LineHistory(
        200.0 * np.arange(n), 200.0 * np.arange(1, n + 1),
        tuple(date(2021, 1, 1) + timedelta(days=float(day)) for day in RUNS),
        sd + ERROR * rng.normal(size=shape), np.full((*shape, 1), np.nan, dtype=complex),
        np.full(shape, np.nan), ERROR, np.full(n, LIMIT), names, names, names, names,
    )  # fmt: skip
    return history, days


@pytest.mark.parametrize("power", [1.0, 0.5])
def test_the_day_of_the_limit_is_where_the_course_has_it(power):
    starts = np.array([[0.8e-3, 0.9e-3], [1.2e-3, 1.4e-3]])
    courses = DescribedCourses(starts, np.array([0.0, 2.5]), np.array([1e-4, 5e-4]), power)
    days = courses.reaching(np.full(2, LIMIT))
    for section in range(2):
        for node, rate in np.ndindex(2, 2):
            on = courses.on(np.full(2, days[section, node, rate]))[section, node, rate]
            assert on == pytest.approx(LIMIT, rel=1e-12)
    np.testing.assert_array_equal(courses.reaching(np.full(2, 0.5e-3)), 0.0)
    fresh, worn = DescribedCourses(starts[:1], np.array([0.0]), courses.rates, power), courses
    slower = worn.on(np.full(2, 365.0))[1] - starts[1][:, None]
    faster = fresh.on(np.full(1, 365.0))[0] - starts[0][:, None]
    assert (slower < faster - 1e-9).all() if power < 1.0 else np.allclose(slower, faster)


@pytest.mark.parametrize(("power", "name"), [(1.0, "straight"), (0.5, "root of time")])
def test_the_runs_of_a_line_say_how_it_grows(power, name):
    history, _ = made(power, 5)
    forecast = line_forecast(by_hand(history), history, HORIZON)
    probability = {form.name: form.probability for form in forecast.forms}
    assert sum(probability.values()) == pytest.approx(1.0)
    assert probability[name] > 0.95
    np.testing.assert_allclose(forecast.weights.sum(axis=(1, 2)), 1.0, rtol=1e-9)


def test_forms_are_averaged_where_the_runs_do_not_tell_them_apart():
    history, _ = made(0.75, 6, n=4)  # between the two
    forms = by_hand(history)
    both = line_forecast(forms, history, HORIZON)
    assert all(form.probability > 0.02 for form in both.forms)
    alone = [line_forecast([form], history, HORIZON) for form in forms]
    expected = sum(
        form.probability * one.probability_within(900.0)
        for form, one in zip(both.forms, alone, strict=True)
    )
    np.testing.assert_allclose(both.probability_within(900.0), expected, rtol=1e-9)


def test_true_dates_are_evenly_distributed_in_their_forecasts():
    """Ranks of all dates, those after the horizon drawn from what is left beyond it."""
    shares, means = [], []
    for seed in range(8):
        history, days = made(1.0, 100 + seed)
        forecast = line_forecast(by_hand(history), history, HORIZON)
        below = (history.last_sd < LIMIT) & (days > 0.0)
        seen = days <= HORIZON
        rank = forecast.probability_within(np.where(seen, days, HORIZON))
        drawn = np.random.default_rng(seed).random(len(days))
        rank = np.where(seen, rank, rank + drawn * (1.0 - rank))[below]
        shares.append(np.mean((rank > 0.05) & (rank < 0.95)))
        means.append(np.mean(rank))
    for values, right in ((shares, 0.9), (means, 0.5)):
        error = np.std(values, ddof=1) / np.sqrt(len(values))
        assert abs(np.mean(values) - right) < 3.0 * error + 0.01
