"""The pointwise kernel against ``passage``: every x, every depth, any exponent."""

import numpy as np
import pytest
import toy

from mcsettle.kernels import pointwise
from mcsettle.passage import in_band, mode_numbers, settlement_of_passage
from mcsettle.pointwise import pointwise_growth, pointwise_load
from mcsettle.settlement import cycle_increment

TOLERANCE = 1e-10  # of the largest: sums of some 1e4 products in another order


def both(model, axles, amplitudes, cycles, train="passenger", shortest=3.0):
    """Growth and uniform settlement of a frozen profile by the kernel and by ``passage``."""
    transfer = toy.transfer(train, shortest=shortest)
    grown = [
        cycle_increment(law, cycles[:, layer], 1.0)
        for layer, law in zip(model.settling_layers, model.group_laws, strict=True)
    ]
    weights = model.settlement_factor * np.stack(grown, axis=1)
    load = pointwise_load(transfer, model, toy.WINDOW)
    kernel = pointwise_growth(load, np.asarray(axles), amplitudes, weights)
    modes = mode_numbers(transfer.wavenumbers, toy.WINDOW)
    change, uniform = np.zeros_like(amplitudes), np.zeros(len(amplitudes))
    for row, u in enumerate(amplitudes):
        for axle in axles:
            settlement = settlement_of_passage(u, axle, transfer, model, cycles[row], toy.WINDOW)
            change[row] += in_band(settlement, modes)
            uniform[row] += settlement.mean()
    return kernel, (change, uniform)


def close(kernel, expected):
    np.testing.assert_allclose(
        kernel[0], expected[0], rtol=0, atol=TOLERANCE * np.abs(expected[0]).max()
    )
    np.testing.assert_allclose(kernel[1], expected[1], rtol=TOLERANCE)


@pytest.mark.parametrize("n", [1, 8, 13])
@pytest.mark.parametrize("stress", ["traffic", "total"])
def test_two_axles(n, stress):
    """Axles add up; realisations at different N, which is what their weights differ by."""
    model = toy.model(stress=stress)
    cycles = np.random.default_rng(n).uniform(1e5, 1e6, (n, 3))
    close(*both(model, [0, 7], toy.profiles(range(n)), cycles))


def test_a_layer_that_does_not_settle():
    model = toy.model(laws=(toy.LAWS[0], None, toy.LAWS[2]))
    cycles = np.full((3, 3), 1e5)
    close(*both(model, [1], toy.profiles(range(3)), cycles, "freight"))


def test_more_realisations_than_one_launch_holds():
    n = pointwise.CAPACITY + 5
    amplitudes = np.resize(toy.profiles(range(50), shortest=8.0), (n, 20))
    cycles = np.random.default_rng(1).uniform(1e5, 1e6, (n, 3))
    close(*both(toy.model(), [2], amplitudes, cycles, "car", 8.0))
