"""Step A: operators, reduced basis, response, cache."""

import math
from dataclasses import asdict, fields, replace

import numpy as np
import pytest
import scipy.linalg
import toy

from mcsettle.railway.track import CASE_STUDY_TRACK, VALIDATION_TRACK, Material, rayleigh_speed
from mcsettle.railway.traffic import Service
from mcsettle.step_a import critical_speed as near_critical
from mcsettle.step_a.critical_speed import lowest_critical_speed, speed_remark
from mcsettle.step_a.depths import geostatic_stress
from mcsettle.step_a.fem25d import MeshSettings, Settings, section_response
from mcsettle.step_a.fem25d.depth_grid import depth_grid
from mcsettle.step_a.fem25d.element import smeared_stiffness
from mcsettle.step_a.fem25d.largest_deflection import critical_speed, deflections
from mcsettle.step_a.fem25d.mesh_lines import growing_lines, uniform_lines
from mcsettle.step_a.fem25d.pml import Border
from mcsettle.step_a.fem25d.reduced_basis import output_error
from mcsettle.step_a.fem25d.settings import many_grounds_settings
from mcsettle.step_a.fem25d.solve import factorise, operator, outputs, solve
from mcsettle.step_a.fem25d.track_section import track_section
from mcsettle.step_a.fem25d.wavenumber_rule import (
    jump_shares,
    smooth_support,
    wavenumber_quadrature,
)
from mcsettle.step_a.transfer import WavenumberSpectra

MESH = MeshSettings(size=0.3, growth=1.5, largest=1.5, border=Border(elements=7))
COARSE = Settings(
    mesh=MESH, max_omega=60.0, max_speed=60.0, bands=(0.05, 0.4, 1.5, 4.0), tolerance=5e-3
)


@pytest.fixture(scope="module")
def section():
    return track_section(CASE_STUDY_TRACK, 5.5, MESH)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("cache")


@pytest.fixture(scope="module")
def response(folder):
    return section_response(CASE_STUDY_TRACK, settings=COARSE, cache=folder)


def test_operator_is_complex_symmetric(section):
    a = operator(section, 0.8, 50.0)
    assert abs(a - a.T).max() < 1e-12 * abs(a).max()
    assert abs(a - a.conj().T).max() > 1e-3 * abs(a).max()  # damped: not Hermitian


def test_reciprocity_between_two_places(section):
    lu = factorise(section, 0.8, 50.0)
    other = np.zeros(section.unknowns, dtype=complex)
    other[section.unknowns // 3] = 1.0
    there = other @ lu.solve(section.load.astype(complex))
    here = section.load @ lu.solve(other)
    assert there == pytest.approx(here, rel=1e-8, abs=0.0)


def test_long_waves_carry_the_load_down(section):
    # Equilibrium at k → 0: the mean of σzz over the embankment's foot is -1/(half its width).
    z = depth_grid(CASE_STUDY_TRACK, 5.5).z
    stress = outputs(section, 1e-3, solve(section, 1e-3, 0.0))[1:].reshape(4, -1).real
    at = int(np.argmin(np.abs(z)))
    assert -1.5 / 1.75 < stress[2, at] < -0.5 / 1.75


def test_reduced_basis_meets_direct_solutions(section, response):
    rng = np.random.default_rng(4)
    errors = []
    for k in (0.01, 0.1, 0.3, 0.9, 1.4, 3.0):
        omega = rng.random() * (60.0 + 60.0 * k)
        band = next(b for b in response.bands if k <= b.upper)
        found = band.outputs(k, np.array([omega]))[0]
        errors.append(output_error(found, outputs(section, k, solve(section, k, omega))))
    assert max(errors) < 5e-3
    assert np.median(errors) < 5e-4
    assert response.error_estimate < 5e-3


def test_modes_agree_with_plain_solutions(response):
    nodes = response.quadrature.nodes
    speed, omega = 50.0, 20.0
    spectrum = next(response.spectra(speed, np.array([omega])))
    half = nodes.size
    for i in range(0, half, 111):
        k = nodes[i]
        exact = response.at(k, np.array([omega + k * speed]))[0]
        assert spectrum.receptance[half + i] == pytest.approx(exact[0], rel=1e-6, abs=0.0)
        np.testing.assert_allclose(
            spectrum.stress[half + i].ravel(), exact[1:], atol=1e-6 * np.abs(exact[1:]).max()
        )


def test_the_critical_speed_is_kept_on_disk(response, monkeypatch, tmp_path):
    monkeypatch.setenv("MCSETTLE_CACHE", str(tmp_path))
    first = critical_speed(replace(response))
    monkeypatch.setattr("mcsettle.step_a.fem25d.largest_deflection.deflections", None)
    again = critical_speed(replace(response))
    assert (again.speed, list(again.deflection)) == (first.speed, list(first.deflection))


def test_a_shorter_border_serves_larger_wavenumbers(section):
    """Cut where the field has decayed: fewer unknowns, the same outputs; not so for long waves."""
    for k, omega in ((0.4, 30.0), (1.5, 150.0), (3.0, 100.0)):
        part = section.for_wavenumbers(k, MESH.border)
        assert part.unknowns < 0.8 * section.unknowns
        exact = outputs(section, k, solve(section, k, omega))
        assert output_error(outputs(part, k, solve(part, k, omega)), exact) < 0.02  # the mesh's own
    part = section.for_wavenumbers(0.4, MESH.border)
    exact = outputs(section, 0.01, solve(section, 0.01, 0.5))
    assert output_error(outputs(part, 0.01, solve(part, 0.01, 0.5)), exact) > 0.05
    assert section.for_wavenumbers(0.0, MESH.border) is section


def test_a_cut_border_is_a_part_of_the_whole(section):
    part = section.for_wavenumbers(0.5, MESH.border)
    kept = np.searchsorted(section.free, part.free)
    whole = operator(section, 0.7, 20.0)[kept][:, kept]
    assert abs(whole - operator(part, 0.7, 20.0)).max() == 0.0
    assert np.abs(part.load).sum() == np.abs(section.load).sum()


@pytest.mark.parametrize(
    "nodes", [slice(0, 2000), slice(0, 700), slice(701, 703), slice(900, 2000)]
)
def test_gathering_is_the_transpose_of_spreading(nodes):
    rng = np.random.default_rng(5)
    rule = wavenumber_quadrature(12.0, 0.045, 12)
    support = smooth_support(rule, 0.03)
    nodes = slice(nodes.start, min(nodes.stop, rule.nodes.size))
    values = (rng.standard_normal((support.nodes.size, 2)) @ [1.0, 1j])[None, :, None]
    factors = rng.standard_normal((3, nodes.stop - nodes.start, 2)) @ [1.0, 1j]
    at, gathered = support.gathered(factors, nodes)
    exact = factors @ support.spread(values)[0, nodes, 0]
    np.testing.assert_allclose(gathered @ values[0, at, 0], exact, rtol=1e-12)


def test_longer_panels_and_pieces_serve_one_ground_of_many(response):
    """Half as many wavenumbers; the integral over k to a fraction of what bases and mesh err by."""
    of_many = many_grounds_settings(COARSE.max_speed, COARSE.max_omega, softens=False)
    points = {n: getattr(of_many, n) for n in ("panel_points", "panel_ratio", "piece_ratio")}
    rough = replace(response, settings=replace(COARSE, panel=of_many.panel, **points))
    fine = replace(response, settings=replace(COARSE, panel=of_many.panel))
    assert rough._support.nodes.size < 0.5 * fine._support.nodes.size
    for omega in (0.0, 25.0):
        sums = []
        for r in (rough, fine):
            s = next(r.spectra(50.0, np.array([omega])))
            phases = np.exp(-1j * np.outer([0.0, 8.0, 40.0], s.wavenumbers)) * s.weights
            sums.append(s.stress_under(phases))
        assert np.abs(sums[0] - sums[1]).max() < 1e-3 * np.abs(sums[1]).max()


@pytest.mark.parametrize("damping", [0.0, 0.02, 0.05])
def test_support_spreads_responses_with_damped_poles(damping):
    """Poles at k = k₀ (1 ± iξ), as those of surface waves; undamped: the rule's own wavenumbers."""
    rule = wavenumber_quadrature(12.0, 0.045, 12)
    support = smooth_support(rule, damping)
    poles = np.array([0.3, 1.1, 4.7, 9.0]) * (1.0 + 1j * max(damping, 0.01))

    def values(k):
        return np.sum(poles**2 / (k[:, None] ** 2 - poles**2), axis=1)[None, :, None]

    found, exact = support.spread(values(support.nodes)), values(rule.nodes)
    assert (support.nodes.size == rule.nodes.size) == (damping == 0.0)
    assert damping == 0.0 or support.nodes.size < 0.5 * rule.nodes.size
    bound = 1e-12 if damping == 0.0 else 3e-3
    assert np.abs(found - exact).max() < bound * np.abs(exact).max()


def test_constant_load_gives_real_fields(response):
    spectrum = next(response.spectra(55.0, np.array([0.0])))
    k = spectrum.wavenumbers
    assert np.array_equal(k, -k[::-1])
    np.testing.assert_allclose(spectrum.receptance, spectrum.receptance[::-1].conj(), rtol=1e-12)
    np.testing.assert_allclose(spectrum.stress, spectrum.stress[::-1].conj(), rtol=1e-12)


def test_spectra_obey_parity_and_conjugation(response):
    speed, omega, z = 50.0, 20.0, response.grid.z.size
    spectrum = next(response.spectra(speed, np.array([omega])))
    half = response.quadrature.nodes.size
    for i in (half - 30, half - 300, 10):  # ω > 0 and ω < 0 behind the load
        k = -spectrum.wavenumbers[i]
        w = omega - k * speed
        value = response.at(k, np.array([abs(w)]))[0]
        if w > 0.0:
            value[-z:] *= -1.0  # τxz is odd in k
        else:
            value = value.conj()  # f(-k, -ω) = conj f(k, ω), τxz included
        assert spectrum.receptance[i] == pytest.approx(value[0], rel=1e-6, abs=0.0)
        np.testing.assert_allclose(
            spectrum.stress[i].ravel(), value[1:], atol=1e-6 * np.abs(value[1:]).max()
        )


@pytest.mark.parametrize("omega", [0.0, 20.0, 26.1, 59.0])
def test_sums_under_a_train_are_those_of_the_stresses_at_every_wavenumber(response, omega):
    """With the change of sign nowhere, inside a panel, and inside a piece of several panels."""
    spectrum = next(response.spectra(50.0, np.array([omega])))
    factors = np.exp(-1j * np.outer([0.0, -2.5, -17.3], spectrum.wavenumbers)) * spectrum.weights
    exact = np.tensordot(factors, spectrum.stress, 1)
    found = spectrum.stress_under(factors)
    assert found.shape == (3, 4, response.grid.z.size)
    np.testing.assert_allclose(found, exact, rtol=0.0, atol=1e-13 * np.abs(exact).max())
    dense = WavenumberSpectra(*(getattr(spectrum, f.name) for f in fields(WavenumberSpectra)))
    np.testing.assert_allclose(dense.stress_under(factors), exact, rtol=1e-12)


def test_change_of_sign_of_the_frequency_inside_a_panel(response):
    speed, omega = 50.0, 26.1
    place, rule = omega / speed, response.quadrature
    at, _ = jump_shares(rule, place)
    spectrum = next(response.spectra(speed, np.array([omega])))
    behind = (spectrum.weights * spectrum.receptance)[: rule.nodes.size][::-1]
    x, w = np.polynomial.legendre.leggauss(10)
    edge = rule.edges[at.start // rule.points :][:2]
    exact = 0.0
    for lower, upper in ((edge[0], place), (place, edge[1])):
        for k, weight in zip((lower + upper + (upper - lower) * x) / 2.0, w, strict=True):
            value = response.at(k, np.array([abs(omega - k * speed)]))[0, 0]
            exact += weight * (upper - lower) / 2.0 * (value if k < place else value.conj())
    # One rule across the jump would miss by some 1e-3.
    assert behind[at].sum() == pytest.approx(exact, rel=1e-6, abs=0.0)


def test_damped_track_dissipates(response):
    spectra = response.spectra(50.0, np.array([10.0, 30.0, 55.0]))
    compliance = [np.sum(s.weights * s.receptance) / (2.0 * np.pi) for s in spectra]
    assert all(c.imag < 0.0 < c.real for c in compliance)


def test_quadrature_resolves_a_train_length(response):
    finer = replace(COARSE, panel=0.03, panel_points=14)
    fine = replace(response, settings=finer)
    spectra = [next(r.spectra(50.0, np.array([25.0]))) for r in (response, fine)]

    def deflection(s, distance):
        return np.sum(s.weights * s.receptance * np.exp(-1j * s.wavenumbers * distance))

    own = abs(deflection(spectra[1], 0.0))
    for distance, share in ((0.0, 3e-4), (100.0, 3e-4), (560.0, 3e-3)):
        coarse, exact = (deflection(s, distance) for s in spectra)
        assert abs(coarse - exact) < share * own


def test_spectra_refuse_what_the_basis_was_not_trained_for(response):
    with pytest.raises(ValueError, match="speed"):
        next(response.spectra(61.0, np.array([1.0])))
    with pytest.raises(ValueError, match="driving frequencies"):
        next(response.spectra(50.0, np.array([61.0])))


def test_stored_basis_is_read_back(response, folder):
    def refuse(*_):
        raise AssertionError("computed again")

    again = section_response(CASE_STUDY_TRACK, settings=COARSE, cache=folder, progress=refuse)
    assert again.digest == response.digest
    for a, b in zip(again.bands, response.bands, strict=True):
        assert np.array_equal(a.stiffness, b.stiffness)
        assert (a.lower, a.upper, a.solves) == (b.lower, b.upper, b.solves)
    # K0, the pad and the settlement laws need no new basis, but K0 and the pad a new digest.
    layers = tuple(replace(layer, k0=0.7) for layer in CASE_STUDY_TRACK.layers)
    pad = replace(CASE_STUDY_TRACK.pad, stiffness=1e8)
    other = replace(CASE_STUDY_TRACK, layers=layers, pad=pad)
    changed = section_response(other, settings=COARSE, cache=folder, progress=refuse)
    assert changed.digest != response.digest
    assert len(list(folder.glob("*.npz"))) == 1


def test_damaged_file_is_named_and_replaced(response, folder, tmp_path):
    stored = next(iter(folder.glob("*.npz")))
    tiny = replace(COARSE, bands=(4.0,), tolerance=0.5, max_omega=1.0, max_speed=1.0)
    section_response(CASE_STUDY_TRACK, settings=tiny, cache=tmp_path)
    path = next(iter(tmp_path.glob("*.npz")))
    whole = path.read_bytes()
    assert path.name != stored.name
    middle = len(whole) // 4  # inside an array, not in the archive's own headers
    for damaged in (whole[:middle], whole[:middle] + b"\xff\x00" + whole[middle + 2 :]):
        path.write_bytes(damaged)
        with pytest.warns(RuntimeWarning, match=path.name):
            section_response(CASE_STUDY_TRACK, settings=tiny, cache=tmp_path)
        assert path.read_bytes() == whole
    with np.load(path) as file:
        arrays = {name: file[name] for name in file.files}
    arrays["load_0"] = arrays["load_0"] * 1.01  # a sound archive whose content was changed
    np.savez(path, **arrays)
    with pytest.warns(RuntimeWarning, match="checksum"):
        section_response(CASE_STUDY_TRACK, settings=tiny, cache=tmp_path)
    assert path.read_bytes() == whole
    assert [p.name for p in tmp_path.iterdir()] == [path.name]


def test_integration_depth_does_not_change_the_track(section):
    deep = track_section(CASE_STUDY_TRACK, 11.0, MESH)
    found = [outputs(s, 0.3, solve(s, 0.3, 40.0)) for s in (section, deep)]
    rows = [np.concatenate([f[:1] * 1e7, f[1:].reshape(4, -1)[2, :9]]) for f in found]
    # The first nine depths (embankment) agree; 1 %: the ground's mesh lines differ.
    np.testing.assert_allclose(rows[0], rows[1], atol=0.01 * np.abs(rows[1]).max())


def test_no_band_has_a_false_resonance(response):
    # Hardly damped ones between the training points would pass most checks at random points. The
    # soil's own have twice its damping ratio, those of the border somewhat less.
    least = 2.0 * min(layer.material.damping for layer in CASE_STUDY_TRACK.layers)
    for band in response.bands[1:]:
        for k in np.linspace(max(band.lower, 0.1), band.upper, 9)[1:]:
            stiffness = band.stiffness[0] + k * band.stiffness[1] + k**2 * band.stiffness[2]
            squares = scipy.linalg.eigvals(stiffness, band.mass)
            highest = response.settings.max_omega + k * response.settings.max_speed
            near = squares[(squares.real > 0.0) & (squares.real < highest**2)]
            assert np.all(near.imag > 0.5 * least * near.real)


@pytest.mark.slow
def test_processes_do_not_change_the_result(response, tmp_path):
    parallel = section_response(CASE_STUDY_TRACK, settings=COARSE, cache=tmp_path, workers=2)
    for a, b in zip(parallel.bands, response.bands, strict=True):
        np.testing.assert_allclose(a.stiffness, b.stiffness, rtol=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("track", [CASE_STUDY_TRACK, VALIDATION_TRACK])
def test_full_settings_meet_their_tolerance(track, tmp_path):
    full = section_response(track, cache=tmp_path)
    assert full.error_estimate < full.settings.tolerance
    assert np.median(full.errors) < 3e-4
    assert full.solves < 400


@pytest.mark.parametrize("track", [CASE_STUDY_TRACK, VALIDATION_TRACK])
@pytest.mark.parametrize("depth", [0.3, 5.5, 11.0, 22.0])
def test_depths_fill_the_layers(track, depth):
    grid = depth_grid(track, depth)
    assert np.all(np.diff(grid.z) < 0.0)
    assert grid.weights.sum() == pytest.approx(0.8 + depth)
    assert grid.weights[grid.layer == 0].sum() == pytest.approx(0.3)
    assert np.sum(grid.weights * grid.z) == pytest.approx((0.8**2 - depth**2) / 2.0)


def test_geostatic_stress_by_hand():
    grid = depth_grid(CASE_STUDY_TRACK, 5.5)
    stress = geostatic_stress(CASE_STUDY_TRACK.layers, grid)
    last = -9.81 * (0.3 * 1650.0 + 0.5 * 2300.0 - grid.z[-1] * 1900.0)
    assert stress[2, -1] == pytest.approx(last)
    np.testing.assert_allclose(stress[0], 0.5 * stress[2])
    np.testing.assert_array_equal(stress[3], 0.0)


@pytest.mark.parametrize("depth", [0.0, -1.0, math.inf])
def test_integration_depth_out_of_range(depth):
    with pytest.raises(ValueError, match="integration depth"):
        depth_grid(CASE_STUDY_TRACK, depth)


def test_smeared_sleepers_hardly_bend_along_the_track():
    s, rail = CASE_STUDY_TRACK.sleeper, CASE_STUDY_TRACK.rail
    ratio = MeshSettings().axial_ratio
    d = smeared_stiffness(s.material.youngs_modulus, s.material.poisson, s.fill, ratio)
    bending = d[0, 0].real * s.length * s.height**3 / 12.0
    assert bending < 1e-4 * 2.0 * rail.bending_stiffness
    assert np.all(np.diag(d)[3:].real > 0.4 * s.material.shear_modulus)


def test_rayleigh_speed_of_the_clay():
    # Reference: 109.2 m/s = 393 km/h for 70 MPa, ν 0.35, 1900 kg/m³.
    assert rayleigh_speed(CASE_STUDY_TRACK.layers[-1].material) == pytest.approx(109.2, abs=0.05)
    # ν = 1/4: c_R/c_S = √(2 - 2/√3), exactly.
    m = Material(1e7, 0.25, 1800.0, 0.0)
    exact = m.shear_wave_speed * math.sqrt(2.0 - 2.0 / math.sqrt(3.0))
    assert rayleigh_speed(m) == pytest.approx(exact, rel=1e-9)


def test_jump_inside_a_panel_is_integrated_exactly():
    rule = wavenumber_quadrature(2.0, 0.3, 8)
    place = 0.7321
    values = np.where(rule.nodes < place, rule.nodes**3, -1.0)
    at, share = jump_shares(rule, place)
    k = rule.nodes[at]
    values[at] = share * k**3 - (1.0 - share)
    exact = place**4 / 4.0 - (2.0 - place)
    assert np.sum(rule.weights * values) == pytest.approx(exact, rel=1e-12)
    assert jump_shares(rule, 5.0) is None
    assert rule.weights.sum() == pytest.approx(2.0)


def test_mesh_lines_meet_their_breaks():
    lines = uniform_lines([0.0, 0.675, 0.825, 1.25], 0.12)
    assert np.diff(lines).max() <= 0.12 + 1e-12
    assert all(np.abs(lines - b).min() < 1e-12 for b in (0.0, 0.675, 0.825, 1.25))
    growing = growing_lines(5.5, 0.12, 1.3, 0.9)
    assert growing[-1] == pytest.approx(5.5)
    assert np.all(np.diff(growing) < 0.91)


def test_bases_do_not_depend_on_the_quadrature_and_usual_settings_keep_their_name():
    """What was stored before a setting existed is found again."""
    usual, quadrature = Settings(), ("panel", "panel_points", "panel_ratio", "piece_ratio")
    new = {"least_solves", "panel_ratio", "piece_ratio"}
    assert not new & set(usual.description)
    other = replace(
        usual, least_solves=5, panel=0.1, panel_points=6, panel_ratio=0.5, piece_ratio=9.0
    )
    assert new < set(other.description)
    assert other.of_bases == replace(usual, least_solves=5).of_bases != usual.of_bases
    assert {n for n in asdict(other) if getattr(other.of_bases, n) != getattr(other, n)} == {
        *quadrature
    }


def test_settings_refuse_nonsense():
    with pytest.raises(ValueError, match="bands"):
        Settings(bands=(1.0, 0.5))
    with pytest.raises(ValueError, match="tolerance"):
        Settings(tolerance=0.0)
    with pytest.raises(ValueError, match="piece_ratio"):
        Settings(piece_ratio=0.0)
    with pytest.raises(ValueError, match="least_solves 0"):
        Settings(least_solves=0)
    with pytest.raises(ValueError, match="mesh sizes"):
        MeshSettings(size=0.0)
    with pytest.raises(ValueError, match="workers"):
        section_response(CASE_STUDY_TRACK, workers=0)


def test_the_critical_speed_is_that_of_the_largest_deflection(response):
    """Near the Rayleigh speed: the embankment is stiffer than the clay, the rails add mass."""
    found = critical_speed(response)
    assert found.speed == pytest.approx(response.rayleigh_speed, rel=0.08)
    assert found.deflection.max() > 1.3 * found.deflection[0]
    assert critical_speed(response) is found  # asked again: kept


def test_trains_from_four_fifths_of_the_critical_speed_are_remarked_on(response, monkeypatch):
    train, critical = (
        toy.study().timetable("v201").services[0].train,
        critical_speed(response).speed,
    )
    assert speed_remark(Service(train, 0.79 * critical, 1), response, False) is None
    said = speed_remark(Service(train, 0.81 * critical, 1), response, True)
    assert said.endswith(
        "81% of the critical speed of track and ground on the ground it softens "
        f"({critical * 3.6:.0f} km/h)"
    )
    # Far below it is not sought.
    monkeypatch.setattr(near_critical, "critical_speed_of", None)
    slow = 0.79 * lowest_critical_speed(response)
    assert speed_remark(Service(train, slow, 1), response, False) is None


def test_deflections_are_those_of_moving_loads(response):
    """Against the response's own quadrature under the load; the reach of 15 m misses no maximum."""
    (spectra,) = response.spectra(40.0, np.zeros(1))
    under = np.sum(spectra.weights * spectra.receptance).real / (2.0 * np.pi)
    assert deflections(response, np.array([40.0]))[0] == pytest.approx(under, rel=0.01)
