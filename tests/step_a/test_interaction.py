"""Dynamic interaction of a train, the transfer functions made from it, and their file."""

from dataclasses import fields, replace

import numpy as np
import pytest

from mcsettle.errors import InputError
from mcsettle.railway.track import TOY_TRACK
from mcsettle.railway.traffic import Train
from mcsettle.railway.vehicle import FREIGHT, PASSENGER, vehicle_compliance
from mcsettle.step_a.beam import beam_response
from mcsettle.step_a.interaction import (
    HERTZ_STIFFNESS,
    axle_phases,
    dynamic_forces,
    load,
    precompute,
    save,
    track_compliance_matrix,
    train_compliance,
)
from mcsettle.units import KMH

SPEED = 50.0
TRACK = replace(TOY_TRACK, support_damping=0.05)
TRAIN = Train("short", (PASSENGER, FREIGHT))
KAPPA = 2 * np.pi / 200.0 * np.array([6, 20, 66])


@pytest.fixture(scope="module")
def response():
    return beam_response(TRACK, integration_depth=1.0, period=300.0, cutoff=20.0)


@pytest.fixture(scope="module")
def transfer(response):
    return precompute(TRAIN, SPEED, response, KAPPA)


def test_train_compliance_is_block_diagonal_by_car():
    matrix = train_compliance(TRAIN, 20.0)
    np.testing.assert_array_equal(matrix[:4, :4], vehicle_compliance(PASSENGER, 20.0))
    np.testing.assert_array_equal(matrix[4:, 4:], vehicle_compliance(FREIGHT, 20.0))
    assert not matrix[:4, 4:].any()
    assert not matrix[4:, :4].any()


def test_track_compliance_is_reciprocal_with_the_direction_of_travel(response):
    """Action at j on l at speed v equals that of l on j at speed -v, here k → -k: T(v) = T(-v)ᵀ."""
    positions = TRAIN.axle_positions
    spectra = next(response.spectra(SPEED, np.array([60.0])))
    forward = track_compliance_matrix(spectra, positions)
    mirrored = replace(spectra, receptance=spectra.receptance[::-1])
    backward = track_compliance_matrix(mirrored, positions)
    np.testing.assert_allclose(backward, forward.T, atol=1e-12 * abs(forward[0, 0]))
    assert np.ptp(np.diag(forward)) < 1e-12 * abs(forward[0, 0])
    slow = track_compliance_matrix(next(response.spectra(1e-9, np.array([60.0]))), positions)
    # a load that stands still sees a symmetric track
    np.testing.assert_allclose(slow, slow.T, atol=1e-12 * abs(slow[0, 0]))


@pytest.mark.parametrize("uneven", [0.0, 1e-3])
def test_equal_distances_between_axles_are_taken_once(response, uneven):
    """T_jl depends on a_j - a_l alone: few distances between equal cars, all between uneven axles."""
    positions = np.concatenate([-20.0 * np.arange(12.0), -20.0 * np.arange(12.0) - 2.5])
    positions = positions + uneven * np.arange(24.0) ** 2
    spectra = next(response.spectra(SPEED, np.array([60.0])))
    phases = axle_phases(spectra.wavenumbers, positions)
    assert (phases.distances is None) == (uneven > 0.0)
    assert uneven > 0.0 or len(phases.distances) == 69  # 20 n and 20 n ± 2.5 m, |n| < 12
    plain = np.exp(-1j * np.outer(positions, spectra.wavenumbers))
    exact = (plain * spectra.weights * spectra.receptance) @ plain.conj().T / (2.0 * np.pi)
    found = track_compliance_matrix(spectra, positions)
    np.testing.assert_allclose(found, exact, rtol=0.0, atol=1e-12 * abs(exact[0, 0]))


def test_forces_meet_the_contact_condition(response):
    """Wheel - rail - profile = f/k_H, each with its own displacement, at every wheelset."""
    omega, kappa = KAPPA[1] * SPEED, KAPPA[1]
    vehicle = train_compliance(TRAIN, omega)
    spectra = next(response.spectra(SPEED, np.array([omega])))
    track = track_compliance_matrix(spectra, TRAIN.axle_positions)
    profile = 1e-3 * np.exp(1j * kappa * TRAIN.axle_positions)
    forces = dynamic_forces(vehicle, track, profile, HERTZ_STIFFNESS)
    wheel, rail = vehicle @ -forces, track @ forces
    np.testing.assert_allclose(wheel - rail - profile, forces / HERTZ_STIFFNESS, atol=1e-15)


def test_forces_are_linear_in_the_profile(response):
    vehicle = train_compliance(TRAIN, 40.0)
    spectra = next(response.spectra(SPEED, np.array([40.0])))
    track = track_compliance_matrix(spectra, TRAIN.axle_positions)
    rng = np.random.default_rng(1)
    a, b = rng.normal(size=(2, 8)) + 1j * rng.normal(size=(2, 8))

    def force(profile):
        return dynamic_forces(vehicle, track, profile, HERTZ_STIFFNESS)

    np.testing.assert_allclose(force(2 * a - 3j * b), 2 * force(a) - 3j * force(b), rtol=1e-10)
    assert not force(np.zeros(8, dtype=complex)).any()


def test_long_waves_only_lift_the_car(response):
    """As κ → 0 each wheelset accelerates a quarter of its car's masses: f = +Ω² M/4."""
    kappa = 1e-4
    forces = precompute(TRAIN, SPEED, response, np.array([kappa])).force[:, 0]
    masses = np.repeat([32900 + 2 * 4932 + 4 * 1538, 86400 + 2 * 2800 + 4 * 2000], 4) / 4
    # corrections: (κ × 11 m)² and, between the wheelsets of a tilting car, κ × 11 m × 1e-2
    np.testing.assert_allclose(forces, masses * (kappa * SPEED) ** 2, rtol=5e-3)


def test_one_mode_by_a_sum_over_axles(response, transfer):
    """dynamic[j] = Σ_l f_l e^{-iκa_j} g(a_j - a_l): written out with the response in space."""
    mode, j = 1, 5
    kappa, a = KAPPA[mode], TRAIN.axle_positions
    omega = kappa * SPEED
    spectra = next(response.spectra(SPEED, np.array([omega])))
    track = track_compliance_matrix(spectra, a)
    vehicle = train_compliance(TRAIN, omega)
    forces = dynamic_forces(vehicle, track, np.exp(1j * kappa * a), HERTZ_STIFFNESS)
    expected = np.zeros((4, response.grid.z.size), dtype=complex)
    for other in range(8):
        wave = np.exp(-1j * spectra.wavenumbers * (a[j] - a[other])) * spectra.weights
        expected += forces[other] * np.tensordot(wave, spectra.stress, axes=1) / (2 * np.pi)
    expected *= np.exp(-1j * kappa * a[j])
    scale = np.abs(expected).max()
    np.testing.assert_allclose(transfer.dynamic[j, mode], expected, atol=1e-12 * scale)
    np.testing.assert_allclose(transfer.force[:, mode], forces * np.exp(-1j * kappa * a))
    assert transfer.track_compliance[mode] == pytest.approx(track[3, 3])


def test_quasi_static_stress_is_symmetric_along_a_symmetric_train(response):
    """No damping, equal cars: mirror images in xx, yy, zz, and opposite shear."""
    undamped = beam_response(TOY_TRACK, integration_depth=1.0, period=300.0, cutoff=20.0)
    train = Train("pair", (PASSENGER, PASSENGER))
    stress = precompute(train, SPEED, undamped, KAPPA[:1]).quasi_static
    scale = np.abs(stress).max()
    np.testing.assert_allclose(stress[::-1, :3], stress[:, :3], atol=1e-12 * scale)
    np.testing.assert_allclose(stress[::-1, 3], -stress[:, 3], atol=1e-12 * scale)
    assert np.all(stress[:, 2] < 0)


def test_a_far_car_is_not_felt():
    """Coupling through an undamped track dies out over the 58 m between two long cars."""
    undamped = beam_response(TOY_TRACK, integration_depth=0.1, period=400.0, cutoff=30.0)
    car = replace(PASSENGER, length=80.0)
    alone = precompute(Train("one", (car,)), SPEED, undamped, KAPPA)
    pair = precompute(Train("two", (car, car)), SPEED, undamped, KAPPA)
    # what is left is the ripple of the cut at 30 rad/m: (1.4/30)³ / (30 × 58) = 6e-8 of T_c
    np.testing.assert_allclose(pair.force[4:], alone.force, rtol=1e-6)
    np.testing.assert_allclose(pair.force[:4], alone.force, rtol=1e-6)


@pytest.mark.parametrize(("vehicle", "cars"), [(PASSENGER, 11), (FREIGHT, 40)])
def test_interior_cars_are_alike(vehicle, cars):
    """Away from the ends every car sees the same neighbours, so dynamic[j] repeats by car.

    Two cars from an end it does so to 1e-3 of the largest stress; the end cars differ by 3 to 8 %,
    for want of one neighbour.
    """
    train = Train("uniform", (vehicle,) * cars)
    full = beam_response(TOY_TRACK)
    transfer = precompute(train, 97 * KMH, full, 2 * np.pi / 200 * np.array([6, 13, 30, 66]))
    per_car = transfer.dynamic.reshape(cars, 4, -1)
    middle = per_car[cars // 2]
    gap = np.abs(per_car - middle).max(axis=(1, 2)) / np.abs(middle).max()
    assert gap[2:-2].max() < 1e-3
    assert 5e-3 < gap[0] < 0.15


def test_progress_counts_every_frequency(response):
    seen = []
    precompute(TRAIN, SPEED, response, KAPPA, progress=lambda *now: seen.append(now))
    stage = f"Step A: {TRAIN.name} at {SPEED / KMH:.0f} km/h"
    assert seen == [(stage, done, 4) for done in (1, 2, 3, 4)]


def test_input_is_checked(response):
    with pytest.raises(ValueError, match="speed is 0"):
        precompute(TRAIN, 0.0, response, KAPPA)
    with pytest.raises(ValueError, match="must be positive and finite"):
        precompute(TRAIN, SPEED, response, -KAPPA)
    with pytest.raises(ValueError, match="at least one"):
        precompute(TRAIN, SPEED, response, np.array([]))
    with pytest.raises(ValueError, match="Hertz stiffness is 0"):
        precompute(TRAIN, SPEED, response, KAPPA, hertz_stiffness=0.0)


def test_the_digest_follows_everything(response, transfer):
    other = replace(TRAIN, cars=(PASSENGER, replace(FREIGHT, axle_load=24e3)))
    changed = [
        precompute(TRAIN, SPEED, response, KAPPA[:2]),
        precompute(TRAIN, SPEED + 1, response, KAPPA[:1]),
        precompute(other, SPEED, response, KAPPA[:1]),
        precompute(TRAIN, SPEED, response, KAPPA[:1], hertz_stiffness=1e9),
        precompute(TRAIN, SPEED, beam_response(TRACK, 1.1, 50.0, 5.0), KAPPA[:1]),
        precompute(TRAIN, SPEED, response, KAPPA[:1]),
    ]
    assert len({transfer.digest, *(t.digest for t in changed)}) == 7
    assert precompute(TRAIN, SPEED, response, KAPPA).digest == transfer.digest


def test_a_file_gives_back_what_was_saved(transfer, tmp_path):
    path = tmp_path / "transfer.npz"
    save(transfer, path)
    back = load(path)
    for field in fields(transfer):
        if field.name != "grid":
            np.testing.assert_array_equal(getattr(back, field.name), getattr(transfer, field.name))
    for name in ("z", "weights", "layer"):
        np.testing.assert_array_equal(getattr(back.grid, name), getattr(transfer.grid, name))
    assert isinstance(back.train, str)
    assert isinstance(back.speed, float)
    first = path.read_bytes()
    save(transfer, path)
    assert path.read_bytes() == first  # content decides the bytes
    assert [p.name for p in tmp_path.iterdir()] == ["transfer.npz"]


def test_a_damaged_file_is_refused(transfer, tmp_path):
    path = tmp_path / "transfer.npz"
    save(transfer, path)
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) // 2])
    with pytest.raises(InputError, match="is damaged"):
        load(path)
    for place in (len(whole) // 3, len(whole) // 2):
        spoilt = bytearray(whole)
        spoilt[place] ^= 0x40
        path.write_bytes(spoilt)
        with pytest.raises(InputError, match="is damaged"):
            load(path)
    path.write_bytes(b"")
    with pytest.raises(InputError, match="is damaged"):
        load(path)
    with pytest.raises(FileNotFoundError):
        load(tmp_path / "none.npz")


def test_a_changed_number_in_a_well_formed_file_is_noticed(transfer, tmp_path):
    path = tmp_path / "transfer.npz"
    save(transfer, path)
    with np.load(path) as file:
        members = dict(file)
    members["force"] = members["force"] * 2
    np.savez(path, **members)
    with pytest.raises(InputError, match="checksum does not match"):
        load(path)
    np.savez(path, other=np.zeros(3))
    with pytest.raises(InputError, match="holds 'nothing', expected"):
        load(path)


def test_a_failed_save_leaves_the_old_file(transfer, tmp_path, monkeypatch):
    path = tmp_path / "transfer.npz"
    save(transfer, path)
    whole = path.read_bytes()

    def fail(*_):
        raise OSError("disk full")

    monkeypatch.setattr("os.replace", fail)
    with pytest.raises(OSError, match="disk full"):
        save(transfer, path)
    assert path.read_bytes() == whole
    assert [p.name for p in tmp_path.iterdir()] == ["transfer.npz"]
