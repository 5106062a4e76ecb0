"""Vehicle compliance against hand formulas: natural frequencies, both limits of frequency."""

import math
from dataclasses import replace

import numpy as np
import pytest

from mcsettle.railway.vehicle import FREIGHT, PASSENGER, natural_frequencies, vehicle_compliance


def hertz(stiffness, mass):
    return math.sqrt(stiffness / mass) / (2 * math.pi)


def two_masses(upper, lower, between, below):
    """Frequencies [Hz] of mass ``upper`` on ``between`` on mass ``lower`` on ``below``, fixed."""
    a = upper * lower
    b = upper * (between + below) + lower * between
    c = between * below
    root = math.sqrt(b * b - 4 * a * c)
    return [math.sqrt((b + s * root) / (2 * a)) / (2 * math.pi) for s in (-1, 1)]


def test_freight_on_fixed_wheels():
    bounce = hertz(2 * 2660e3, 86400)
    pitch = hertz(2 * 2660e3 * 4.85**2, 1.02e6)
    assert pitch == pytest.approx(1.76, abs=0.005)  # the paper's 15.3 m at 97 km/h
    np.testing.assert_allclose(natural_frequencies(FREIGHT), [bounce, pitch], rtol=1e-10)


def test_freight_with_free_wheels():
    """Half the body and a whole bogie move against each other on one spring."""
    bogie = 2800 + 2 * 2000
    half, lever = 86400 / 2, 1.02e6 / (2 * 4.85**2)
    moving = sorted(hertz(2660e3, m * bogie / (m + bogie)) for m in (half, lever))
    # rigid modes are √(rounding of K/M): about 1e-5 Hz
    np.testing.assert_allclose(
        natural_frequencies(FREIGHT, "free"), [0, 0, 0, 0, *moving], rtol=1e-8, atol=1e-4
    )


def test_passenger_on_fixed_wheels():
    bounce = two_masses(32900 / 2, 4932, 1320e3, 2 * 3420e3)
    pitch = two_masses(2080e3 / (2 * 9.5**2), 4932, 1320e3, 2 * 3420e3)
    bogie = hertz(2 * 3420e3 * 1.45**2, 5150)
    expected = sorted([*bounce, *pitch, bogie, bogie])
    np.testing.assert_allclose(natural_frequencies(PASSENGER), expected, rtol=1e-10)


def test_passenger_bogie_pitch_with_free_wheels():
    """The wheelsets' rotation about the bogie, 2 Mw lw², joins its inertia in series."""
    bogie, wheels = 5150, 2 * 1538 * 1.45**2
    pitch = hertz(2 * 3420e3 * 1.45**2, bogie * wheels / (bogie + wheels))
    frequencies = natural_frequencies(PASSENGER, "free")
    assert np.sum(np.isclose(frequencies, pitch, rtol=1e-10)) == 2
    assert np.all(frequencies[:4] < 1e-4)
    assert frequencies[4] > 1.0


def shares(vehicle):
    """Inertias and their motion per wheelset displacement, for a car rigid on its wheelsets."""
    lb, lw = vehicle.bogie_spacing / 2, vehicle.axle_spacing / 2
    front, rear = np.array([0.5, 0.5, 0, 0]), np.array([0, 0, 0.5, 0.5])
    tilt_front, tilt_rear = np.array([1, -1, 0, 0]) / (2 * lw), np.array([0, 0, 1, -1]) / (2 * lw)
    body = [
        (vehicle.body_mass, (front + rear) / 2),
        (vehicle.body_inertia, (front - rear) / (2 * lb)),
    ]
    bogies = [(vehicle.bogie_mass, v) for v in (front, rear)]
    bogies += [(vehicle.bogie_inertia, v) for v in (tilt_front, tilt_rear)]
    return body, bogies, [(vehicle.wheelset_mass, v) for v in np.eye(4)]


def carried_mass(parts):
    return sum(m * np.outer(v, v) for m, v in parts)


@pytest.mark.parametrize("vehicle", [PASSENGER, FREIGHT], ids=lambda v: v.name)
@pytest.mark.parametrize("model", ["complete", "bogies"])
def test_low_frequency_is_a_rigid_car(vehicle, model):
    """Four wheelsets determine the rigid motion, so V_c → -M⁻¹/Ω² with the mass they carry."""
    body, bogies, wheels = shares(vehicle)
    parts = (body if model == "complete" else []) + bogies + wheels
    omega = 1e-3
    expected = -np.linalg.inv(carried_mass(parts)) / omega**2
    compliance = vehicle_compliance(replace(vehicle, model=model), omega)
    # corrections are (Ω/ω1)², 1e-8, and cancellation K/(MΩ²)·1e-16, 1e-6
    np.testing.assert_allclose(compliance, expected, atol=1e-5 * np.abs(expected).max())


def test_high_frequency_leaves_the_wheelsets_alone():
    omega = 1e6
    expected = -np.eye(4) / (1538 * omega**2)
    # the primary damper's iΩc over MΩ² is 2e-5 here
    np.testing.assert_allclose(
        vehicle_compliance(PASSENGER, omega), expected, atol=1e-4 * abs(expected[0, 0])
    )
    np.testing.assert_allclose(
        vehicle_compliance(replace(PASSENGER, model="wheelsets"), 7.0),
        -np.eye(4) / (1538 * 7.0**2),
        rtol=1e-12,
    )


def test_high_frequency_freight_is_a_rigid_bogie():
    _, bogies, wheels = shares(FREIGHT)
    omega = 1e5
    expected = -np.linalg.inv(carried_mass(bogies + wheels)) / omega**2
    # k/(MΩ²) is 4e-8, the damper's share c/(MΩ) 4e-6
    np.testing.assert_allclose(
        vehicle_compliance(FREIGHT, omega), expected, atol=1e-5 * np.abs(expected).max()
    )
