"""One axle passage: by hand at one point, and what must hold whatever the profile."""

import numpy as np
import pytest
import toy

from mcsettle.step_b import passage as module
from mcsettle.step_b.passage import grid_size, in_band, mode_numbers, passage, settlement_of_passage

AXLE = 5
MODEL = toy.model()
CYCLES = toy.cycles(MODEL, 12345.0)


def settle(amplitudes, model=MODEL, axle=AXLE):
    return settlement_of_passage(amplitudes, axle, toy.transfer(), model, CYCLES, toy.WINDOW)


@pytest.mark.parametrize("stress", ["traffic", "total"])
def test_one_point_by_hand(stress):
    """Eqs. (1), (2), (10) in printed units, with principal stresses, at one x."""
    transfer, model = toy.transfer(), toy.model(stress=stress, cycles_per_passage=3.0)
    amplitudes = toy.profiles([4])[0]
    settlement = settle(amplitudes, model)
    point = 37
    x = toy.WINDOW * point / len(settlement)
    wave = np.exp(1j * transfer.wavenumbers * x)
    expected = 0.0
    for z, (thickness, layer) in enumerate(
        zip(transfer.grid.weights, transfer.grid.layer, strict=True)
    ):
        xx, yy, zz, xz = (
            transfer.quasi_static[AXLE, c, z]
            + np.sum(amplitudes * transfer.dynamic[AXLE, :, c, z] * wave).real
            + (transfer.geostatic[c, z] if stress == "total" else 0.0)
            for c in range(4)
        )
        a, b, c = np.linalg.eigvalsh([[xx, 0, xz], [0, yy, 0], [xz, 0, zz]])
        sigma_d = np.sqrt(0.5 * ((a - b) ** 2 + (b - c) ** 2 + (c - a) ** 2))
        n, law = CYCLES[layer], model.laws[layer]
        if layer == 0:
            strain = 0.375 * (sigma_d / 1e6) ** 2 * 0.4 * (np.log10(n + 3) - np.log10(n))
        else:
            growth = (n + 3) ** law.b - n**law.b
            strain = law.a * (sigma_d / law.strength) ** law.m * growth / 100
        expected += toy.FACTOR * strain * thickness
    # the plain differences above keep 16 − log10(N/3) − 1 = 10 digits
    assert settlement[point] == pytest.approx(expected, rel=1e-9, abs=0.0)


def test_smooth_track_settles_uniformly():
    transfer = toy.transfer()
    zero = np.zeros(len(transfer.wavenumbers), dtype=complex)
    settlement = settle(zero)
    assert settlement[0] > 0.0
    np.testing.assert_array_equal(settlement, settlement[0])
    after, uniform = passage(zero, AXLE, transfer, MODEL, CYCLES, toy.WINDOW)
    assert uniform == pytest.approx(settlement[0], rel=1e-14, abs=0.0)
    # a transform of equal numbers leaves rounding: ε log2 X of them
    assert np.abs(after).max() < 1e-14 * uniform


def test_growth_is_linear_for_small_profiles():
    """What superposition misses is second order in the amplitude: observed order 2."""
    transfer = toy.transfer()
    modes = mode_numbers(transfer.wavenumbers, toy.WINDOW)
    a, b = toy.profiles([0, 1])

    def growth(amplitudes):
        return in_band(settle(amplitudes), modes)

    missed = []
    for scale in (0.1, 0.05):
        gap = growth(scale * (a + b)) - growth(scale * a) - growth(scale * b)
        missed.append(np.abs(gap).max() / np.abs(growth(scale * a)).max())
    assert missed[0] < 0.02
    # a relative gap of first order is an absolute one of second order
    assert missed[0] / missed[1] == pytest.approx(2.0, rel=0.02)


@pytest.mark.parametrize("sd", [1e-6, 1e-3, 0.1])
@pytest.mark.parametrize("stress", ["traffic", "total"])
def test_settlement_is_never_negative(sd, stress):
    """Even where the dynamic stress would lift the wheel: strain is a power of |σ_d|."""
    for amplitudes in toy.profiles(range(5), sd=sd):
        for axle in (0, 5, 11):
            assert settle(amplitudes, toy.model(stress=stress), axle).min() >= 0.0


def test_a_shifted_profile_settles_alike_elsewhere():
    amplitudes = toy.profiles([2])[0]
    here = settle(amplitudes)
    shift = 2 * np.pi * 17 / len(here) * mode_numbers(toy.transfer().wavenumbers, toy.WINDOW)
    there = settle(amplitudes * np.exp(-1j * shift))
    np.testing.assert_allclose(there, np.roll(here, 17), rtol=1e-11)


def test_a_finer_grid_changes_nothing(monkeypatch):
    """Products of two modes fit on the grid; exponent 1.49 aliases far below its own size."""
    transfer, amplitudes = toy.transfer(), toy.profiles([2])[0]
    modes = mode_numbers(transfer.wavenumbers, toy.WINDOW)
    for laws, tolerance in ((toy.QUADRATIC_LAWS, 1e-12), (toy.LAWS, 1e-5)):
        model = toy.model(laws=laws)
        coarse = in_band(settle(amplitudes, model), modes)
        with monkeypatch.context() as patch:
            patch.setattr(module, "grid_size", lambda highest: 3 * grid_size(highest))
            fine = in_band(settle(amplitudes, model), modes)
        assert np.abs(fine - coarse).max() < tolerance * np.abs(fine).max()


def test_the_factor_scales_the_settlement():
    amplitudes = toy.profiles([2])[0]
    twice = settle(amplitudes, toy.model(settlement_factor=2 * toy.FACTOR))
    np.testing.assert_allclose(twice, 2 * settle(amplitudes), rtol=1e-14)


def test_in_band_returns_the_amplitudes_of_a_sum_of_waves():
    x = np.arange(64) / 64
    heights = 5.0 + np.real((2 - 3j) * np.exp(2j * np.pi * 7 * x)) + np.cos(2 * np.pi * 9 * x)
    np.testing.assert_allclose(in_band(heights, np.array([7, 8, 9])), [2 - 3j, 0, 1], atol=1e-14)


def test_wavenumbers_must_be_modes_of_the_window():
    k = toy.transfer().wavenumbers
    np.testing.assert_array_equal(mode_numbers(k, toy.WINDOW), np.arange(6, 67))
    with pytest.raises(ValueError, match="not modes of a window of 190"):
        mode_numbers(k, 190.0)
