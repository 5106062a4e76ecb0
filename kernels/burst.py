"""Realisations advanced passage by passage: a launch of updates on tiles of lanes, second-order form.

Coefficients are the same in every lane: those of the groups are added up once for every update, before
any tile needs them. Layout, vectorisation and precision as in the spectral module.
"""

from mcsettle.kernels.backend import ti
from mcsettle.kernels.spectral import ROWS, product, step_on
from mcsettle.kernels.varying import keep_half, raise_mean, spread


@ti.kernel
def burst(
    load: ti.types.ndarray(dtype=ti.i32, ndim=1),  # [N] form of each update, in order
    weight: ti.types.ndarray(dtype=ti.f64, ndim=3),  # [N, 1 + F, G] growth of the cycle functions
    form: ti.types.ndarray(dtype=ti.f64, ndim=4),  # [A, G, K + P + M, 2]
    constant: ti.types.ndarray(dtype=ti.f64, ndim=2),  # [A, G]
    mean: ti.types.ndarray(dtype=ti.f64, ndim=3),  # [A, G, K]
    joined: ti.types.ndarray(dtype=ti.i32, ndim=2),  # [J, 3]
    joined_start: ti.types.ndarray(dtype=ti.i32, ndim=2),  # [2 n_max, 3]
    single: ti.types.ndarray(dtype=ti.i32, ndim=2),  # [S, 2]
    single_start: ti.types.ndarray(dtype=ti.i32, ndim=2),  # [2 n_max, 3]
    following: ti.types.ndarray(dtype=ti.f64, ndim=1),  # [K] what the rail follows
    first: ti.i32,  # mode number of the band
    power_limit: ti.f64,  # 2 sd_limit²
    n_tiles: ti.i32,
    n_groups: ti.template(),
    varies: ti.template(),  # whether there are fields
    alike: ti.template(),  # one field, the same in all groups
    varying: ti.template(),
    state: ti.template(),
    c: ti.types.ndarray(ndim=2),  # [N (1 + F), 2 (K + P + M)] scratch: coefficients of each update
    on_average: ti.types.ndarray(dtype=ti.f64, ndim=2),  # [N (1 + F), 1 + K] scratch
):
    """Advance every active realisation by the given updates.

    ``weight`` of an update: of all groups, then of those that each field of susceptibility multiplies.
    A realisation whose Σ|U|² reaches ``power_limit`` stops there: its ``factor`` falls to 0 and
    ``passages`` keeps the count.
    """
    n_modes = following.shape[0]
    n_fields = weight.shape[1] - 1
    lanes = ti.static(state.v.shape[3])
    for row in range(load.shape[0] * weight.shape[1]):
        add_up(row, load, weight, form, constant, mean, n_groups, state, c, on_average)
    for tile in range(n_tiles):
        t = tile & (state.v.shape[0] - 1)
        state.d[t, 0, 0, 0] = state.v[t, 0, 0, 0]  # see the module's note on vectorisation
        re = ti.Vector.zero(state.d.dtype, lanes)
        im = ti.Vector.zero(state.d.dtype, lanes)
        total = ti.Vector.zero(ti.f64, lanes)  # sums of all modes: double in single precision, too
        force = ti.Vector.zero(state.d.dtype, lanes)
        raised = ti.Vector.zero(state.d.dtype, lanes)
        for step in range(load.shape[0]):
            row = step * (1 + n_fields)
            for lane in range(lanes):
                total[lane] = on_average[row, 0]
            for mode in range(n_modes):
                n = mode & ROWS
                begin_mode(t, row, n, c, on_average, state, total, re, im)
                add_terms(
                    t, row, first - 1 + n, n_modes, joined, joined_start, single, single_start, c,
                    state, re, im,
                )  # fmt: skip
                for lane in range(lanes):
                    state.d[t, n, 0, lane] = re[lane]
                    state.d[t, n, 1, lane] = im[lane]
            settle_uniformly(t, total, state)
            if ti.static(varies):
                for f in range(n_fields):
                    common_half(
                        t, row + 1 + f, first, n_modes, joined, joined_start, single, single_start,
                        c, on_average, alike, varying, state, total, re, im,
                    )  # fmt: skip
                    for lane in range(lanes):
                        force[lane] = ti.cast(total[lane], state.d.dtype)
                    for i in range(n_modes):
                        spread(t, f, i, first, n_modes, varying, force, re, im)
                        for lane in range(lanes):
                            state.d[t, i, 0, lane] = state.d[t, i, 0, lane] + re[lane]
                            state.d[t, i, 1, lane] = state.d[t, i, 1, lane] + im[lane]
                    raise_mean(t, f, varying, raised)
                    settle_uniformly(t, raised, state)
            step_on(t, n_modes, power_limit, following, state)
            if ti.static(state.v.dtype != state.u.dtype):
                take_copy(t, n_modes, state)


@ti.func
def add_up(
    row: int, load: ti.template(), weight: ti.template(), form: ti.template(),
    constant: ti.template(), mean: ti.template(), n_groups: ti.template(), state: ti.template(),
    c: ti.template(), on_average: ti.template(),
):  # fmt: skip
    """Add up the coefficients of the groups, those of row ``row`` of the weights of all updates."""
    step = row // weight.shape[1]
    part = row % weight.shape[1]
    a = load[step]
    w = ti.Vector([weight[step, part, g] for g in ti.static(range(n_groups))])
    for i in range(form.shape[2]):
        re = 0.0
        im = 0.0
        for g in ti.static(range(n_groups)):
            re = re + w[g] * form[a, g, i, 0]
            im = im + w[g] * form[a, g, i, 1]
        c[row, 2 * i] = ti.cast(re, state.d.dtype)
        c[row, 2 * i + 1] = ti.cast(im, state.d.dtype)
    whole = 0.0
    for g in ti.static(range(n_groups)):
        whole = whole + w[g] * constant[a, g]
    on_average[row, 0] = whole
    for k in range(mean.shape[2]):
        of_mode = 0.0
        for g in ti.static(range(n_groups)):
            of_mode = of_mode + w[g] * mean[a, g, k]
        on_average[row, 1 + k] = of_mode


@ti.func
def take_copy(t: int, n_modes: int, state: ti.template()):
    """Single precision computes the next growth from a copy."""
    for k in range(n_modes):
        for lane in range(state.v.shape[3]):
            state.v[t, k, 0, lane] = ti.cast(state.u[t, k, 0, lane], state.v.dtype)
            state.v[t, k, 1, lane] = ti.cast(state.u[t, k, 1, lane], state.v.dtype)


@ti.func
def begin_mode(
    t: int, row: int, n: int, c: ti.template(), on_average: ti.template(), state: ti.template(),
    total: ti.template(), re: ti.template(), im: ti.template(),
):  # fmt: skip
    """The linear part of what settles at mode n; ``total`` gains what the mode adds to the average."""
    a = c[row, 2 * n]
    b = c[row, 2 * n + 1]
    g = on_average[row, 1 + n]
    for lane in range(state.v.shape[3]):
        x = state.v[t, n, 0, lane]
        y = state.v[t, n, 1, lane]
        re[lane] = a * x - b * y
        im[lane] = a * y + b * x
        total[lane] = total[lane] + g * (x * x + y * y)


@ti.func
def add_terms(
    t: int, row: int, wave: int, n_modes: int, joined: ti.template(), joined_start: ti.template(),
    single: ti.template(), single_start: ti.template(), c: ti.template(), state: ti.template(),
    re: ti.template(), im: ti.template(),
):  # fmt: skip
    """Add the products of pairs of modes that settle at mode number ``wave`` + 1."""
    v = ti.static(state.v)
    middle = joined_start[wave, 1]
    for p in range(joined_start[wave, 0], middle):
        add_joined(t, row, n_modes, p, joined, c, False, v, re, im)
    for p in range(middle, joined_start[wave, 2]):
        add_joined(t, row, n_modes, p, joined, c, True, v, re, im)
    q = n_modes + 2 * joined.shape[0]
    middle = single_start[wave, 1]
    for p in range(single_start[wave, 0], middle):
        add_single_pair(t, row, q, p, single, c, False, v, re, im)
    for p in range(middle, single_start[wave, 2]):
        add_single_pair(t, row, q, p, single, c, True, v, re, im)


@ti.func
def add_joined(
    t: int, row: int, n_modes: int, p: int, joined: ti.template(), c: ti.template(),
    conjugate: ti.template(), v: ti.template(), re: ti.template(), im: ti.template(),
):  # fmt: skip
    """Add two products that share a mode (mcsettle.step_b.mode_pairs), one coefficient for all lanes."""
    shared = joined[p, 0] & ROWS
    i = joined[p, 1] & ROWS
    j = joined[p, 2] & ROWS
    at = 2 * n_modes + 4 * p
    a0 = c[row, at]
    a1 = c[row, at + 1]
    b0 = c[row, at + 2]
    b1 = c[row, at + 3]
    for lane in range(v.shape[3]):
        qr, qi = times(a0, a1, t, i, lane, conjugate, v)
        rr, ri = times(b0, b1, t, j, lane, False, v)
        x = v[t, shared, 0, lane]
        y = v[t, shared, 1, lane]
        re[lane] = re[lane] + (x * (qr + rr) - y * (qi - ri))
        im[lane] = im[lane] + (x * (qi + ri) + y * (qr - rr))


@ti.func
def times(
    a: ti.template(), b: ti.template(), t: int, i: int, lane: int, conjugate: ti.template(),
    s: ti.template(),
):  # fmt: skip
    """(a + ib) U_i of a lane, or of U*_i."""
    x = s[t, i, 0, lane]
    y = s[t, i, 1, lane]
    re = a * x - b * y
    im = a * y + b * x
    if ti.static(conjugate):
        re = a * x + b * y
        im = b * x - a * y
    return re, im


@ti.func
def add_single_pair(
    t: int, row: int, q: int, p: int, single: ti.template(), c: ti.template(),
    conjugate: ti.template(), v: ti.template(), re: ti.template(), im: ti.template(),
):  # fmt: skip
    """Add a product of two modes, its coefficient the same in every lane."""
    i = single[p, 0] & ROWS
    j = single[p, 1] & ROWS
    a = c[row, 2 * (q + p)]
    b = c[row, 2 * (q + p) + 1]
    for lane in range(v.shape[3]):
        x, y = product(t, i, j, lane, conjugate, v)
        re[lane] = re[lane] + (a * x - b * y)
        im[lane] = im[lane] + (a * y + b * x)


@ti.func
def settle_uniformly(t: int, amount: ti.template(), state: ti.template()):
    """Add what settles on average."""
    for lane in range(state.v.shape[3]):
        state.uniform[t, lane] = state.uniform[t, lane] + state.factor[t, lane] * amount[lane]


@ti.func
def common_half(
    t: int, row: int, first: int, n_modes: int, joined: ti.template(),
    joined_start: ti.template(), single: ti.template(), single_start: ti.template(),
    c: ti.template(), on_average: ti.template(), alike: ti.template(), varying: ti.template(),
    state: ti.template(), total: ti.template(), re: ti.template(), im: ti.template(),
):  # fmt: skip
    """Half of what settles under the groups of a field, wave by wave, and on average."""
    lanes = ti.static(state.v.shape[3])
    for lane in range(lanes):
        total[lane] = on_average[row, 0]
    for mode in range(n_modes):
        n = mode & ROWS
        begin_mode(t, row, n, c, on_average, state, total, re, im)
        if ti.static(alike):  # the growth itself
            for lane in range(lanes):
                re[lane] = state.d[t, n, 0, lane]
                im[lane] = state.d[t, n, 1, lane]
        else:
            add_terms(
                t, row, first - 1 + n, n_modes, joined, joined_start, single, single_start, c,
                state, re, im,
            )  # fmt: skip
        keep_half(t, first - 1 + n, varying, re, im)
    for wave in range(joined_start.shape[0]):
        if wave < first - 1 or wave >= first - 1 + n_modes:
            for lane in range(lanes):
                re[lane] = 0.0
                im[lane] = 0.0
            add_terms(
                t, row, wave, n_modes, joined, joined_start, single, single_start, c, state, re, im
            )
            keep_half(t, wave, varying, re, im)
