"""Closed forms that the models are verified against; none of them is used to compute results.

u and loads positive down, stresses positive in tension, distance s positive ahead of the load.
"""

import math

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import quad
from scipy.special import k0, kn

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]


def moving_load_factor(angle: Array, speed: float, c_p: float, c_s: float) -> Array:
    """F(θ) of a load moving below the Rayleigh speed on an undamped half-space.

    A pressure of wave vector κ(cos θ, sin θ) that moves at ``speed`` along x displaces the surface by
    F/(Gκ); a point load displaces it by P F(φ + π/2)/(2πG r) at (r, φ). F = 1 - ν at rest:
    b²√(1-a²) / (4√(1-a²)√(1-b²) - (2-b²)²) with a, b = V cos θ/c_P, V cos θ/c_S.
    """
    b2 = (speed * np.cos(angle) / c_s) ** 2
    ratio = (c_s / c_p) ** 2
    root_a, root_b = np.sqrt(1.0 - ratio * b2), np.sqrt(1.0 - b2)
    # 4 root_a root_b - (2 - b²)² over b², without cancellation as b → 0
    mixed = ((ratio * b2) - 1.0 - ratio) / (root_a * root_b + 1.0)
    return np.asarray(root_a / (4.0 * mixed + 4.0 - b2))


def static_strip_compliance(
    wavenumber: float, width: float, shear_modulus: float, poisson: float
) -> float:
    """Mean displacement [m/(N/m)] of a strip under its own even load, static half-space.

    The point-load form (1 - ν)/(πG) K0(|k||y|) averaged over all pairs of points of the strip.
    """
    k, b = abs(wavenumber), width
    edges = [0.0, 1e-3 * b, min(b, 40.0 / k)]
    parts = [
        quad(lambda y: (1.0 - y / b) * k0(k * y), lower, upper, epsabs=0.0, epsrel=1e-11)[0]
        for lower, upper in zip(edges, edges[1:], strict=False)
    ]
    return (1.0 - poisson) / (math.pi * shear_modulus) * 2.0 / b * sum(parts)


def static_strip_pressure(wavenumber: float, depth: float, width: float) -> float:
    """σzz [Pa/(N/m)] below the middle of a strip: -z³k² K2(kr)/(πr²) averaged over its width."""

    def point(y: float) -> float:
        r = math.hypot(y, depth)
        return float(-(depth**3) * wavenumber**2 * kn(2, abs(wavenumber) * r) / (math.pi * r**2))

    near = min(width / 2.0, 10.0 * depth)
    first = quad(point, 0.0, near, epsrel=1e-11, epsabs=0.0)[0]
    return 2.0 / width * (first + quad(point, near, width / 2.0, epsrel=1e-11, epsabs=1e-14)[0])


def winkler_deflection(
    distance: Array, speed: float, bending_stiffness: float, mass: float, support: float
) -> Array:
    """Deflection [m/N] of a beam on a Winkler support under a load moving below V_cr.

    Pλ/(2s) e^{-λ√(1-α²)|ξ|} [cos(λ√(1+α²)ξ)/√(1-α²) + sin(λ√(1+α²)|ξ|)/√(1+α²)] with
    λ = (s/4EI)^¼ and α² = V²/V_cr², V_cr = (4 s EI/m²)^¼.
    """
    decay = (support / (4.0 * bending_stiffness)) ** 0.25
    ratio2 = speed**2 * mass / math.sqrt(4.0 * support * bending_stiffness)
    slow, fast = math.sqrt(1.0 - ratio2), math.sqrt(1.0 + ratio2)
    s = decay * np.abs(distance)
    shape = np.cos(fast * s) / slow + np.sin(fast * s) / fast
    return np.asarray(decay / (2.0 * support) * np.exp(-slow * s) * shape)


def winkler_compliance(
    distance: float,
    speed: float,
    omega: float,
    bending_stiffness: float,
    mass: float,
    support: float,
    viscous: float = 0.0,
) -> complex:
    """Displacement [m/N] at ``distance`` from a load e^{iΩt} moving along a Winkler beam: residues.

    k are the roots of EIk⁴ - m(Ω+kV)² + s + i(Ω+kV)c = 0. Behind the load the contour closes above
    the real axis, ahead of it below; the damping ``viscous`` [N·s/m²] may be zero while no root is real.
    """
    roots = np.roots(
        [
            bending_stiffness,
            0.0,
            -mass * speed**2,
            -2.0 * mass * omega * speed + 1j * speed * viscous,
            support - mass * omega**2 + 1j * omega * viscous,
        ]
    )
    behind = distance <= 0.0
    roots = roots[roots.imag > 0.0] if behind else roots[roots.imag < 0.0]
    slope = 4.0 * bending_stiffness * roots**3 - 2.0 * mass * speed * (omega + roots * speed)
    slope = slope + 1j * speed * viscous
    residues = np.sum(np.exp(-1j * roots * distance) / slope)
    return complex((1j if behind else -1j) * residues)
