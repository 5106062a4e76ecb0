"""Deviatoric stress: Eq. (10), its principal form and its three degrees of freedom."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mcsettle.step_b.stress import DEVIATOR, deviatoric_stress, mean_state

component = st.floats(-1e6, 1e6)
state = st.tuples(component, component, component, component)


@given(state)
def test_deviator_matrix_is_equation_10(sigma):
    """|D σ|² = σ_d², whatever the state; rounding is relative to the largest component."""
    exact = deviatoric_stress(*sigma) ** 2
    assert np.sum((DEVIATOR @ sigma) ** 2) == pytest.approx(
        exact, rel=1e-12, abs=1e-13 * max(map(abs, sigma)) ** 2
    )


@given(state)
def test_principal_stresses_give_the_same(sigma):
    """σ_d² = ½ Σ (σ_i − σ_j)² over the eigenvalues of the stress tensor."""
    xx, yy, zz, xz = sigma
    a, b, c = np.linalg.eigvalsh([[xx, 0.0, xz], [0.0, yy, 0.0], [xz, 0.0, zz]])
    principal = np.sqrt(0.5 * ((a - b) ** 2 + (b - c) ** 2 + (c - a) ** 2))
    # eigvalsh is right to some 1e-15 of the norm; the root of a small square magnifies nothing here,
    # and the square of what is below 1e-150 is none
    assert deviatoric_stress(*sigma) == pytest.approx(
        principal, rel=1e-12, abs=1e-13 * np.abs(sigma).max() + 1e-150
    )


@given(state, component)
def test_pressure_does_not_count(sigma, pressure):
    shifted = [s + pressure for s in sigma[:3]]
    scale = max(map(abs, [*sigma, pressure]))
    assert deviatoric_stress(*shifted, sigma[3]) == pytest.approx(
        deviatoric_stress(*sigma), rel=1e-9, abs=1e-9 * scale
    )


def test_known_states():
    assert deviatoric_stress(0.0, 0.0, -60e3, 0.0) == pytest.approx(60e3)  # uniaxial
    assert deviatoric_stress(0.0, 0.0, 0.0, 10e3) == pytest.approx(np.sqrt(3) * 10e3)  # pure shear
    assert deviatoric_stress(-5e3, -5e3, -5e3, 0.0) == 0.0


def test_geostatic_stress_counts_in_total_only():
    quasi_static, geostatic = np.full((2, 4, 3), -2.0), np.full((4, 3), -5.0)
    np.testing.assert_array_equal(mean_state(quasi_static, geostatic, "traffic"), quasi_static)
    np.testing.assert_array_equal(mean_state(quasi_static, geostatic, "total"), quasi_static - 5.0)
