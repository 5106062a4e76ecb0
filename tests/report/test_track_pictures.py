"""The numbers behind the pictures: against definitions, not against stored values."""

import numpy as np
import pytest
import toy

from mcsettle.analysis.stress_under_train import (
    change_squares,
    depth_curve,
    dynamic_squares,
    layer_weights,
    profile_power,
    quasi_static_overhead,
    stress_along,
)
from mcsettle.analysis.table4 import CHANGE, DYNAMIC, OVERHEAD, SurfaceStress, increases
from mcsettle.railway.irregularity import sample_profiles, wavenumbers
from mcsettle.railway.spectra import spectrum
from mcsettle.railway.track import CASE_STUDY_TRACK, TOY_TRACK
from mcsettle.railway.traffic import Train
from mcsettle.railway.vehicle import PASSENGER
from mcsettle.report.figures.passage import axle_passage
from mcsettle.report.figures.receptance import receptance_map
from mcsettle.report.figures.section import cell_values, section_view
from mcsettle.report.figures.vehicles import vehicle_peaks
from mcsettle.step_a.fem25d.section import MeshSettings
from mcsettle.step_a.interaction import HERTZ_STIFFNESS, precompute, train_compliance
from mcsettle.step_b.passage import settlement_of_passage
from mcsettle.step_b.stress import deviatoric_stress
from mcsettle.units import KMH

WINDOW = 200.0
MODES = wavenumbers(WINDOW)
SD = 1.03e-3


def test_layer_weights_reproduce_parabolas_and_stay_in_their_layer() -> None:
    grid = toy.transfer().grid
    for layer, z in ((0, 0.7), (0, 0.8), (2, 0.0), (2, -1.3)):
        weights = layer_weights(grid, layer, z)
        # Three points carry a parabola exactly, also beyond the last of them.
        assert weights @ (grid.z**2 - 3.0 * grid.z) == pytest.approx(z**2 - 3.0 * z, rel=1e-10)
        assert not weights[grid.layer != layer].any()
    with pytest.raises(ValueError, match="no stresses are given in layer 7"):
        layer_weights(grid, 7, 0.0)


def test_profile_power_adds_up_to_the_variance() -> None:
    assert profile_power(spectrum(), MODES, WINDOW, SD).sum() == pytest.approx(SD**2, rel=1e-12)
    unscaled = profile_power(spectrum("fra", 4), MODES, WINDOW, None)
    drawn = sample_profiles(spectrum("fra", 4), MODES, WINDOW, 1, range(400))
    # 400 realisations of 61 modes: the mean power is known to some 2 %.
    assert unscaled.sum() == pytest.approx(0.5 * np.mean(np.sum(abs(drawn) ** 2, axis=1)), rel=0.1)


def sampled(amplitudes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Quasi-static [J, 4] and dynamic [J, 4, X] stress at the subgrade surface, by brute force."""
    transfer = toy.transfer()
    weights = layer_weights(transfer.grid, 2, 0.0)
    x = WINDOW * np.arange(400) / 400
    waves = amplitudes[:, None] * np.exp(1j * np.outer(MODES, x))
    dynamic = np.einsum("jkc,kx->jcx", transfer.dynamic @ weights, waves).real
    return transfer.quasi_static @ weights, dynamic


def test_dynamic_rms_equals_the_mean_over_a_sampled_profile() -> None:
    amplitudes = toy.profiles([3])[0]
    transfer = toy.transfer()
    weights = layer_weights(transfer.grid, 2, 0.0)[None]
    power = 0.5 * np.abs(amplitudes) ** 2
    static, dynamic = sampled(amplitudes)
    squares = deviatoric_stress(*np.moveaxis(dynamic, 1, 0)) ** 2
    found = power @ dynamic_squares(transfer, weights)
    # Products of two modes up to 66 are summed exactly by 400 points.
    assert found == pytest.approx(squares.mean(), rel=1e-10)
    # A thousandth of the profile makes the change of σ_d linear to a thousandth.
    small = 1e-3
    total = deviatoric_stress(*np.moveaxis(static[:, :, None] + small * dynamic, 1, 0))
    change = (total - deviatoric_stress(*static.T)[:, None]) / small
    found = power @ change_squares(transfer, weights)
    assert found == pytest.approx((change**2).mean(), rel=1e-3)
    assert found < power @ dynamic_squares(transfer, weights)


def test_depth_curve_is_the_mean_over_axles() -> None:
    transfer = toy.transfer()
    power = profile_power(spectrum(), MODES, WINDOW, SD)
    curve = depth_curve(transfer, power, "toy")
    one_by_one = [deviatoric_stress(*q) for q in transfer.quasi_static]
    assert curve.quasi_static == pytest.approx(np.mean(one_by_one, axis=0), rel=1e-12)
    doubled = depth_curve(transfer, 4.0 * power, "rougher")
    assert doubled.dynamic == pytest.approx(2.0 * curve.dynamic, rel=1e-12)
    assert np.all(curve.dynamic > 0.0)


def test_stress_along_meets_the_stress_under_the_axles() -> None:
    transfer, train = toy.transfer(), toy.TRAINS["passenger"]
    weights = layer_weights(transfer.grid, 2, 0.0)[None]
    view = stress_along(toy.response(), train, toy.SPEEDS["passenger"], np.zeros(1), weights)
    middle = 4 * (len(train.cars) // 2)
    under = deviatoric_stress(*(transfer.quasi_static[middle : middle + 4] @ weights.T)[..., 0].T)
    at_axles = np.interp(view.axles, view.x, view.sigma[0])
    # Linear interpolation between places 0.1 m apart, of a curve that bends over a metre.
    for value in under:
        assert np.min(np.abs(at_axles / value - 1.0)) < 3e-3
    assert view.sigma[0].max() >= under.max() * (1.0 - 1e-3)
    assert quasi_static_overhead(transfer, weights)[0] < view.sigma[0].max()


def test_table4_compares_with_the_first_scenario_and_finds_published_values() -> None:
    samples = {DYNAMIC: np.array([1.0, 2.0]), CHANGE: np.array([1.0, 1.0])}
    faster = {DYNAMIC: np.array([1.1, 2.6]), CHANGE: np.array([1.2, 1.2])}
    values = dict.fromkeys((OVERHEAD, "quasi-static, largest in passing", DYNAMIC, CHANGE), 10.0)
    table = increases(
        [
            SurfaceStress("slow", 50.0, values, samples),
            SurfaceStress("fast", 60.0, dict.fromkeys(values, 11.0), faster),
        ],
        {("dynamic_stress_increase_percent", "fast"): (12.7, "Table 4")},
    )
    fast = {row.definition: row for row in table if row.scenario == "fast"}
    assert fast[OVERHEAD].percent == pytest.approx(10.0)
    assert (fast[OVERHEAD].low, fast[OVERHEAD].published) == (fast[OVERHEAD].percent, None)
    assert (fast[DYNAMIC].published, fast[DYNAMIC].source) == (12.7, "Table 4")
    assert fast[DYNAMIC].low == pytest.approx(10.0 + 0.05 * 20.0)
    assert all(row.percent == 0.0 for row in table if row.scenario == "slow")


def test_receptance_of_the_beam_is_that_of_its_spectrum() -> None:
    response = toy.response()
    spectra = next(response.spectra(50.0, np.zeros(1)))
    at = [int(np.argmin(abs(spectra.wavenumbers - k))) for k in (0.1, 1.0, 2.0)]
    k = spectra.wavenumbers[at]
    view = receptance_map(response, k, 50.0 * k, ())
    assert np.diag(view.receptance) == pytest.approx(np.abs(spectra.receptance[at]), rel=1e-12)
    with pytest.raises(TypeError, match="no receptance of a int"):
        receptance_map(3, k, k, ())  # type: ignore[arg-type]


def test_section_view_is_the_solver_s_mesh() -> None:
    view = section_view(CASE_STUDY_TRACK, 5.5)
    assert view.z[0] == pytest.approx(1.0)  # 0.8 m of embankment and the sleeper
    assert view.z[-1] == pytest.approx(-5.5)
    assert np.all(np.diff(view.y) > 0.0)
    assert np.all(np.diff(view.z) < 0.0)
    width, height = np.diff(view.y), -np.diff(view.z)
    area = width[:, None] * height[None, :]
    for index, half in ((0, 1.25 * 0.2), (1, 1.4 * 0.3), (2, 1.75 * 0.5)):
        assert area[view.material == index].sum() == pytest.approx(half, rel=1e-9)
    coarse = section_view(CASE_STUDY_TRACK, 5.5, MeshSettings(size=0.25))
    assert coarse.n_elements < view.n_elements
    place = np.array([[0, 1, 99], [2, 0, 0]])
    cells = cell_values(view, place, np.array([0.3, 0.6, 0.9]))
    assert (cells[0, 2], cells[1, 0], np.isfinite(cells).sum()) == (0.3, 0.6, 2)


def test_vehicle_peaks_are_the_largest_displacement_of_the_rail() -> None:
    amplitudes, modes = toy.profiles([0], shortest=20.0)[0], wavenumbers(WINDOW, 20.0)
    arguments = (TOY_TRACK, amplitudes, modes, WINDOW)
    view = vehicle_peaks(PASSENGER, 1, 200.0 * KMH, ("complete", "wheelsets"), *arguments)
    assert list(view.peaks) == ["complete", "wheelsets"]
    assert view.peaks["complete"][0] == pytest.approx(view.peaks["complete"][-1], rel=1e-9)
    # Under an axle the rail follows wheel and profile: -(Δu + V_c f + f / k_H), Eq. (3) read from
    # the vehicle's side. The track is cut at another wavenumber there: some 1e-4 of the forces.
    train, speed = Train("one", (PASSENGER,)), 200.0 * KMH
    transfer = precompute(train, speed, toy.response(), modes)
    ahead = np.exp(1j * np.outer(train.axle_positions, modes))
    forces = transfer.force * ahead
    wheels = [train_compliance(train, k * speed) @ f for k, f in zip(modes, forces.T, strict=True)]
    rail = -(ahead + np.array(wheels).T + forces / HERTZ_STIFFNESS) / ahead
    under = np.abs((rail @ (amplitudes[:, None] * np.exp(1j * np.outer(modes, view.x)))).real)
    peak = view.peaks["complete"]
    assert np.all(peak >= under[0] * (1.0 - 1e-3) - 1e-3 * peak.max())
    # The other axles lie between the places looked at, a twentieth of a metre from one at most.
    assert np.all(peak >= under.max(axis=0) * (1.0 - 0.01) - 1e-3 * peak.max())
    # Nowhere does the rail move more than under an axle, but for the places between those looked at.
    assert peak.max() == pytest.approx(under.max(), rel=0.01)


def test_axle_passage_splits_stress_and_settlement() -> None:
    transfer, model = toy.transfer(), toy.model()
    amplitudes = toy.profiles([1])[0]
    weights = layer_weights(transfer.grid, 0, 0.7)
    view = axle_passage(transfer, 2, amplitudes, weights, model, WINDOW)
    assert view.total.min() < view.quasi_static < view.total.max()
    assert np.all(view.total <= view.quasi_static + view.dynamic + 1e-9)  # triangle inequality
    expected = settlement_of_passage(amplitudes, 2, transfer, model, toy.cycles(model), WINDOW)
    assert view.all_layers == pytest.approx(expected, rel=1e-12)
    assert 0.0 < view.first_layer_quasi_static < view.all_layers_quasi_static
    flat = axle_passage(transfer, 2, 0.0 * amplitudes, weights, model, WINDOW)
    assert np.ptp(flat.all_layers) <= 1e-12 * flat.all_layers_quasi_static
    assert not flat.dynamic.any()
