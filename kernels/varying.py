"""Support that varies along the track (twin of mcsettle.step_b.susceptibility), on tiles of lanes.

Layout and precautions are those of the spectral module. A field of susceptibility has M = 2 n_max waves,
those of field f in the rows f M … f M + M − 1; its products with the linear part of the growth are summed
over waves: at 61 modes as cheap as transforms of so few points, and without a grid.
"""

import functools
from dataclasses import dataclass

import numpy as np
import taichi as ti

from mcsettle.kernels.spectral import (
    CAPACITY,
    LANES,
    PRECISIONS,
    ROWS,
    take_rows,
    take_weights,
    workspace,
)


@dataclass(frozen=True)
class Varying:
    """``h`` [tile, F M, part, lane] waves of the fields; ``half`` [tile, mode, part, lane] V/2, m."""

    h: ti.Field
    half: ti.Field


@functools.cache
def fields_of(n_modes: int, n_rows: int, precision: str = "f64") -> Varying:
    """Allocate (once per shape) the ``n_rows`` waves of all fields of CAPACITY realisations."""
    kind, lanes = PRECISIONS[precision], LANES[precision]
    n_tiles = CAPACITY // lanes
    h = ti.field(kind, shape=(n_tiles, max(n_rows, 1), 2, lanes))
    return Varying(h, ti.field(kind, shape=(n_tiles, n_modes, 2, lanes)))


def add_rates(
    u: np.ndarray,  # [R, K, 2]
    weights: np.ndarray,  # [R, E]
    form: tuple[np.ndarray, ...],  # form [E, …, 2], constant [E], mean [E, K], multipliers [F, E]
    waves: np.ndarray,  # [R, F M, 2]
    first: int,  # mode number of the band
    growth: np.ndarray,  # [R, K, 2], added to
    uniform: np.ndarray,  # [R], added to
) -> None:
    """Run ``varying_rates`` on any number of realisations, CAPACITY at a time."""
    w = workspace(u.shape[1], weights.shape[1])
    w.owner[:] = ["rates"]
    varying = fields_of(u.shape[1], waves.shape[1])
    for begin in range(0, len(u), CAPACITY):
        part = slice(begin, min(begin + CAPACITY, len(u)))
        n_real = part.stop - part.start
        varying_rates(
            u[part], weights[part], *form, waves[part], first,
            n_real, weights.shape[1], w.state.u, w.weight, varying, growth[part], uniform[part],
        )  # fmt: skip


@ti.kernel
def varying_rates(
    u: ti.types.ndarray(dtype=ti.f64, ndim=3),  # [R, K, 2] amplitudes
    w: ti.types.ndarray(dtype=ti.f64, ndim=2),  # [R, E] weights of the forms
    form: ti.types.ndarray(dtype=ti.f64, ndim=3),  # [E, K + P + M, 2], of which the linear part
    constant: ti.types.ndarray(dtype=ti.f64, ndim=1),  # [E]
    mean: ti.types.ndarray(dtype=ti.f64, ndim=2),  # [E, K]
    multipliers: ti.types.ndarray(dtype=ti.f64, ndim=2),  # [F, E] of the fields in the forms
    waves: ti.types.ndarray(dtype=ti.f64, ndim=3),  # [R, F M, 2]
    first: ti.i32,  # mode number of the band
    n_real: ti.i32,
    n_forms: ti.template(),
    s: ti.template(),
    weight: ti.template(),
    varying: ti.template(),
    out: ti.types.ndarray(dtype=ti.f64, ndim=3),  # [R, K, 2] added to: growth of the amplitudes
    out_uniform: ti.types.ndarray(dtype=ti.f64, ndim=1),  # [R] added to: uniform settlement
):
    """Add what varying support adds to the growth of every realisation."""
    n_modes = u.shape[1]
    lanes = ti.static(s.shape[3])
    for tile in range((n_real + lanes - 1) // lanes):
        t = tile & (s.shape[0] - 1)
        begin = t * lanes
        s[t, 0, 0, 0] = 0.0  # see the spectral module's note on vectorisation
        re = ti.Vector.zero(ti.f64, lanes)
        im = ti.Vector.zero(ti.f64, lanes)
        load = ti.Vector.zero(ti.f64, lanes)
        settled = ti.Vector.zero(ti.f64, lanes)
        # Realisations, their weights and fields into lanes; those left over repeat the last.
        take_rows(t, begin, n_modes, n_real, u, s)
        take_weights(t, begin, n_forms, n_real, w, weight)
        take_rows(t, begin, waves.shape[1], n_real, waves, varying.h)
        for f in range(multipliers.shape[0]):
            own_load(
                t, f, n_forms, n_modes, form, constant, mean, multipliers, s, weight, varying, load
            )
            for i in range(n_modes):
                spread(t, f, i, first, n_modes, varying, load, settled, re, im)
                for lane in range(lanes):
                    if begin + lane < n_real:
                        r = begin + lane
                        out[r, i, 0] = out[r, i, 0] + re[lane]
                        out[r, i, 1] = out[r, i, 1] + im[lane]
        for lane in range(lanes):
            if begin + lane < n_real:
                out_uniform[begin + lane] = out_uniform[begin + lane] + settled[lane]


@ti.func
def own_load(
    t: int, f: int, n_forms: ti.template(), n_modes: int, form: ti.template(),
    constant: ti.template(), mean: ti.template(), multipliers: ti.template(), s: ti.template(),
    weight: ti.template(), varying: ti.template(), load: ti.template(),
):  # fmt: skip
    """What settles on average under the groups of field f, and half its linear part; own weights."""
    c = ti.Vector([multipliers[f, e] for e in ti.static(range(n_forms))])
    for lane in range(s.shape[3]):
        load[lane] = 0.0
    for e in ti.static(range(n_forms)):
        c0 = c[e] * constant[e]
        for lane in range(s.shape[3]):
            load[lane] = load[lane] + weight[t, e, lane] * c0
    for mode in range(n_modes):
        n = mode & ROWS
        a = ti.Vector([0.5 * c[e] * form[e, n, 0] for e in ti.static(range(n_forms))])
        b = ti.Vector([0.5 * c[e] * form[e, n, 1] for e in ti.static(range(n_forms))])
        g = ti.Vector([c[e] * mean[e, n] for e in ti.static(range(n_forms))])
        for lane in range(s.shape[3]):
            ca = 0.0
            cb = 0.0
            cg = 0.0
            for e in ti.static(range(n_forms)):
                ca = ca + weight[t, e, lane] * a[e]
                cb = cb + weight[t, e, lane] * b[e]
                cg = cg + weight[t, e, lane] * g[e]
            x = s[t, n, 0, lane]
            y = s[t, n, 1, lane]
            varying.half[t, n, 0, lane] = ca * x - cb * y
            varying.half[t, n, 1, lane] = ca * y + cb * x
            load[lane] = load[lane] + cg * (x * x + y * y)


@ti.func
def spread(
    t: int, f: int, i: int, first: int, n_modes: int, varying: ti.template(), load: ti.template(),
    settled: ti.template(), re: ti.template(), im: ti.template(),
):  # fmt: skip
    """Growth of mode i by field f: forced by ``load``, and by products with the linear part."""
    h, half = ti.static(varying.h, varying.half)
    base = f * 2 * (first + n_modes - 1) - 1  # a field's wave of mode number m is row base + m
    own = (base + first + i) & ROWS
    k = i & ROWS
    for lane in range(h.shape[3]):
        a = h[t, own, 0, lane]
        b = h[t, own, 1, lane]
        re[lane] = a * load[lane]
        im[lane] = b * load[lane]
        settled[lane] = settled[lane] + (a * half[t, k, 0, lane] + b * half[t, k, 1, lane])
    # h at the sum of two mode numbers, with V*; h at their difference with V, or h* where it is negative.
    for mode in range(n_modes):
        j = mode & ROWS
        ahead = (base + 2 * first + i + mode) & ROWS
        if mode < i:
            apart = (base + i - mode) & ROWS
            for lane in range(h.shape[3]):
                a = h[t, apart, 0, lane] + h[t, ahead, 0, lane]
                b = h[t, apart, 1, lane] + h[t, ahead, 1, lane]
                c = h[t, apart, 0, lane] - h[t, ahead, 0, lane]
                d = h[t, ahead, 1, lane] - h[t, apart, 1, lane]
                x = half[t, j, 0, lane]
                y = half[t, j, 1, lane]
                re[lane] = re[lane] + (a * x + d * y)
                im[lane] = im[lane] + (b * x + c * y)
        elif mode > i:
            apart = (base + mode - i) & ROWS
            for lane in range(h.shape[3]):
                a = h[t, apart, 0, lane] + h[t, ahead, 0, lane]
                b = h[t, apart, 1, lane] + h[t, ahead, 1, lane]
                c = h[t, apart, 0, lane] - h[t, ahead, 0, lane]
                d = h[t, ahead, 1, lane] - h[t, apart, 1, lane]
                x = half[t, j, 0, lane]
                y = half[t, j, 1, lane]
                re[lane] = re[lane] + (a * x + b * y)
                im[lane] = im[lane] + (d * x + c * y)
        else:
            for lane in range(h.shape[3]):
                a = h[t, ahead, 0, lane]
                b = h[t, ahead, 1, lane]
                x = half[t, j, 0, lane]
                y = half[t, j, 1, lane]
                re[lane] = re[lane] + (a * x + b * y)
                im[lane] = im[lane] + (b * x - a * y)
