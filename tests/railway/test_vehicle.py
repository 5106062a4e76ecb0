"""Vehicles: what the constructors refuse, and the matrices of Appendix A."""

from dataclasses import replace

import numpy as np
import pytest

from mcsettle.railway.vehicle import (
    FREIGHT,
    PASSENGER,
    Suspension,
    connection_matrix,
    mass_matrix,
    natural_frequencies,
    stiffness_matrix,
    vehicle_compliance,
)

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
