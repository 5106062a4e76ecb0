"""A constant load moving along a beam on a Winkler support: the closed form of the deflection."""

import numpy as np
import pytest

from mcsettle.railway.track import TOY_TRACK
from mcsettle.railway.traffic import Train
from mcsettle.railway.vehicle import FREIGHT
from mcsettle.step_a.beam import beam_response
from mcsettle.step_a.interaction import precompute

SUPPORT = 100e6
BENDING = 2.1e11 * 30.55e-6
MASS = 0.00763 * 7850.0
CRITICAL = (4 * SUPPORT * BENDING / MASS**2) ** 0.25


def deflection(distance, speed):
    """Of one rail under 1/2 N, at ``distance`` ahead of the load; below the critical speed."""
    decay = (SUPPORT / (4 * BENDING)) ** 0.25
    slow, fast = np.sqrt(1 - (speed / CRITICAL) ** 2), np.sqrt(1 + (speed / CRITICAL) ** 2)
    s = decay * np.abs(distance)
    shape = np.cos(fast * s) / slow + np.sin(fast * s) / fast
    return 0.5 * decay / (2 * SUPPORT) * np.exp(-slow * s) * shape


@pytest.mark.parametrize("ratio", [0.05, 0.3, 0.7, 0.9])
def test_moving_load(ratio):
    response = beam_response(TOY_TRACK, integration_depth=0.5, period=150.0, cutoff=120.0)
    speed = ratio * response.rayleigh_speed
    spectra = next(response.spectra(speed, np.array([0.0])))
    distance = np.linspace(-8.0, 8.0, 65)
    waves = np.exp(-1j * np.outer(distance, spectra.wavenumbers))
    found = waves @ (spectra.weights * spectra.receptance) / (2 * np.pi)
    expected = deflection(distance, speed)
    # beyond 120 rad/m lie (1.4/120)³ ≈ 1.6e-6 of the deflection
    np.testing.assert_allclose(found, expected, atol=3e-6 * expected.max())


def test_critical_speed():
    response = beam_response(TOY_TRACK, integration_depth=0.5, period=50.0, cutoff=5.0)
    assert response.rayleigh_speed == pytest.approx(CRITICAL, rel=1e-12)


def test_a_train_is_the_sum_of_its_loads():
    train, speed = Train("two cars", (FREIGHT, FREIGHT)), 60.0
    response = beam_response(TOY_TRACK, integration_depth=0.5, period=150.0, cutoff=120.0)
    found = precompute(train, speed, response, np.array([1.0])).rail_deflection
    a = train.axle_positions
    expected = deflection(a[:, None] - a, speed) @ train.axle_forces
    np.testing.assert_allclose(found, expected, rtol=5e-6)
