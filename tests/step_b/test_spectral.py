"""The second-order form: exact where every exponent is 2, third-order error elsewhere."""

from dataclasses import fields

import numpy as np
import pytest
import toy

from mcsettle.step_b.expansion_error import expansion_error
from mcsettle.step_b.mode_pairs import mode_pairs
from mcsettle.step_b.passage import in_band, mode_numbers, settlement_of_passage
from mcsettle.step_b.settlement import cycle_increment
from mcsettle.step_b.spectral import axle_form, growth, stacked, train_form

MODES = np.arange(6, 67)
PAIRS = mode_pairs(MODES)
AXLE = 3


def both(amplitudes, model, axle=AXLE):
    """Growth and uniform settlement of one passage: by the form, and at every x and depth."""
    transfer = toy.transfer()
    weights = weights_of(model)
    fast, uniform = growth(axle_form(transfer, axle, model, PAIRS), amplitudes, weights, PAIRS)
    slow = settlement_of_passage(amplitudes, axle, transfer, model, toy.cycles(model), toy.WINDOW)
    return (fast[0], uniform[0]), (in_band(slow, MODES), slow.mean())


def weights_of(model, n=1):
    grown = [cycle_increment(law, model.cycles_before(law), 1.0) for law in model.group_laws]
    return np.tile(model.settlement_factor * np.array(grown), (n, 1))


@pytest.mark.parametrize("stress", ["traffic", "total"])
@pytest.mark.parametrize("sd", [1e-6, 1e-3, 1e-2])
def test_exact_where_every_exponent_is_two(stress, sd):
    """Algebra, not expansion: rounding of some 1e4 terms is all that may differ."""
    model = toy.model(laws=toy.QUADRATIC_LAWS, stress=stress)
    for amplitudes in toy.profiles(range(3), sd=sd):
        (fast, uniform), (slow, mean) = both(amplitudes, model)
        assert np.abs(fast - slow).max() < 1e-10 * np.abs(slow).max()
        assert uniform == pytest.approx(mean, rel=1e-12, abs=0.0)


@pytest.mark.parametrize("stress", ["traffic", "total"])
def test_sub_ballast_exponent_is_expanded_to_second_order(stress):
    """m = 1.49: within 3e-4 at the case studies' SD, and the error is of third order.

    Relative to the growth (first order) a third-order error falls by 4 when the profile is halved;
    what is left beyond the third order bends that by less than a tenth.
    """
    model = toy.model(stress=stress)
    errors = []
    for sd in (toy.SD, toy.SD / 2):
        worst = 0.0
        for amplitudes in toy.profiles(range(3), sd=sd):
            (fast, uniform), (slow, mean) = both(amplitudes, model)
            worst = max(worst, np.abs(fast - slow).max() / np.abs(slow).max())
            assert uniform == pytest.approx(mean, rel=1e-5, abs=0.0)
        errors.append(worst)
    assert errors[0] < 3e-4
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.1)


def test_train_is_the_sum_of_its_axles():
    transfer, model, amplitudes = toy.transfer(), toy.model(), toy.profiles(range(2))
    weights = weights_of(model, 2)
    total = sum(
        growth(axle_form(transfer, j, model, PAIRS), amplitudes, weights, PAIRS)[0]
        for j in range(12)
    )
    whole, _ = growth(train_form(transfer, model, PAIRS), amplitudes, weights, PAIRS)
    np.testing.assert_allclose(whole, total, atol=1e-13 * np.abs(total).max())
    some = train_form(transfer, model, PAIRS, np.array([2, 7]))
    two = [axle_form(transfer, j, model, PAIRS) for j in (2, 7)]
    for field in fields(some):
        parts = [getattr(form, field.name) for form in two]
        np.testing.assert_allclose(getattr(some, field.name), parts[0] + parts[1], rtol=1e-12)


def test_groups_stand_side_by_side():
    """Stacked forms with joined weights add up to the sum of both."""
    model, amplitudes = toy.model(), toy.profiles(range(3))
    forms = [train_form(toy.transfer(t), model, PAIRS) for t in ("passenger", "freight")]
    rng = np.random.default_rng(3)
    weights = rng.random((3, 6))
    change, uniform = growth(stacked(forms), amplitudes, weights, PAIRS)
    first = growth(forms[0], amplitudes, weights[:, :3], PAIRS)
    second = growth(forms[1], amplitudes, weights[:, 3:], PAIRS)
    np.testing.assert_allclose(change, first[0] + second[0], atol=1e-13 * np.abs(change).max())
    np.testing.assert_allclose(uniform, first[1] + second[1], rtol=1e-13)


def test_packed_is_linear_sums_differences():
    form = axle_form(toy.transfer(), 0, toy.model(), PAIRS)
    packed = form.packed()
    joined = np.concatenate([form.linear, form.sums, form.differences], axis=1)
    np.testing.assert_array_equal(packed[..., 0] + 1j * packed[..., 1], joined)
    assert packed.flags.c_contiguous
    order = PAIRS.terms.order
    np.testing.assert_array_equal(
        form.packed(order)[:, len(MODES) :], packed[:, len(MODES) + order]
    )


def test_expansion_error_is_nothing_for_quadratic_laws_and_small_for_the_others():
    profiles = toy.profiles(range(2))
    services = (("passenger", 72), ("freight", 10))
    assert expansion_error(toy.case(services, laws=toy.QUADRATIC_LAWS), profiles) < 1e-10
    published = expansion_error(toy.case(services), profiles)
    assert 1e-7 < published < 3e-4
    # third order, as above
    assert expansion_error(toy.case(services), 0.5 * profiles) == pytest.approx(
        published / 4, rel=0.1
    )


def test_mode_numbers_of_the_toy_are_those_of_the_pairs():
    np.testing.assert_array_equal(mode_numbers(toy.transfer().wavenumbers, toy.WINDOW), MODES)
