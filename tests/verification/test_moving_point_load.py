"""Point load on an undamped half-space, at rest (Boussinesq) and moving below the Rayleigh speed.

The load is a Gaussian of standard deviation A along the track, so that the wavenumber integral ends;
the exact fields of a point load are averaged over the same Gaussian.
"""

import numpy as np
import pytest
from half_space import C_P, C_S, DEPTHS, POISSON, SHEAR, TOTAL, half_space, surface_unknowns

from mcsettle.step_a.fem25d.pml import Border
from mcsettle.step_a.fem25d.solve import outputs, solve

A = 0.6  # m
EDGES = np.array([0.0, 0.003, 0.03, 0.15, 0.4, 0.8, 1.4, 2.2, 3.2, 4.6, 6.5])
OFFSETS, SHARES = np.polynomial.hermite_e.hermegauss(40)
SHARES = SHARES / np.sqrt(2.0 * np.pi)


def directional(angle: np.ndarray, speed: float) -> np.ndarray:
    """F(θ) of a load moving at ``speed``; (1 - ν) where V cos θ = 0."""
    b = speed * np.cos(angle) / C_S
    a = speed * np.cos(angle) / C_P
    b = np.where(np.abs(b) < 1e-3, 1e-3, b)
    a = np.where(np.abs(a) < 1e-3 * C_S / C_P, 1e-3 * C_S / C_P, a)
    root = np.sqrt(1 - a**2)
    return b**2 * root / (4 * root * np.sqrt(1 - b**2) - (2 - b**2) ** 2)


def exact_surface(x: float, y: np.ndarray, speed: float) -> np.ndarray:
    dx = x - A * OFFSETS[:, None]
    angle = np.arctan2(y, dx) + np.pi / 2.0
    field = directional(angle, speed) / (2.0 * np.pi * SHEAR * np.hypot(dx, y))
    return TOTAL * SHARES @ field


def sweep(speed: float):
    """Wavenumbers, weights, surface uz(k, y) and stresses for the moving load."""
    section = half_space(0.2, Border(elements=11))
    at, y = surface_unknowns(section, 2.0, 4.5)
    x, w = np.polynomial.legendre.leggauss(4)
    half = np.diff(EDGES)[:, None] / 2.0
    k = (EDGES[:-1, None] + half + half * x).ravel()
    weights = (half * w).ravel() * np.exp(-((k * A) ** 2) / 2.0) / np.pi
    fields = [solve(section, q, q * speed) for q in k]
    surface = np.array([-u[at] for u in fields])
    centre, _ = surface_unknowns(section, -1e-6, 1e-6)
    axis = np.array([-u[centre] for u in fields])
    stress = np.array([outputs(section, q, u)[1:] for q, u in zip(k, fields, strict=True)])
    return k, weights, y, surface, axis, stress.reshape(k.size, 4, -1)


def along(k, weights, field, x):
    """Real field at distance x ahead: (1/π) Re ∫ f e^{-ikx} dk."""
    return np.tensordot(weights * np.exp(-1j * k * x), field, axes=1).real


@pytest.fixture(scope="module")
def moving():
    return sweep(0.7 * C_S)


@pytest.fixture(scope="module")
def resting():
    return sweep(0.0)


def test_displacement_abeam_grows_by_the_directional_factor(moving):
    k, weights, y, surface, _, _ = moving
    computed = along(k, weights, surface, 0.0)
    exact = exact_surface(0.0, y, 0.7 * C_S)
    assert np.all(exact > 1.15 * exact_surface(0.0, y, 0.0))
    np.testing.assert_allclose(computed, exact, rtol=0.01)


def test_displacement_on_the_axis_is_static(moving):
    k, weights, _, _, axis, _ = moving
    for x in (3.0, 5.0):
        # Below the Rayleigh speed ahead and behind agree; 2 %: the offsets of the Gaussian are
        # exact, the strip's are not.
        exact = exact_surface(x, np.array([1e-9]), 0.7 * C_S)
        np.testing.assert_allclose(along(k, weights, axis, x), exact, rtol=0.02)
        np.testing.assert_allclose(along(k, weights, axis, -x), exact, rtol=0.02)


@pytest.mark.parametrize("ahead", [0.0, 1.5])
def test_boussinesq_stresses(resting, ahead):
    k, weights, _, _, _, stress = resting
    computed = along(k, weights, stress, ahead)
    z = np.abs(DEPTHS)
    x = ahead - A * OFFSETS[:, None]
    big = np.hypot(x, z)
    near = (1 - 2 * POISSON) / (big * (big + z))
    xx = near - 3 * x**2 * z / big**5
    yy = (1 - 2 * POISSON) * z / big**3 - near
    exact = (
        TOTAL
        / (2 * np.pi)
        * np.stack([SHARES @ f for f in (xx, yy, -3 * z**3 / big**5, 3 * x * z**2 / big**5)])
    )
    # 1 % of the largest stress at that depth: elements of 0.2-0.7 m, strip instead of point.
    assert np.all(np.abs(computed - exact) < 0.01 * np.abs(exact).max(axis=0))
