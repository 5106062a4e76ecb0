"""Layered ground: limits, symmetries and consistency of the exact solution."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import expm

from mcsettle.errors import NumericalError
from mcsettle.railway.track import BALLAST, LEAN_CLAY, VALIDATION_TRACK, rayleigh_speed
from mcsettle.step_a.halfspace import strip_stress
from mcsettle.verification.closed_forms import moving_load_factor, static_strip_compliance
from mcsettle.verification.layered_ground import (
    _slice_stiffness,
    _thick_stiffness,
    _thin_stiffness,
    layer_of,
    layered_ground,
    plane_waves,
    surface_compliance,
)
from mcsettle.verification.quadrature import integrate
from mcsettle.verification.strip import strip_compliance, strip_response

CLAY = LEAN_CLAY.material
GROUND = layered_ground(VALIDATION_TRACK.ground)
UNDAMPED = layered_ground((replace(LEAN_CLAY, material=replace(CLAY, damping=0.0)),))
WIDTH = 2.5


def test_static_half_space_over_ten_decades():
    kappa = np.geomspace(1e-6, 1e4, 21)
    expected = (1 - CLAY.poisson) / (CLAY.shear_modulus * kappa)
    np.testing.assert_allclose(surface_compliance(UNDAMPED, kappa, 0.0), expected, rtol=1e-13)


def test_static_is_the_limit_of_low_frequency():
    kappa = np.geomspace(1e-3, 100.0, 11)
    slow = surface_compliance(GROUND, kappa, 1e-7)
    # differs by (ω/κ c)², 1e-12
    np.testing.assert_allclose(surface_compliance(GROUND, kappa, 0.0), slow, rtol=1e-10)


def test_static_stress_below_the_surface():
    """-(1 + κζ) e^{-κζ} and κζ e^{-κζ}, uniform in κ."""
    depths, kappa = np.array([0.1, 1.0, 5.0]), np.array([0.01, 0.3, 2.0, 9.0])
    waves = plane_waves(UNDAMPED, kappa, 0.0, depths)
    x = kappa * depths[:, None]
    np.testing.assert_allclose(waves.normal, -(1 + x) * np.exp(-x), atol=1e-12)
    np.testing.assert_allclose(waves.shear, x * np.exp(-x), atol=1e-12)


@pytest.mark.parametrize("ratio", [0.2, 0.7, 0.99])
def test_load_moving_below_the_rayleigh_speed(ratio):
    speed, kappa = ratio * rayleigh_speed(CLAY), 0.7
    angle = np.linspace(0.0, np.pi / 2, 7)
    factor = moving_load_factor(angle, speed, CLAY.pressure_wave_speed, CLAY.shear_wave_speed)
    found = [
        surface_compliance(UNDAMPED, np.array([kappa]), kappa * speed * np.cos(a))[0] for a in angle
    ]
    # 1 % below the Rayleigh speed the secular function cancels to 2 %
    np.testing.assert_allclose(found, factor / (CLAY.shear_modulus * kappa), rtol=1e-11)


def test_the_rayleigh_wave_is_the_pole():
    kappa, speed = np.array([0.5]), rayleigh_speed(CLAY)
    below, above = (
        surface_compliance(UNDAMPED, kappa, 0.5 * speed * s)[0] for s in (1 - 1e-7, 1 + 1e-7)
    )
    static = surface_compliance(UNDAMPED, kappa, 0.0)[0].real
    assert below.real > 1e5 * static
    assert above.real < -1e5 * static


def test_waves_leave_the_surface():
    """Above the wave speeds the load does work: with e^{iωt} the compliance lags."""
    assert surface_compliance(UNDAMPED, np.array([1e-3]), 50.0)[0].imag < 0.0


@pytest.mark.parametrize("omega", [0.0, 40.0, -300.0])
def test_cutting_a_half_space_changes_nothing(omega):
    cuts = tuple(replace(LEAN_CLAY, name=f"{h}", height=h) for h in (0.01, 0.4, 7.0))
    kappa, depths = np.geomspace(1e-4, 300.0, 61), np.array([0.0, 0.2, 1.0])
    whole = plane_waves(layered_ground((LEAN_CLAY,)), kappa, omega, depths)
    cut = plane_waves(layered_ground((*cuts, LEAN_CLAY)), kappa, omega, depths)
    motion = np.maximum(np.abs(whole.horizontal), np.abs(whole.vertical)).max(axis=0)
    for name, scale in (("horizontal", motion), ("vertical", motion), ("shear", 1), ("normal", 1)):
        difference = np.abs(getattr(whole, name) - getattr(cut, name)) / scale
        # a slice of 1 cm over a wave of 60 km: G/h over Gκ amplifies rounding to 1e-10
        assert difference.max() < 1e-9


@pytest.mark.parametrize("omega", [0.0, 1e-6, 30.0, 400.0])
def test_series_and_waves_give_one_slice_stiffness(omega):
    kappa, h = np.array([0.7, 1.0, 1.2]), 0.4
    series = _thin_stiffness(GROUND, 0, h, kappa, omega)
    waves = _thick_stiffness(GROUND, 0, h, kappa, omega)
    scale = np.abs(series).max()
    np.testing.assert_allclose(series, waves, atol=1e-12 * scale)
    np.testing.assert_allclose(waves, np.swapaxes(waves, 1, 2), atol=1e-12 * scale)


def test_slice_stiffness_is_the_differential_equation():
    """Against the matrix exponential of the equations of motion in physical quantities."""
    kappa, omega, h, i = 2.3, 250.0, 0.5, 0
    mu, nu, rho = GROUND.shear_modulus[i], GROUND.poisson[i], GROUND.density[i]
    lam = 2 * mu * nu / (1 - 2 * nu)
    m = lam + 2 * mu
    a = np.array(
        [
            [0, kappa, 1 / mu, 0],
            [-lam * kappa / m, 0, 0, 1 / m],
            [kappa**2 * (m - lam**2 / m) - rho * omega**2, 0, 0, lam * kappa / m],
            [0, -rho * omega**2, -kappa, 0],
        ]
    )
    t = expm(-a * h)
    u = np.array([1e-3, -2e-3, 3e-3, 0.5e-3])
    traction = np.linalg.solve(t[:2, 2:], u[2:] - t[:2, :2] @ u[:2])
    below = t[2:, :2] @ u[:2] + t[2:, 2:] @ traction
    expected = np.concatenate([traction, -below])
    for k in (kappa, 1.01 * kappa):  # one of them only, lest the test be blind
        force = _slice_stiffness(GROUND, i, h, np.array([k]), omega)[0] @ u
        close = np.allclose(force, expected, rtol=1e-9)
        assert close == (k == kappa)


def test_negative_frequency_is_the_conjugate():
    kappa = np.array([0.1, 1.0])
    up, down = (surface_compliance(GROUND, kappa, w) for w in (60.0, -60.0))
    np.testing.assert_array_equal(down, up.conj())


@pytest.mark.parametrize("k", [0.3, -0.3])
def test_strip_at_negative_frequency(k):
    """A real load gives a real field: f(-k, -ω) = conj f(k, ω), every component."""
    depths = np.array([0.2, 0.8])
    up = strip_response(GROUND, k, 40.0, WIDTH, depths)
    down = strip_response(GROUND, -k, -40.0, WIDTH, depths)
    assert down.mean == up.mean.conjugate()
    np.testing.assert_allclose(down.displacement, up.displacement.conj(), rtol=1e-12)
    np.testing.assert_allclose(down.stress, up.stress.conj(), rtol=1e-12, atol=1e-14)


def test_a_depth_that_rounding_keeps_from_an_interface():
    """0.1 + 0.2 + 0.2 is 1e-16 above 0.5: no slice of that height, and the layer below it."""
    kappa = np.array([0.01, 1.0])
    depths = np.array([0.5 - 1e-16, 0.5, 0.5 + 1e-15])
    waves = plane_waves(GROUND, kappa, 30.0, depths)
    np.testing.assert_array_equal(waves.normal[0], waves.normal[2])
    assert layer_of(GROUND, depths).tolist() == [1, 1, 1]


def test_strip_is_the_half_space_of_bessel_functions():
    depths = np.array([0.1, 1.0, 5.5])
    for k in (1e-4, -0.2, 6.0):
        found = strip_response(UNDAMPED, k, 0.0, WIDTH, depths)
        mean = static_strip_compliance(k, WIDTH, CLAY.shear_modulus, CLAY.poisson)
        assert found.mean == pytest.approx(mean, rel=2e-9)
        exact = [strip_stress(np.array([k]), d, WIDTH, CLAY.poisson)[0] for d in depths]
        np.testing.assert_allclose(found.stress.T, exact, atol=1e-9)


@pytest.mark.parametrize("omega", [0.0, 70.0])
def test_strip_displacement_and_stress_agree(omega):
    """Hooke along x on the centreline: E(-ik ux) = σxx - ν(σyy + σzz), at depth and damped."""
    k, depths = 0.4, np.array([0.2, 0.5, 1.5])
    found = strip_response(GROUND, k, omega, WIDTH, depths)
    i = layer_of(GROUND, depths)
    assert i.tolist() == [0, 1, 1]
    nu = GROUND.poisson[i]
    young = 2 * GROUND.shear_modulus[i] * (1 + nu)
    xx, yy, zz, _ = found.stress
    np.testing.assert_allclose(
        young * -1j * k * found.displacement[0], xx - nu * (yy + zz), rtol=1e-6, atol=1e-9
    )


def test_strip_refuses_what_has_no_answer():
    with pytest.raises(ValueError, match="no limit"):
        strip_compliance(GROUND, 0.0, 0.0, WIDTH)
    with pytest.raises(ValueError, match="width is -1"):
        strip_compliance(GROUND, 0.1, 0.0, -1.0)
    with pytest.raises(ValueError, match="positive"):
        strip_response(GROUND, 0.1, 0.0, WIDTH, np.zeros(1))
    with pytest.raises(ValueError, match="must not fall"):
        plane_waves(GROUND, np.ones(1), 0.0, np.array([1.0, 0.5]))
    with pytest.raises(ValueError, match="half-space"):
        layered_ground(VALIDATION_TRACK.ground[:1])
    with pytest.raises(ValueError, match="no width, unlike ballast"):
        layered_ground((BALLAST, LEAN_CLAY))


def test_adaptive_quadrature():
    found = integrate(
        lambda x: np.stack([1 / (1e-6 + x**2), np.cos(50 * x)]), np.array([0.0, 2.0]), 1e-10
    )
    np.testing.assert_allclose(found, [1e3 * np.arctan(2e3), np.sin(100.0) / 50], rtol=1e-8)
    with pytest.raises(NumericalError, match="does not converge"):
        integrate(lambda x: 1 / (x[None] - 0.3), np.array([0.0, 1.0]), 1e-8)
