"""Realisations advanced passage by passage: a launch of updates on tiles of lanes, second-order form.

Coefficients are the same in every lane; layout, vectorisation and precision as in the spectral module.
"""

from mcsettle.kernels.backend import ti
from mcsettle.kernels.spectral import ROWS, product, step_on
from mcsettle.kernels.varying import keep_half, raise_mean, spread


@ti.kernel
def burst(
    axle: ti.types.ndarray(dtype=ti.i32, ndim=1),  # [N] form of each passage, in order
    weight: ti.types.ndarray(dtype=ti.f64, ndim=2),  # [N, G] growth of the cycle functions
    form: ti.types.ndarray(dtype=ti.f64, ndim=4),  # [A, G, K + P + M, 2]
    constant: ti.types.ndarray(dtype=ti.f64, ndim=2),  # [A, G]
    mean: ti.types.ndarray(dtype=ti.f64, ndim=3),  # [A, G, K]
    sums: ti.types.ndarray(dtype=ti.i32, ndim=2),  # [P, 2]
    sum_start: ti.types.ndarray(dtype=ti.i32, ndim=1),  # [K + 1]
    diffs: ti.types.ndarray(dtype=ti.i32, ndim=2),  # [M, 2]
    diff_start: ti.types.ndarray(dtype=ti.i32, ndim=1),  # [K + 1]
    outer_sums: ti.types.ndarray(dtype=ti.i32, ndim=1),  # [2 n_max + 1] beside the band
    outer_diffs: ti.types.ndarray(dtype=ti.i32, ndim=1),  # [2 n_max + 1]
    multipliers: ti.types.ndarray(dtype=ti.f64, ndim=2),  # [F, G] of the fields of susceptibility
    following: ti.types.ndarray(dtype=ti.f64, ndim=1),  # [K] what the rail follows
    first: ti.i32,  # mode number of the band
    power_limit: ti.f64,  # 2 sd_limit²
    n_tiles: ti.i32,
    n_groups: ti.template(),
    varies: ti.template(),  # whether there are fields
    alike: ti.template(),  # one field, the same in all groups
    varying: ti.template(),
    state: ti.template(),
):
    """Advance every active realisation by the given passages, one update each.

    A realisation whose Σ|U|² reaches ``power_limit`` stops there: its ``factor`` falls to 0 and
    ``passages`` keeps the count.
    """
    n_modes = sum_start.shape[0] - 1
    lanes = ti.static(state.v.shape[3])
    for tile in range(n_tiles):
        t = tile & (state.v.shape[0] - 1)
        state.d[t, 0, 0, 0] = state.v[t, 0, 0, 0]  # see the module's note on vectorisation
        re = ti.Vector.zero(state.d.dtype, lanes)
        im = ti.Vector.zero(state.d.dtype, lanes)
        load = ti.Vector.zero(state.d.dtype, lanes)
        raised = ti.Vector.zero(state.d.dtype, lanes)
        for step in range(axle.shape[0]):
            a = axle[step]
            w = ti.Vector([weight[step, g] for g in ti.static(range(n_groups))])
            # What settles whatever the profile.
            c0 = common_constant(a, w, constant, n_groups)
            for lane in range(lanes):
                state.uniform[t, lane] = state.uniform[t, lane] + state.factor[t, lane] * c0
            for mode in range(n_modes):
                n = mode & ROWS
                common_linear(t, a, n, w, form, mean, n_groups, state, re, im)
                # Pairs of modes whose numbers add up to n, then those that differ by n.
                for p in range(sum_start[n], sum_start[n + 1]):
                    common_product(
                        t, a, n_modes + p, p, sums, form, w, n_groups, False, state, re, im
                    )
                row = n_modes + sums.shape[0]
                for p in range(diff_start[n], diff_start[n + 1]):
                    common_product(t, a, row + p, p, diffs, form, w, n_groups, True, state, re, im)
                for lane in range(lanes):
                    state.d[t, n, 0, lane] = re[lane]
                    state.d[t, n, 1, lane] = im[lane]
            if ti.static(varies):
                for f in range(multipliers.shape[0]):
                    own = ti.Vector([w[g] * multipliers[f, g] for g in ti.static(range(n_groups))])
                    common_half(
                        t, a, first, n_modes, own, form, constant, mean, sums, sum_start,
                        outer_sums, diffs, diff_start, outer_diffs, n_groups, alike, varying,
                        state, load, re, im,
                    )  # fmt: skip
                    for i in range(n_modes):
                        spread(t, f, i, first, n_modes, varying, load, re, im)
                        for lane in range(lanes):
                            state.d[t, i, 0, lane] = state.d[t, i, 0, lane] + re[lane]
                            state.d[t, i, 1, lane] = state.d[t, i, 1, lane] + im[lane]
                    raise_mean(t, f, varying, raised)
                    for lane in range(lanes):
                        state.uniform[t, lane] = (
                            state.uniform[t, lane] + state.factor[t, lane] * raised[lane]
                        )
            step_on(t, n_modes, power_limit, following, state)
            if ti.static(state.v.dtype != state.u.dtype):
                take_copy(t, n_modes, state)


@ti.func
def common_constant(a: int, w: ti.template(), constant: ti.template(), n_groups: ti.template()):
    """What settles whatever the profile, at a factor of one."""
    c0 = 0.0
    for g in ti.static(range(n_groups)):
        c0 = c0 + w[g] * constant[a, g]
    return c0


@ti.func
def take_copy(t: int, n_modes: int, state: ti.template()):
    """Single precision computes the next growth from a copy."""
    for k in range(n_modes):
        for lane in range(state.v.shape[3]):
            state.v[t, k, 0, lane] = ti.cast(state.u[t, k, 0, lane], state.v.dtype)
            state.v[t, k, 1, lane] = ti.cast(state.u[t, k, 1, lane], state.v.dtype)


@ti.func
def linear_coefficients(
    a: int, n: int, w: ti.template(), form: ti.template(), mean: ti.template(),
    n_groups: ti.template(),
):  # fmt: skip
    """Of mode n at a passage: the linear part, real and imaginary, and what it adds to the average."""
    ca = 0.0
    cb = 0.0
    cg = 0.0
    for g in ti.static(range(n_groups)):
        ca = ca + w[g] * form[a, g, n, 0]
        cb = cb + w[g] * form[a, g, n, 1]
        cg = cg + w[g] * mean[a, g, n]
    return ca, cb, cg


@ti.func
def common_linear(
    t: int, a: int, n: int, w: ti.template(), form: ti.template(), mean: ti.template(),
    n_groups: ti.template(), state: ti.template(), re: ti.template(), im: ti.template(),
):  # fmt: skip
    """Begin the growth of mode n with its linear part; add what it settles uniformly."""
    ca, cb, cg = linear_coefficients(a, n, w, form, mean, n_groups)
    la = ti.cast(ca, state.d.dtype)
    lb = ti.cast(cb, state.d.dtype)
    for lane in range(state.v.shape[3]):
        x = state.v[t, n, 0, lane]
        y = state.v[t, n, 1, lane]
        re[lane] = la * x - lb * y
        im[lane] = la * y + lb * x
        state.uniform[t, lane] = state.uniform[t, lane] + state.factor[t, lane] * cg * (
            x * x + y * y
        )


@ti.func
def common_product(
    t: int, a: int, row: int, p: int, pairs: ti.template(), form: ti.template(), w: ti.template(),
    n_groups: ti.template(), conjugate: ti.template(), state: ti.template(),
    re: ti.template(), im: ti.template(),
):  # fmt: skip
    """Add a product of two modes, its coefficient the same in every lane."""
    i = pairs[p, 0] & ROWS
    j = pairs[p, 1] & ROWS
    ta = 0.0
    tb = 0.0
    for g in ti.static(range(n_groups)):
        ta = ta + w[g] * form[a, g, row, 0]
        tb = tb + w[g] * form[a, g, row, 1]
    pa = ti.cast(ta, state.d.dtype)
    pb = ti.cast(tb, state.d.dtype)
    for lane in range(state.v.shape[3]):
        xr, xi = product(t, i, j, lane, conjugate, state.v)
        re[lane] = re[lane] + (pa * xr - pb * xi)
        im[lane] = im[lane] + (pa * xi + pb * xr)


@ti.func
def common_half(
    t: int, a: int, first: int, n_modes: int, w: ti.template(), form: ti.template(),
    constant: ti.template(), mean: ti.template(), sums: ti.template(), sum_start: ti.template(),
    outer_sums: ti.template(), diffs: ti.template(), diff_start: ti.template(),
    outer_diffs: ti.template(), n_groups: ti.template(), alike: ti.template(),
    varying: ti.template(), state: ti.template(), load: ti.template(),
    re: ti.template(), im: ti.template(),
):  # fmt: skip
    """Half of what settles under the groups of a field, wave by wave, and on average; weights ``w``."""
    lanes = ti.static(state.v.shape[3])
    row = n_modes + sums.shape[0]
    c0 = common_constant(a, w, constant, n_groups)
    for lane in range(lanes):
        load[lane] = ti.cast(c0, state.d.dtype)
    for mode in range(n_modes):
        n = mode & ROWS
        common_load(t, a, n, w, form, mean, n_groups, state, load, re, im)
        if ti.static(alike):  # the growth itself
            for lane in range(lanes):
                re[lane] = state.d[t, n, 0, lane]
                im[lane] = state.d[t, n, 1, lane]
        else:
            for p in range(sum_start[n], sum_start[n + 1]):
                common_product(t, a, n_modes + p, p, sums, form, w, n_groups, False, state, re, im)
            for p in range(diff_start[n], diff_start[n + 1]):
                common_product(t, a, row + p, p, diffs, form, w, n_groups, True, state, re, im)
        keep_half(t, first - 1 + n, varying, re, im)
    for wave in range(outer_sums.shape[0] - 1):
        if wave < first - 1 or wave >= first - 1 + n_modes:
            for lane in range(lanes):
                re[lane] = 0.0
                im[lane] = 0.0
            for p in range(outer_sums[wave], outer_sums[wave + 1]):
                common_product(t, a, n_modes + p, p, sums, form, w, n_groups, False, state, re, im)
            for p in range(outer_diffs[wave], outer_diffs[wave + 1]):
                common_product(t, a, row + p, p, diffs, form, w, n_groups, True, state, re, im)
            keep_half(t, wave, varying, re, im)


@ti.func
def common_load(
    t: int, a: int, n: int, w: ti.template(), form: ti.template(), mean: ti.template(),
    n_groups: ti.template(), state: ti.template(), load: ti.template(),
    re: ti.template(), im: ti.template(),
):  # fmt: skip
    """The linear part of what settles at mode n, and what the mode adds to the average."""
    ca, cb, cg = linear_coefficients(a, n, w, form, mean, n_groups)
    la = ti.cast(ca, state.d.dtype)
    lb = ti.cast(cb, state.d.dtype)
    lg = ti.cast(cg, state.d.dtype)
    for lane in range(state.v.shape[3]):
        x = state.v[t, n, 0, lane]
        y = state.v[t, n, 1, lane]
        re[lane] = la * x - lb * y
        im[lane] = la * y + lb * x
        load[lane] = load[lane] + lg * (x * x + y * y)
