"""The pointwise kernel against ``passage``: every x, every depth, any exponent."""

from dataclasses import replace

import numpy as np
import pytest
import toy

from mcsettle.kernels import fourier, runtime, spectral
from mcsettle.kernels.backend import ti
from mcsettle.kernels.laws import (
    binary_logarithm,
    binary_logarithm_32,
    power_of_two,
    power_of_two_32,
)
from mcsettle.railway.settlement_model import SettlementModel
from mcsettle.railway.track import PowerLaw
from mcsettle.step_b.cycles import update_weights
from mcsettle.step_b.passage import grid_size, in_band, mode_numbers, settlement_of_passage
from mcsettle.step_b.pointwise import joined, pointwise_growth, pointwise_load
from mcsettle.step_b.settlement import cycle_increment
from mcsettle.step_b.stepwise import pointwise_day_loads

TOLERANCE = 1e-10  # of the largest: sums of some 1e4 products in another order, powers by series
STEEP = replace(toy.LAWS[1], m=2.4)


def both(model, axles, amplitudes, cycles, transfer=None, window=toy.WINDOW, tolerance=0.0):
    """Growth and uniform settlement of a frozen profile by the kernel and by ``passage``."""
    transfer = transfer or toy.transfer()
    grown = [
        cycle_increment(law, cycles[:, layer], 1.0)
        for layer, law in zip(model.settling_layers, model.group_laws, strict=True)
    ]
    weights = model.settlement_factor * np.stack(grown, axis=1)
    load = pointwise_load(transfer, model, window, tolerance)
    kernel = pointwise_growth(load, np.asarray(axles), amplitudes, weights)
    modes = mode_numbers(transfer.wavenumbers, window)
    change, uniform = np.zeros_like(amplitudes), np.zeros(len(amplitudes))
    for row, u in enumerate(amplitudes):
        for axle in axles:
            settlement = settlement_of_passage(u, axle, transfer, model, cycles[row], window)
            change[row] += in_band(settlement, modes)
            uniform[row] += settlement.mean()
    return kernel, (change, uniform)


def close(kernel, expected, tolerance=TOLERANCE):
    largest = np.abs(expected[0]).max()
    np.testing.assert_allclose(kernel[0], expected[0], rtol=0, atol=tolerance * largest)
    np.testing.assert_allclose(kernel[1], expected[1], rtol=tolerance)


@pytest.mark.parametrize("n", [1, 13])
@pytest.mark.parametrize("stress", ["traffic", "total"])
def test_two_axles(n, stress):
    """Axles add up; realisations at different N, which is what their weights differ by."""
    model = toy.model(stress=stress)
    cycles = np.random.default_rng(n).uniform(1e5, 1e6, (n, 3))
    close(*both(model, [0, 7], toy.profiles(range(n)), cycles))


@pytest.mark.parametrize(
    "laws",
    [
        (toy.LAWS[0], None, toy.LAWS[2]),
        (None, STEEP, None),
        (toy.LAWS[0], STEEP, replace(toy.LAWS[2], m=1.2)),
        toy.QUADRATIC_LAWS,
    ],
)
def test_laws(laws):
    model, n = toy.model(laws=laws), 3
    cycles = np.random.default_rng(2).uniform(1e5, 1e6, (n, 3))
    close(*both(model, [1], toy.profiles(range(n)), cycles, toy.transfer("freight")))


def test_an_odd_number_of_depths():
    transfer = toy.transfer("car", shortest=8.0)
    here = np.flatnonzero(transfer.grid.layer == 1)
    grid = transfer.grid
    layer = grid.layer.copy()
    layer[here[-1]] = 2
    odd = replace(transfer, grid=replace(grid, layer=layer))
    model = toy.model(laws=(toy.LAWS[0], STEEP, STEEP))
    assert (layer == 1).sum() % 2
    close(*both(model, [0, 3], toy.profiles([4], shortest=8.0), np.full((1, 3), 1e5), odd))


def test_more_realisations_than_one_launch_holds():
    n, transfer = spectral.CAPACITY + 70, toy.transfer("car", shortest=20.0)
    amplitudes = np.resize(toy.profiles(range(50), shortest=20.0), (n, len(transfer.wavenumbers)))
    cycles = np.random.default_rng(1).uniform(1e5, 1e6, (n, 3))
    close(*both(toy.model(), [2], amplitudes, cycles, transfer))


@pytest.mark.parametrize(
    ("window", "shortest"),
    [
        (70.0, 3.0),
        (600.0, 8.0),
        # Compiles for seconds what 200 m have too, 384 points.
        pytest.param(1000.0, 10.0, marks=pytest.mark.slow),
    ],
)
def test_windows(window, shortest):
    """Grids of 96, 288 and 384 points: passes of radix 2, 3 and 4; modes from 2 or so."""
    transfer = toy.transfer("car", window, shortest)
    assert grid_size(int(window / shortest)) in (96, 288, 384)
    amplitudes = toy.profiles(range(2), window=window, shortest=shortest)
    close(*both(toy.model(), [1], amplitudes, np.full((2, 3), 1e5), transfer, window))


@pytest.mark.parametrize("highest", [1, 5, 23, 66, 100, 133, 333, 666])
def test_grids_of_every_window_can_be_transformed(highest):
    n_points = grid_size(highest)
    assert n_points >= 3.8 * highest
    assert 16 * np.prod(fourier.radices(n_points), dtype=int) == n_points
    with pytest.raises(ValueError, match="the transform takes"):
        fourier.radices(252)


@pytest.mark.parametrize("sd", [1e-3, 5e-3])
def test_what_is_left_out_falls_with_the_tolerance(sd):
    """The default errs no more than the grid's own points; a quarter of the fields is enough."""
    transfer, model, cycles = toy.transfer(), toy.model(), np.full((4, 3), 1e5)
    amplitudes, errors, sizes = toy.profiles(range(4), sd=sd), [], []
    for tolerance in (1e-4, 1e-6, 1e-8, 0.0):
        kernel, expected = both(model, [5], amplitudes, cycles, tolerance=tolerance)
        errors.append(np.abs(kernel[0] - expected[0]).max() / np.abs(expected[0]).max())
        sizes.append(len(pointwise_load(transfer, model, toy.WINDOW, tolerance).kind))
    assert errors[0] > errors[1] > errors[2] > errors[3]
    assert sizes[0] < sizes[1] < sizes[2] < sizes[3] / 2
    kernel, expected = both(model, [5], amplitudes, cycles, tolerance=1e-8)
    close(kernel, expected, 1e-9)
    default = pointwise_load(transfer, model, toy.WINDOW)
    assert len(default.kind) == sizes[0]
    assert errors[0] < 2e-6 * sd / 1e-3


def test_a_broken_neighbour_is_not_felt():
    """A row of NaN changes no bit of the rows beside it, and is not hidden by the power."""
    for laws in (toy.LAWS, (None, STEEP, None)):
        model = toy.model(laws=laws)
        load = pointwise_load(toy.transfer("car", shortest=8.0), model, toy.WINDOW)
        weights = np.full((6, len(model.group_laws)), 1e-3)
        amplitudes = toy.profiles(range(6), shortest=8.0)
        clean, _ = pointwise_growth(load, np.arange(2), amplitudes, weights)
        amplitudes[3] = np.nan
        change, _ = pointwise_growth(load, np.arange(2), amplitudes, weights)
        others = [0, 1, 2, 4, 5]
        np.testing.assert_array_equal(change[others], clean[others])
        assert np.isnan(change[3]).all()


def test_an_exponent_out_of_range_is_refused():
    model = SettlementModel((PowerLaw(a=1.0, b=0.1, m=10.5, strength=1e6), None, None))
    with pytest.raises(ValueError, match=r"exponent 10\.5"):
        pointwise_load(toy.transfer("car", shortest=8.0), model, toy.WINDOW)


@ti.kernel
def powers(
    q2: ti.types.ndarray(dtype=ti.f64, ndim=1),
    exponent: ti.f64,
    out: ti.types.ndarray(dtype=ti.f64, ndim=1),
):
    for i in range(q2.shape[0]):
        out[i] = power_of_two(0.5 * exponent * binary_logarithm(q2[i]))


@pytest.mark.parametrize("exponent", [0.3, 1.49, 2.0, 2.4, 10.0])
def test_power(exponent):
    """Polynomials of 1e-14, times the logarithm that the exponent multiplies (up to 60 here)."""
    runtime.start()
    q2 = np.concatenate([[0.0], np.logspace(-6.0, 18.0, 20_001), 2.0 ** np.arange(-8, 40)])
    found = np.empty_like(q2)
    powers(q2, exponent, found)
    assert found[0] < 1e-8
    np.testing.assert_allclose(found[1:], q2[1:] ** (exponent / 2), rtol=2e-13 * max(exponent, 1))


@ti.kernel
def powers_32(
    q2: ti.types.ndarray(dtype=ti.f32, ndim=1),
    exponent: ti.f32,
    out: ti.types.ndarray(dtype=ti.f32, ndim=1),
):
    for i in range(q2.shape[0]):
        out[i] = power_of_two_32(ti.f32(0.5) * exponent * binary_logarithm_32(q2[i]))


@pytest.mark.parametrize("exponent", [0.3, 1.49, 2.0, 2.4])
def test_power_in_single_precision(exponent):
    """Roundings of 6e-8, times the logarithm that the exponent multiplies (up to 60 here)."""
    runtime.start()
    q2 = np.concatenate([[0.0], np.logspace(-6.0, 18.0, 20_001)]).astype(np.float32)
    found = np.empty_like(q2)
    powers_32(q2, exponent, found)
    assert found[0] < 1e-4
    expected = q2[1:].astype(float) ** (exponent / 2)
    np.testing.assert_allclose(found[1:], expected, rtol=3e-6 * max(exponent, 1))


def test_march_follows_the_definition():
    """Two services, profile by profile, axle by axle; some lanes stop on the way."""
    case = toy.case((("car", 2), ("freight", 1)), shortest=8.0, settlement_factor=1e5)
    exact = [pointwise_load(t, case.model, case.window, tolerance=1e-8) for t in case.transfers]
    loads, n, count = replace(pointwise_day_loads(case), load=joined(exact)), 5, 40
    u = toy.profiles(range(n), shortest=8.0) * np.linspace(0.9, 1.1, n)[:, None]
    limit = 1.12e-3
    state = loads.begin(u, 2.0 * limit**2)
    updates = update_weights(case, loads.plan, 0, count)
    for piece in (slice(0, 1), slice(1, 15), slice(15, count)):
        state.advance(updates[0][piece], updates[1][piece])
    modes = mode_numbers(case.transfers[0].wavenumbers, case.window)
    axles = [(t, j) for t in case.transfers for j in range(len(t.quasi_static))]
    expected, done = u.copy(), np.zeros(n, dtype=int)
    start = case.model.ballast_cycles_before
    for row in range(n):
        for step, load in enumerate(updates[0]):
            if np.sum(np.abs(expected[row]) ** 2) >= 2.0 * limit**2:
                break
            cycles = np.full(3, start + step)
            s = settlement_of_passage(
                expected[row], axles[load][1], axles[load][0], case.model, cycles, case.window
            )
            expected[row] += in_band(s, modes)
            done[row] += 1
    assert len(np.unique(done)) > 2
    np.testing.assert_array_equal(state.updates(), done)
    grown = np.abs(expected - u).max()
    # such a tolerance: 1e-9 of the change a passage
    np.testing.assert_allclose(state.amplitudes(), expected, rtol=0, atol=1e-9 * grown)
