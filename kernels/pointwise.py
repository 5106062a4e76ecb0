"""Settlement at every x and depth under axle passages (twin of mcsettle.passage): the reference kernel.

Any settlement law and exponent; nothing is expanded. Stress fields are synthesised on the grid from the
profile's modes, two real fields in one complex transform, and what a passage settles is transformed
back (mcsettle.kernels.fourier). State, lanes and tiles as in the spectral kernels. The arrays over x
belong to workers, each of which takes every WORKERS-th tile, so that they stay in its cache: 10 kB a
point, 2.6 MB each on a window of 200 m and 32 MB on one of 2 km.

Depends on: fourier, passes, spectral, taichi.
"""

import functools
from dataclasses import dataclass

import numpy as np
import taichi as ti

from mcsettle.kernels.fourier import forwards, pass_back
from mcsettle.kernels.passes import (
    add_linear,
    add_power,
    add_squares,
    begin_power,
    clear,
    collect,
    first_pass,
)
from mcsettle.kernels.spectral import CAPACITY, LANES, N_TILES, update

WORKERS = 16
SQUARES, BEGIN = 0, 1  # what becomes of a transform's fields; else they finish what another began


@dataclass(frozen=True)
class Workspace:
    """Fields of one band and grid, allocated once and reused for every batch (as spectral's)."""

    u: ti.Field
    du: ti.Field
    own: ti.Field
    active: ti.Field
    power: ti.Field
    uniform: ti.Field
    passages: ti.Field
    weight: ti.Field
    z: ti.Field
    q2: ti.Field
    settled: ti.Field
    owner: list[object]


def workspace(n_modes: int, n_points: int, n_groups: int) -> Workspace:
    """Room for such a band and grid, rounded up: another shape compiles the kernels again."""
    rows = max(256, 1 << (n_points - 1).bit_length())
    return _allocated(-(-n_modes // 64) * 64, rows, max(4, n_groups))


@functools.cache
def _allocated(n_modes: int, n_points: int, n_groups: int) -> Workspace:
    state = [ti.field(ti.f64, shape=(N_TILES, n_modes, 2, LANES)) for _ in range(2)]
    own = ti.field(ti.f64, shape=(N_TILES, n_groups, LANES))
    lanes = [ti.field(ti.f64, shape=(N_TILES, LANES)) for _ in range(3)]
    passages = ti.field(ti.i64, shape=(N_TILES, LANES))
    weight = ti.field(ti.f64, shape=(WORKERS, n_groups, LANES))
    z = ti.field(ti.f64, shape=(WORKERS, n_points, 2, LANES))
    q2 = ti.field(ti.f64, shape=(WORKERS, 2, n_points, LANES))
    settled = ti.field(ti.f64, shape=(WORKERS, n_points, LANES))
    return Workspace(*state, own, *lanes, passages, weight, z, q2, settled, [])


@ti.kernel
def burst(
    axle: ti.types.ndarray(dtype=ti.i32, ndim=1),  # [N] axle of each passage, in order
    growth: ti.types.ndarray(dtype=ti.f64, ndim=2),  # [N, G] growth of the cycle functions
    start: ti.types.ndarray(dtype=ti.i32, ndim=1),  # [J + 1] first transform of each axle
    kind: ti.types.ndarray(dtype=ti.i32, ndim=2),  # [T, 3] kind, groups of the two fields
    law: ti.types.ndarray(dtype=ti.f64, ndim=2),  # [T, 5] mean deviators, coefficients, exponent
    response: ti.types.ndarray(dtype=ti.f64, ndim=3),  # [T, K, 4] factors of U_k and U*_k
    linear: ti.types.ndarray(dtype=ti.f64, ndim=4),  # [J, G, K, 2]
    constant: ti.types.ndarray(dtype=ti.f64, ndim=2),  # [J, G]
    wave: ti.types.ndarray(dtype=ti.f64, ndim=2),  # [X, 2] cos, sin of 2π x / X
    radix: ti.types.ndarray(dtype=ti.i32, ndim=1),  # radices between the first and the last
    band: ti.types.ndarray(dtype=ti.i32, ndim=1),  # first mode; butterflies of two modes: from, to
    frozen: ti.i32,  # 1: profiles stay as they are, their growth adds up in ``d``
    power_limit: ti.f64,  # 2 sd_limit²
    n_tiles: ti.i32,
    n_groups: ti.i32,
    u: ti.template(),
    d: ti.template(),
    own: ti.template(),  # growth of the cycle functions of each realisation, a factor
    active: ti.template(),
    power: ti.template(),
    uniform: ti.template(),
    passages: ti.template(),
    weight: ti.template(),
    z: ti.template(),
    q2: ti.template(),
    settled: ti.template(),
):
    """Advance every active realisation by the given passages, or collect its growth under them."""
    for worker in range(WORKERS):
        p = worker & (WORKERS - 1)
        z[p, 0, 0, 0] = u[0, 0, 0, 0]  # see the spectral module's note on vectorisation
        for turn in range((n_tiles - p + WORKERS - 1) // WORKERS):
            t = (p + turn * WORKERS) & (N_TILES - 1)
            for step in range(axle.shape[0]):
                j = axle[step]
                if frozen == 0 or step == 0:
                    clear(p, t, wave.shape[0], response.shape[1], d, settled)
                for g in range(n_groups):
                    w = growth[step, g]
                    c = constant[j, g]
                    for lane in range(LANES):
                        own_weight = w * own[t, g, lane]
                        weight[p, g, lane] = own_weight
                        uniform[t, lane] = uniform[t, lane] + active[t, lane] * (own_weight * c)
                add_linear(p, t, j, linear, u, d, weight)
                for c in range(start[j], start[j + 1]):
                    first_pass(p, t, c, response, wave, band, u, z)
                    points = wave.shape[0] // 4  # in a block
                    for stage in range(radix.shape[0] - 1):
                        r = radix[stage]
                        for b in range(wave.shape[0] // points):
                            pass_back(z, p, b * points, points // r, r, wave)
                        points = points // r
                    for b in range(wave.shape[0] // points):  # the last two passes, in cache
                        if points > 4:
                            pass_back(z, p, b * points, 4, points // 4, wave)
                        if kind[c, 0] == SQUARES:
                            add_squares(p, c, b * points, points, kind, weight, z, settled)
                        elif kind[c, 0] == BEGIN:
                            begin_power(p, c, b * points, points, kind, law, z, q2)
                        else:
                            add_power(p, c, b * points, points, kind, law, weight, z, q2, settled)
                if frozen == 0 or step == axle.shape[0] - 1:
                    forwards(settled, p, wave, radix)
                    collect(p, t, response.shape[1], wave, band, settled, active, uniform, d)
                if frozen == 0:
                    update(t, response.shape[1], power_limit, u, d, active, power, passages)


@ti.kernel
def fill(
    amplitudes: ti.types.ndarray(dtype=ti.f64, ndim=3),  # [R, K, 2]
    weights: ti.types.ndarray(dtype=ti.f64, ndim=2),  # [R, G]
    n_tiles: ti.i32,
    u: ti.template(),
    own: ti.template(),
    active: ti.template(),
    uniform: ti.template(),
):
    """Put realisations into lanes; those left over repeat the last."""
    for t in range(n_tiles):
        for lane in range(LANES):
            r = ti.min(t * LANES + lane, amplitudes.shape[0] - 1)
            active[t, lane] = 1.0
            uniform[t, lane] = 0.0
            for g in range(weights.shape[1]):
                own[t, g, lane] = weights[r, g]
            for k in range(amplitudes.shape[1]):
                u[t, k, 0, lane] = amplitudes[r, k, 0]
                u[t, k, 1, lane] = amplitudes[r, k, 1]


@ti.kernel
def fetch(
    d: ti.template(),
    uniform: ti.template(),
    change: ti.types.ndarray(dtype=ti.f64, ndim=3),  # [R, K, 2], written
    total: ti.types.ndarray(dtype=ti.f64, ndim=1),  # [R], written
):
    """Take growth and uniform settlement out of the lanes."""
    for r in range(change.shape[0]):
        t = r // LANES
        lane = r % LANES
        total[r] = uniform[t, lane]
        for k in range(change.shape[1]):
            change[r, k, 0] = d[t, k, 0, lane]
            change[r, k, 1] = d[t, k, 1, lane]


def evaluate(
    u: np.ndarray,  # [R, K, 2]
    weights: np.ndarray,  # [R, G]
    axles: np.ndarray,  # [N]
    tables: tuple[np.ndarray, ...],  # ``start`` to ``band`` of ``burst``
    change: np.ndarray,  # [R, K, 2], written
    uniform: np.ndarray,  # [R], written
) -> None:
    """Growth under ``axles`` at frozen profiles, any number of realisations."""
    n_groups = weights.shape[1]
    w = workspace(u.shape[1], len(tables[6]), n_groups)
    w.owner[:] = ["evaluate"]
    ones = np.ones((len(axles), n_groups))
    for first in range(0, len(u), CAPACITY):
        part = slice(first, min(first + CAPACITY, len(u)))
        n_tiles = -(-(part.stop - first) // LANES)
        fill(u[part], weights[part], n_tiles, w.u, w.own, w.active, w.uniform)
        burst(
            axles, ones, *tables, 1, 0.0, n_tiles, n_groups,
            w.u, w.du, w.own, w.active, w.power, w.uniform, w.passages,
            w.weight, w.z, w.q2, w.settled,
        )  # fmt: skip
        fetch(w.du, w.uniform, change[part], uniform[part])
