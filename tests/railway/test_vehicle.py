"""Vehicles: what the constructors refuse, and the matrices of Appendix A."""

from dataclasses import replace

import numpy as np
import pytest

from mcsettle.railway.traffic import Train
from mcsettle.railway.vehicle import (
    FREIGHT,
    PASSENGER,
    Suspension,
    Vehicle,
    connection_matrix,
    mass_matrix,
    natural_frequencies,
    stiffness_matrix,
    vehicle_compliance,
)
from mcsettle.railway.vehicle_remarks import vehicle_remarks

MODELS = [
    (PASSENGER, "complete"),
    (PASSENGER, "bogies"),
    (PASSENGER, "wheelsets"),
    (FREIGHT, "complete"),
    (FREIGHT, "bogies"),
]
OMEGA = 30.0


def modelled(vehicle, model):
    return replace(vehicle, model=model)


@pytest.mark.parametrize("field", ["length", "body_mass", "bogie_inertia", "axle_load"])
@pytest.mark.parametrize("value", [0.0, -1.0, float("nan"), float("inf")])
def test_refuses_what_is_not_positive(field, value):
    with pytest.raises(ValueError, match=f"{field} of vehicle 'passenger' is {value}"):
        replace(PASSENGER, **{field: value})


def test_refuses_a_suspension_without_stiffness_or_with_negative_damping():
    with pytest.raises(ValueError, match="suspension stiffness is 0"):
        Suspension(0.0, 1.0)
    with pytest.raises(ValueError, match="suspension damping is -1"):
        Suspension(1.0, -1.0)
    assert Suspension(1.0, 0.0).damping == 0.0


def test_refuses_spacings_that_do_not_fit():
    with pytest.raises(ValueError, match="do not fit"):
        replace(PASSENGER, length=21.0)
    with pytest.raises(ValueError, match="do not fit"):
        replace(PASSENGER, axle_spacing=19.0, length=60.0)


def test_refuses_unknown_models_and_loose_freight_wheelsets():
    with pytest.raises(ValueError, match="choose one of complete, bogies, wheelsets"):
        modelled(PASSENGER, "body")
    with pytest.raises(ValueError, match=r"rigidly part of the bogies.*choose the model 'bogies'"):
        modelled(FREIGHT, "wheelsets")


def test_passenger_matrices_are_those_of_appendix_a():
    kp = 3420e3 + 1j * OMEGA * 36e3
    ks = 1320e3 + 1j * OMEGA * 36e3
    lb, lw = 9.5, 1.45
    upper = np.zeros((10, 10), dtype=complex)  # Eq. (18), above the diagonal
    upper[0, [2, 4]] = -ks
    upper[1, [2, 4]] = -ks * lb, ks * lb
    upper[2, [6, 7]] = upper[4, [8, 9]] = -kp
    upper[3, [6, 7]] = upper[5, [8, 9]] = -kp * lw, kp * lw
    bogie = [ks + 2 * kp, 2 * kp * lw**2]
    diagonal = [2 * ks, 2 * ks * lb**2, *bogie, *bogie, kp, kp, kp, kp]
    expected = upper + upper.T + np.diag(diagonal)
    # rtol: rounding of a few sums of products
    np.testing.assert_allclose(stiffness_matrix(PASSENGER, OMEGA), expected, rtol=1e-13)
    masses = [32900, 2080e3, 4932, 5150, 4932, 5150, 1538, 1538, 1538, 1538]  # Eq. (17)
    np.testing.assert_array_equal(mass_matrix(PASSENGER), np.diag(masses))


def test_freight_matrices_are_those_of_appendix_a():
    ks = 2660e3 + 1j * OMEGA * 2500.0
    lb, lw = 4.85, 0.85
    expected = np.zeros((6, 6), dtype=complex)  # Eq. (21)
    expected[0, [0, 2, 4]] = 2 * ks, -ks, -ks
    expected[1, [1, 2, 4]] = 2 * ks * lb**2, -ks * lb, ks * lb
    expected[2, [0, 1, 2]] = -ks, -ks * lb, ks
    expected[4, [0, 1, 4]] = -ks, ks * lb, ks
    np.testing.assert_allclose(stiffness_matrix(FREIGHT, OMEGA), expected, rtol=1e-13)
    bogie = [2800 + 2 * 2000, 2020 + 2 * 2000 * lw**2]  # Eq. (20)
    np.testing.assert_allclose(
        mass_matrix(FREIGHT), np.diag([86400, 1020e3, *bogie, *bogie]), rtol=1e-15
    )
    z = [[0, 0, 1, lw, 0, 0], [0, 0, 1, -lw, 0, 0], [0, 0, 0, 0, 1, lw], [0, 0, 0, 0, 1, -lw]]
    np.testing.assert_array_equal(connection_matrix(FREIGHT), z)


@pytest.mark.parametrize(("vehicle", "size"), list(zip(MODELS, [10, 8, 4, 6, 4], strict=True)))
def test_each_model_has_its_degrees_of_freedom(vehicle, size):
    car = modelled(*vehicle)
    assert mass_matrix(car).shape == stiffness_matrix(car, OMEGA).shape == (size, size)
    assert connection_matrix(car).shape == (4, size)


@pytest.mark.parametrize(("vehicle", "model"), MODELS)
def test_compliance_is_reciprocal_real_in_time_and_dissipative(vehicle, model):
    car = modelled(vehicle, model)
    compliance = vehicle_compliance(car, OMEGA)
    scale = np.abs(compliance).max()
    # rounding of a 10 × 10 solve
    np.testing.assert_allclose(compliance, compliance.T, atol=1e-12 * scale)
    np.testing.assert_allclose(
        vehicle_compliance(car, -OMEGA), compliance.conj(), atol=1e-12 * scale
    )
    # power into the car, -Ω Im(V_c)/2 per unit force, is never negative
    assert np.linalg.eigvalsh(-compliance.imag).min() > -1e-12 * scale


def test_front_and_rear_of_a_car_mirror_each_other():
    compliance = vehicle_compliance(PASSENGER, OMEGA)
    np.testing.assert_allclose(compliance, compliance[::-1, ::-1], rtol=1e-10)


def test_a_static_compliance_is_refused():
    with pytest.raises(ValueError, match="must be finite and not zero"):
        vehicle_compliance(PASSENGER, 0.0)


def test_natural_frequencies_refuse_what_they_cannot_do():
    with pytest.raises(ValueError, match="choose 'fixed' or 'free'"):
        natural_frequencies(PASSENGER, "loose")
    with pytest.raises(ValueError, match="nothing left to move"):
        natural_frequencies(modelled(PASSENGER, "wheelsets"))


WAGON = Vehicle(
    name="wagon", length=14.0, bogie_spacing=9.0, axle_spacing=0.0, body_mass=36e3, body_inertia=5e5,
    bogie_mass=0.0, bogie_inertia=0.0, wheelset_mass=1300.0, secondary=Suspension(2e6, 4e4),
    primary=None, axle_load=20e3, axles_per_bogie=1,
)  # fmt: skip
CO_CO = replace(
    PASSENGER, name="co_co", length=21.0, bogie_spacing=11.5, axle_spacing=1.9, axles_per_bogie=3
)
ARTICULATED = replace(PASSENGER, name="articulated", length=64.0, bodies=3)


def assembled(vehicle, omega):
    """K and M of any vehicle by its energies: a body's end on a bogie, a bogie on each wheelset."""
    bodies, bogies = vehicle.bodies, vehicle.bodies + 1
    positions = {}
    for i in range(bodies):
        positions["body", i] = vehicle.bogie_spacing * ((bodies - 1) / 2 - i)
    for b in range(bogies):
        positions["bogie", b] = vehicle.bogie_spacing * (bodies / 2 - b)
    names = [(kind, i, what) for kind, n in (("body", bodies), ("bogie", bogies)) for i in range(n)
             for what in ("down", "pitch")]  # fmt: skip
    names += [("wheel", i, "down") for i in range(vehicle.n_axles)]
    place = {name: row for row, name in enumerate(names)}
    stiffness = np.zeros((len(names), len(names)), dtype=complex)

    def spring(suspension, upper, lower, x):
        vector = np.zeros(len(names))
        for sign, (kind, i) in ((1.0, upper), (-1.0, lower)):
            vector[place[kind, i, "down"]] += sign
            if kind != "wheel" and (kind, i, "pitch") in place:
                vector[place[kind, i, "pitch"]] += sign * (x - positions[kind, i])
        stiffness[:] += suspension.dynamic_stiffness(omega) * np.outer(vector, vector)

    for i in range(bodies):
        for b in (i, i + 1):
            spring(vehicle.secondary, ("body", i), ("bogie", b), positions["bogie", b])
    for j, x in enumerate(vehicle.axle_offsets):
        spring(vehicle.primary, ("bogie", j // vehicle.axles_per_bogie), ("wheel", j), x)
    v = vehicle
    masses = {
        "body": (v.body_mass, v.body_inertia),
        "bogie": (v.bogie_mass, v.bogie_inertia),
        "wheel": (v.wheelset_mass,),
    }
    diagonal = [masses[kind][what == "pitch"] for kind, _, what in names]
    return stiffness, np.diag(diagonal)


@pytest.mark.parametrize(
    "vehicle", [PASSENGER, CO_CO, ARTICULATED, replace(CO_CO, length=40.0, bodies=2)]
)
def test_any_number_of_axles_and_bodies_is_what_its_energies_say(vehicle):
    stiffness, mass = assembled(vehicle, OMEGA)
    np.testing.assert_allclose(stiffness_matrix(vehicle, OMEGA), stiffness, rtol=1e-12, atol=1e-6)
    np.testing.assert_allclose(mass_matrix(vehicle), mass, rtol=1e-13)
    n = vehicle.n_axles
    direct = np.linalg.inv(stiffness - OMEGA**2 * mass)[-n:, -n:]
    np.testing.assert_allclose(vehicle_compliance(vehicle, OMEGA), direct, rtol=1e-9)
    assert ARTICULATED.moving_mass == 3 * 32900 + 4 * 4932 + 8 * 1538


def test_a_two_axle_wagon_bounces_and_pitches_on_its_springs():
    """Closed forms: two springs under a body, and two wheelsets that its forces do not move apart."""
    k, wheelbase = WAGON.secondary.stiffness, WAGON.bogie_spacing
    bounce = np.sqrt(2.0 * k / WAGON.body_mass) / (2.0 * np.pi)
    pitch = np.sqrt(2.0 * k * (wheelbase / 2.0) ** 2 / WAGON.body_inertia) / (2.0 * np.pi)
    np.testing.assert_allclose(natural_frequencies(WAGON), np.sort([bounce, pitch]), rtol=1e-12)
    assert WAGON.axle_offsets == (4.5, -4.5)
    high = vehicle_compliance(WAGON, 1e6)
    np.testing.assert_allclose(high[0, 0], -1.0 / (WAGON.wheelset_mass * 1e12), rtol=1e-3)


def test_a_rigid_bogie_of_three_axles_moves_as_a_body():
    freight = replace(FREIGHT, axles_per_bogie=3, bogie_spacing=9.7, length=16.0)
    arm = freight.axle_spacing
    assert freight.arms == (arm, 0.0, -arm)
    turning = FREIGHT.bogie_inertia + 2.0 * FREIGHT.wheelset_mass * arm**2
    assert mass_matrix(freight)[3, 3] == pytest.approx(turning)
    compliance = vehicle_compliance(freight, OMEGA)
    assert compliance.shape == (6, 6)
    np.testing.assert_allclose(  # three points of one bogie stay on a line
        compliance[0] - 2.0 * compliance[1] + compliance[2], 0.0, atol=1e-12 * abs(compliance[0, 0])
    )


def test_trains_of_unlike_cars_have_all_their_axles():
    from mcsettle.step_a.interaction import train_compliance

    train = Train("mixed", (CO_CO, PASSENGER, WAGON, ARTICULATED))
    assert train.n_axles == 6 + 4 + 2 + 8 == len(train.axle_positions) == len(train.axle_forces)
    assert np.all(np.diff(train.axle_positions) < 0.0)
    matrix = train_compliance(train, OMEGA)
    np.testing.assert_array_equal(matrix[10:12, 10:12], vehicle_compliance(WAGON, OMEGA))
    assert np.all(matrix[:6, 6:] == 0.0)
    assert train.mass == pytest.approx(6 * 17e3 + 4 * 17e3 + 2 * 20e3 + 8 * 17e3)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"axles_per_bogie": 5}, "'passenger' has axles_per_bogie 5; this model takes 1 to 4"),
        ({"bodies": 0}, "'passenger' has bodies 0; this model takes 1 to 20"),
        ({"bodies": 2}, "do not fit"),
        ({"axle_loads": (1.0, 2.0)}, "has 4 axles and 2 axle loads"),
    ],
)
def test_arrangements_that_cannot_be_are_refused_by_name(changes, said):
    with pytest.raises(ValueError, match=said):
        replace(PASSENGER, **changes)


def test_masses_of_half_a_vehicle_and_slipped_units_are_remarked_on():
    half = replace(PASSENGER, body_mass=12e3, bogie_mass=2e3, wheelset_mass=0.9e3, axle_load=10e3)
    (remark,) = [r for r in vehicle_remarks(half) if "half" in r]
    assert "19.6 t, about half of the 40 t" in remark
    assert any("twice" in r for r in vehicle_remarks(replace(FREIGHT, axle_load=12.5e3)))
    assert any("m L²/12" in r for r in vehicle_remarks(replace(PASSENGER, body_inertia=2080.0)))
    soft = replace(PASSENGER, secondary=Suspension(1320.0, 36e3))
    assert any("of critical damping" in r for r in vehicle_remarks(soft))
    for vehicle in (PASSENGER, FREIGHT, WAGON):
        assert list(vehicle_remarks(vehicle)) == []
