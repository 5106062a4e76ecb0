"""Strip load on a half-space against Boussinesq, the 2.5D point load and the plane-strain strip."""

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.special import kv

from mcsettle.step_a.halfspace import strip_stress

WIDTH, POISSON = 2.5, 0.3


def boussinesq(x, y, depth, poisson):
    """Stresses xx, yy, zz, xz under a unit point load; tension positive, z up."""
    r2 = x**2 + y**2
    distance = np.sqrt(r2 + depth**2)

    def normal(a2, b2):
        side = (a2 - b2) / (distance * r2 * (distance + depth)) + b2 * depth / (distance**3 * r2)
        return 3 * a2 * depth / distance**5 - (1 - 2 * poisson) * side

    return np.stack(
        [
            -normal(x**2, y**2),
            -normal(y**2, x**2),
            -3 * depth**3 / distance**5,
            3 * x * depth**2 / distance**5,
        ]
    ) / (2 * np.pi)


@pytest.mark.parametrize("depth", [0.2, 0.8, 3.0])
@pytest.mark.parametrize("x", [-1.1, 0.4, 4.0])
def test_all_components_are_boussinesqs_spread_over_the_width(depth, x):
    """Fixes every sign, that of the shear stress ahead of and behind the load included."""
    cutoff, period = 40.0 / depth, 1000.0
    step = 2 * np.pi / period
    k = step * np.arange(-int(cutoff / step), int(cutoff / step) + 1)
    spectrum = strip_stress(k, depth, WIDTH, POISSON)
    found = (np.exp(-1j * k * x) @ spectrum) * step / (2 * np.pi)
    nodes, weights = np.polynomial.legendre.leggauss(200)
    expected = boussinesq(x, nodes * WIDTH / 2, depth, POISSON) @ weights / 2
    # the load repeats every 1000 m; its images' σxx falls with 1/x²: 1e-7 Pa per N
    np.testing.assert_allclose(found, expected, atol=3e-7)


@pytest.mark.parametrize("depth", [0.003, 0.1, 1.0, 6.0])
@pytest.mark.parametrize("k", [1e-3, 0.3, 2.0, 8.0])
def test_vertical_stress_is_the_point_load_integrated_over_the_width(depth, k):
    def point(y):
        r = np.hypot(y, depth)
        return -(depth**3) * k**2 * kv(2, k * r) / (np.pi * r**2)

    half, near = WIDTH / 2, min(WIDTH / 2, 10 * depth)
    parts = [quad(point, a, b, epsabs=1e-13, epsrel=1e-11)[0] for a, b in ((0, near), (near, half))]
    expected = 2 * sum(parts) / WIDTH
    found = strip_stress(np.array([k]), depth, WIDTH, POISSON)[0, 2]
    # 1e-10 of the surface pressure 1/b
    assert found == pytest.approx(expected, rel=1e-9, abs=4e-11)


@pytest.mark.parametrize("depth", [0.003, 0.5, 5.0])
def test_long_waves_are_the_plane_strain_strip(depth):
    angle = 2 * np.arctan(WIDTH / (2 * depth))
    vertical = -(angle + np.sin(angle)) / (np.pi * WIDTH)
    across = -(angle - np.sin(angle)) / (np.pi * WIDTH)
    expected = [POISSON * (vertical + across), across, vertical, 0.0]
    # k = 0 is replaced by 1e-8 rad/m, which σxx feels as k/2
    np.testing.assert_allclose(
        strip_stress(np.array([0.0]), depth, WIDTH, POISSON)[0], expected, atol=1e-8
    )


def test_near_the_surface_the_stress_is_the_pressure():
    """σzz = σ = -1/b and, with κζ → 0, σxx + σyy = -(1 + 2ν)/b."""
    depth = 1e-5
    found = strip_stress(np.array([0.5]), depth, WIDTH, POISSON)[0]
    assert found[2] == pytest.approx(-1 / WIDTH, rel=1e-4)  # 1 - O(kζ)
    assert found[0] + found[1] == pytest.approx(-(1 + 2 * POISSON) / WIDTH, rel=1e-4)


def test_trace_is_twice_one_plus_nu_times_the_harmonic_part():
    """σxx + σyy + σzz = -2(1 + ν) × harmonic: it must not depend on how ν enters each one."""
    k = np.linspace(0.01, 8.0, 40)
    traces = [
        strip_stress(k, 0.7, WIDTH, nu)[:, :3].sum(axis=1) / (1 + nu) for nu in (0.0, 0.2, 0.45)
    ]
    np.testing.assert_allclose(traces[1:], [traces[0]] * 2, atol=1e-12)


def test_refuses_the_surface_itself():
    with pytest.raises(ValueError, match=r"depth and width must be positive, received 0\.0 m"):
        strip_stress(np.array([1.0]), 0.0, WIDTH, POISSON)
