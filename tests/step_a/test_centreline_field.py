"""The field along the centreline (Fig. 10) against Step B's own rail and direct solutions."""

import numpy as np
import pytest
import toy
from scipy.interpolate import CubicSpline

from mcsettle.railway.irregularity import to_space
from mcsettle.railway.track import CASE_STUDY_TRACK
from mcsettle.report.figures.slice import deflection_slice
from mcsettle.step_a.fem25d import MeshSettings, Settings, section_response
from mcsettle.step_a.fem25d.centreline_field import CentrelineField
from mcsettle.step_a.fem25d.pml import Border
from mcsettle.step_a.fem25d.solve import solve
from mcsettle.step_a.fem25d.stress_outputs import centreline
from mcsettle.step_a.fem25d.track_section import track_section
from mcsettle.step_a.interaction import precompute, train_compliance

MESH = MeshSettings(size=0.5, growth=1.8, largest=2.0, border=Border(elements=5))
SETTINGS = Settings(
    mesh=MESH,
    max_omega=60.0,
    max_speed=60.0,
    bands=(0.03, 0.1, 0.25, 0.6, 1.5),
    tolerance=5e-3,
    panel=0.15,
    panel_points=8,
)
TRAIN, SPEED, CONTACT = toy.TRAINS["passenger"], toy.SPEEDS["passenger"], 2.7e9
MODES = 2.0 * np.pi / 200.0 * np.array([6.0, 13.0, 31.0])
AMPLITUDES = 1e-3 * np.array([0.7 - 0.4j, -0.3 + 0.5j, 0.1 + 0.2j])
PLACE = 37.0


@pytest.fixture(scope="module")
def response():
    return section_response(CASE_STUDY_TRACK, 2.0, SETTINGS, use_cache=False)


@pytest.fixture(scope="module")
def field(response):
    return CentrelineField(response)


def drawn(field, amplitudes=AMPLITUDES, place=PLACE):
    return deflection_slice(field, TRAIN, SPEED, MODES, amplitudes, place, CONTACT)


@pytest.fixture(scope="module")
def view(field):
    return drawn(field)


def at_axles(view, values):
    """Values at the axles, by a spline through places 0.2 m apart."""
    order = np.argsort(view.axles)
    found = np.empty(order.size)
    found[order] = CubicSpline(view.x, values)(view.axles[order])
    return found


def test_the_rail_is_that_of_step_b(field, response, view):
    """Quasi-static and dynamic deflection under every axle by the transfer functions."""
    transfer = precompute(TRAIN, SPEED, response, MODES, CONTACT)
    assert at_axles(view, view.rail_quasi_static) == pytest.approx(
        transfer.rail_deflection, rel=1e-4
    )
    places = PLACE + view.axles
    waves = AMPLITUDES * np.exp(1j * MODES * places[:, None])
    assert view.forces == pytest.approx((transfer.force * waves).sum(axis=1).real, rel=2e-3)


def test_contact_holds_under_every_wheel(field):
    """Eq. (3): rail + profile = -(V_c + V^H) f, with one mode and two instants for its phase."""
    kappa, omega = MODES[1], MODES[1] * SPEED
    amplitudes = np.array([0.0, 1e-3, 0.0], complex)
    now = drawn(field, amplitudes)
    quarter = drawn(field, 1j * amplitudes)  # a quarter of a period: the imaginary parts
    forces = now.forces - 1j * quarter.forces
    rail = at_axles(now, now.rail_dynamic) - 1j * at_axles(quarter, quarter.rail_dynamic)
    profile = 1e-3 * np.exp(1j * kappa * (PLACE + now.axles))
    wheel = -(train_compliance(TRAIN, omega) + np.eye(12) / CONTACT) @ forces
    assert wheel == pytest.approx(rail + profile, rel=1e-3)


def test_without_roughness_the_field_is_quasi_static(field, view):
    flat = drawn(field, np.zeros(3, complex))
    assert np.all(flat.dynamic == 0.0)
    assert np.all(flat.rail_dynamic == 0.0)
    assert np.all(flat.forces == 0.0)
    assert np.array_equal(flat.total, view.quasi_static)
    assert np.array_equal(flat.rail, view.rail_quasi_static)


def test_the_dynamic_part_is_linear_and_moves_with_the_profile(field, view):
    twice = drawn(field, 2.0 * AMPLITUDES)
    assert twice.dynamic == pytest.approx(2.0 * view.dynamic, rel=1e-9, abs=1e-15)
    later = drawn(field, place=PLACE + 200.0)  # the window is periodic
    assert later.dynamic == pytest.approx(view.dynamic, rel=1e-9, abs=1e-12)
    shifted = drawn(field, AMPLITUDES * np.exp(-8j * MODES), PLACE + 8.0)
    assert shifted.dynamic == pytest.approx(view.dynamic, rel=1e-9, abs=1e-15)
    profile = to_space(AMPLITUDES[None], MODES, PLACE + view.x)[0]
    assert view.profile == pytest.approx(profile, abs=1e-12)


def test_ground_follows_the_rail(view):
    """Rail, sleeper, ballast, ground: one after the other the deflection falls off under a wheel."""
    under = np.array([at_axles(view, column)[0] for column in view.quasi_static.T])
    assert at_axles(view, view.rail_quasi_static)[0] > under[0] > under[-1] > 0.0
    assert np.all(np.diff(view.z) < 0.0)
    assert (view.z[0], view.z[-1]) == (pytest.approx(1.0), pytest.approx(-2.0))


@pytest.mark.parametrize(("k", "omega"), [(0.02, 3.0), (0.3, 60.0), (1.0, 20.0), (1.4, 110.0)])
def test_the_bases_are_those_of_the_section(field, response, k, omega):
    section = track_section(CASE_STUDY_TRACK, 2.0, MESH)
    rows, z = centreline(section.basis, section.free, -2.0)
    assert np.array_equal(field.z, z)
    u = solve(section, k, omega)
    exact = -u[rows]
    (band,) = [b for b in response.bands if b.lower <= k < b.upper]
    found = band.solve(k, np.array([omega]))[0] @ band.centreline.T
    assert found == pytest.approx(exact, abs=5e-3 * np.abs(exact).max())


def test_a_load_s_spectra_meet_their_own_rail(field, response):
    """Both signs of k and of the frequency, and the jump between: the response's receptance."""
    for omega in (0.0, 55.0):
        (found,) = field.spectra(SPEED, np.array([omega]))
        (own,) = response.spectra(SPEED, np.array([omega]))
        assert found.rail.receptance == pytest.approx(own.receptance, rel=1e-9)
        assert np.array_equal(found.rail.wavenumbers, own.wavenumbers)
        assert found.ground.shape == (own.wavenumbers.size, field.z.size)


def test_speeds_and_waves_beyond_the_bases_are_refused(field):
    with pytest.raises(ValueError, match="bases reach 60 m/s and 60 rad/s"):
        deflection_slice(field, TRAIN, 61.0, MODES, AMPLITUDES, PLACE, CONTACT)
    with pytest.raises(ValueError, match="highest driving frequency"):
        deflection_slice(field, TRAIN, SPEED, 3.0 * MODES, AMPLITUDES, PLACE, CONTACT)
