"""Support that varies along the track: the form against every x, and closed forms."""

from dataclasses import replace

import numpy as np
import pytest
import toy

from mcsettle.railway.spatial_variability import (
    SpatialVariability,
    field_waves,
    susceptibility,
    to_points,
)
from mcsettle.railway.spectra import spectrum
from mcsettle.step_b.case import Support
from mcsettle.step_b.cycles import cycles_at
from mcsettle.step_b.engine import engine_for
from mcsettle.step_b.mode_pairs import mode_pairs
from mcsettle.step_b.passage import grid_size, in_band, mode_numbers, passage, settlement_of_passage
from mcsettle.step_b.pointwise import joined, load_parts, pointwise_growth, pointwise_load
from mcsettle.step_b.settlement import cycle_increment
from mcsettle.step_b.spectral import axle_form, growth, settled_beside, stacked
from mcsettle.step_b.susceptibility import VaryingForm, fast_varying_growth, varying_growth

MODES, FIRST = np.arange(6, 67), 6
PAIRS = mode_pairs(MODES, outer=True)
LAYERS = {
    "one field": np.ones((1, 3)),
    "multipliers": np.array([[1.0, 0.5, 0.0]]),
    "independent": np.diag([1.0, 0.5, 2.0]),
}
FRA = spectrum()
EXPONENTIAL = SpatialVariability(cov=0.3, correlation_length=5.0, multipliers=(1.0, 1.0, 1.0))


def fields(n, settings=EXPONENTIAL, count=1, seed=1, modes=MODES):
    waves = field_waves(settings, modes, toy.WINDOW, FRA)
    drawn = [susceptibility(settings, waves, seed + f, range(n), [0, 1, 2]) for f in range(count)]
    return np.concatenate(drawn, axis=1)


def forms(services=("passenger", "freight"), axles=(0, 6)):
    found = [
        axle_form(toy.transfer(train), axle, toy.model(), PAIRS)
        for train in services
        for axle in axles
    ]
    return stacked(found), len(found)


@pytest.mark.parametrize("layers", LAYERS)
def test_the_form_is_a_product_over_x(layers):
    """Against a sum over x of 1 + h times what the form itself settles, in the band and beside it."""
    form, n = forms()
    multipliers = np.tile(LAYERS[layers], n)
    h, u = fields(3, count=len(multipliers)), toy.profiles(range(3))
    weights = np.random.default_rng(1).random((3, 3 * n))
    change, uniform = varying_growth(
        VaryingForm(form, multipliers, None, FIRST), u, weights, PAIRS, h
    )
    n_points = grid_size(66, varies=True)
    waves = np.exp(2j * np.pi * np.outer(np.arange(1, 133), np.arange(n_points) / n_points))
    for r in range(3):
        settled = np.zeros(n_points)
        for e in range(3 * n):
            one = np.zeros((1, 3 * n))
            one[0, e] = weights[r, e]
            amplitudes = settled_beside(form, u[r], one, PAIRS)
            amplitudes[:, FIRST - 1 : 66], mean = growth(form, u[r], one, PAIRS)
            local = 1.0 + to_points(multipliers[:, e] @ h[r], n_points)
            settled += local * (mean + np.real(amplitudes[0] @ waves))
        expected = in_band(settled, MODES)
        np.testing.assert_allclose(change[r], expected, rtol=0, atol=1e-13 * np.abs(expected).max())
        assert uniform[r] == pytest.approx(settled.mean(), rel=1e-9)


def test_what_settles_beside_the_band():
    """Where every exponent is 2 the form is all that settles, at every mode number to 2 n_max."""
    transfer, model = toy.transfer(), toy.model(laws=toy.QUADRATIC_LAWS)
    form, u = axle_form(transfer, 4, model, PAIRS), toy.profiles([0])
    weights = model.settlement_factor * np.array(
        [[float(cycle_increment(law, 1e5, 1.0)) for law in model.group_laws]]
    )
    args = u[0], 4, transfer, model, np.full(3, 1e5), toy.WINDOW
    settled = settlement_of_passage(*args, np.zeros((3, grid_size(66, varies=True))))
    every = np.arange(1, 133)
    exact = in_band(settled, every)
    beside = settled_beside(form, u, weights, PAIRS)[0]
    outside = (every < FIRST) | (every > 66)
    np.testing.assert_allclose(
        beside[outside], exact[outside], rtol=0, atol=1e-10 * np.abs(exact).max()
    )
    assert not beside[~outside].any()


@pytest.mark.parametrize("n", [1, 33, 65])
@pytest.mark.parametrize("layers", LAYERS)
def test_kernel_and_twin(n, layers):
    form, services = forms()
    multipliers = np.tile(LAYERS[layers], services)
    following = np.linspace(1.0, 0.5, 61)
    varying = VaryingForm(form, multipliers, following, FIRST)
    h, u = fields(n, count=len(multipliers)), toy.profiles(range(n))
    weights = np.random.default_rng(n).random((n, 3 * services))
    fast = fast_varying_growth(varying, form.packed(), u, weights, PAIRS, h)
    slow = varying_growth(varying, u, weights, PAIRS, h)
    np.testing.assert_allclose(fast[0], slow[0], rtol=0, atol=1e-10 * np.abs(slow[0]).max())
    np.testing.assert_allclose(fast[1], slow[1], rtol=1e-10)


@pytest.mark.parametrize("layers", LAYERS)
def test_pointwise_kernel_against_the_passage(layers):
    """Every x and depth, exponents of 2 and not, axles that add up."""
    multipliers, model = LAYERS[layers], toy.model()
    h, u = fields(2, count=len(multipliers)), toy.profiles(range(2))
    weights = model.settlement_factor * np.stack(
        [cycle_increment(law, [1e5, 4e5], 1.0) for law in model.group_laws], axis=1
    )
    load = pointwise_load(toy.transfer(), model, toy.WINDOW, 0.0, load_parts(multipliers))
    change, uniform = pointwise_growth(load, np.array([0, 7]), u, weights, load.strain_factors(h))
    for r, cycles in enumerate([1e5, 4e5]):
        local = to_points(np.einsum("fl,fm->lm", multipliers, h[r]), load.n_points)
        settled = [
            settlement_of_passage(
                u[r], j, toy.transfer(), model, np.full(3, cycles), toy.WINDOW, local
            )
            for j in (0, 7)
        ]
        expected = in_band(sum(settled), MODES)
        np.testing.assert_allclose(change[r], expected, rtol=0, atol=1e-10 * np.abs(expected).max())
        assert uniform[r] == pytest.approx(sum(settled).mean(), rel=1e-10)


def varying_case(layers="one field", still=False, **changes):
    case = toy.case(**changes)
    transfers = case.transfers
    if still:
        transfers = tuple(replace(t, dynamic=np.zeros_like(t.dynamic)) for t in transfers)
    return replace(case, transfers=transfers, multipliers=LAYERS[layers])


@pytest.mark.parametrize(
    ("right_hand_side", "precision"),
    [
        ("spectral", "f64"),
        ("spectral", "f32"),
        ("pointwise", "f64"),
        # Compiles for seconds; without fields test_stepwise has it, with fields the line above.
        pytest.param("pointwise", "f32", marks=pytest.mark.slow),
    ],
)
def test_every_axle_against_the_definition(right_hand_side, precision):
    """Six axle passages."""
    case = varying_case("independent", services=(("car", 2),), horizon=0.75, sd_limit=0.1)
    case = replace(case, following=np.linspace(1.0, 0.6, 61))
    u0, h = toy.profiles(range(2)), fields(2, count=3)
    engine = engine_for(case, "every_axle", right_hand_side, precision=precision)
    if right_hand_side == "pointwise":  # what the default leaves out has a test of its own
        parts = load_parts(case.group_multipliers)
        exact = pointwise_load(case.transfers[0], case.model, case.window, 1e-8, parts)
        engine.loads = replace(engine.loads, load=joined([exact]))
    outcome = engine.run(u0, np.zeros(0), support=Support(h, np.array([1.0, 0.3])))
    for r, factor in enumerate([1.0, 0.3]):
        u, settled = u0[r], 0.0
        local = to_points(np.einsum("fl,fm->lm", case.multipliers, h[r]), 384)
        model = replace(case.model, settlement_factor=factor * case.model.settlement_factor)
        for i in range(6):
            u, more = passage(
                u, i % 4, case.transfers[0], model, toy.cycles(model, i), toy.WINDOW, local,
                case.following,
            )  # fmt: skip
            settled += more
        tolerance = 5e-4 if right_hand_side == "spectral" else 1e-9
        tolerance = max(tolerance, 1e-5 if precision == "f32" else 0.0)
        error = np.abs(outcome.amplitudes[r] - u).max() / np.abs(u - u0[r]).max()
        assert error < tolerance
        assert outcome.mean_settlement[r] == pytest.approx(settled, rel=max(tolerance, 1e-9))


def long_waves(layers, n):
    """Case, profiles and support of ``n`` tracks without the waves below 8 m: quick train by train."""
    h = fields(n, modes=np.arange(6, 26))
    support = Support(h, np.linspace(0.8, 1.3, n))
    case = varying_case(layers, shortest=8.0, settlement_factor=2.0 * toy.FACTOR)
    return case, toy.profiles(range(n), shortest=8.0), support


def test_steppings_agree():
    case, u, support = long_waves("multipliers", 5)
    jump, train = (
        engine_for(case, stepping).run(u, np.zeros(0), support=support)
        for stepping in ("cycle_jump", "every_train")
    )
    assert jump.reached.all()
    np.testing.assert_allclose(train.days, jump.days, rtol=2e-3)


@pytest.mark.parametrize("stepping", ["cycle_jump", "every_train"])
def test_bits_do_not_depend_on_the_batch(stepping):
    case, u, support = long_waves("one field", 70)
    engine = engine_for(case, stepping)
    together = engine.run(u, np.zeros(0), support=support)
    some = np.array([68, 3, 40])
    apart = engine.run(u[some], np.zeros(0), support=support[some])
    for name in ("days", "amplitudes", "mean_settlement"):
        assert np.array_equal(getattr(together, name)[some], getattr(apart, name))


def test_no_field_and_a_field_of_nothing():
    case, u = varying_case(), toy.profiles(range(4))
    days = np.array([0.0, 10.0])
    with_field = engine_for(case).run(u, days, support=Support(fields(4) * 0.0))
    without = engine_for(replace(case, multipliers=None)).run(u, days)
    np.testing.assert_allclose(with_field.days, without.days, rtol=1e-14)


# Closed forms without dynamic transfer: U(t) = U(0) + h S(t).


def test_sd_without_dynamics():
    """SD² = SD₀² + 2 ρ̂ c SD₀ S + c² S², S the uniform settlement."""
    case, n = varying_case(still=True), 6
    u0, h = toy.profiles(range(n)), fields(n, replace(EXPONENTIAL, profile_correlation=0.5))
    outcome = engine_for(case).run(u0, np.array([0.0, 3.0, 9.0]), support=Support(h))
    sd0 = np.sqrt(0.5 * np.sum(np.abs(u0) ** 2, axis=1))
    band = h[:, 0, FIRST - 1 : 66]
    c = np.sqrt(0.5 * np.sum(np.abs(band) ** 2, axis=1))
    rho = 0.5 * np.sum(band * u0.conj(), axis=1).real / (c * sd0)
    s = outcome.mean_settlement
    sd = np.sqrt(sd0**2 + 2.0 * rho * c * sd0 * s + c**2 * s**2)
    np.testing.assert_allclose(outcome.sd_final, sd, rtol=1e-8)
    at_limit = (sd0 / c) * (np.sqrt(rho**2 + (case.sd_limit / sd0) ** 2 - 1.0) - rho)
    assert outcome.reached.any()
    np.testing.assert_allclose(s[outcome.reached], at_limit[outcome.reached], rtol=1e-8)


def test_factor_and_coefficient_trade_exactly():
    """Without dynamics the SD depends on their product alone."""
    case, u = varying_case(still=True), toy.profiles(range(4))
    half = replace(case, model=replace(case.model, settlement_factor=toy.FACTOR / 2.0))
    h, days = fields(4), np.array([0.0, 5.0, 20.0])
    one = engine_for(case).run(u, days, support=Support(h))
    two = engine_for(half).run(u, days, support=Support(2.0 * h))
    np.testing.assert_allclose(one.days, two.days, rtol=1e-12)
    np.testing.assert_allclose(one.mean_settlement, 2.0 * two.mean_settlement, rtol=1e-12)


def test_a_constant_susceptibility_is_a_factor():
    transfer, model, u = toy.transfer(), toy.model(), toy.profiles([0])[0]
    args = (u, 3, transfer, model, np.full(3, 1e5), toy.WINDOW)
    more = settlement_of_passage(*args, np.full((3, 384), 0.25))
    plain = settlement_of_passage(*args, np.zeros((3, 384)))
    np.testing.assert_allclose(more, 1.25 * plain, rtol=1e-14)


def test_a_field_of_the_profile_tamps_every_track_on_one_day():
    """Correlation 1, the profile's own spectrum, no dynamics: SD = SD₀ + c S with c in proportion."""
    settings = replace(EXPONENTIAL, correlation_length=None, profile_correlation=1.0)
    case, n = varying_case(still=True), 8
    u = toy.profiles(range(n))
    h = fields(n, settings)
    band = h[:, 0, FIRST - 1 : 66]
    ratio = band / u
    np.testing.assert_allclose(ratio, ratio[:, :1].real * np.ones(61), rtol=1e-12)
    c = np.sqrt(0.5 * np.sum(np.abs(band) ** 2, axis=1))
    outcome = engine_for(case).run(u, np.zeros(0), support=Support(h * (0.3 / c)[:, None, None]))
    assert outcome.reached.all()
    np.testing.assert_allclose(outcome.days, outcome.days[0], rtol=1e-9)


def test_one_settling_group_of_linear_growth():
    """U = (U₀ + h c/L) e^{F L ΔΦ} − h c/L, each wave on its own."""
    laws = (None, None, toy.QUADRATIC_LAWS[2])
    case = varying_case(laws=laws, horizon=20.0, sd_limit=0.1)
    form = axle_form(case.transfers[0], 3, case.model, PAIRS)
    u0, h = 1e-9 * toy.profiles([0]), 1e-9 * fields(1)
    varying = VaryingForm(form, np.ones((1, 1)), None, FIRST)
    grown, n_steps = 2e-3, 100
    u = u0.copy()
    for _ in range(n_steps):  # the classical fourth-order rule
        step = np.array([[grown / n_steps]])
        k1 = varying_growth(varying, u, step, PAIRS, h)[0]
        k2 = varying_growth(varying, u + k1 / 2, step, PAIRS, h)[0]
        k3 = varying_growth(varying, u + k2 / 2, step, PAIRS, h)[0]
        k4 = varying_growth(varying, u + k3, step, PAIRS, h)[0]
        u = u + (k1 + 2.0 * k2 + 2.0 * k3 + k4) / 6.0
    band, ratio = h[0, :, FIRST - 1 : 66], form.constant[0] / form.linear[0]
    closed = (u0 + band * ratio) * np.exp(form.linear[0] * grown) - band * ratio
    np.testing.assert_allclose(u, closed, rtol=0, atol=1e-7 * np.abs(closed).max())


def test_identical_trains_still_count_alone():
    """One more of 72 equal trains: days in proportion 72/73, whatever the support."""
    u, support = toy.profiles(range(4)), Support(fields(4))
    days = [
        engine_for(varying_case(services=(("passenger", q),)))
        .run(u, np.zeros(0), support=support)
        .days
        for q in (72, 73)
    ]
    np.testing.assert_allclose(days[1] / days[0], 72.0 / 73.0, rtol=1e-5)


@pytest.mark.parametrize(("train", "sd", "cov", "error"), [
    ("passenger", 1.03e-3, 0.4, 3e-4), ("passenger", 1.5e-3, 0.4, 3e-4), ("freight", 2.4e-3, 0.4, 2e-3),
])  # fmt: skip
def test_what_the_form_leaves_out(train, sd, cov, error):
    """dU of one car against every x and depth."""
    transfer, model = toy.transfer(train), toy.model()
    form = axle_form(transfer, 4, model, PAIRS)
    u, h = toy.profiles(range(3), sd=sd), fields(3, replace(EXPONENTIAL, cov=cov))
    weights = np.tile(
        [
            model.settlement_factor * float(cycle_increment(law, 1e5, 1.0))
            for law in model.group_laws
        ],
        (3, 1),
    )
    change, _ = varying_growth(
        VaryingForm(form, np.ones((1, 3)), None, FIRST), u, weights, PAIRS, h
    )
    for r in range(3):
        local = np.repeat(to_points(h[r], 384), 3, axis=0)
        settled = settlement_of_passage(
            u[r], 4, transfer, model, np.full(3, 1e5), toy.WINDOW, local
        )
        exact = in_band(settled, mode_numbers(transfer.wavenumbers, toy.WINDOW))
        assert np.abs(change[r] - exact).max() < error * np.abs(exact).max()


def test_cycles_are_those_without_fields():
    assert np.array_equal(cycles_at(varying_case(), np.ones(2)), cycles_at(toy.case(), np.ones(2)))
