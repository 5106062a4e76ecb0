"""Verification cases against closed forms: beam, vehicles, strip stresses, layered ground."""

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from mcsettle.railway.track import LEAN_CLAY, TOY_TRACK, VALIDATION_TRACK, Layer, rayleigh_speed
from mcsettle.railway.vehicle import FREIGHT, PASSENGER, natural_frequencies, vehicle_compliance
from mcsettle.step_a.beam import beam_response
from mcsettle.step_a.halfspace import strip_stress
from mcsettle.step_a.interaction import track_compliance_matrix
from mcsettle.verification.case import Case, worst_point, worst_ratio
from mcsettle.verification.closed_forms import (
    moving_load_factor,
    static_strip_compliance,
    static_strip_pressure,
    winkler_compliance,
    winkler_deflection,
)
from mcsettle.verification.layered_ground import LayeredGround, layered_ground, surface_compliance
from mcsettle.verification.quadrature import integrate
from mcsettle.verification.strip import strip_compliance, strip_response

WIDTH = 2.5  # m, of the strip
DEPTHS = np.array([0.1, 0.5, 2.0, 5.5])  # m
WAVENUMBERS = np.array([1e-3, 0.03, 0.3, 2.0, 8.0])  # rad/m
CLAY = LEAN_CLAY.material
_ELASTIC = replace(LEAN_CLAY, material=replace(CLAY, damping=0.0))
_RAILS = (
    2.0 * TOY_TRACK.rail.bending_stiffness,
    2.0 * TOY_TRACK.rail.mass_per_length,
    2.0 * TOY_TRACK.support_stiffness,
)


def elastic_ground() -> LayeredGround:
    """The case studies' clay without its damping."""
    return layered_ground((_ELASTIC,))


def plane_strain_strip(name: str) -> Case:
    """Long waves under the sleepers' strip: the plane-strain strip, all four components."""
    angle = 2.0 * np.arctan(WIDTH / (2.0 * DEPTHS))
    vertical = -(angle + np.sin(angle)) / (math.pi * WIDTH)
    across = -(angle - np.sin(angle)) / (math.pi * WIDTH)
    expected = np.stack(
        [0.3 * (vertical + across), across, vertical, np.zeros(DEPTHS.size)], axis=1
    )
    found = [strip_stress(np.zeros(1), d, WIDTH, 0.3)[0] for d in DEPTHS.tolist()]
    source = "plane-strain strip load (Flamant)"
    return worst_point(name, source, expected, np.array(found), 1e-6, "Pa/(N/m)")


def point_load_strip(name: str) -> Case:
    """σzz under the strip at any wavenumber: the Bessel form of the point load, averaged."""
    expected = [[static_strip_pressure(k, d, WIDTH) for k in WAVENUMBERS] for d in DEPTHS.tolist()]
    found = [strip_stress(WAVENUMBERS, d, WIDTH, 0.3)[:, 2] for d in DEPTHS.tolist()]
    source = "2.5D Boussinesq, -z³k²K2(kr)/(πr²)"
    return worst_point(name, source, np.array(expected), np.array(found), 1e-8, "Pa/(N/m)")


def winkler_moving_load(name: str) -> Case:
    """Deflection around a constant load at 70 % of the critical speed."""
    response = beam_response(TOY_TRACK, integration_depth=0.5, period=150.0, cutoff=120.0)
    speed = 0.7 * response.rayleigh_speed
    spectra = next(response.spectra(speed, np.zeros(1)))
    s = np.linspace(-8.0, 8.0, 65)
    waves = np.exp(-1j * np.outer(s, spectra.wavenumbers))
    found = (waves @ (spectra.weights * spectra.receptance)).real / (2.0 * math.pi)
    expected = winkler_deflection(s, speed, *_RAILS)
    source = "beam on Winkler support, moving load"
    return worst_point(name, source, expected, found, 3e-6, "m/N")


def winkler_residues(name: str) -> Case:
    """Track compliance between the axles of a car, 130 rad/s at 62.5 m/s."""
    positions = np.array([0.0, -2.9, -19.0, -21.9])
    response = beam_response(TOY_TRACK, integration_depth=0.5, period=200.0, cutoff=120.0)
    spectra = next(response.spectra(62.5, np.array([130.0])))
    found = track_compliance_matrix(spectra, positions)
    distance = positions[:, None] - positions
    expected = [[winkler_compliance(d, 62.5, 130.0, *_RAILS) for d in row] for row in distance]
    source = "residues of the Winkler beam, Eq. (13)"
    return worst_point(name, source, np.array(expected), found, 3e-6, "m/N")


def freight_frequencies(name: str) -> Case:
    """Bounce and pitch of the freight car's body on fixed wheels."""
    v = FREIGHT
    spring = v.secondary.stiffness
    bounce = math.sqrt(2.0 * spring / v.body_mass)
    pitch = math.sqrt(2.0 * spring * (v.bogie_spacing / 2.0) ** 2 / v.body_inertia)
    expected = np.array([bounce, pitch]) / (2.0 * math.pi)
    source = "one mass on two springs"
    return worst_ratio(name, source, expected, natural_frequencies(v), 1e-9, "Hz")


def passenger_wheelset(name: str) -> Case:
    """Compliance of a passenger wheelset far above all resonances: -1/(M Ω²)."""
    expected = -1.0 / (PASSENGER.wheelset_mass * 1e12)
    found = vehicle_compliance(PASSENGER, 1e6)[0, 0]
    return worst_ratio(name, "free mass", expected, found, 1e-4, "m/N")


def layered_bessel(name: str) -> Case:
    """Static mean displacement of a strip by quadrature over ky: Bessel K0."""
    ground = elastic_ground()
    expected = [
        static_strip_compliance(k, WIDTH, CLAY.shear_modulus, CLAY.poisson) for k in WAVENUMBERS
    ]
    found = [strip_compliance(ground, k, 0.0, WIDTH) for k in WAVENUMBERS.tolist()]
    source = "static point load, (1-ν)/(πG) K0(k|y|)"
    return worst_ratio(name, source, np.array(expected), np.array(found), 1e-7, "m/(N/m)")


def layered_interior(name: str) -> Case:
    """Static stresses below the strip by quadrature over ky: Bessel forms."""
    ground, nu = elastic_ground(), CLAY.poisson
    k = WAVENUMBERS.tolist()
    found = np.array([strip_response(ground, q, 0.0, WIDTH, DEPTHS).stress.T for q in k])
    expected = np.stack([strip_stress(WAVENUMBERS, d, WIDTH, nu) for d in DEPTHS.tolist()], axis=1)
    source = "2.5D Boussinesq strip, four components"
    return worst_point(name, source, expected, found, 1e-7, "Pa/(N/m)")


def layered_boussinesq(name: str) -> Case:
    """Stresses 1 m below a point load, by quadrature over kx and ky."""
    ground, nu, width = elastic_ground(), CLAY.poisson, 0.002

    def integrand(k: np.ndarray) -> np.ndarray:
        depth = np.ones(1)
        rows = [strip_response(ground, q, 0.0, width, depth).stress[:3, 0] for q in k.tolist()]
        return np.array(rows).T / math.pi

    found = integrate(integrand, np.array([0.0, 1e-3, 0.1, 1.0, 4.0, 12.0, 30.0]), 1e-4).real
    side = (1.0 - 2.0 * nu) / (4.0 * math.pi)
    expected = np.array([side, side, -1.5 / math.pi])
    source = "Boussinesq, σxx = σyy, σzz on the axis"
    return worst_point(name, source, expected, found, 1e-5, "Pa/N")


def layered_moving_load(name: str) -> Case:
    """Surface compliance at ω = kx V, up to 98 % of the Rayleigh speed, in all directions."""
    ground = elastic_ground()
    speed = 0.98 * rayleigh_speed(CLAY)
    angle, kappa = np.linspace(0.0, math.pi / 2.0, 19), 0.4
    factor = moving_load_factor(angle, speed, CLAY.pressure_wave_speed, CLAY.shear_wave_speed)
    found = [
        surface_compliance(ground, np.array([kappa]), kappa * speed * c)[0]
        for c in np.cos(angle).tolist()
    ]
    expected = factor / (CLAY.shear_modulus * kappa)
    source = "point load moving below the Rayleigh speed, F(θ)"
    return worst_ratio(name, source, expected, np.array(found), 1e-9, "m/Pa")


def layered_split(name: str) -> Case:
    """A half-space cut into layers of its own material responds as the half-space does."""
    cuts = tuple(replace(LEAN_CLAY, name=f"slice {h}", height=h) for h in (0.01, 0.4, 7.0))
    whole, cut = layered_ground((LEAN_CLAY,)), layered_ground((*cuts, LEAN_CLAY))
    kappa = np.geomspace(1e-5, 1e3, 33)
    omegas = (0.0, 1e-4, 30.0, -400.0)
    expected = np.array([surface_compliance(whole, kappa, w) for w in omegas])
    found = np.array([surface_compliance(cut, kappa, w) for w in omegas])
    return worst_ratio(name, "homogeneous half-space", expected, found, 1e-8, "m/Pa")


def extreme_waves(name: str) -> Case:
    """Very long static waves feel the lowest layer alone, very short ones the uppermost."""
    ground = layered_ground(VALIDATION_TRACK.ground)
    kappa = np.array([1e-6, 1e3])
    found = surface_compliance(ground, kappa, 0.0) * kappa
    layers: tuple[Layer, ...] = VALIDATION_TRACK.ground
    stiffness = [
        w.material.shear_modulus * (1.0 + 2j * w.material.damping) / (1.0 - w.material.poisson)
        for w in (layers[-1], layers[0])
    ]
    source = "(1-ν)/(Gκ) of the lowest and the uppermost layer"
    return worst_ratio(name, source, 1.0 / np.array(stiffness), found, 1e-5, "1/Pa")


CLOSED_CASES: dict[str, Callable[[str], Case]] = {
    "strip_plane_strain": plane_strain_strip,
    "strip_point_load": point_load_strip,
    "winkler_moving_load": winkler_moving_load,
    "winkler_residues": winkler_residues,
    "freight_frequencies": freight_frequencies,
    "passenger_wheelset": passenger_wheelset,
    "layered_bessel": layered_bessel,
    "layered_interior": layered_interior,
    "layered_boussinesq": layered_boussinesq,
    "layered_moving_load": layered_moving_load,
    "layered_split": layered_split,
    "layered_limits": extreme_waves,
}
