"""What the pointwise kernel does with a tile: modes to stress fields, stress to settlement and back.

Arguments throughout: worker ``p`` and tile ``t``, transform ``c`` or axle ``j``, block of ``points``
points from ``begin``; the tables and fields of ``mcsettle.kernels.pointwise.burst``.

Depends on: fourier, laws, taichi.
"""

import taichi as ti

from mcsettle.kernels.fourier import LANES, ROWS, butterfly, twiddled
from mcsettle.kernels.laws import strain_power


@ti.func
def clear(p: int, t: int, n_points: int, n_modes: int, d: ti.template(), settled: ti.template()):
    """Begin a passage: nothing has settled, nothing has grown."""
    for i in range(n_points):
        for lane in range(LANES):
            settled[p, i, lane] = 0.0
    for k in range(n_modes):
        for lane in range(LANES):
            d[t, k, 0, lane] = 0.0
            d[t, k, 1, lane] = 0.0


@ti.func
def add_linear(
    p: int, t: int, j: int, linear: ti.template(),
    u: ti.template(), d: ti.template(), weight: ti.template(),
):  # fmt: skip
    """Growth that is linear in the profile and needs no grid (exponent 2)."""
    for mode in range(linear.shape[2]):
        k = mode & ROWS
        for g in range(linear.shape[1]):
            a = linear[j, g, k, 0]
            b = linear[j, g, k, 1]
            for lane in range(LANES):
                x = u[t, k, 0, lane]
                y = u[t, k, 1, lane]
                w = weight[p, g, lane]
                d[t, k, 0, lane] = d[t, k, 0, lane] + w * (a * x - b * y)
                d[t, k, 1, lane] = d[t, k, 1, lane] + w * (a * y + b * x)


@ti.func
def first_pass(
    p: int, t: int, c: int, response: ti.template(), wave: ti.template(), band: ti.template(),
    u: ti.template(), z: ti.template(),
):  # fmt: skip
    """Coefficients of two fields and the first pass of their transform, modes to x.

    Most butterflies take two modes at most: n and, N/4 before the end, the conjugate of N/4 − n.
    """
    quarter = wave.shape[0] // 4
    first = band[0]
    for n in range(quarter):
        c1 = wave[n, 0]
        s1 = wave[n, 1]
        c2 = wave[2 * n, 0]
        s2 = wave[2 * n, 1]
        c3 = wave[3 * n, 0]
        s3 = wave[3 * n, 1]
        if band[1] <= n and n < band[2]:
            k = within(n - first, response.shape[1])
            m = within(quarter - n - first, response.shape[1])
            n0 = n & ROWS
            n1 = (n + quarter) & ROWS
            n2 = (n + 2 * quarter) & ROWS
            n3 = (n + 3 * quarter) & ROWS
            ka = 0.0
            kb = 0.0
            if k == n - first:
                ka = response[c, k, 0]
                kb = response[c, k, 1]
            ma = 0.0
            mb = 0.0
            if m == quarter - n - first:
                ma = response[c, m, 2]
                mb = response[c, m, 3]
            for lane in range(LANES):
                ar = ka * u[t, k, 0, lane] - kb * u[t, k, 1, lane]
                ai = ka * u[t, k, 1, lane] + kb * u[t, k, 0, lane]
                br = ma * u[t, m, 0, lane] - mb * u[t, m, 1, lane]
                bi = -(ma * u[t, m, 1, lane] + mb * u[t, m, 0, lane])
                z[p, n0, 0, lane] = ar + br
                z[p, n0, 1, lane] = ai + bi
                xr = ar + bi
                xi = ai - br
                z[p, n1, 0, lane] = c1 * xr - s1 * xi
                z[p, n1, 1, lane] = c1 * xi + s1 * xr
                xr = ar - br
                xi = ai - bi
                z[p, n2, 0, lane] = c2 * xr - s2 * xi
                z[p, n2, 1, lane] = c2 * xi + s2 * xr
                xr = ar - bi
                xi = ai + br
                z[p, n3, 0, lane] = c3 * xr - s3 * xi
                z[p, n3, 1, lane] = c3 * xi + s3 * xr
        else:
            for q in range(4):
                coefficient(p, t, c, n + q * quarter, 4 * quarter, first, response, u, z)
            twiddled(z, p, n, quarter, c1, s1, c2, s2, c3, s3)


@ti.func
def within(k: int, n_modes: int) -> int:
    """Index k, or the nearest there is."""
    return ti.min(ti.max(k, 0), n_modes - 1) & ROWS


@ti.func
def coefficient(
    p: int, t: int, c: int, i: int, n_points: int, first: int,
    response: ti.template(), u: ti.template(), z: ti.template(),
):  # fmt: skip
    """Coefficient i of two fields: of mode i, of the conjugate of mode N − i, or zero."""
    k = i - first
    m = n_points - i - first
    for lane in range(LANES):
        z[p, i, 0, lane] = 0.0
        z[p, i, 1, lane] = 0.0
    if 0 <= k and k < response.shape[1]:
        a = response[c, k, 0]
        b = response[c, k, 1]
        for lane in range(LANES):
            z[p, i, 0, lane] = a * u[t, k, 0, lane] - b * u[t, k, 1, lane]
            z[p, i, 1, lane] = a * u[t, k, 1, lane] + b * u[t, k, 0, lane]
    if 0 <= m and m < response.shape[1]:
        a = response[c, m, 2]
        b = response[c, m, 3]
        for lane in range(LANES):
            z[p, i, 0, lane] = a * u[t, m, 0, lane] - b * u[t, m, 1, lane]
            z[p, i, 1, lane] = -(a * u[t, m, 1, lane] + b * u[t, m, 0, lane])


@ti.func
def add_squares(
    p: int, c: int, begin: int, points: int, kind: ti.template(),
    weight: ti.template(), z: ti.template(), settled: ti.template(),
):  # fmt: skip
    """Last pass of a transform whose two fields settle as their squares."""
    ga = kind[c, 1]
    gb = kind[c, 2]
    for n in range(points // 4):
        i = (begin + 4 * n) & (ROWS - 3)
        for lane in range(LANES):
            x0, y0, x1, y1, x2, y2, x3, y3 = butterfly(z, p, i, i + 1, i + 2, i + 3, lane)
            wa = weight[p, ga, lane]
            wb = weight[p, gb, lane]
            a0 = settled[p, i, lane] + (wa * (x0 * x0) + wb * (y0 * y0))
            a1 = settled[p, i + 1, lane] + (wa * (x1 * x1) + wb * (y1 * y1))
            a2 = settled[p, i + 2, lane] + (wa * (x2 * x2) + wb * (y2 * y2))
            a3 = settled[p, i + 3, lane] + (wa * (x3 * x3) + wb * (y3 * y3))
            settled[p, i, lane] = a0
            settled[p, i + 1, lane] = a1
            settled[p, i + 2, lane] = a2
            settled[p, i + 3, lane] = a3


@ti.func
def begin_power(
    p: int, c: int, begin: int, points: int, kind: ti.template(), law: ti.template(),
    z: ti.template(), q2: ti.template(),
):  # fmt: skip
    """Last pass of a transform of two deviators of one depth: begin its σ_d²."""
    depth = kind[c, 1] & 1
    m0 = law[c, 0]
    m1 = law[c, 1]
    for n in range(points // 4):
        i = (begin + 4 * n) & (ROWS - 3)
        for lane in range(LANES):
            x0, y0, x1, y1, x2, y2, x3, y3 = butterfly(z, p, i, i + 1, i + 2, i + 3, lane)
            q2[p, depth, i, lane] = (m0 + x0) * (m0 + x0) + (m1 + y0) * (m1 + y0)
            q2[p, depth, i + 1, lane] = (m0 + x1) * (m0 + x1) + (m1 + y1) * (m1 + y1)
            q2[p, depth, i + 2, lane] = (m0 + x2) * (m0 + x2) + (m1 + y2) * (m1 + y2)
            q2[p, depth, i + 3, lane] = (m0 + x3) * (m0 + x3) + (m1 + y3) * (m1 + y3)


@ti.func
def add_power(
    p: int, c: int, begin: int, points: int, kind: ti.template(), law: ti.template(),
    weight: ti.template(), z: ti.template(), q2: ti.template(), settled: ti.template(),
):  # fmt: skip
    """Last pass of a transform of the third deviators of two depths, which then settle."""
    g = kind[c, 1]
    m0 = law[c, 0]
    m1 = law[c, 1]
    exponent = law[c, 4]
    for n in range(points // 4):
        i = (begin + 4 * n) & (ROWS - 3)
        for lane in range(LANES):
            x0, y0, x1, y1, x2, y2, x3, y3 = butterfly(z, p, i, i + 1, i + 2, i + 3, lane)
            z[p, i, 0, lane] = m0 + x0
            z[p, i, 1, lane] = m1 + y0
            z[p, i + 1, 0, lane] = m0 + x1
            z[p, i + 1, 1, lane] = m1 + y1
            z[p, i + 2, 0, lane] = m0 + x2
            z[p, i + 2, 1, lane] = m1 + y2
            z[p, i + 3, 0, lane] = m0 + x3
            z[p, i + 3, 1, lane] = m1 + y3
    for depth in range(2):
        scale = law[c, 2 + depth]
        if scale > 0.0:
            for row in range(begin, begin + points):
                i = row & ROWS
                for lane in range(LANES):
                    x = z[p, i, depth, lane]
                    value = strain_power(q2[p, depth, i, lane] + x * x, exponent)
                    settled[p, i, lane] = settled[p, i, lane] + weight[p, g, lane] * scale * value


@ti.func
def collect(
    p: int, t: int, n_modes: int, wave: ti.template(), band: ti.template(),
    settled: ti.template(), active: ti.template(), uniform: ti.template(), d: ti.template(),
):  # fmt: skip
    """Growth of the modes and uniform settlement from the transforms of the four quarters."""
    quarter = wave.shape[0] // 4
    e = 1.0 / wave.shape[0]
    for lane in range(LANES):
        total = 0.0
        for q in ti.static(range(4)):
            total = total + settled[p, q * quarter, lane]
        uniform[t, lane] = uniform[t, lane] + active[t, lane] * (e * total)
    for mode in range(n_modes):
        k = mode & ROWS
        n = band[0] + k
        i = (n % quarter) & ROWS
        m = ((quarter - i) % quarter) & ROWS
        c1 = wave[n, 0]
        s1 = wave[n, 1]
        c2 = wave[2 * n, 0]
        s2 = wave[2 * n, 1]
        c3 = wave[3 * n, 0]
        s3 = wave[3 * n, 1]
        for lane in range(LANES):
            # twice the transforms of the first quarter, x, and of the second, y; then the others
            ar = settled[p, i, lane]
            ai = settled[p, i + quarter, lane]
            br = settled[p, m, lane]
            bi = settled[p, m + quarter, lane]
            xr = ar + br
            xi = ai - bi
            yr = ai + bi
            yi = br - ar
            re = xr + (c1 * yr + s1 * yi)
            im = xi + (c1 * yi - s1 * yr)
            ar = settled[p, i + 2 * quarter, lane]
            ai = settled[p, i + 3 * quarter, lane]
            br = settled[p, m + 2 * quarter, lane]
            bi = settled[p, m + 3 * quarter, lane]
            xr = ar + br
            xi = ai - bi
            yr = ai + bi
            yi = br - ar
            re = re + (c2 * xr + s2 * xi) + (c3 * yr + s3 * yi)
            im = im + (c2 * xi - s2 * xr) + (c3 * yi - s3 * yr)
            d[t, k, 0, lane] = d[t, k, 0, lane] + e * re
            d[t, k, 1, lane] = d[t, k, 1, lane] + e * im
