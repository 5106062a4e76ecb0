"""Strip load on layered ground in the (kx, ω) domain: exact, by quadrature over ky.

A vertical line load e^{i(ωt - kx x)} of 1 N per metre of track, spread evenly over |y| < b/2, is the
reference for the 2.5D finite-element section. Each ky is a plane wave of ``layered_ground``; the
integral over ky is adaptive.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcsettle.errors import check_positive
from mcsettle.verification.layered_ground import (
    LayeredGround,
    PlaneWaves,
    layer_of,
    plane_waves,
    surface_compliance,
)
from mcsettle.verification.quadrature import integrate

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

TOLERANCE = 1e-8  # of every integral over ky, relative to the integral of the modulus
_LOBES = 100  # of the load's spectrum integrated for the surface displacement; the rest is static
_DECAY = 40.0  # e^{-40}: where the integrand at depth is cut


@dataclass(frozen=True)
class StripResponse:
    """Response to a unit strip load on the plane y = 0, and below it; D depths.

    ``mean`` m/(N/m): downward displacement averaged over the strip (under a rigid-pressure load the
    work-conjugate displacement); ``displacement`` [2, D] m/(N/m): ux forward and downward;
    ``stress`` [4, D] Pa/(N/m): xx, yy, zz, xz, positive in tension, z up.
    """

    mean: complex
    displacement: ComplexArray
    stress: ComplexArray


def strip_response(
    ground: LayeredGround, wavenumber: float, omega: float, width: float, depths: Array
) -> StripResponse:
    """Displacement and stress at (kx, ω) under a strip load.

    Parameters
    ----------
    ground
        The layers.
    wavenumber
        kx [rad/m], any sign.
    omega
        ω [rad/s], any sign.
    width
        Width b of the strip [m].
    depths
        [D] m below the surface, positive, not falling.

    Raises
    ------
    ValueError
        If kx = ω = 0 (the plane static displacement has no limit), or a depth or the width is not
        positive.
    NumericalError
        If undamped ground carries a wave of wavenumber kx or more at ω.
    """
    depths = np.asarray(depths, dtype=float)
    mean = strip_compliance(ground, wavenumber, omega, width)
    if depths.size == 0:
        return StripResponse(mean, np.zeros((2, 0), complex), np.zeros((4, 0), complex))
    if not np.all(depths > 0.0):
        raise ValueError(f"depths must be positive, received {depths} m")
    layers = layer_of(ground, depths)

    def integrand(ky: Array) -> ComplexArray:
        kappa = np.hypot(wavenumber, ky)
        waves = plane_waves(ground, kappa, omega, depths)
        rows = _centreline(ground, layers, waves, wavenumber, ky, omega)
        return np.asarray(rows * _spectrum(ky, width) / math.pi)

    edges = _edges(ground, wavenumber, omega, width, _DECAY / float(depths[0]))
    rows = integrate(integrand, edges, TOLERANCE).reshape(6, depths.size)
    return StripResponse(mean, rows[:2], rows[2:])


def strip_compliance(
    ground: LayeredGround, wavenumber: float, omega: float, width: float
) -> complex:
    """Downward displacement averaged over the loaded strip [m/(N/m)]; see ``strip_response``.

    (1/π) ∫ ũ(κ, ω) sinc²(ky b/2) dky; the tail beyond a hundred lobes is that of the static
    compliance (1 - ν)/(G ky) of the uppermost layer.
    """
    check_positive("the strip's width", width, "m")
    if wavenumber == 0.0 and omega == 0.0:
        raise ValueError("the static displacement of the ground has no limit as kx → 0")

    def integrand(ky: Array) -> ComplexArray:
        compliance = surface_compliance(ground, np.hypot(wavenumber, ky), omega)
        return np.asarray((compliance * _spectrum(ky, width) ** 2 / math.pi)[None])

    lobes = 2.5 * width * _largest(ground, wavenumber, omega) / math.pi
    phase = (math.ceil(max(_LOBES, lobes)) + 0.5) * math.pi  # cos(ky b) = -1, sin(ky b) = 0
    edges = _edges(ground, wavenumber, omega, width, 2.0 * phase / width)
    modulus = ground.shear_modulus[0]
    modulus = modulus.conjugate() if omega < 0.0 else modulus
    tail = (1.0 - ground.poisson[0]) / (math.pi * modulus) / (4.0 * phase**2)
    tail *= 1.0 - (wavenumber * width / phase) ** 2 / 16.0  # 1/κ for 1/ky
    return complex(integrate(integrand, edges, TOLERANCE)[0] + tail)


def _centreline(
    ground: LayeredGround,
    layers: NDArray[np.intp],
    waves: PlaneWaves,
    kx: float,
    ky: Array,
    omega: float,
) -> ComplexArray:
    """ux, u down, σxx, σyy, σzz, τxz at y = 0 of the plane waves ±ky, [6 D, P]."""
    kappa = np.hypot(kx, ky)
    along, across = (kx / kappa) ** 2, (ky / kappa) ** 2
    mu = ground.shear_modulus[layers, None]
    mu = mu.conj() if omega < 0.0 else mu
    nu = ground.poisson[layers, None]
    strain = kappa * waves.horizontal  # ε along the wave vector
    lateral = nu / (1.0 - nu) * (waves.normal + 2.0 * mu * strain)  # σ at right angles to it
    radial = lateral + 2.0 * mu * strain
    rows = [
        1j * kx / kappa * waves.horizontal,
        -waves.vertical,
        along * radial + across * lateral,
        across * radial + along * lateral,
        waves.normal,
        1j * kx / kappa * waves.shear,
    ]
    return np.concatenate(rows)


def _spectrum(ky: Array, width: float) -> Array:
    """Transform of the unit pressure 1/b over |y| < b/2."""
    return np.asarray(np.sinc(ky * width / (2.0 * math.pi)))


def _largest(ground: LayeredGround, wavenumber: float, omega: float) -> float:
    """The largest wavenumber at which the integrand has structure [rad/m]."""
    slow = float(np.max(np.sqrt(ground.density / ground.shear_modulus.real)))
    thin = 1.0 / float(np.min(ground.height))
    return max(abs(wavenumber), abs(omega) * slow, thin)


def _edges(
    ground: LayeredGround, wavenumber: float, omega: float, width: float, end: float
) -> Array:
    """Panel edges over ky in [0, end]: wave speeds, decades around |kx|, lobes of the load."""
    slowness = np.sqrt(ground.density / ground.shear_modulus.real)
    ratio = np.sqrt((1.0 - 2.0 * ground.poisson) / (2.0 - 2.0 * ground.poisson))
    waves = abs(omega) * np.concatenate([slowness, slowness * ratio, 1.07 * slowness])
    rough = np.sqrt(np.maximum(waves**2 - wavenumber**2, 0.0))
    small = max(abs(wavenumber), float(waves.min()))
    doubling = small * 2.0 ** np.arange(-2.0, max(1.0, math.log2(end / small)))
    count = min(40, math.ceil(end * width / (4.0 * math.pi)))
    points = np.concatenate([rough, doubling, np.linspace(0.0, end, count + 1)])
    return np.unique(np.clip(points, 0.0, end))
