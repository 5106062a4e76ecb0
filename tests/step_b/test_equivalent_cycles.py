"""Cycles of different loads: closed forms, and the steppings against each other."""

from dataclasses import replace

import numpy as np
import pytest
import toy

from mcsettle.railway.track import BallastLaw
from mcsettle.step_b.cycles import daily_weights
from mcsettle.step_b.engine import engine_for
from mcsettle.step_b.equivalent_cycles import counting_remark, with_equivalent_cycles
from mcsettle.step_b.few_weights import few_weights
from mcsettle.step_b.settlement import cycle_increment, cycle_rate, long_run_rate
from mcsettle.step_b.spectral import stacked, train_form
from mcsettle.step_b.susceptibility import VaryingForm, varying_growth

MIXED = (("passenger", 36), ("freight", 2))


def counted(exponent, history="reference", services=MIXED, **changes):
    case = toy.case(
        services,
        cycles="equivalent",
        equivalence_exponent=exponent,
        equivalence_history=history,
        **changes,
    )
    reference = toy.transfer(services[0][0]) if history == "reference" else None
    return with_equivalent_cycles(case, reference)


def days(case, stepping="cycle_jump", n=4):
    return engine_for(case, stepping).run(toy.profiles(range(n)), np.zeros(0)).days


def test_exponent_zero_counts_every_axle_alike():
    shared = toy.case(MIXED)
    assert np.array_equal(days(counted(0.0)), days(shared))


def one_class(case):
    """Every axle under the stresses of the fourth."""
    alike = tuple(
        replace(t, quasi_static=np.repeat(t.quasi_static[3:4], len(t.quasi_static), axis=0))
        for t in case.transfers
    )
    return replace(case, transfers=alike)


@pytest.mark.parametrize("history", ["reference", "mix"])
@pytest.mark.parametrize("stress", ["traffic", "total"])
def test_one_axle_class_counts_alike_whatever_the_exponent(history, stress):
    services = (("passenger", 72),)
    plain = one_class(toy.case(services, stress=stress))
    model = replace(
        plain.model, cycles="equivalent", equivalence_exponent=5.0, equivalence_history=history
    )
    case = with_equivalent_cycles(
        replace(plain, model=model), plain.transfers[0] if history == "reference" else None
    )
    np.testing.assert_allclose(days(case), days(plain), rtol=1e-9)


@pytest.mark.parametrize(
    ("exponent", "history"),
    [
        (3.0, "reference"),
        (5.0, "mix"),
        pytest.param(3.0, "mix", marks=pytest.mark.slow),  # each of the four once above
        pytest.param(5.0, "reference", marks=pytest.mark.slow),
    ],
)
def test_every_axle_and_every_train_against_day_averages(exponent, history):
    case = counted(exponent, history)
    jump = days(case)
    assert np.isfinite(jump).all()
    np.testing.assert_allclose(days(case, "every_axle"), jump, rtol=2e-3)
    # Freight roughens the end of a day here: frozen over a train, a track may cross a day apart.
    np.testing.assert_allclose(days(case, "every_train"), jump, rtol=0, atol=1.0)


def test_one_passage_by_its_own_formula():
    """A σ^m ρ^(−nb) D^b expm1(b log1p(p ρ^n / D)), and the logarithm's, from the scaled case."""
    n, case = 3.0, counted(3.0)
    plain, d = toy.case(MIXED), 1e5
    for s, (before, after) in enumerate(zip(plain.transfers, case.transfers, strict=True)):
        for g, z in enumerate(range(len(before.grid.z))):
            law, count = case.model.laws[z], case.severity[s][:, g]
            state = after.quasi_static[:, :, z]
            sigma = np.linalg.norm(toy.deviator(state), axis=1)
            own = np.linalg.norm(toy.deviator(before.quasi_static[:, :, z]), axis=1)
            found = sigma**law.exponent * cycle_increment(law, d, count) / count
            rho = count ** (1.0 / n)
            if isinstance(law, BallastLaw):
                expected = own**2 * law.log_slope / np.log(10.0) * np.log1p(rho**n / d)
            else:
                inside = np.expm1(law.b * np.log1p(rho**n / d))
                expected = own**law.m * rho ** (-n * law.b) * d**law.b * inside
            np.testing.assert_allclose(found, expected, rtol=1e-12)


def test_the_laws_own_exponents():
    case = counted("law", ballast_equivalence_exponent=5.0)
    freight = case.severity[1].max(axis=0)
    assert freight[-1] > freight[0] > 1.0  # clay at depth, ballast
    with pytest.raises(ValueError, match="exponent for every law"):
        counted("law")


def test_an_axle_that_counts_beyond_measure_is_remarked_on():
    assert counting_remark(counted(5.0)) is None
    assert counting_remark(toy.case(MIXED)) is None
    text = counting_remark(counted(30.0))
    assert "'freight' counts" in text
    assert "exponents of 1.5 to 3" in text


def test_identical_trains_count_alone():
    """One more of 36 equal trains in a mix of its own: 36/37 of the days."""
    one = counted(3.0, "mix", (("passenger", 36),))
    two = counted(3.0, "mix", (("passenger", 37),))
    np.testing.assert_allclose(days(two) / days(one), 36.0 / 37.0, rtol=1e-5)


def test_the_long_run_term():
    """λ times the slope at N_s for every cycle; the increments add up to the integral of the rate."""
    model = toy.model(long_run_cycles=1e6, long_run_strength=0.5)
    for law in model.group_laws:
        linear = long_run_rate(law, model)
        assert linear == pytest.approx(0.5 * float(cycle_rate(law, 1e6)))
        more = cycle_increment(law, 1e5, 1e6, linear) - cycle_increment(law, 1e5, 1e6)
        assert more == pytest.approx(linear * 1e6, rel=1e-9)
        step = cycle_increment(law, 1e5, 1e-3, linear) / 1e-3
        assert step == pytest.approx(float(cycle_rate(law, 1e5, linear)), rel=1e-6)
    case = toy.case(long_run_cycles=1e6)
    assert (days(case) < days(toy.case())).all()
    np.testing.assert_allclose(days(case, "every_train"), days(case), rtol=2e-3)


@pytest.mark.parametrize("multipliers", [None, np.ones((1, 3)), np.diag([1.0, 0.5, 2.0])])
@pytest.mark.parametrize("history", ["reference", "mix"])
def test_a_few_weights_do_for_every_depth(history, multipliers):
    """The growth of a third as many combinations is that of all depths, of all services and of one."""
    plain = toy.case(MIXED, cycles="equivalent", equivalence_exponent=5.0,
                     equivalence_history=history)  # fmt: skip
    reference = toy.transfer("passenger") if history == "reference" else None
    case = with_equivalent_cycles(replace(plain, multipliers=multipliers), reference)
    form = stacked([train_form(t, case.model, case.mode_pairs) for t in case.transfers])
    own = np.tile(case.group_multipliers, 2)
    few = few_weights(case, form, own)
    assert 2 * few.combined.shape[1] < few.combined.shape[0]
    n, n_fields = 5, len(own)
    u = toy.profiles(range(n))
    h = 0.1 * np.ones((n, n_fields, 132), dtype=complex)
    days, ground = np.geomspace(1.0, 900.0, n), np.linspace(0.0, 50.0, n)
    weights = daily_weights(case, days, ground)
    args = (case.mode_pairs, h)
    fewer = VaryingForm(few.form, few.multipliers, None, 6)
    one_service = np.where(np.arange(weights.shape[1]) < weights.shape[1] // 2, weights, 0.0)
    for given in (weights, one_service):
        many = varying_growth(VaryingForm(form, own, None, 6), u, given, *args)
        one = varying_growth(fewer, u, few.of(given), *args)
        np.testing.assert_allclose(one[0], many[0], rtol=0, atol=1e-5 * np.abs(many[0]).max())
        np.testing.assert_allclose(one[1], many[1], rtol=1e-5)
