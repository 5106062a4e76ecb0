"""Fourier transforms over x of tiles of realisations, the realisation in the lane.

Scratch field [worker, row, lane]: each quarter of the points has its rows, the imaginary parts have
theirs ``im`` further on; of a real field two quarters make a complex one. Backward transforms (modes to
x) decimate in frequency and leave x in digit-reversed order; forward ones decimate in time and take it
in that order: nothing is ever reordered. The first and last passes of a transform over N points have
radix 4 and belong to the caller; those between are here.

The number of points and hence every distance between the points of a butterfly is known when the
kernel is compiled: points of one field at known distances cannot overlap, and the compiler need not
check it before every loop over lanes. Rows are masked with POINTS, which changes none of them: it tells
the compiler that no index overflows, without which it works out every address anew.
"""

from mcsettle.kernels.backend import ti

POINTS = 0x3FFFF  # mask of rows
LARGEST = 28000  # points


def radices(n_points: int) -> tuple[int, ...]:
    """Radices of the passes between the first and the last (both 4), for N = 16 · 2^a · 3^b."""
    rest, found = n_points // 16, []
    for radix in (4, 2, 3):
        while rest % radix == 0:
            found.append(radix)
            rest //= radix
    if n_points % 16 or rest != 1 or n_points > LARGEST:
        raise ValueError(f"{n_points} points; the transform takes 16 · 2^a · 3^b ≤ {LARGEST}")
    return tuple(found)


def stages(n_points: int) -> list[tuple[int, int]]:
    """(radix, distance within a butterfly) of the passes between the first and the last."""
    found, points = [], n_points // 4
    for radix in radices(n_points):
        points //= radix
        found.append((radix, points))
    return found


@ti.func
def butterfly(z: ti.template(), p: int, a: int, hop: ti.template(), im: ti.template(), lane: int):
    """Radix-4 butterfly backwards of points a, a + hop, …: real and imaginary parts in turn."""
    r0 = z[p, a, lane] + z[p, a + 2 * hop, lane]
    r1 = z[p, a, lane] - z[p, a + 2 * hop, lane]
    r2 = z[p, a + hop, lane] + z[p, a + 3 * hop, lane]
    r3 = z[p, a + hop, lane] - z[p, a + 3 * hop, lane]
    i0 = z[p, a + im, lane] + z[p, a + 2 * hop + im, lane]
    i1 = z[p, a + im, lane] - z[p, a + 2 * hop + im, lane]
    i2 = z[p, a + hop + im, lane] + z[p, a + 3 * hop + im, lane]
    i3 = z[p, a + hop + im, lane] - z[p, a + 3 * hop + im, lane]
    return r0 + r2, i0 + i2, r1 - i3, i1 + r3, r0 - r2, i0 - i2, r1 + i3, i1 - r3


@ti.func
def twiddle(wave: ti.template(), n: int, z: ti.template()):
    """Cosine and sine of 2π n / N in the precision of z."""
    return ti.cast(wave[n, 0], z.dtype), ti.cast(wave[n, 1], z.dtype)


@ti.func
def put_turned(
    z: ti.template(), p: int, row: ti.template(), im: ti.template(), lane: int,
    c: ti.template(), s: ti.template(), x: ti.template(), y: ti.template(),
):  # fmt: skip
    """Store (c + i s) (x + i y) in ``row``, the imaginary part ``im`` rows further on."""
    z[p, row, lane] = c * x - s * y
    z[p, row + im, lane] = c * y + s * x


@ti.func
def turned_back(c: ti.template(), s: ti.template(), x: ti.template(), y: ti.template()):
    """Real and imaginary part of (c − i s) (x + i y)."""
    return c * x + s * y, c * y - s * x


@ti.func
def back_4(
    z: ti.template(), p: int, a: int, hop: ti.template(), im: ti.template(),
    unit_n: int, wave: ti.template(),
):  # fmt: skip
    """Radix-4 butterfly backwards in place on a, a + hop, …, then twiddles."""
    c1, s1 = twiddle(wave, unit_n, z)
    c2, s2 = twiddle(wave, 2 * unit_n, z)
    c3, s3 = twiddle(wave, 3 * unit_n, z)
    for lane in range(z.shape[2]):
        wr, wi, xr, xi, yr, yi, vr, vi = butterfly(z, p, a, hop, im, lane)
        z[p, a, lane] = wr
        z[p, a + im, lane] = wi
        put_turned(z, p, a + hop, im, lane, c1, s1, xr, xi)
        put_turned(z, p, a + 2 * hop, im, lane, c2, s2, yr, yi)
        put_turned(z, p, a + 3 * hop, im, lane, c3, s3, vr, vi)


@ti.func
def back_2(
    z: ti.template(), p: int, a: int, hop: ti.template(), im: ti.template(),
    unit_n: int, wave: ti.template(),
):  # fmt: skip
    """Radix-2 butterfly backwards, as ``back_4``."""
    c1, s1 = twiddle(wave, unit_n, z)
    for lane in range(z.shape[2]):
        ar = z[p, a, lane]
        ai = z[p, a + im, lane]
        br = z[p, a + hop, lane]
        bi = z[p, a + hop + im, lane]
        xr = ar - br
        xi = ai - bi
        z[p, a, lane] = ar + br
        z[p, a + im, lane] = ai + bi
        put_turned(z, p, a + hop, im, lane, c1, s1, xr, xi)


@ti.func
def back_3(
    z: ti.template(), p: int, a: int, hop: ti.template(), im: ti.template(),
    unit_n: int, wave: ti.template(),
):  # fmt: skip
    """Radix-3 butterfly backwards, as ``back_4``."""
    c1, s1 = twiddle(wave, unit_n, z)
    c2, s2 = twiddle(wave, 2 * unit_n, z)
    half = ti.cast(0.5, z.dtype)
    h = ti.cast(ti.sqrt(0.75), z.dtype)
    for lane in range(z.shape[2]):
        ar = z[p, a, lane]
        ai = z[p, a + im, lane]
        br = z[p, a + hop, lane] + z[p, a + 2 * hop, lane]
        bi = z[p, a + hop + im, lane] + z[p, a + 2 * hop + im, lane]
        dr = h * (z[p, a + hop, lane] - z[p, a + 2 * hop, lane])
        di = h * (z[p, a + hop + im, lane] - z[p, a + 2 * hop + im, lane])
        er = ar - half * br
        ei = ai - half * bi
        xr = er - di
        xi = ei + dr
        yr = er + di
        yi = ei - dr
        z[p, a, lane] = ar + br
        z[p, a + im, lane] = ai + bi
        put_turned(z, p, a + hop, im, lane, c1, s1, xr, xi)
        put_turned(z, p, a + 2 * hop, im, lane, c2, s2, yr, yi)


@ti.func
def pass_back(
    z: ti.template(), p: int, begin: int, r: ti.template(), hop: ti.template(), im: ti.template(),
    n_points: ti.template(), wave: ti.template(),
):  # fmt: skip
    """One pass of radix r backwards over the ``r hop`` points from row ``begin``."""
    for n in range(hop):
        a = (begin + n) & POINTS
        if ti.static(r == 4):
            back_4(z, p, a, hop, im, n_points // (r * hop) * n, wave)
        elif ti.static(r == 2):
            back_2(z, p, a, hop, im, n_points // (r * hop) * n, wave)
        else:
            back_3(z, p, a, hop, im, n_points // (r * hop) * n, wave)


@ti.func
def forth_4(
    f: ti.template(), p: int, i: int, hop: ti.template(), q: ti.template(),
    unit_n: int, wave: ti.template(),
):  # fmt: skip
    """Radix-4 butterfly forwards in place: real parts at i, imaginary at i + q, twiddles first."""
    c1, s1 = twiddle(wave, unit_n, f)
    c2, s2 = twiddle(wave, 2 * unit_n, f)
    c3, s3 = twiddle(wave, 3 * unit_n, f)
    for lane in range(f.shape[2]):
        ar = f[p, i, lane]
        ai = f[p, i + q, lane]
        br, bi = turned_back(c1, s1, f[p, i + hop, lane], f[p, i + hop + q, lane])
        cr, ci = turned_back(c2, s2, f[p, i + 2 * hop, lane], f[p, i + 2 * hop + q, lane])
        dr, di = turned_back(c3, s3, f[p, i + 3 * hop, lane], f[p, i + 3 * hop + q, lane])
        f[p, i, lane] = (ar + cr) + (br + dr)
        f[p, i + q, lane] = (ai + ci) + (bi + di)
        f[p, i + hop, lane] = (ar - cr) + (bi - di)
        f[p, i + hop + q, lane] = (ai - ci) - (br - dr)
        f[p, i + 2 * hop, lane] = (ar + cr) - (br + dr)
        f[p, i + 2 * hop + q, lane] = (ai + ci) - (bi + di)
        f[p, i + 3 * hop, lane] = (ar - cr) - (bi - di)
        f[p, i + 3 * hop + q, lane] = (ai - ci) + (br - dr)


@ti.func
def forth_2(
    f: ti.template(), p: int, i: int, hop: ti.template(), q: ti.template(),
    unit_n: int, wave: ti.template(),
):  # fmt: skip
    """Radix-2 butterfly forwards, as ``forth_4``."""
    c1, s1 = twiddle(wave, unit_n, f)
    for lane in range(f.shape[2]):
        ar = f[p, i, lane]
        ai = f[p, i + q, lane]
        br, bi = turned_back(c1, s1, f[p, i + hop, lane], f[p, i + hop + q, lane])
        f[p, i, lane] = ar + br
        f[p, i + q, lane] = ai + bi
        f[p, i + hop, lane] = ar - br
        f[p, i + hop + q, lane] = ai - bi


@ti.func
def forth_3(
    f: ti.template(), p: int, i: int, hop: ti.template(), q: ti.template(),
    unit_n: int, wave: ti.template(),
):  # fmt: skip
    """Radix-3 butterfly forwards, as ``forth_4``."""
    c1, s1 = twiddle(wave, unit_n, f)
    c2, s2 = twiddle(wave, 2 * unit_n, f)
    half = ti.cast(0.5, f.dtype)
    h = ti.cast(ti.sqrt(0.75), f.dtype)
    for lane in range(f.shape[2]):
        ar = f[p, i, lane]
        ai = f[p, i + q, lane]
        br, bi = turned_back(c1, s1, f[p, i + hop, lane], f[p, i + hop + q, lane])
        cr, ci = turned_back(c2, s2, f[p, i + 2 * hop, lane], f[p, i + 2 * hop + q, lane])
        xr = ar - half * (br + cr)
        xi = ai - half * (bi + ci)
        yr = h * (bi - ci)
        yi = h * (cr - br)
        f[p, i, lane] = ar + (br + cr)
        f[p, i + q, lane] = ai + (bi + ci)
        f[p, i + hop, lane] = xr + yr
        f[p, i + hop + q, lane] = xi + yi
        f[p, i + 2 * hop, lane] = xr - yr
        f[p, i + 2 * hop + q, lane] = xi - yi


@ti.func
def forwards(
    f: ti.template(), p: int, begin: ti.template(), q: ti.template(), n_points: ti.template(),
    wave: ti.template(),
):  # fmt: skip
    """Forward transforms of quarters 0 + i 1 and 2 + i 3, q rows apart: every pass but the last."""
    for r, hop in ti.static(forward_stages(n_points)):
        for b in range(n_points // (4 * r * hop)):
            for n in range(hop):
                for half in range(2):
                    i = (begin + half * (2 * q) + b * (r * hop) + n) & POINTS
                    unit_n = n_points // (r * hop) * n
                    if ti.static(r == 4):
                        forth_4(f, p, i, hop, q, unit_n, wave)
                    elif ti.static(r == 2):
                        forth_2(f, p, i, hop, q, unit_n, wave)
                    else:
                        forth_3(f, p, i, hop, q, unit_n, wave)


def forward_stages(n_points: int) -> list[tuple[int, int]]:
    """(radix, distance) of the forward passes: those of ``stages`` backwards, radix 4 first."""
    return [(4, 1), *reversed(stages(n_points))]
