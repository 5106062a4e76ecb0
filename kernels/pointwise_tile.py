"""What the pointwise kernel does with a tile of lanes: modes to stress, to settlement and back.

Arguments throughout: worker ``p``, tile ``t``, transform ``c`` or axle ``j``; ``n_points`` N of the grid,
known to the compiler; scratch rows ``w`` [worker, row, lane]; the tables and fields of
``mcsettle.kernels.pointwise.burst``.
"""

from mcsettle.kernels.backend import bundle, ti
from mcsettle.kernels.fourier import (
    POINTS,
    back_4,
    butterfly,
    pass_back,
    put_turned,
    stages,
    twiddle,
)
from mcsettle.kernels.laws import (
    binary_logarithm,
    binary_logarithm_32,
    power_of_two,
    power_of_two_32,
)
from mcsettle.kernels.spectral import ROWS

GROUPS = 64  # settlement groups at most: layers, or depths
PAD = 9  # rows between quarters: powers of two would put them all into the same lines of the cache


@bundle
class Rows:
    """Where the scratch rows of a grid of N points begin: one field at known distances (``fourier``).

    ``q`` rows from one quarter of the points to the next; a transform has its real parts at 0 and its
    imaginary ones at ``im``. ``settled`` and ``squared``: settlement and σ_d² of two depths at every
    point. Amplitudes by mode number: ``up`` U_n at row n, ``down`` at row N/2 − n, ``grown`` their
    growth at n, imaginary parts ``half`` further on. ``weights`` of the groups, then ``picked`` ones;
    ``gathered`` what has settled in the parts that are done; ``count`` in all.
    """

    points: int
    q: int
    im: int
    settled: int
    squared: tuple[int, int]
    half: int
    up: int
    down: int
    grown: int
    weights: int
    picked: int
    gathered: int
    count: int


def rows_of(points: int, varies: bool = False) -> Rows:
    """The scratch rows of a grid of N points; with ``gathered`` ones where the support varies."""
    q, half = points // 4 + PAD, points // 2 + PAD
    im = 4 * q + PAD
    up = 5 * im
    weights = up + 6 * half
    picked = weights + GROUPS
    return Rows(
        points=points,
        q=q,
        im=im,
        settled=2 * im,
        squared=(3 * im, 4 * im),
        half=half,
        up=up,
        down=up + 2 * half,
        grown=up + 4 * half,
        weights=weights,
        picked=picked,
        gathered=picked + 2,
        count=picked + 2 + (im if varies else 0),
    )


@ti.func
def clear_rows(p: int, begin: ti.template(), end: ti.template(), w: ti.template()):
    """Zero the rows from ``begin`` to ``end``."""
    for row in range(begin, end):
        i = row & POINTS
        for lane in range(w.shape[2]):
            w[p, i, lane] = 0.0


@ti.func
def put_one(p: int, row: ti.template(), w: ti.template()):
    """One in every lane of ``row``."""
    for lane in range(w.shape[2]):
        w[p, row, lane] = 1.0


@ti.func
def take_up(
    p: int, t: int, rows: ti.template(), n_modes: int, first: int,
    u: ti.template(), w: ti.template(),
):  # fmt: skip
    """Copy the amplitudes of the tile to its rows, up and down."""
    for mode in range(n_modes):
        k = mode & ROWS
        n = (first + mode) & ROWS
        up = (rows.up + n) & POINTS
        down = (rows.down + rows.points // 2 - n) & POINTS
        for lane in range(w.shape[2]):
            w[p, up, lane] = ti.cast(u[t, k, 0, lane], w.dtype)
        for lane in range(w.shape[2]):
            w[p, up + rows.half, lane] = ti.cast(u[t, k, 1, lane], w.dtype)
        for lane in range(w.shape[2]):
            w[p, down, lane] = w[p, up, lane]
            w[p, down + rows.half, lane] = w[p, up + rows.half, lane]


@ti.func
def weigh(
    p: int, t: int, j: int, step: int, n_groups: int, growth: ti.template(),
    constant: ti.template(), rows: ti.template(), scratch: ti.template(), state: ti.template(),
):  # fmt: skip
    """Weights of the groups in this passage, and what settles whatever the profile."""
    w, weights = ti.static(scratch.w, rows.weights)
    for group in range(n_groups):
        g = group & (GROUPS - 1)
        every = growth[step, g]
        c = constant[j, g]
        for lane in range(w.shape[2]):
            mine = every * scratch.own[t, g, lane]
            w[p, weights + g, lane] = ti.cast(mine, w.dtype)
            state.uniform[t, lane] = state.uniform[t, lane] + state.factor[t, lane] * (mine * c)


@ti.func
def pick_weights(p: int, a: int, b: int, factor: float, rows: ti.template(), w: ti.template()):
    """Copy the weights of groups a and b, times ``factor``, to rows of known place."""
    f = ti.cast(factor, w.dtype)
    for lane in range(w.shape[2]):
        w[p, rows.picked, lane] = f * w[p, rows.weights + (a & (GROUPS - 1)), lane]
    for lane in range(w.shape[2]):
        w[p, rows.picked + 1, lane] = f * w[p, rows.weights + (b & (GROUPS - 1)), lane]


@ti.func
def add_linear(
    p: int, rows: ti.template(), j: int, first: int, linear: ti.template(), w: ti.template()
):
    """Growth that is linear in the profile and needs no grid (exponent 2)."""
    up, to, h = ti.static(rows.up, rows.grown, rows.half)
    for g in range(linear.shape[1]):
        pick_weights(p, g, g, 1.0, rows, w)
        for n in range(rows.points // 2):
            mode = n - first
            if 0 <= mode and mode < linear.shape[2]:
                a = ti.cast(linear[j, g, mode, 0], w.dtype)
                b = ti.cast(linear[j, g, mode, 1], w.dtype)
                for lane in range(w.shape[2]):
                    x = w[p, n + up, lane]
                    y = w[p, n + up + h, lane]
                    weight = w[p, rows.picked, lane]
                    w[p, n + to, lane] = w[p, n + to, lane] + weight * (a * x - b * y)
                    w[p, n + to + h, lane] = w[p, n + to + h, lane] + weight * (a * y + b * x)


@ti.func
def first_pass(
    p: int, c: int, rows: ti.template(), response: ti.template(),
    wave: ti.template(), band: ti.template(), w: ti.template(),
):  # fmt: skip
    """Coefficients of two fields and the first pass of their transform, modes to x.

    Most butterflies take two modes at most: n and, N/4 before the end, the conjugate of N/4 − n.
    """
    for n in range(rows.points // 4):
        if band[1] <= n and n < band[2]:
            few_modes(p, c, n, rows, response, wave, w)
        else:
            many_modes(p, c, n, rows, response, wave, w)


@ti.func
def few_modes(
    p: int, c: int, n: int, rows: ti.template(), response: ti.template(),
    wave: ti.template(), w: ti.template(),
):  # fmt: skip
    """Butterfly n of the first pass where it takes two modes at most."""
    q, im, h = ti.static(rows.q, rows.im, rows.half)
    up, down = ti.static(rows.up, rows.down + rows.points // 4)
    c1, s1 = twiddle(wave, n, w)
    c2, s2 = twiddle(wave, 2 * n, w)
    c3, s3 = twiddle(wave, 3 * n, w)
    ga = ti.cast(response[c, n, 0], w.dtype)
    gb = ti.cast(response[c, n, 1], w.dtype)
    ha = ti.cast(response[c, n + rows.points // 4, 2], w.dtype)
    hb = ti.cast(response[c, n + rows.points // 4, 3], w.dtype)
    i = n
    for lane in range(w.shape[2]):
        ar = ga * w[p, i + up, lane] - gb * w[p, i + up + h, lane]
        ai = ga * w[p, i + up + h, lane] + gb * w[p, i + up, lane]
        br = ha * w[p, i + down, lane] - hb * w[p, i + down + h, lane]
        bi = -(ha * w[p, i + down + h, lane] + hb * w[p, i + down, lane])
        xr = ar + bi
        xi = ai - br
        yr = ar - br
        yi = ai - bi
        vr = ar - bi
        vi = ai + br
        w[p, i, lane] = ar + br
        w[p, i + im, lane] = ai + bi
        put_turned(w, p, i + q, im, lane, c1, s1, xr, xi)
        put_turned(w, p, i + 2 * q, im, lane, c2, s2, yr, yi)
        put_turned(w, p, i + 3 * q, im, lane, c3, s3, vr, vi)


@ti.func
def many_modes(
    p: int, c: int, n: int, rows: ti.template(), response: ti.template(),
    wave: ti.template(), w: ti.template(),
):  # fmt: skip
    """Butterfly n of the first pass with all four of its coefficients."""
    q, im, h = ti.static(rows.q, rows.im, rows.half)
    quarter = ti.static(rows.points // 4)
    i = n
    for part in ti.static(range(2)):
        a = ti.cast(response[c, n + part * quarter, 0], w.dtype)
        b = ti.cast(response[c, n + part * quarter, 1], w.dtype)
        e = ti.cast(response[c, n + part * quarter, 2], w.dtype)
        f = ti.cast(response[c, n + part * quarter, 3], w.dtype)
        up = ti.static(rows.up + part * quarter)
        down = ti.static(rows.down + part * quarter)
        for lane in range(w.shape[2]):
            x = w[p, i + up, lane]
            y = w[p, i + up + h, lane]
            v = w[p, i + down, lane]
            z = w[p, i + down + h, lane]
            put_turned(w, p, i + part * q, im, lane, a, b, x, y)
            w[p, i + (2 + part) * q, lane] = e * v - f * z
            w[p, i + (2 + part) * q + im, lane] = -(e * z + f * v)
    back_4(w, p, i, q, im, n, wave)


@ti.func
def inner_passes(p: int, begin: int, rows: ti.template(), wave: ti.template(), w: ti.template()):
    """The passes of a transform between its first and its last: a quarter of the points."""
    for r, hop in ti.static(stages(rows.points)):
        for b in range(rows.points // 4 // (r * hop)):
            pass_back(w, p, begin + b * (r * hop), r, hop, rows.im, rows.points, wave)


@ti.func
def add_two(p: int, begin: int, squares: ti.template(), rows: ti.template(), w: ti.template()):
    """Last pass of a transform whose two fields settle as they are, or as their ``squares``: a quarter
    of the points.
    """
    s = ti.static(rows.settled)
    weights = ti.static(rows.picked)
    for n in range(rows.points // 16):
        i = (begin + 4 * n) & POINTS
        for lane in range(w.shape[2]):
            x0, y0, x1, y1, x2, y2, x3, y3 = butterfly(w, p, i, 1, rows.im, lane)
            if ti.static(squares):
                x0, y0, x1, y1 = x0 * x0, y0 * y0, x1 * x1, y1 * y1
                x2, y2, x3, y3 = x2 * x2, y2 * y2, x3 * x3, y3 * y3
            wa = w[p, weights, lane]
            wb = w[p, weights + 1, lane]
            w[p, i + s, lane] = w[p, i + s, lane] + (wa * x0 + wb * y0)
            w[p, i + s + 1, lane] = w[p, i + s + 1, lane] + (wa * x1 + wb * y1)
            w[p, i + s + 2, lane] = w[p, i + s + 2, lane] + (wa * x2 + wb * y2)
            w[p, i + s + 3, lane] = w[p, i + s + 3, lane] + (wa * x3 + wb * y3)


@ti.func
def begin_power(p: int, begin: int, rows: ti.template(), depth: ti.template(), w: ti.template()):
    """Last pass of a transform of two deviators of one depth: begin its σ_d²."""
    s = ti.static(rows.squared[depth])
    for n in range(rows.points // 16):
        i = (begin + 4 * n) & POINTS
        for lane in range(w.shape[2]):
            x0, y0, x1, y1, x2, y2, x3, y3 = butterfly(w, p, i, 1, rows.im, lane)
            w[p, i + s, lane] = x0 * x0 + y0 * y0
            w[p, i + s + 1, lane] = x1 * x1 + y1 * y1
            w[p, i + s + 2, lane] = x2 * x2 + y2 * y2
            w[p, i + s + 3, lane] = x3 * x3 + y3 * y3


@ti.func
def add_power(p: int, begin: int, m: float, rows: ti.template(), w: ti.template()):
    """Last pass of a transform of the third deviators of two depths, which then settle."""
    im, s = ti.static(rows.im, rows.settled)
    s0, s1 = ti.static(rows.squared[0], rows.squared[1])
    weights = ti.static(rows.picked)
    for n in range(rows.points // 16):
        i = (begin + 4 * n) & POINTS
        for lane in range(w.shape[2]):
            x0, y0, x1, y1, x2, y2, x3, y3 = butterfly(w, p, i, 1, rows.im, lane)
            w[p, i, lane] = x0
            w[p, i + im, lane] = y0
            w[p, i + 1, lane] = x1
            w[p, i + 1 + im, lane] = y1
            w[p, i + 2, lane] = x2
            w[p, i + 2 + im, lane] = y2
            w[p, i + 3, lane] = x3
            w[p, i + 3 + im, lane] = y3
    half = ti.cast(0.5 * m, w.dtype)
    single = ti.static(w.dtype == ti.f32)
    logarithm = ti.static(binary_logarithm_32 if single else binary_logarithm)
    power = ti.static(power_of_two_32 if single else power_of_two)
    for n in range(rows.points // 4):
        i = (begin + n) & POINTS
        for lane in range(w.shape[2]):
            x = w[p, i, lane]
            y = w[p, i + im, lane]
            a = w[p, i + s0, lane] + x * x
            b = w[p, i + s1, lane] + y * y
            w[p, i + s0, lane] = half * logarithm(a)
            w[p, i + s1, lane] = half * logarithm(b)
        for lane in range(w.shape[2]):
            a = power(w[p, i + s0, lane])
            b = power(w[p, i + s1, lane])
            w[p, i + s, lane] = w[p, i + s, lane] + w[p, weights, lane] * (a + b)


@ti.func
def collect(
    p: int, t: int, rows: ti.template(), n_modes: int, first: int,
    wave: ti.template(), state: ti.template(), w: ti.template(),
):  # fmt: skip
    """Growth of the modes and uniform settlement from the transforms of the four quarters."""
    q, s, quarter = ti.static(rows.q, rows.settled, rows.points // 4)
    e = ti.cast(1.0 / rows.points, w.dtype)
    for lane in range(w.shape[2]):
        total = (w[p, s, lane] + w[p, s + q, lane]) + (
            w[p, s + 2 * q, lane] + w[p, s + 3 * q, lane]
        )
        state.uniform[t, lane] = state.uniform[t, lane] + state.factor[t, lane] * (e * total)
    for mode in range(n_modes):
        n = first + mode
        to = (rows.grown + n) & POINTS
        i = (s + n % quarter) & POINTS
        m = (s + (quarter - n % quarter) % quarter) & POINTS
        c1, s1 = twiddle(wave, n, w)
        c2, s2 = twiddle(wave, 2 * n, w)
        c3, s3 = twiddle(wave, 3 * n, w)
        for lane in range(w.shape[2]):
            # twice the transforms of the first quarter, x, and of the second, y; then the others
            ar = w[p, i, lane]
            ai = w[p, i + q, lane]
            br = w[p, m, lane]
            bi = w[p, m + q, lane]
            xr = ar + br
            xi = ai - bi
            yr = ai + bi
            yi = br - ar
            re = xr + (c1 * yr + s1 * yi)
            im = xi + (c1 * yi - s1 * yr)
            ar = w[p, i + 2 * q, lane]
            ai = w[p, i + 3 * q, lane]
            br = w[p, m + 2 * q, lane]
            bi = w[p, m + 3 * q, lane]
            xr = ar + br
            xi = ai - bi
            yr = ai + bi
            yi = br - ar
            re = re + (c2 * xr + s2 * xi) + (c3 * yr + s3 * yi)
            im = im + (c2 * xi - s2 * xr) + (c3 * yi - s3 * yr)
            w[p, to, lane] = w[p, to, lane] + e * re
            w[p, to + rows.half, lane] = w[p, to + rows.half, lane] + e * im


@ti.func
def give_back(
    p: int, t: int, rows: ti.template(), n_modes: int, first: int,
    d: ti.template(), w: ti.template(),
):  # fmt: skip
    """Copy the growth of a tile to its lanes."""
    for mode in range(n_modes):
        k = mode & ROWS
        i = (rows.grown + ((first + mode) & ROWS)) & POINTS
        for lane in range(w.shape[2]):
            d[t, k, 0, lane] = ti.cast(w[p, i, lane], d.dtype)
        for lane in range(w.shape[2]):
            d[t, k, 1, lane] = ti.cast(w[p, i + rows.half, lane], d.dtype)
