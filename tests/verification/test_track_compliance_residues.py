"""Track compliance of the beam by residues, undamped and with a viscous support.

The poles are the roots k of EI k⁴ - m (Ω + kV)² + s + i(Ω + kV) c = 0. Behind the load (distance
s ≤ 0) the contour closes in the upper half-plane, ahead of it in the lower one. (The hysteretic
support of the package, with sgn ω, is not analytic: it has no residues.)
"""

import numpy as np
import pytest

from mcsettle.railway.track import TOY_TRACK
from mcsettle.step_a.beam import beam_response
from mcsettle.step_a.interaction import track_compliance_matrix
from mcsettle.step_a.transfer import WavenumberSpectra

SUPPORT = 100e6
BENDING = 2.1e11 * 30.55e-6
MASS = 0.00763 * 7850.0
POSITIONS = np.array([0.0, -2.9, -19.0, -21.9])
CUTOFF, PERIOD = 120.0, 200.0


def by_residues(distance, speed, omega, viscous):
    """Displacement of both rails at ``distance`` ahead of a unit load."""
    roots = np.roots(
        [
            BENDING,
            0.0,
            -MASS * speed**2,
            -2 * MASS * omega * speed + 1j * speed * viscous,
            SUPPORT - MASS * omega**2 + 1j * omega * viscous,
        ]
    )
    upper = distance <= 0.0
    roots = roots[roots.imag > 0.0] if upper else roots[roots.imag < 0.0]
    slope = 4 * BENDING * roots**3 - 2 * MASS * speed * (omega + roots * speed)
    slope = slope + 1j * speed * viscous
    return (1j if upper else -1j) * np.sum(np.exp(-1j * roots * distance) / slope) / 2


def matrix_by_residues(speed, omega, viscous):
    distances = POSITIONS[:, None] - POSITIONS
    return np.vectorize(lambda d: by_residues(d, speed, omega, viscous))(distances)


def viscous_spectra(speed, omega, viscous):
    k = 2 * np.pi / PERIOD * np.arange(-4000, 4001)
    total = omega + k * speed
    receptance = 0.5 / (BENDING * k**4 - MASS * total**2 + SUPPORT + 1j * total * viscous)
    weights = np.full(k.size, 2 * np.pi / PERIOD)
    return WavenumberSpectra(k, weights, receptance, np.zeros((k.size, 4, 0)))


@pytest.mark.parametrize("speed", [27.0, 62.5, 400.0])
@pytest.mark.parametrize("omega", [5.0, 130.0, 400.0])
def test_undamped_support(speed, omega):
    response = beam_response(TOY_TRACK, integration_depth=0.5, period=PERIOD, cutoff=CUTOFF)
    spectra = next(response.spectra(speed, np.array([omega])))
    expected = matrix_by_residues(speed, omega, 0.0)
    # beyond 120 rad/m lie 1.6e-6 of the compliance
    np.testing.assert_allclose(
        track_compliance_matrix(spectra, POSITIONS), expected, atol=3e-6 * np.abs(expected).max()
    )


@pytest.mark.parametrize("speed", [27.0, 62.5, 400.0])
@pytest.mark.parametrize("omega", [0.0, 130.0, 1400.0])
def test_viscous_support(speed, omega):
    """Also past the cut-on frequency of the beam (1292 rad/s), where damped waves travel."""
    viscous = 1.5e5
    expected = matrix_by_residues(speed, omega, viscous)
    found = track_compliance_matrix(viscous_spectra(speed, omega, viscous), POSITIONS)
    np.testing.assert_allclose(found, expected, atol=3e-6 * np.abs(expected).max())


def test_ahead_and_behind_differ_when_the_load_moves():
    """What fixes the sign of a_j - a_l: at speed the compliance matrix is not symmetric."""
    matrix = matrix_by_residues(62.5, 130.0, 1.5e5)
    assert abs(matrix[0, 1] - matrix[1, 0]) > 1e-3 * abs(matrix[0, 0])
