"""Exact solution of horizontally layered ground in the (κ, ω) domain: layer stiffness matrices.

A vertical load e^{i(ωt - kx x - ky y)} on the surface moves each layer in the vertical plane of the
wave vector alone (P and SV waves of wavenumber κ = √(kx² + ky²)). With z up and the horizontal
displacement and the shear traction along the wave vector written iR and iT, all coefficients are
real except for damping and radiation. A layer has four waves; displacements and forces at its two faces
give its symmetric 4 × 4 stiffness matrix (Thomson, Haskell, Kausel and Roësset). From the half-space
upwards the layers are condensed into the 2 × 2 stiffness of everything below a level; a load at the
surface is then carried down level by level. No term grows, however large κh.

Three devices keep every limit regular:

* the second wave of each pair is (P - SV)/(kS² - kP²), written without cancellation, so that ω → 0
  gives the static solution, ω = 0 included;
* exponentials decay from the face they start at;
* layers thin against the wavelength take their matrix from the series of the transfer matrix.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcsettle.railway.track import Layer

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

_THIN = 0.5  # thickness times the larger of κ and |kS| below which the series is used
_TERMS = 26  # of that series: 2.5^26/26! = 6e-17
_SNAP = 1e-9  # m, from an interface: a slice may not be as thin as rounding errors
_MIRROR = np.array([1.0, -1.0])  # z → -z keeps R, turns Z


@dataclass(frozen=True)
class LayeredGround:
    """Layers from the surface down, the last a half-space; L in number.

    ``height`` [L] m, the last infinite; ``shear_modulus`` [L] Pa, complex, for ω > 0; ``poisson``
    [L]; ``density`` [L] kg/m³. Make it with ``layered_ground``.
    """

    height: Array
    shear_modulus: ComplexArray
    poisson: Array
    density: Array

    @property
    def interfaces(self) -> Array:
        """Depths [L - 1] m of the interfaces below the surface."""
        return np.asarray(np.cumsum(self.height[:-1]))


@dataclass(frozen=True)
class PlaneWaves:
    """Motion at some depths under a unit pressure (down) of wavenumber κ; D depths, N values of κ.

    ``horizontal`` R and ``vertical`` Z [D, N] m/Pa with displacements (iR along the wave vector, Z
    up); ``shear`` T and ``normal`` [D, N] (tractions iT and σzz, Pa per Pa).
    """

    horizontal: ComplexArray
    vertical: ComplexArray
    shear: ComplexArray
    normal: ComplexArray


def layered_ground(layers: tuple[Layer, ...]) -> LayeredGround:
    """Ground of a track description with its hysteretic damping, modulus × (1 + 2iξ sgn ω).

    Parameters
    ----------
    layers
        Ground layers from the surface down (``SectionTrack.ground``); the last is a half-space.

    Raises
    ------
    ValueError
        If a layer has a width, or the last one is not a half-space.
    """
    if not layers or not math.isinf(layers[-1].height):
        raise ValueError("the lowest layer of a layered ground must be a half-space")
    wide = [layer.name for layer in layers if layer.width is not None]
    if wide:
        raise ValueError(f"layers of a layered ground have no width, unlike {', '.join(wide)}")
    return LayeredGround(
        np.array([layer.height for layer in layers]),
        np.array([w.material.shear_modulus * (1.0 + 2j * w.material.damping) for w in layers]),
        np.array([layer.material.poisson for layer in layers]),
        np.array([layer.material.density for layer in layers]),
    )


def plane_waves(ground: LayeredGround, kappa: Array, omega: float, depths: Array) -> PlaneWaves:
    """Motion and tractions at ``depths`` under a unit downward surface pressure.

    Parameters
    ----------
    ground
        The layers.
    kappa
        Horizontal wavenumber κ [rad/m], shape [N], positive.
    omega
        ω [rad/s], any sign; zero is the static case.
    depths
        [D] m below the surface, not falling; 0 is the surface.

    Raises
    ------
    ValueError
        If a κ is not positive or the depths fall or are negative.
    """
    kappa, depths = np.asarray(kappa, dtype=float), np.asarray(depths, dtype=float)
    if not np.all(kappa > 0.0):
        raise ValueError("wavenumbers κ must be positive")
    if np.any(depths < 0.0) or np.any(np.diff(depths) < 0.0):
        raise ValueError(f"depths must be zero or more and must not fall, received {depths} m")
    depths = _snapped(ground, depths)
    levels, index, thickness = _slices(ground, depths)
    below, carry = _condense(ground, index, thickness, kappa, abs(omega))
    state = np.empty((levels.size, 4, kappa.size), dtype=complex)
    u = -_inverse(below[0])[:, :, 1]  # tractions (0, -1)
    for level in range(levels.size):
        if level > 0:
            u = np.einsum("nij,nj->ni", carry[level - 1], u)
        state[level, :2] = u.T
        state[level, 2:] = np.einsum("nij,nj->in", below[level], u)
    waves = state[np.searchsorted(levels, depths)]
    waves = waves.conj() if omega < 0.0 else waves
    return PlaneWaves(*(waves[:, i] for i in range(4)))


def surface_compliance(ground: LayeredGround, kappa: Array, omega: float) -> ComplexArray:
    """Downward displacement of the surface under a unit pressure [N] m/Pa; see ``plane_waves``."""
    return -plane_waves(ground, kappa, omega, np.zeros(1)).vertical[0]


def layer_of(ground: LayeredGround, depths: Array) -> NDArray[np.intp]:
    """Layer that contains each depth [D]; an interface belongs to the layer below it."""
    return np.searchsorted(ground.interfaces, _snapped(ground, depths), side="right")


def _slices(ground: LayeredGround, depths: Array) -> tuple[Array, NDArray[np.intp], Array]:
    """Levels (interfaces and depths), and the layer and thickness of each slice between them."""
    levels = np.unique(np.concatenate([[0.0], ground.interfaces, depths]))
    return levels, layer_of(ground, levels), np.diff(levels)


def _snapped(ground: LayeredGround, depths: Array) -> Array:
    """Depths, with those within rounding of an interface (or the surface) set to it."""
    for interface in (0.0, *ground.interfaces):
        depths = np.where(np.abs(depths - interface) < _SNAP, interface, depths)
    return depths


def _condense(
    ground: LayeredGround, index: NDArray[np.intp], thickness: Array, kappa: Array, omega: float
) -> tuple[list[ComplexArray], list[ComplexArray]]:
    """Stiffness [N, 2, 2] of all below each level, and the matrices that carry u down a slice."""
    displacement, force, _ = _waves(ground, int(index[-1]), kappa, omega)
    below, carry = [force @ _inverse(displacement)], []
    for i, h in zip(index[-2::-1], thickness[::-1], strict=True):
        k = _slice_stiffness(ground, int(i), float(h), kappa, omega)
        gain = -_inverse(k[:, 2:, 2:] + below[-1]) @ k[:, 2:, :2]
        below.append(k[:, :2, :2] + k[:, :2, 2:] @ gain)
        carry.append(gain)
    return below[::-1], carry[::-1]


def _slice_stiffness(
    ground: LayeredGround, i: int, h: float, kappa: Array, omega: float
) -> ComplexArray:
    """Stiffness [N, 4, 4] of a slice: forces on its upper and lower face per displacement there."""
    shear_wave = omega * np.sqrt(ground.density[i] / abs(ground.shear_modulus[i]))
    thin = h * np.maximum(kappa, shear_wave) < _THIN
    stiffness = np.empty((kappa.size, 4, 4), dtype=complex)
    stiffness[thin] = _thin_stiffness(ground, i, h, kappa[thin], omega)
    stiffness[~thin] = _thick_stiffness(ground, i, h, kappa[~thin], omega)
    return stiffness


def _waves(
    ground: LayeredGround, i: int, kappa: Array, omega: float
) -> tuple[ComplexArray, ComplexArray, tuple[ComplexArray, ComplexArray]]:
    """Downgoing waves P and (P - SV)/(kS² - kP²) of a layer, at the level they start from.

    Returns
    -------
    Displacements (R, Z) and tractions (T, σzz), [N, 2, 2] with a column for each wave, and the
    vertical wavenumbers α, β [N].
    """
    mu, ratio = ground.shear_modulus[i], _speed_ratio(ground, i)
    s2 = omega**2 * ground.density[i] / mu
    alpha = np.sqrt(kappa**2 - ratio * s2 + 0j)
    beta = np.sqrt(kappa**2 - s2 + 0j)
    displacement, force = (np.empty((kappa.size, 2, 2), dtype=complex) for _ in range(2))
    displacement[:, 0, 0] = -kappa
    displacement[:, 1, 0] = alpha
    displacement[:, 0, 1] = -1.0 / ((1.0 - ratio) * (kappa + beta))
    displacement[:, 1, 1] = -ratio / ((1.0 - ratio) * (kappa + alpha))
    force[:, 0, 0] = -2.0 * mu * kappa * alpha
    force[:, 1, 0] = mu * (2.0 * kappa**2 - s2)
    force[:, 0, 1] = mu * (2.0 * ratio * kappa / (kappa + alpha) - 1.0) / (1.0 - ratio)
    force[:, 1, 1] = mu * (2.0 * kappa / (kappa + beta) - 1.0) / (1.0 - ratio)
    return displacement, force, (alpha, beta)


def _thick_stiffness(
    ground: LayeredGround, i: int, h: float, kappa: Array, omega: float
) -> ComplexArray:
    """Slice stiffness from its four waves, each decaying from the face it starts at."""
    down, force, (alpha, beta) = _waves(ground, i, kappa, omega)
    difference = (1.0 - _speed_ratio(ground, i)) * omega**2 * ground.density[i]
    x = -h * difference / ground.shear_modulus[i] / (alpha + beta)  # -(α - β) h
    safe = np.where(x == 0.0, 1.0, x)
    share = np.where(x == 0.0, 1.0, np.expm1(safe) / safe)
    decay = np.zeros_like(down)
    decay[:, 0, 0], decay[:, 1, 1] = np.exp(-alpha * h), np.exp(-beta * h)
    decay[:, 0, 1] = -h * decay[:, 1, 1] * share / (alpha + beta)
    up, force_up = _MIRROR[:, None] * down, -_MIRROR[:, None] * force
    u = np.concatenate([np.dstack([down, up @ decay]), np.dstack([down @ decay, up])], axis=1)
    f = np.concatenate(
        [np.dstack([force, force_up @ decay]), np.dstack([-force @ decay, -force_up])], axis=1
    )
    return np.swapaxes(np.linalg.solve(np.swapaxes(u, 1, 2), np.swapaxes(f, 1, 2)), 1, 2)


def _thin_stiffness(
    ground: LayeredGround, i: int, h: float, kappa: Array, omega: float
) -> ComplexArray:
    """Slice stiffness from the series of its transfer matrix, for h small against the wavelength."""
    mu, ratio, rho = ground.shear_modulus[i], _speed_ratio(ground, i), ground.density[i]
    lam, q = 1.0 - 2.0 * ratio, kappa * h  # λ/(λ + 2μ)
    inertia = rho * (omega * h) ** 2 / mu
    a = np.zeros((kappa.size, 4, 4), dtype=complex)  # d(R, Z, hT/μ, hσzz/μ)/d(z/h)
    a[:, 0, 1], a[:, 0, 2] = q, 1.0
    a[:, 1, 0], a[:, 1, 3] = -lam * q, ratio
    a[:, 2, 0], a[:, 2, 3] = 4.0 * (1.0 - ratio) * q**2 - inertia, lam * q
    a[:, 3, 1], a[:, 3, 2] = -inertia, -q
    transfer = np.broadcast_to(np.eye(4, dtype=complex), a.shape)
    for n in range(_TERMS, 0, -1):  # from the upper to the lower face: e^{-a}
        transfer = np.eye(4) - a @ transfer / n
    t11, t12 = transfer[:, :2, :2], transfer[:, :2, 2:]
    t21, t22 = transfer[:, 2:, :2], transfer[:, 2:, 2:]
    back = _inverse(t12)
    top = np.concatenate([-back @ t11, back], axis=2)
    bottom = -t22 @ top
    bottom[:, :, :2] -= t21
    return mu / h * np.concatenate([top, bottom], axis=1)


def _speed_ratio(ground: LayeredGround, i: int) -> float:
    """(cS/cP)² = (1 - 2ν)/(2 - 2ν)."""
    nu = float(ground.poisson[i])
    return (1.0 - 2.0 * nu) / (2.0 - 2.0 * nu)


def _inverse(m: ComplexArray) -> ComplexArray:
    """Inverse of 2 × 2 matrices [N, 2, 2]."""
    determinant = m[:, 0, 0] * m[:, 1, 1] - m[:, 0, 1] * m[:, 1, 0]
    adjugate = np.empty_like(m)
    adjugate[:, 0, 0], adjugate[:, 1, 1] = m[:, 1, 1], m[:, 0, 0]
    adjugate[:, 0, 1], adjugate[:, 1, 0] = -m[:, 0, 1], -m[:, 1, 0]
    return adjugate / determinant[:, None, None]
