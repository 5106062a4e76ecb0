"""Support that varies along the track (twin of mcsettle.step_b.susceptibility), on tiles of lanes.

Layout and precautions are those of the spectral module. A field of susceptibility has M = 2 n_max waves,
those of field f in the rows f M … f M + M − 1; its products with what settles are summed over waves, at
61 modes as cheap as transforms of so few points, and without a grid.
"""

import functools

import numpy as np

from mcsettle.kernels.backend import bundle, ti
from mcsettle.kernels.spectral import (
    CAPACITY,
    PRECISIONS,
    ROWS,
    Tables,
    own_mode,
    own_product,
    take_rows,
    take_weights,
    tiles,
    workspace,
)


@bundle
class Varying:
    """``h`` [tile, F M, part, lane] waves of the fields; ``half`` [tile, M, part, lane] half of what
    settles at each wave, m; ``own`` [tile, weight, lane] weights times a field's multipliers.
    """

    h: ti.Field
    half: ti.Field
    own: ti.Field


@functools.cache
def fields_of(
    n_rows: int, n_waves: int, n_weights: int, precision: str = "f64", few: bool = False
) -> Varying:
    """Allocate (once per shape) the ``n_rows`` waves of all fields of the realisations of a workspace."""
    kind, (n_tiles, lanes) = PRECISIONS[precision], tiles(precision, few)
    h, half = (ti.field(kind, shape=(n_tiles, max(n, 1), 2, lanes)) for n in (n_rows, n_waves))
    return Varying(h, half, ti.field(kind, shape=(n_tiles, n_weights, lanes)))


def is_alike(multipliers: np.ndarray) -> bool:
    """Whether there is one field, the same in all groups: what it multiplies is the growth itself."""
    return len(multipliers) == 1 and bool(np.all(multipliers == 1.0))


def add_rates(
    u: np.ndarray,  # [R, K, 2]
    weights: np.ndarray,  # [R, E]
    form: tuple[np.ndarray, ...],  # form [E, …, 2], constant [E], mean [E, K], multipliers [F, E]
    tables: Tables,  # of the pairs of modes, in the band and beside it
    waves: np.ndarray,  # [R, F M, 2]
    first: int,  # mode number of the band
    growth: np.ndarray,  # [R, K, 2], without fields; added to
    uniform: np.ndarray,  # [R], without fields; added to
) -> None:
    """Run ``varying_rates`` on any number of realisations, CAPACITY at a time."""
    n_modes, n_forms, multipliers = u.shape[1], weights.shape[1], form[-1]
    w = workspace(n_modes, n_forms)
    w.owner[:] = ["rates"]
    varying = fields_of(waves.shape[1], 2 * (first + n_modes - 1), n_forms)
    for begin in range(0, len(u), CAPACITY):
        part = slice(begin, min(begin + CAPACITY, len(u)))
        n_real = part.stop - part.start
        varying_rates(
            u[part], weights[part], *form, *tables, waves[part], first, n_real, n_forms,
            is_alike(multipliers), w.state.u, w.weight, varying, growth[part], uniform[part],
        )  # fmt: skip


@ti.kernel
def varying_rates(
    u: ti.types.ndarray(dtype=ti.f64, ndim=3),  # [R, K, 2] amplitudes
    w: ti.types.ndarray(dtype=ti.f64, ndim=2),  # [R, E] weights of the forms
    form: ti.types.ndarray(dtype=ti.f64, ndim=3),  # [E, K + P + M, 2]
    constant: ti.types.ndarray(dtype=ti.f64, ndim=1),  # [E]
    mean: ti.types.ndarray(dtype=ti.f64, ndim=2),  # [E, K]
    multipliers: ti.types.ndarray(dtype=ti.f64, ndim=2),  # [F, E] of the fields in the forms
    sums: ti.types.ndarray(dtype=ti.i32, ndim=2),  # [P, 2]
    sum_start: ti.types.ndarray(dtype=ti.i32, ndim=1),  # [K + 1]
    diffs: ti.types.ndarray(dtype=ti.i32, ndim=2),  # [M, 2]
    diff_start: ti.types.ndarray(dtype=ti.i32, ndim=1),  # [K + 1]
    outer_sums: ti.types.ndarray(dtype=ti.i32, ndim=1),  # [2 n_max + 1]
    outer_diffs: ti.types.ndarray(dtype=ti.i32, ndim=1),  # [2 n_max + 1]
    waves: ti.types.ndarray(dtype=ti.f64, ndim=3),  # [R, F M, 2]
    first: ti.i32,  # mode number of the band
    n_real: ti.i32,
    n_forms: ti.template(),
    alike: ti.template(),  # one field, the same in all groups
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
        raised = ti.Vector.zero(ti.f64, lanes)
        # Realisations, their weights and fields into lanes; those left over repeat the last.
        take_rows(t, begin, n_modes, n_real, u, s)
        take_weights(t, begin, n_forms, n_real, w, weight)
        take_rows(t, begin, waves.shape[1], n_real, waves, varying.h)
        for f in range(multipliers.shape[0]):
            for e in range(n_forms):
                for lane in range(lanes):
                    varying.own[t, e, lane] = multipliers[f, e] * weight[t, e, lane]
            # Half of what settles under the groups of this field, wave by wave, and on average.
            if ti.static(alike):
                take_half(t, begin, n_real, first, n_modes, out, out_uniform, varying, load)
            else:
                own_half(
                    t, first, n_modes, n_forms, form, constant, mean, sums, sum_start, diffs,
                    diff_start, s, varying, load, re, im,
                )  # fmt: skip
            own_half_beside(
                t, first, n_modes, n_forms, form, sums, outer_sums, diffs, outer_diffs, s, varying,
                re, im,
            )  # fmt: skip
            for i in range(n_modes):
                spread(t, f, i, first, n_modes, varying, load, re, im)
                for lane in range(lanes):
                    if begin + lane < n_real:
                        r = begin + lane
                        out[r, i, 0] = out[r, i, 0] + re[lane]
                        out[r, i, 1] = out[r, i, 1] + im[lane]
            raise_mean(t, f, varying, raised)
            for lane in range(lanes):
                if begin + lane < n_real:
                    out_uniform[begin + lane] = out_uniform[begin + lane] + raised[lane]


@ti.func
def take_half(
    t: int, begin: int, n_real: int, first: int, n_modes: int, out: ti.template(),
    out_uniform: ti.template(), varying: ti.template(), load: ti.template(),
):  # fmt: skip
    """Half of what settles in the band, and what settles on average: the growth without fields."""
    for mode in range(n_modes):
        row = (first - 1 + mode) & ROWS
        for lane in range(varying.half.shape[3]):
            r = ti.min(begin + lane, n_real - 1)
            varying.half[t, row, 0, lane] = 0.5 * out[r, mode, 0]
            varying.half[t, row, 1, lane] = 0.5 * out[r, mode, 1]
    for lane in range(varying.half.shape[3]):
        load[lane] = out_uniform[ti.min(begin + lane, n_real - 1)]


@ti.func
def own_half(
    t: int, first: int, n_modes: int, n_forms: ti.template(), form: ti.template(),
    constant: ti.template(), mean: ti.template(), sums: ti.template(), sum_start: ti.template(),
    diffs: ti.template(), diff_start: ti.template(), s: ti.template(), varying: ti.template(),
    load: ti.template(), re: ti.template(), im: ti.template(),
):  # fmt: skip
    """Half of what settles in the band by own weights, and what settles on average."""
    own = ti.static(varying.own)
    for lane in range(s.shape[3]):
        load[lane] = 0.0
    for e in ti.static(range(n_forms)):
        c0 = constant[e]
        for lane in range(s.shape[3]):
            load[lane] = load[lane] + own[t, e, lane] * c0
    for mode in range(n_modes):
        n = mode & ROWS
        own_mode(
            t, n, n_modes, n_forms, form, mean, sums, sum_start, diffs, diff_start, s, own, load,
            re, im,
        )  # fmt: skip
        keep_half(t, first - 1 + n, varying, re, im)


@ti.func
def own_half_beside(
    t: int, first: int, n_modes: int, n_forms: ti.template(), form: ti.template(),
    sums: ti.template(), outer_sums: ti.template(), diffs: ti.template(),
    outer_diffs: ti.template(), s: ti.template(), varying: ti.template(), re: ti.template(),
    im: ti.template(),
):  # fmt: skip
    """Half of what settles in the mode numbers beside the band, by own weights."""
    n_sums = sums.shape[0]
    for wave in range(outer_sums.shape[0] - 1):
        if wave < first - 1 or wave >= first - 1 + n_modes:
            for lane in range(s.shape[3]):
                re[lane] = 0.0
                im[lane] = 0.0
            for p in range(outer_sums[wave], outer_sums[wave + 1]):
                own_product(t, n_modes + p, p, sums, form, varying.own, n_forms, False, s, re, im)
            for p in range(outer_diffs[wave], outer_diffs[wave + 1]):
                own_product(
                    t, n_modes + n_sums + p, p, diffs, form, varying.own, n_forms, True, s, re, im
                )
            keep_half(t, wave, varying, re, im)


@ti.func
def keep_half(t: int, wave: int, varying: ti.template(), re: ti.template(), im: ti.template()):
    """Keep half of ``re`` and ``im`` as what settles at a wave."""
    row = wave & ROWS
    for lane in range(varying.half.shape[3]):
        varying.half[t, row, 0, lane] = 0.5 * re[lane]
        varying.half[t, row, 1, lane] = 0.5 * im[lane]


@ti.func
def spread(
    t: int, f: int, i: int, first: int, n_modes: int, varying: ti.template(), load: ti.template(),
    re: ti.template(), im: ti.template(),
):  # fmt: skip
    """Growth of mode i by field f: forced by ``load``, and by products with what settles.

    h at the sum of two mode numbers, with Q*; at their difference with Q, or h* where it is negative.
    """
    h, half = ti.static(varying.h, varying.half)
    n_waves = half.shape[1]
    base = f * n_waves - 1  # a field's wave of mode number m is row base + m
    n = first + i
    own = (base + n) & ROWS
    for lane in range(h.shape[3]):
        re[lane] = h[t, own, 0, lane] * load[lane]
        im[lane] = h[t, own, 1, lane] * load[lane]
    for number in range(1, n):
        j = (number - 1) & ROWS
        apart = (base + n - number) & ROWS
        ahead = (base + n + number) & ROWS
        add_pair(t, apart, ahead, j, False, h, half, re, im)
    same = (n - 1) & ROWS
    twice = (base + 2 * n) & ROWS
    add_single(t, twice, same, False, h, half, re, im)
    for number in range(n + 1, n_waves - n + 1):
        j = (number - 1) & ROWS
        apart = (base + number - n) & ROWS
        ahead = (base + n + number) & ROWS
        add_pair(t, apart, ahead, j, True, h, half, re, im)
    for number in range(ti.max(n_waves - n, n) + 1, n_waves + 1):
        j = (number - 1) & ROWS
        apart = (base + number - n) & ROWS
        add_single(t, apart, j, True, h, half, re, im)


@ti.func
def raise_mean(t: int, f: int, varying: ti.template(), raised: ti.template()):
    """What field f adds to the uniform settlement."""
    h, half = ti.static(varying.h, varying.half)
    for lane in range(h.shape[3]):
        raised[lane] = 0.0
    for wave in range(half.shape[1]):
        row = (f * half.shape[1] + wave) & ROWS
        k = wave & ROWS
        for lane in range(h.shape[3]):
            raised[lane] = raised[lane] + (
                h[t, row, 0, lane] * half[t, k, 0, lane] + h[t, row, 1, lane] * half[t, k, 1, lane]
            )


@ti.func
def add_pair(
    t: int, apart: int, ahead: int, j: int, beyond: ti.template(), h: ti.template(),
    half: ti.template(), re: ti.template(), im: ti.template(),
):  # fmt: skip
    """Products of wave j with a field's waves at the difference of two numbers and at their sum.

    ``beyond``: wave j has the larger number, and the field's wave at the difference is conjugate.
    """
    for lane in range(h.shape[3]):
        a = h[t, apart, 0, lane] + h[t, ahead, 0, lane]
        b = h[t, apart, 1, lane] + h[t, ahead, 1, lane]
        c = h[t, apart, 0, lane] - h[t, ahead, 0, lane]
        d = h[t, ahead, 1, lane] - h[t, apart, 1, lane]
        x = half[t, j, 0, lane]
        y = half[t, j, 1, lane]
        if ti.static(beyond):
            re[lane] = re[lane] + (a * x + b * y)
            im[lane] = im[lane] + (d * x + c * y)
        else:
            re[lane] = re[lane] + (a * x + d * y)
            im[lane] = im[lane] + (b * x + c * y)


@ti.func
def add_single(
    t: int, row: int, j: int, beyond: ti.template(), h: ti.template(), half: ti.template(),
    re: ti.template(), im: ti.template(),
):  # fmt: skip
    """Product of a field's wave with wave j, conjugate; ``beyond``: with the field's wave conjugate."""
    for lane in range(h.shape[3]):
        a = h[t, row, 0, lane]
        b = h[t, row, 1, lane]
        x = half[t, j, 0, lane]
        y = half[t, j, 1, lane]
        re[lane] = re[lane] + (a * x + b * y)
        im[lane] = im[lane] + ((a * y - b * x) if ti.static(beyond) else (b * x - a * y))
