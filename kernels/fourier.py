"""Fourier transforms over x of tiles of realisations, the realisation in the lane.

Fields [worker, point, 2, LANES] (complex) or [worker, point, LANES] (two quarters make a complex one).
Backward transforms (modes to x) decimate in frequency and leave x in digit-reversed order; forward
ones decimate in time and take it in that order: nothing is ever reordered. The first and last passes
of a transform over N points have radix 4 and belong to the caller; those between are here.

Rows are masked with ROWS, which changes none of them: it tells the compiler that no index overflows,
without which it works out every address anew for every vector of lanes (measured: a fifth slower).

Depends on: spectral, taichi.
"""

import numpy as np
import taichi as ti

from mcsettle.kernels.spectral import LANES, ROWS

__all__ = ["LANES", "ROWS", "butterfly", "forwards", "pass_back", "radices", "twiddled"]


def radices(n_points: int) -> np.ndarray:
    """Radices of the passes between the first and the last (both 4), for N = 16 · 2^a · 3^b."""
    rest, found = n_points // 16, []
    for radix in (4, 2, 3):
        while rest % radix == 0:
            found.append(radix)
            rest //= radix
    if n_points % 16 or rest != 1 or n_points > ROWS:
        raise ValueError(f"{n_points} points; the transform takes 16 · 2^a · 3^b ≤ {ROWS}")
    return np.array(found, dtype=np.int32)


@ti.func
def butterfly(z: ti.template(), p: int, a: int, b: int, c: int, d: int, lane: int):
    """Radix-4 butterfly backwards of points a, b, c, d: their real and imaginary parts in turn."""
    r0 = z[p, a, 0, lane] + z[p, c, 0, lane]
    r1 = z[p, a, 0, lane] - z[p, c, 0, lane]
    r2 = z[p, b, 0, lane] + z[p, d, 0, lane]
    r3 = z[p, b, 0, lane] - z[p, d, 0, lane]
    i0 = z[p, a, 1, lane] + z[p, c, 1, lane]
    i1 = z[p, a, 1, lane] - z[p, c, 1, lane]
    i2 = z[p, b, 1, lane] + z[p, d, 1, lane]
    i3 = z[p, b, 1, lane] - z[p, d, 1, lane]
    return r0 + r2, i0 + i2, r1 - i3, i1 + r3, r0 - r2, i0 - i2, r1 + i3, i1 - r3


@ti.func
def twiddled(
    z: ti.template(), p: int, i: int, hop: int,
    c1: float, s1: float, c2: float, s2: float, c3: float, s3: float,
):  # fmt: skip
    """Radix-4 butterfly backwards in place on i, i + hop, …, then twiddles."""
    a = i & ROWS
    b = (i + hop) & ROWS
    c = (i + 2 * hop) & ROWS
    d = (i + 3 * hop) & ROWS
    for lane in range(LANES):
        wr, wi, xr, xi, yr, yi, vr, vi = butterfly(z, p, a, b, c, d, lane)
        z[p, a, 0, lane] = wr
        z[p, a, 1, lane] = wi
        z[p, b, 0, lane] = c1 * xr - s1 * xi
        z[p, b, 1, lane] = c1 * xi + s1 * xr
        z[p, c, 0, lane] = c2 * yr - s2 * yi
        z[p, c, 1, lane] = c2 * yi + s2 * yr
        z[p, d, 0, lane] = c3 * vr - s3 * vi
        z[p, d, 1, lane] = c3 * vi + s3 * vr


@ti.func
def pass_back(z: ti.template(), p: int, block: int, hop: int, r: int, wave: ti.template()):
    """One pass of radix r backwards over the ``r hop`` points from ``block``."""
    unit = wave.shape[0] // (r * hop)
    for n in range(hop):
        i = (block + n) & ROWS
        j = (block + n + hop) & ROWS
        k = (block + n + 2 * hop) & ROWS
        c1 = wave[unit * n, 0]
        s1 = wave[unit * n, 1]
        if r == 4:
            c2 = wave[2 * unit * n, 0]
            s2 = wave[2 * unit * n, 1]
            c3 = wave[3 * unit * n, 0]
            s3 = wave[3 * unit * n, 1]
            twiddled(z, p, i, hop, c1, s1, c2, s2, c3, s3)
        elif r == 2:
            for lane in range(LANES):
                ar = z[p, i, 0, lane]
                ai = z[p, i, 1, lane]
                br = z[p, j, 0, lane]
                bi = z[p, j, 1, lane]
                xr = ar - br
                xi = ai - bi
                z[p, i, 0, lane] = ar + br
                z[p, i, 1, lane] = ai + bi
                z[p, j, 0, lane] = c1 * xr - s1 * xi
                z[p, j, 1, lane] = c1 * xi + s1 * xr
        else:
            c2 = wave[2 * unit * n, 0]
            s2 = wave[2 * unit * n, 1]
            h = ti.sqrt(ti.f64(0.75))
            for lane in range(LANES):
                ar = z[p, i, 0, lane]
                ai = z[p, i, 1, lane]
                br = z[p, j, 0, lane] + z[p, k, 0, lane]
                bi = z[p, j, 1, lane] + z[p, k, 1, lane]
                dr = h * (z[p, j, 0, lane] - z[p, k, 0, lane])
                di = h * (z[p, j, 1, lane] - z[p, k, 1, lane])
                z[p, i, 0, lane] = ar + br
                z[p, i, 1, lane] = ai + bi
                er = ar - 0.5 * br
                ei = ai - 0.5 * bi
                xr = er - di
                xi = ei + dr
                z[p, j, 0, lane] = c1 * xr - s1 * xi
                z[p, j, 1, lane] = c1 * xi + s1 * xr
                xr = er + di
                xi = ei - dr
                z[p, k, 0, lane] = c2 * xr - s2 * xi
                z[p, k, 1, lane] = c2 * xi + s2 * xr


@ti.func
def forth_4(
    f: ti.template(), p: int, i: int, j: int, hop: int,
    c1: float, s1: float, c2: float, s2: float, c3: float, s3: float,
):  # fmt: skip
    """Radix-4 butterfly forwards in place: real parts at i, imaginary at j, twiddles first."""
    i0 = i & ROWS
    i1 = (i + hop) & ROWS
    i2 = (i + 2 * hop) & ROWS
    i3 = (i + 3 * hop) & ROWS
    j0 = j & ROWS
    j1 = (j + hop) & ROWS
    j2 = (j + 2 * hop) & ROWS
    j3 = (j + 3 * hop) & ROWS
    for lane in range(LANES):
        ar = f[p, i0, lane]
        ai = f[p, j0, lane]
        br = c1 * f[p, i1, lane] + s1 * f[p, j1, lane]
        bi = c1 * f[p, j1, lane] - s1 * f[p, i1, lane]
        cr = c2 * f[p, i2, lane] + s2 * f[p, j2, lane]
        ci = c2 * f[p, j2, lane] - s2 * f[p, i2, lane]
        dr = c3 * f[p, i3, lane] + s3 * f[p, j3, lane]
        di = c3 * f[p, j3, lane] - s3 * f[p, i3, lane]
        f[p, i0, lane] = (ar + cr) + (br + dr)
        f[p, j0, lane] = (ai + ci) + (bi + di)
        f[p, i1, lane] = (ar - cr) + (bi - di)
        f[p, j1, lane] = (ai - ci) - (br - dr)
        f[p, i2, lane] = (ar + cr) - (br + dr)
        f[p, j2, lane] = (ai + ci) - (bi + di)
        f[p, i3, lane] = (ar - cr) - (bi - di)
        f[p, j3, lane] = (ai - ci) + (br - dr)


@ti.func
def forth_2(f: ti.template(), p: int, i: int, j: int, hop: int, c1: float, s1: float):
    """Radix-2 butterfly forwards, as ``forth_4``."""
    for lane in range(LANES):
        ar = f[p, i, lane]
        ai = f[p, j, lane]
        br = c1 * f[p, i + hop, lane] + s1 * f[p, j + hop, lane]
        bi = c1 * f[p, j + hop, lane] - s1 * f[p, i + hop, lane]
        f[p, i, lane] = ar + br
        f[p, j, lane] = ai + bi
        f[p, i + hop, lane] = ar - br
        f[p, j + hop, lane] = ai - bi


@ti.func
def forth_3(
    f: ti.template(), p: int, i: int, j: int, hop: int, c1: float, s1: float, c2: float, s2: float
):
    """Radix-3 butterfly forwards, as ``forth_4``."""
    h = ti.sqrt(ti.f64(0.75))
    for lane in range(LANES):
        ar = f[p, i, lane]
        ai = f[p, j, lane]
        br = c1 * f[p, i + hop, lane] + s1 * f[p, j + hop, lane]
        bi = c1 * f[p, j + hop, lane] - s1 * f[p, i + hop, lane]
        cr = c2 * f[p, i + 2 * hop, lane] + s2 * f[p, j + 2 * hop, lane]
        ci = c2 * f[p, j + 2 * hop, lane] - s2 * f[p, i + 2 * hop, lane]
        f[p, i, lane] = ar + (br + cr)
        f[p, j, lane] = ai + (bi + ci)
        xr = ar - 0.5 * (br + cr)
        xi = ai - 0.5 * (bi + ci)
        yr = h * (bi - ci)
        yi = h * (cr - br)
        f[p, i + hop, lane] = xr + yr
        f[p, j + hop, lane] = xi + yi
        f[p, i + 2 * hop, lane] = xr - yr
        f[p, j + 2 * hop, lane] = xi - yi


@ti.func
def forwards(f: ti.template(), p: int, wave: ti.template(), radix: ti.template()):
    """Forward transforms of quarters 0 + i 1 and 2 + i 3: every pass but the last over all points."""
    n_points = wave.shape[0]
    quarter = n_points // 4
    length = 1
    for stage in range(radix.shape[0] + 1):
        r = 4
        if stage > 0:
            r = radix[radix.shape[0] - stage]
        hop = length
        length = hop * r
        unit = n_points // length
        for n in range(hop):
            c1 = wave[unit * n, 0]
            s1 = wave[unit * n, 1]
            c2 = wave[2 * unit * n % n_points, 0]
            s2 = wave[2 * unit * n % n_points, 1]
            for b in range(unit // 4):
                for half in range(2):
                    i = 2 * half * quarter + b * length + n
                    j = i + quarter
                    if r == 4:
                        c3 = wave[3 * unit * n, 0]
                        s3 = wave[3 * unit * n, 1]
                        forth_4(f, p, i, j, hop, c1, s1, c2, s2, c3, s3)
                    elif r == 2:
                        forth_2(f, p, i, j, hop, c1, s1)
                    else:
                        forth_3(f, p, i, j, hop, c1, s1, c2, s2)
