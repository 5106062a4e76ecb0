"""Static stresses under a strip load on a homogeneous elastic half-space, in the wavenumber domain.

A unit line load (1 N per metre of track) that varies as e^{-ikx} along x is spread evenly over a
width b across the track. In the (kx, ky) domain a normal surface load q, positive down, gives at
depth ζ with κ² = kx² + ky²

    σzz = -q (1 + κζ) e^{-κζ},                    τxz = i kx ζ q e^{-κζ},
    σxx = -q [kx²/κ² (1 - κζ) + 2ν ky²/κ²] e^{-κζ},   σyy the same with x and y exchanged

(axes x forward, z up, tension positive). The transform back over ky is done in closed form: it
leaves modified Bessel functions of the distance to each load across the width, and the integral
over the width becomes smooth with y = ζ sinh t, however small ζ is.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.special import k0, k1

Array = NDArray[np.float64]

_POINTS = 40  # Gauss points of each integral over the width; 1e-13 of the surface pressure
_VANISHING = 45.0  # e^{-45} = 3e-20: where the Bessel functions no longer count
_SMALLEST = 1e-8  # rad/m: stands for k = 0, whose limit is finite but 0/0 in floating point
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(_POINTS)


def strip_stress(
    wavenumbers: Array, depth: float, width: float, poisson: float
) -> NDArray[np.complex128]:
    """Stress below the middle of a strip load, at one depth.

    Parameters
    ----------
    wavenumbers
        k along the track [rad/m], shape [Q], any sign.
    depth
        ζ below the loaded surface [m], positive.
    width
        Width b of the strip across the track [m].
    poisson
        Poisson's ratio of the half-space.

    Returns
    -------
    Shape [Q, 4]: σxx, σyy, σzz, τxz [Pa per N/m], positive in tension, τxz for z up.

    Raises
    ------
    ValueError
        If the depth or the width is not positive.

    Notes
    -----
    Boussinesq's half-space in 2.5D; with r² = y² + ζ² the point-load form of σzz is
    -ζ³ k² K2(kr) / (π r²).
    """
    if not (depth > 0.0 and width > 0.0):
        raise ValueError(f"depth and width must be positive, received {depth} m and {width} m")
    k = np.maximum(np.abs(np.asarray(wavenumbers, dtype=float)), _SMALLEST)
    half = width / 2.0
    e0, e1, cubic = _across_width(k, depth, half)
    # k² × transform of e^{-κζ}/κ²: K0 integrated from ζ downwards, in polar coordinates
    potential = k / (np.pi * half) * (depth * e1 - half * _beyond_edge(k, depth, half))
    slope = k**2 * depth**2 * e0 / (np.pi * half)  # k² ζ × transform of e^{-κζ}/κ
    plain = k * depth * e1 / (np.pi * half)  # transform of e^{-κζ}
    vertical = k**2 * depth**2 * cubic / (np.pi * half)  # transform of (1 + κζ) e^{-κζ}
    volume = (1.0 - 2.0 * poisson) * potential - slope
    stress = np.empty((k.size, 4), dtype=complex)
    stress[:, 0] = -(volume + 2.0 * poisson * plain)
    stress[:, 1] = -(2.0 * plain - vertical - volume)
    stress[:, 2] = -vertical
    stress[:, 3] = 1j * np.asarray(wavenumbers) * depth * plain
    return stress


def _across_width(k: Array, depth: float, half: float) -> tuple[Array, Array, Array]:
    """∫ K0(kr) cosh t dt, ∫ K1(kr) dt and ∫ K2(kr)/cosh t dt over half the width; r = ζ cosh t."""
    end = np.minimum(np.arcsinh(half / depth), _reach(k * depth))
    t = 0.5 * end[:, None] * (_NODES + 1.0)
    weights = 0.5 * end[:, None] * _WEIGHTS
    cosh = np.cosh(t)
    argument = k[:, None] * depth * cosh
    bessel0, bessel1 = k0(argument), k1(argument)
    bessel2 = bessel0 + 2.0 * bessel1 / argument
    return (
        np.sum(weights * bessel0 * cosh, axis=1),
        np.sum(weights * bessel1, axis=1),
        np.sum(weights * bessel2 / cosh, axis=1),
    )


def _beyond_edge(k: Array, depth: float, half: float) -> Array:
    """∫ K1(kr) du below the edge of the strip, from depth ζ downwards; r = b/2 cosh u."""
    start = np.arcsinh(depth / half)
    end = np.maximum(start, np.minimum(_reach(k * half), start + _VANISHING))
    total = np.zeros_like(k)
    edges = start + (end - start)[:, None] * np.linspace(0.0, 1.0, 4)
    for lower, upper in zip(edges.T, edges.T[1:], strict=False):
        u = 0.5 * (lower + upper)[:, None] + 0.5 * (upper - lower)[:, None] * _NODES
        values = k1(k[:, None] * half * np.cosh(u))
        total += np.sum(0.5 * (upper - lower)[:, None] * _WEIGHTS * values, axis=1)
    return total


def _reach(scale: Array) -> Array:
    """Upper limit t at which scale × cosh t makes the Bessel functions vanish."""
    return np.arccosh(np.maximum(_VANISHING / scale, 1.0 + 1e-12))
