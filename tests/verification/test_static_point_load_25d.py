"""Static 2.5D point load on a half-space: Bessel forms over three decades of wavenumber.

Surface: uz = (1 - ν)/(πG) K0(k|y|). Interior, below the load: σzz = -z k² K2(k z)/π.
"""

import numpy as np
import pytest
from half_space import DEPTHS, HALF_WIDTH, POISSON, SHEAR, TOTAL, half_space, surface_unknowns
from scipy.special import k0, kn

from mcsettle.step_a.fem25d.solve import outputs, solve

POINTS, SHARES = np.polynomial.legendre.leggauss(8)
SHARES = SHARES / 2.0


@pytest.fixture(scope="module")
def section():
    return half_space()


@pytest.mark.parametrize("wavenumber", [0.01, 0.1, 1.0, 3.0])
def test_surface_displacement(section, wavenumber):
    at, y = surface_unknowns(section, 0.7, 3.5)
    near = wavenumber * y < 4.0  # beyond, the field is e^-4 of that at the load
    computed = -solve(section, wavenumber, 0.0)[at][near]
    distance = np.abs(y[near][:, None] - HALF_WIDTH * POINTS)  # from each part of the strip
    exact = TOTAL * (1.0 - POISSON) / (np.pi * SHEAR) * k0(wavenumber * distance) @ SHARES
    # 1 %: k h reaches 1.5 where elements are 0.5 m long; below 1 rad/m the border's length counts.
    np.testing.assert_allclose(computed.real, exact, rtol=0.01)
    assert np.abs(computed.imag).max() < 1e-3 * np.abs(computed.real).max()


@pytest.mark.parametrize("wavenumber", [0.001, 0.01, 0.1, 1.0])
def test_vertical_stress_below_the_load(section, wavenumber):
    computed = outputs(section, wavenumber, solve(section, wavenumber, 0.0))[1:].reshape(4, -1)[2]
    r = np.hypot(DEPTHS[:, None], HALF_WIDTH * POINTS)
    point = np.abs(DEPTHS[:, None]) ** 3 * wavenumber**2 * kn(2, wavenumber * r) / (np.pi * r**2)
    exact = -TOTAL * point @ SHARES
    np.testing.assert_allclose(computed.real, exact, rtol=5e-3)  # measured: 1e-3
