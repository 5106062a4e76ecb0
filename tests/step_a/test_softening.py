"""Equivalent-linear soil: strains of a passing train, iteration, properties in Step A."""

import math
from dataclasses import replace

import numpy as np
import pytest

from mcsettle.errors import NumericalError
from mcsettle.railway.modulus_curves import Curve
from mcsettle.railway.softening_choices import SofteningSettings
from mcsettle.railway.track import CASE_STUDY_TRACK, Layer, Material, RailPad, SectionTrack, Sleeper
from mcsettle.railway.traffic import Train
from mcsettle.railway.vehicle import PASSENGER
from mcsettle.step_a.fem25d import (
    MeshSettings,
    Settings,
    equivalent_linear_response,
    section_response,
)
from mcsettle.step_a.fem25d.element_scaling import LEAST_CONFINEMENT, confinement, track_frame
from mcsettle.step_a.fem25d.passing_train import along_train, line_wavenumbers, places
from mcsettle.step_a.fem25d.pml import Border
from mcsettle.step_a.fem25d.softening import (
    largest_octahedral,
    octahedral_strain,
    soften,
    strain_spectra,
)
from mcsettle.step_a.fem25d.solve import outputs, solve
from mcsettle.step_a.fem25d.stress_outputs import _to_centreline
from mcsettle.step_a.fem25d.track_section import ElementProperties, track_section
from mcsettle.units import KMH
from mcsettle.verification.layered_ground import layered_ground
from mcsettle.verification.strip import strip_response

MESH = MeshSettings(size=0.5, growth=1.8, largest=2.0, border=Border(elements=5))
DEPTH = 3.0  # m of the real mesh below the subgrade surface
TINY = Settings(mesh=MESH, max_omega=5.0, max_speed=60.0, bands=(1.0,), tolerance=0.3)
TRAIN = Train("passenger", (PASSENGER,) * 2)
SPEED = 201 * KMH
CONSTANT = SofteningSettings(
    curves=tuple((layer.name, Curve("constant")) for layer in CASE_STUDY_TRACK.layers)
)


@pytest.fixture(scope="module")
def frame():
    return track_frame(CASE_STUDY_TRACK, DEPTH, MESH)


@pytest.fixture(scope="module")
def softened(frame):
    return soften(CASE_STUDY_TRACK, TRAIN, SPEED, DEPTH, MESH, frame=frame)


def unchanged(frame):
    soft = frame.elements
    own = np.array([layer.material.damping for layer in frame.track.layers])[soft.layer]
    return soft.spread(frame.track, frame.grid, np.ones(soft.number.size), own)


# --- strains --------------------------------------------------------------------------------------


def test_octahedral_strain_is_the_shear_of_the_octahedral_plane():
    rng = np.random.default_rng(3)
    tensor = rng.standard_normal((3, 3))
    tensor += tensor.T
    own, axes = np.linalg.eigh(tensor)
    normal = axes @ np.ones(3) / math.sqrt(3.0)  # equal angles with the principal axes
    along = tensor @ normal
    shear = 2.0 * math.sqrt(along @ along - (normal @ along) ** 2)
    components = np.array(
        [tensor[i, j] for i, j in ((0, 0), (1, 1), (2, 2), (1, 2), (0, 1), (0, 2))]
    )
    assert octahedral_strain(components, "engineering") == pytest.approx(shear)
    assert octahedral_strain(components, "third") == pytest.approx(shear / 2.0)
    shifted = components + 5.0 * np.array([1, 1, 1, 0, 0, 0])
    assert octahedral_strain(shifted) == pytest.approx(octahedral_strain(components))
    assert np.ptp(own) > 0.0


@pytest.mark.parametrize("component", [3, 4, 5])
def test_pure_shear_has_its_octahedral_share(component):
    # An engineering shear strain γ has √(2/3) γ on the octahedral plane; the largest counts.
    spectra = np.zeros((6, 1, 2), dtype=complex)
    spectra[component, 0] = 1e-3, 1e-3j
    passing = np.array([[0.2, 0.5, 1.0], [0.0, 1j, 0.0]])  # γ = 0.2, 0.5 - 1, 1 in thousandths
    found = largest_octahedral(spectra, passing, "engineering")
    assert found == pytest.approx(1e-3 * math.sqrt(2.0 / 3.0))
    passing[1, 0] = 1j * 3.0
    found = largest_octahedral(spectra, passing, "third")
    assert found == pytest.approx(2.8e-3 * math.sqrt(1.0 / 6.0))


def test_static_strip_load_strains_the_ground_as_the_closed_form():
    # A thin, soft strip of sleeper passes an even pressure on to a uniform half-space. Strains at
    # element centres on the first column follow from the exact stresses by Hooke's law.
    material = Material(50e6, 0.3, 1900.0, 0.0)
    ground = Layer("ground", math.inf, material)
    sleeper = Sleeper(1.0, 0.02, 0.65, 0.65, Material(1e5, 0.0, 1.0, 0.0))
    rail = replace(CASE_STUDY_TRACK.rail, offset=0.25, foot_width=0.499999)
    track = SectionTrack((ground,), rail, RailPad(1e12), sleeper)
    # Centres lie off the axis by half an element: even in y, they differ from it by (y/b)².
    fine = track_frame(track, 5.5, MeshSettings(size=0.08, side=3.0, border=Border(elements=13)))
    k = 0.5
    spectra = strain_spectra(fine, unchanged(fine), np.array([k]), 1e-6)[:, :, 0]
    foot_force = spectra_force(fine, k)
    soft = fine.elements
    column = np.flatnonzero((soft.y == soft.y.min()) & (soft.z > -3.0) & (soft.z < -0.1))
    exact = strip_response(layered_ground((ground,)), k, 0.0, 1.0, np.sort(-soft.z[column])).stress[
        :, np.argsort(np.argsort(-soft.z[column]))
    ]
    xx, yy, zz, xz = exact * 2.0 * foot_force
    young, nu, g = material.youngs_modulus, material.poisson, material.shear_modulus
    wanted = np.stack(
        [
            (xx - nu * (yy + zz)) / young,
            (yy - nu * (xx + zz)) / young,
            (zz - nu * (xx + yy)) / young,
            xz / g,
        ]
    )
    found = spectra[[0, 1, 2, 5]][:, column]
    scale = np.abs(wanted).max(axis=0)
    # 3 %: elements of 0.08 m half a width from the axis, under a strip 1 m wide.
    assert np.max(np.abs(found - wanted) / scale) < 0.03


def spectra_force(frame, k):
    """Force on one pad per unit force per wheelset at (k, ω → 0)."""
    from mcsettle.step_a.fem25d.line_spectra import rail_coupling
    from mcsettle.step_a.fem25d.section import Section

    stiffness = frame.stiffness(unchanged(frame))
    empty = np.zeros((0, frame.load.size))
    section = Section(
        stiffness,
        frame.mass,
        frame.load,
        empty,
        empty,
        frame.grid.basis,
        frame.grid.free,
        *frame.lines,
    )
    foot = frame.load @ solve(section, k, 0.0)
    one = np.array([k])
    return rail_coupling(frame.track, one, np.zeros(1), np.array([foot]))[1][0]


def test_few_wavenumbers_carry_the_passing_strains(frame):
    found = []
    for count in (16, 40):
        k = line_wavenumbers(count)
        spectra = strain_spectra(frame, unchanged(frame), k, SPEED)
        found.append(largest_octahedral(spectra, along_train(TRAIN, k, places(TRAIN)), "third"))
    assert np.max(np.abs(found[0] / found[1] - 1.0)) < 0.02
    assert np.median(np.abs(found[0] / found[1] - 1.0)) < 3e-3


def test_ends_of_a_train_stand_for_all_of_it(frame):
    train = Train("passenger", (PASSENGER,) * 7)
    k = line_wavenumbers(16)
    spectra = strain_spectra(frame, unchanged(frame), k, SPEED)
    ends, whole = (
        largest_octahedral(spectra, along_train(train, k, places(train, cars)), "third")
        for cars in (2, 7)
    )
    np.testing.assert_allclose(ends, whole, rtol=5e-3)


def test_static_train_strains_are_symmetric(frame):
    # At rest and undamped a train of two alike cars strains the ground evenly about its middle.
    k = line_wavenumbers(16)
    properties = unchanged(frame)
    quiet = ElementProperties(properties.scale, np.zeros_like(properties.damping))
    x = np.linspace(-20.0, 20.0, 41)
    middle = TRAIN.axle_positions.mean()
    passing = along_train(TRAIN, k, middle + x)
    rail, sleeper = CASE_STUDY_TRACK.rail, CASE_STUDY_TRACK.sleeper
    elastic = replace(sleeper, material=replace(sleeper.material, damping=0.0))
    track = replace(CASE_STUDY_TRACK, rail=replace(rail, damping=0.0), sleeper=elastic)
    still = track_frame(track, DEPTH, MESH)
    spectra = strain_spectra(still, quiet, k, 1e-6)
    zz = (spectra[2] @ passing).real
    # 1 %: of the largest strain, what sixteen wavenumbers leave.
    np.testing.assert_allclose(zz, zz[:, ::-1], atol=0.01 * np.abs(zz).max())


# --- elements -------------------------------------------------------------------------------------


def test_border_takes_the_outermost_and_deepest_properties(frame):
    soft, grid = frame.elements, frame.grid
    assert np.all(soft.source[soft.number] == np.arange(soft.number.size))
    assert np.all(soft.source[grid.material == 0] == -1)
    column, row = grid.place
    side = np.flatnonzero((grid.cells.stretch_y != 1.0) & (grid.cells.stretch_z == 1.0))
    below = np.flatnonzero((grid.cells.stretch_y == 1.0) & (grid.cells.stretch_z != 1.0))
    outer = soft.number[soft.source[side]]
    assert np.all(row[outer] == row[side])
    assert len(set(column[outer])) == 1
    assert np.all(soft.y[soft.source[side]] == soft.y.max())
    assert np.all(column[soft.number[soft.source[below]]] == column[below])
    assert np.all(soft.z[soft.source[below]] == soft.z.min())
    assert np.all(grid.material[soft.number[soft.source[side]]] == grid.material[side])


def test_confinement_by_hand():
    y, z = np.array([0.0, 0.0, 4.0, 3.0]), np.array([0.5, -1.0, -1.0, -1e-3])
    stress = confinement(CASE_STUDY_TRACK, y, z, np.array([0, 2, 2, 2]))
    own = 9.81 * (2.0 * 7850.0 * 7.677e-3 + 2500.0 * 0.285 / 0.65 * 0.2 * 2.5)
    assert stress[0] == pytest.approx(2.0 / 3.0 * (own / 2.8 + 9.81 * 0.3 * 1650.0))
    above = own / 3.5 + 9.81 * (0.3 * 1650.0 + 0.5 * 2300.0 + 1900.0)
    assert stress[1] == pytest.approx(2.0 / 3.0 * above)
    assert stress[2] == pytest.approx(2.0 / 3.0 * 9.81 * 1900.0)
    assert stress[3] == LEAST_CONFINEMENT


def test_frame_gives_the_operators_of_the_section(frame, softened):
    for properties in (None, softened.properties):
        section = track_section(CASE_STUDY_TRACK, DEPTH, MESH, properties)
        stiffness = frame.stiffness(properties or unchanged(frame))
        for a, b in zip(section.stiffness, stiffness, strict=True):
            assert abs(a - b).max() < 1e-12 * abs(a).max()
    assert np.array_equal(section.load, frame.load)


def test_uniform_scale_is_another_track():
    # Half the moduli in every layer, element by element, or in the layers themselves.
    layers = tuple(
        replace(w, material=replace(w.material, youngs_modulus=w.material.youngs_modulus / 2.0,
                                    damping=0.1))
        for w in CASE_STUDY_TRACK.layers
    )  # fmt: skip
    frame = track_frame(CASE_STUDY_TRACK, DEPTH, MESH)
    half = np.full(frame.elements.number.size, 0.5)
    properties = frame.elements.spread(CASE_STUDY_TRACK, frame.grid, half, np.full_like(half, 0.1))
    found = track_section(CASE_STUDY_TRACK, DEPTH, MESH, properties)
    wanted = track_section(replace(CASE_STUDY_TRACK, layers=layers), DEPTH, MESH)
    a, b = (outputs(s, 0.7, solve(s, 0.7, 30.0)) for s in (found, wanted))
    np.testing.assert_allclose(a, b, rtol=1e-9, atol=1e-12 * np.abs(b[1:]).max())


# --- iteration ------------------------------------------------------------------------------------


def test_moduli_converge_and_fit_their_strains(frame, softened):
    history = softened.history
    assert history.converged
    assert history.iterations <= 7
    assert history.change[-1] <= 0.03 < history.change[0]
    assert history.layers == ("ballast", "sub_ballast", "subgrade")
    own = [layer.material.youngs_modulus for layer in CASE_STUDY_TRACK.layers]
    assert np.all(history.lowest[-1] < 0.85 * np.array(own))
    assert np.all(history.lowest <= history.mean)
    assert np.all(history.mean[-1] <= own)
    assert "iteration 1" in history.text()
    # One more iteration from the converged state moves no modulus by more than the tolerance.
    k = line_wavenumbers(16)
    spectra = strain_spectra(frame, softened.properties, k, SPEED)
    strain = 0.65 * largest_octahedral(spectra, along_train(TRAIN, k, places(TRAIN)), "third")
    lowest = [strain[frame.elements.layer == i].max() for i in range(3)]
    np.testing.assert_allclose(lowest, history.strain[-1], rtol=0.03)
    again = soften(
        CASE_STUDY_TRACK, TRAIN, SPEED, DEPTH, MESH, SofteningSettings(tolerance=1e-4,
                                                                     max_iterations=30), frame=frame
    )  # fmt: skip
    np.testing.assert_allclose(softened.properties.scale, again.properties.scale, rtol=0.03)


def test_softest_below_the_track_and_damping_never_below_the_layers(frame, softened):
    scale = softened.properties.scale[frame.elements.number]
    clay = frame.elements.layer == 2
    softest = np.flatnonzero(clay)[scale[clay].argmin()]
    # Near the surface, below the track or at its foot, where the confinement is least.
    assert frame.elements.y[softest] < 2.2
    assert frame.elements.z[softest] > -0.5
    damping = softened.properties.damping[frame.elements.number]
    own = np.array([layer.material.damping for layer in CASE_STUDY_TRACK.layers])
    assert np.all(damping >= own[frame.elements.layer])
    assert np.all(softened.properties.scale[softened_sleepers(frame)] == 1.0)


def softened_sleepers(frame):
    return np.flatnonzero(frame.grid.material == 0)


def test_a_feather_softens_nothing_and_a_heavier_train_softens_more(frame, softened):
    feather = Train("feather", (replace(PASSENGER, axle_load=1.0),) * 2)
    light = soften(CASE_STUDY_TRACK, feather, SPEED, DEPTH, MESH, frame=frame)
    # A kilogram on every axle: strains of 1e-8, where every curve starts.
    assert light.properties.scale.min() > 0.99
    assert light.history.iterations == 1
    heavy = Train("heavy", (replace(PASSENGER, axle_load=30e3),) * 2)
    more = soften(CASE_STUDY_TRACK, heavy, SPEED, DEPTH, MESH, frame=frame)
    assert np.all(more.history.lowest[-1] < 0.95 * softened.history.lowest[-1])


def test_engineering_strains_soften_more(frame, softened):
    twice = soften(
        CASE_STUDY_TRACK, TRAIN, SPEED, DEPTH, MESH,
        SofteningSettings(octahedral="engineering", max_iterations=30), frame=frame,
    )  # fmt: skip
    assert np.all(twice.history.lowest[-1] < softened.history.lowest[-1])
    half = SofteningSettings(octahedral="engineering", strain_factor=0.325)
    same = soften(CASE_STUDY_TRACK, TRAIN, SPEED, DEPTH, MESH, half, frame=frame)
    assert np.array_equal(same.properties.scale, softened.properties.scale)


def test_without_convergence_it_says_so(frame):
    short = SofteningSettings(max_iterations=2)
    with pytest.raises(NumericalError, match=r"did not converge.*keep_last"):
        soften(CASE_STUDY_TRACK, TRAIN, SPEED, DEPTH, MESH, short, frame=frame)
    keep = replace(short, keep_last=True)
    with pytest.warns(RuntimeWarning, match="last iterate"):
        ground = soften(CASE_STUDY_TRACK, TRAIN, SPEED, DEPTH, MESH, keep, frame=frame)
    assert not ground.history.converged
    assert ground.history.iterations == 2


def test_settings_refuse_nonsense():
    for changes, told in (
        ({"strain_factor": 0.0}, "strain_factor"),
        ({"octahedral": "half"}, "third, engineering"),
        ({"tolerance": 1.0}, "tolerance"),
        ({"max_iterations": 0}, "max_iterations"),
    ):
        with pytest.raises(ValueError, match=told):
            SofteningSettings(**changes)
    with pytest.raises(ValueError, match="no layer 'clay'"):
        SofteningSettings(curves=(("clay", Curve()),)).layer_curves(CASE_STUDY_TRACK)
    with pytest.raises(ValueError, match="speed"):
        soften(CASE_STUDY_TRACK, TRAIN, 0.0)
    with pytest.raises(ValueError, match="element properties given"):
        track_section(CASE_STUDY_TRACK, DEPTH, MESH, ElementProperties(np.ones(3), np.zeros(3)))
    for scale, damping in ((0.0, 0.1), (np.nan, 0.1), (1.0, 0.5), (1.0, -0.1)):
        with pytest.raises(ValueError, match=r"moduli|damping"):
            ElementProperties(np.array([scale]), np.array([damping]))


# --- Step A ---------------------------------------------------------------------------------------


def test_constant_curves_are_the_linear_ground(tmp_path):
    found, history = equivalent_linear_response(
        CASE_STUDY_TRACK, TRAIN, SPEED, DEPTH, TINY, CONSTANT, cache=tmp_path
    )
    linear = section_response(CASE_STUDY_TRACK, DEPTH, TINY, cache=tmp_path)
    assert history.iterations == 1
    assert history.change[0] == 0.0
    a, b = (r.at(0.6, np.array([3.0]))[0] for r in (found, linear))
    # Rounding may lead the greedy search elsewhere; the coarse bases agree to their own error.
    np.testing.assert_allclose(a[0], b[0], rtol=0.02)
    assert found.digest != linear.digest


def test_softened_response_is_kept_and_differs_by_train_and_speed(tmp_path, monkeypatch):
    from mcsettle.step_a.fem25d import equivalent_linear

    first, history = equivalent_linear_response(
        CASE_STUDY_TRACK, TRAIN, SPEED, DEPTH, TINY, cache=tmp_path
    )
    digests = {first.digest, section_response(CASE_STUDY_TRACK, DEPTH, TINY, cache=tmp_path).digest}
    monkeypatch.setattr(equivalent_linear, "soften", None)
    again, stored = equivalent_linear_response(
        CASE_STUDY_TRACK, TRAIN, SPEED, DEPTH, TINY, cache=tmp_path
    )
    assert again.digest == first.digest
    assert np.array_equal(stored.lowest, history.lowest)
    assert stored.layers == history.layers
    monkeypatch.undo()
    kept = next(tmp_path.glob("softening-*.npz"))
    kept.write_bytes(kept.read_bytes()[:-100])
    with pytest.warns(RuntimeWarning, match="softening"):
        equivalent_linear_response(CASE_STUDY_TRACK, TRAIN, SPEED, DEPTH, TINY, cache=tmp_path)
    for ground in (
        equivalent_linear.softened_ground(
            CASE_STUDY_TRACK, TRAIN, 50.0, DEPTH, MESH, cache=tmp_path
        ),
        equivalent_linear.softened_ground(
            CASE_STUDY_TRACK, Train("one", (PASSENGER,)), SPEED, DEPTH, MESH, cache=tmp_path
        ),
    ):
        digests.add(ground.properties.digest)
    assert len(digests) == 4
    hard = section_response(CASE_STUDY_TRACK, DEPTH, TINY, cache=tmp_path)
    soft, stiff = (abs(r.at(0.6, np.array([3.0]))[0, 0]) for r in (first, hard))
    assert soft > 1.02 * stiff


def test_heights_on_an_interface_are_refused():
    y, height = np.array([0.1, 0.2]), np.array([-0.3, -0.7])
    with pytest.raises(ValueError, match="interface"):
        _to_centreline(y, height, np.array([-0.5, -1.0]), [(0.0, -1.0), (-1.0, -2.0)])
