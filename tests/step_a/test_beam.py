"""The simplified track: what goes in, the depth grid, and how the spectra behave."""

from dataclasses import replace

import numpy as np
import pytest

from mcsettle.errors import InputError
from mcsettle.railway.track import BALLAST, LEAN_CLAY, SUB_BALLAST, TOY_TRACK, BeamTrack, Layer
from mcsettle.step_a.beam import beam_response, depth_grid
from mcsettle.step_a.depths import geostatic_stress
from mcsettle.units import GRAVITY

SPEED = 55.0
LAYERS = TOY_TRACK.layers


@pytest.fixture(scope="module")
def response():
    return beam_response(TOY_TRACK, integration_depth=2.0, period=200.0, cutoff=20.0)


def one(response, omega=0.0, speed=SPEED):
    return next(response.spectra(speed, np.array([omega])))


def integral(spectra, values):
    return np.tensordot(spectra.weights, values, axes=1) / (2 * np.pi)


def test_weights_add_up_to_the_height_of_each_layer():
    grid = depth_grid(LAYERS, 5.5)
    heights = np.bincount(grid.layer, grid.weights)
    np.testing.assert_allclose(heights, [0.3, 0.5, 5.5], rtol=1e-14)
    assert np.all(np.diff(grid.z) < 0)
    assert 0.5 < grid.z[grid.layer == 0].min() < grid.z[grid.layer == 0].max() < 0.8
    assert -5.5 < grid.z.min() < -5.4


def test_layers_must_reach_the_integration_depth():
    shallow = replace(LEAN_CLAY, height=3.0)
    with pytest.raises(ValueError, match=r"end 3\.0 m below the subgrade surface, above .* 5\.5 m"):
        depth_grid((BALLAST, shallow), 5.5)
    assert depth_grid((BALLAST, shallow), 3.0).weights.sum() == pytest.approx(3.3)


def test_layers_below_the_integration_depth_get_no_points():
    upper = Layer("upper", 1.0, LEAN_CLAY.material)
    grid = depth_grid((BALLAST, upper, LEAN_CLAY), 0.5)
    assert set(grid.layer) == {0, 1}
    assert grid.weights.sum() == pytest.approx(0.8)


def test_geostatic_stress_is_the_weight_above():
    grid = depth_grid((BALLAST, replace(SUB_BALLAST, k0=0.4), LEAN_CLAY), 5.5)
    stress = geostatic_stress((BALLAST, replace(SUB_BALLAST, k0=0.4), LEAN_CLAY), grid)
    for point, layer in ((1, 0), (6, 1), (20, 2)):
        z = grid.z[point]
        above = [
            1650 * (0.8 - z),
            1650 * 0.3 + 2300 * (0.5 - z),
            1650 * 0.3 + 2300 * 0.5 - 1900 * z,
        ]
        vertical = -GRAVITY * above[layer]
        k0 = (0.5, 0.4, 0.5)[layer]
        assert grid.layer[point] == layer
        expected = [k0 * vertical, k0 * vertical, vertical, 0]
        np.testing.assert_allclose(stress[:, point], expected, rtol=1e-12)


def test_the_support_carries_the_whole_static_load(response):
    """At k = 0 two supports of stiffness s carry 1 N: ũ = 1/2s."""
    spectra = one(response)
    middle = spectra.wavenumbers.size // 2
    assert spectra.wavenumbers[middle] == 0.0
    assert spectra.receptance[middle] == pytest.approx(1 / (2 * 100e6), rel=1e-14)


def test_a_constant_load_gives_a_real_symmetric_response(response):
    spectra = one(response)
    np.testing.assert_allclose(spectra.receptance, spectra.receptance[::-1].conj(), rtol=1e-14)
    np.testing.assert_allclose(spectra.stress, spectra.stress[::-1].conj(), rtol=1e-12)
    assert np.all(integral(spectra, spectra.stress).imag == pytest.approx(0.0, abs=1e-15))


def test_reversed_frequency_is_the_mirrored_conjugate(response):
    forward, backward = one(response, 90.0), one(response, -90.0)
    np.testing.assert_allclose(
        backward.receptance, forward.receptance[::-1].conj(), rtol=1e-13, atol=1e-25
    )


def test_support_damping_takes_energy_from_the_load():
    damped = beam_response(replace(TOY_TRACK, support_damping=0.1), 1.0, 200.0, 20.0)
    for omega in (20.0, 200.0):
        spectra = one(damped, omega)
        assert integral(spectra, spectra.receptance).imag < 0.0
    undamped = one(beam_response(TOY_TRACK, 1.0, 200.0, 20.0), 200.0)
    assert np.all(undamped.receptance.imag == 0.0)


def test_where_the_damping_changes_sign_the_quadrature_stays_second_order():
    """Period by period the jump moves through its cell, and the imaginary part must not notice."""
    track = replace(TOY_TRACK, support_damping=0.1)
    values = []
    for period in (600.0, 613.0, 631.0, 2400.0):
        spectra = one(beam_response(track, 0.1, period, 10.0), 130.0)
        values.append(integral(spectra, spectra.receptance))
    # step² × (slope of the jump) ~ 1e-4 × loss 0.1; a jump put at one end of its cell costs 1e-4
    np.testing.assert_allclose(values[:3], values[3], atol=1e-5 * abs(values[3]))


def test_rail_damping_counts():
    damped = replace(TOY_TRACK, rail=replace(TOY_TRACK.rail, damping=0.01))
    spectra = one(beam_response(damped, 1.0, 200.0, 20.0), 50.0)
    assert integral(spectra, spectra.receptance).imag < 0.0


@pytest.fixture(scope="module")
def usual_and_fine():
    """Default quadrature and a finer one; the damping enters when spectra are asked for."""
    usual = beam_response(TOY_TRACK, integration_depth=0.1)
    return usual, beam_response(TOY_TRACK, integration_depth=0.1, period=1400.0, cutoff=80.0)


@pytest.mark.parametrize("damping", [0.0, 0.1])
@pytest.mark.parametrize("omega", [0.0, 10.0, 130.0])
def test_the_quadrature_has_converged(usual_and_fine, damping, omega):
    track = replace(TOY_TRACK, support_damping=damping)
    usual, fine = (one(replace(made, track=track), omega) for made in usual_and_fine)
    expected = integral(fine, fine.receptance)
    # beyond 30 rad/m lie 8e-5 of the deflection; the change of sign of the damping costs less
    assert integral(usual, usual.receptance) == pytest.approx(expected, rel=1.5e-4)
    stress, reference = integral(usual, usual.stress), integral(fine, fine.stress)
    np.testing.assert_allclose(stress, reference, atol=1.5e-4 * np.abs(reference).max())


def test_waves_along_the_beam_are_refused(response):
    assert response.rayleigh_speed == pytest.approx(919.7, abs=0.1)
    with pytest.raises(InputError, match="waves travel along the beam"):
        one(response, 0.0, speed=925.0)
    with pytest.raises(InputError, match="waves travel along the beam"):
        one(response, 1400.0)
    with pytest.raises(ValueError, match="speed is 0"):
        one(response, speed=0.0)


@pytest.mark.parametrize("setting", ["integration_depth", "period", "cutoff"])
def test_settings_must_be_positive(setting):
    with pytest.raises(ValueError, match=f"{setting} is -1"):
        beam_response(TOY_TRACK, **{setting: -1.0})


def test_the_digest_follows_the_track_and_the_settings():
    def digest(track: BeamTrack = TOY_TRACK, depth=1.0, period=50.0, cutoff=5.0):
        return beam_response(track, depth, period, cutoff).digest

    same = digest()
    assert same == digest()
    assert len(same) == 64
    changed = [
        digest(replace(TOY_TRACK, support_stiffness=90e6)),
        digest(replace(TOY_TRACK, poisson=0.2)),
        digest(replace(TOY_TRACK, layers=(replace(BALLAST, k0=0.4), *LAYERS[1:]))),
        digest(depth=1.1),
        digest(period=51.0),
        digest(cutoff=6.0),
    ]
    assert len({same, *changed}) == 7
