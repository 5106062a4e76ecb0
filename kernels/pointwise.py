"""Settlement at every x and depth under one axle (twin of mcsettle.passage): the reference kernel.

Any settlement law and exponent; nothing is expanded. The deviator has three components per depth
(mcsettle.stress.DEVIATOR), synthesised on the grid from the profile's modes. Layout as in the spectral
kernels, with fewer lanes because each carries a whole window.

Depends on: laws, taichi.
"""

import functools
from dataclasses import dataclass

import numpy as np
import taichi as ti

from mcsettle.kernels.laws import strain_power

LANES = 8
N_TILES = 64
CAPACITY = LANES * N_TILES


@dataclass(frozen=True)
class Workspace:
    """Fields for CAPACITY realisations of one band and grid."""

    v_re: ti.Field
    v_im: ti.Field
    q2: ti.Field
    settlement: ti.Field


@functools.cache
def workspace(n_modes: int, n_points: int) -> Workspace:
    """Allocate (once per shape) the scratch of the pointwise kernel."""
    v = [ti.field(ti.f64, shape=(N_TILES, n_modes, LANES)) for _ in range(2)]
    x = [ti.field(ti.f64, shape=(N_TILES, n_points, LANES)) for _ in range(2)]
    return Workspace(*v, *x)


@ti.kernel
def settle(
    u: ti.types.ndarray(dtype=ti.f64, ndim=3),  # [R, K, 2] amplitudes, m
    w: ti.types.ndarray(dtype=ti.f64, ndim=2),  # [R, G] growth of the cycle functions
    response: ti.types.ndarray(dtype=ti.f64, ndim=4),  # [Z, 3, K, 2] deviator, Pa/m
    mean: ti.types.ndarray(dtype=ti.f64, ndim=2),  # [Z, 3] deviator of the mean state, Pa
    coefficient: ti.types.ndarray(dtype=ti.f64, ndim=1),  # [Z] strain scale × thickness
    exponent: ti.types.ndarray(dtype=ti.f64, ndim=1),  # [Z]
    group: ti.types.ndarray(dtype=ti.i32, ndim=1),  # [Z]
    waves: ti.types.ndarray(dtype=ti.f64, ndim=3),  # [X, K, 2] cos kx, sin kx
    n_tiles: ti.i32,
    n_real: ti.i32,
    v_re: ti.template(),
    v_im: ti.template(),
    q2: ti.template(),
    settlement: ti.template(),
    growth: ti.types.ndarray(dtype=ti.f64, ndim=3),  # [R, K, 2] added to
    uniform: ti.types.ndarray(dtype=ti.f64, ndim=1),  # [R] added to
):
    """Add the growth of the amplitudes and the uniform settlement of one axle passage."""
    n_points = waves.shape[0]
    n_modes = waves.shape[1]
    n_depths = mean.shape[0]
    for t in range(n_tiles):
        first = t * LANES
        for x in range(n_points):
            for lane in range(LANES):
                settlement[t, x, lane] = 0.0
        for z in range(n_depths):
            for x in range(n_points):
                for lane in range(LANES):
                    q2[t, x, lane] = 0.0
            for d in range(3):
                for k in range(n_modes):
                    a = response[z, d, k, 0]
                    b = response[z, d, k, 1]
                    for lane in range(LANES):
                        r = ti.min(first + lane, n_real - 1)
                        v_re[t, k, lane] = a * u[r, k, 0] - b * u[r, k, 1]
                        v_im[t, k, lane] = a * u[r, k, 1] + b * u[r, k, 0]
                p0 = mean[z, d]
                for x in range(n_points):
                    s = ti.Vector.zero(ti.f64, LANES)
                    for k in range(n_modes):
                        c = waves[x, k, 0]
                        n = waves[x, k, 1]
                        for lane in ti.static(range(LANES)):
                            s[lane] = s[lane] + (c * v_re[t, k, lane] - n * v_im[t, k, lane])
                    for lane in ti.static(range(LANES)):
                        q2[t, x, lane] = q2[t, x, lane] + (p0 + s[lane]) * (p0 + s[lane])
            g = group[z]
            for x in range(n_points):
                for lane in range(LANES):
                    weight = coefficient[z] * w[ti.min(first + lane, n_real - 1), g]
                    value = strain_power(q2[t, x, lane], exponent[z])
                    settlement[t, x, lane] = settlement[t, x, lane] + weight * value
        for lane in range(LANES):
            r = first + lane
            if r < n_real:
                total = 0.0
                for x in range(n_points):
                    total = total + settlement[t, x, lane]
                uniform[r] = uniform[r] + total / n_points
                for k in range(n_modes):
                    a = 0.0
                    b = 0.0
                    for x in range(n_points):
                        a = a + settlement[t, x, lane] * waves[x, k, 0]
                        b = b - settlement[t, x, lane] * waves[x, k, 1]
                    growth[r, k, 0] = growth[r, k, 0] + 2.0 * a / n_points
                    growth[r, k, 1] = growth[r, k, 1] + 2.0 * b / n_points


def add_passage(
    u: np.ndarray,  # [R, K, 2]
    weights: np.ndarray,  # [R, G]
    response: np.ndarray,  # [Z, 3, K, 2]
    mean: np.ndarray,  # [Z, 3]
    coefficient: np.ndarray,  # [Z]
    exponent: np.ndarray,  # [Z]
    group: np.ndarray,  # [Z]
    waves: np.ndarray,  # [X, K, 2]
    growth: np.ndarray,  # [R, K, 2], added to
    uniform: np.ndarray,  # [R], added to
) -> None:
    """Run ``settle`` on any number of realisations, CAPACITY at a time."""
    f = workspace(u.shape[1], len(waves))
    for first in range(0, len(u), CAPACITY):
        part = slice(first, min(first + CAPACITY, len(u)))
        n_real = part.stop - part.start
        settle(
            u[part], weights[part], response, mean, coefficient, exponent, group, waves,
            -(-n_real // LANES), n_real, f.v_re, f.v_im, f.q2, f.settlement,
            growth[part], uniform[part],
        )  # fmt: skip
