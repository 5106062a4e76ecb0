"""The second-order settlement form on tiles of realisations (twin of mcsettle.step_b.spectral.growth).

Layout: state fields are [tile, mode, part, lane] with the realisation in the lane, innermost and
contiguous, so that plain loops over lanes vectorise. One parallel loop over tiles; a realisation owns its
lane and nothing is summed across lanes, hence results do not depend on threads, batches or neighbours.
Accumulate with ``a = a + b``: ``+=`` on a field element is an atomic operation.

Vectorisation. The compiler fetches the address of the fields' memory where a field is first used. Inside
a lane loop it would be fetched again after every store and nothing would vectorise (measured: three
times slower), so each tile begins with a use of a field outside all lane loops. What is summed over pairs
of modes is a local vector: memory of its own, which the compiler need not compare with every row of the
state before every loop (measured: a quarter quicker). Indices are masked with ROWS or the number of
tiles, which changes none of them: no overflow, simpler addresses.

Precision. The state ``u`` is in double precision always. The growth ``d`` is computed from ``v``, which
is ``u`` itself or, for single precision, a copy of it: an increment of 1e-7 of an amplitude may lose its
own eighth digit but must not be lost in the sum.
"""

import functools

import numpy as np

from mcsettle.kernels.backend import bundle, ti

ROWS = 0xFFFF
PRECISIONS = {"f64": ti.f64, "f32": ti.f32}
LANES = {
    "f64": 32,
    "f32": 64,
}  # a power of two: 256 bytes a row, the state of 61 modes 31 kB a tile
FEW = 4  # tiles in place of one
CAPACITY = 2048  # realisations at a time, a multiple of the lanes
Tables = tuple[np.ndarray, ...]


@bundle
class State:
    """Realisations in their lanes, as the kernels take them.

    ``u`` [tile, mode, part, lane] amplitudes, m; ``v`` what the growth is computed from; ``d`` the
    growth; ``factor`` [tile, lane] multiplies a realisation's growth, 0 once it has stopped; ``uniform``
    [tile, lane] settlement, m; ``passages`` [tile, lane].
    """

    u: ti.Field
    v: ti.Field
    d: ti.Field
    factor: ti.Field
    uniform: ti.Field
    passages: ti.Field


@bundle
class Workspace:
    """Fields of one band of modes, allocated once and reused for every batch.

    ``owner`` holds whoever has left its state in them last: a march that finds another there stops.
    """

    state: State
    weight: ti.Field
    owner: list[object]


def tiles(precision: str, few: bool) -> tuple[int, int]:
    """Tiles of a workspace and the lanes of each."""
    lanes = LANES[precision]
    return (FEW, lanes // FEW) if few else (CAPACITY // lanes, lanes)


@functools.cache
def workspace(n_modes: int, n_weights: int, precision: str = "f64", few: bool = False) -> Workspace:
    """Allocate (once per band) the state of CAPACITY realisations: some 32 bytes per mode of each.

    ``few``: of as many as one tile holds, in smaller tiles, so that cores share them.
    """
    kind, (n_tiles, lanes) = PRECISIONS[precision], tiles(precision, few)
    shape = (n_tiles, n_modes, 2, lanes)
    u, d = ti.field(ti.f64, shape=shape), ti.field(kind, shape=shape)
    v = u if precision == "f64" else ti.field(kind, shape=shape)
    weight = ti.field(kind, shape=(n_tiles, n_weights, lanes))
    factor, uniform = (ti.field(ti.f64, shape=(n_tiles, lanes)) for _ in range(2))
    passages = ti.field(ti.i64, shape=(n_tiles, lanes))
    return Workspace(State(u, v, d, factor, uniform, passages), weight, [])


def evaluate_rates(
    u: np.ndarray,  # [R, K, 2]
    weights: np.ndarray,  # [R, E]
    form: np.ndarray,  # [E, K + P + M, 2]
    constant: np.ndarray,  # [E]
    mean: np.ndarray,  # [E, K]
    tables: Tables,
    growth: np.ndarray,  # [R, K, 2], written
    uniform: np.ndarray,  # [R], written
) -> None:
    """Run ``rates`` on any number of realisations, CAPACITY at a time."""
    w = workspace(u.shape[1], len(constant))
    w.owner[:] = ["rates"]
    for first in range(0, len(u), CAPACITY):
        part = slice(first, min(first + CAPACITY, len(u)))
        n_real = part.stop - part.start
        rates(
            u[part], weights[part], form, constant, mean, *tables,
            n_real, len(constant), w.state.u, w.weight, growth[part], uniform[part],
        )  # fmt: skip


@ti.kernel
def rates(
    u: ti.types.ndarray(dtype=ti.f64, ndim=3),  # [R, K, 2] amplitudes
    w: ti.types.ndarray(dtype=ti.f64, ndim=2),  # [R, E] weights of the forms
    form: ti.types.ndarray(dtype=ti.f64, ndim=3),  # [E, K + P + M, 2]
    constant: ti.types.ndarray(dtype=ti.f64, ndim=1),  # [E]
    mean: ti.types.ndarray(dtype=ti.f64, ndim=2),  # [E, K]
    sums: ti.types.ndarray(dtype=ti.i32, ndim=2),  # [P, 2]
    sum_start: ti.types.ndarray(dtype=ti.i32, ndim=1),  # [K + 1]
    diffs: ti.types.ndarray(dtype=ti.i32, ndim=2),  # [M, 2]
    diff_start: ti.types.ndarray(dtype=ti.i32, ndim=1),  # [K + 1]
    n_real: ti.i32,
    n_forms: ti.template(),
    s: ti.template(),
    weight: ti.template(),
    out: ti.types.ndarray(dtype=ti.f64, ndim=3),  # [R, K, 2] growth of the amplitudes
    out_uniform: ti.types.ndarray(dtype=ti.f64, ndim=1),  # [R] uniform settlement
):
    """Growth of every realisation with its own weights: out = Σ_e w[r, e] form_e(u[r])."""
    n_modes = sum_start.shape[0] - 1
    lanes = ti.static(s.shape[3])
    for tile in range((n_real + lanes - 1) // lanes):
        t = tile & (s.shape[0] - 1)
        first = t * lanes
        s[t, 0, 0, 0] = 0.0  # see the module's note on vectorisation
        re = ti.Vector.zero(ti.f64, lanes)
        im = ti.Vector.zero(ti.f64, lanes)
        total = ti.Vector.zero(ti.f64, lanes)
        # Realisations and their weights into lanes; those left over repeat the last.
        take_rows(t, first, n_modes, n_real, u, s)
        take_weights(t, first, n_forms, n_real, w, weight)
        for e in range(n_forms):
            c0 = constant[e]
            for lane in range(lanes):
                total[lane] = total[lane] + weight[t, e, lane] * c0
        for mode in range(n_modes):
            n = mode & ROWS
            own_mode(
                t, n, n_modes, n_forms, form, mean, sums, sum_start, diffs, diff_start, s, weight,
                total, re, im,
            )  # fmt: skip
            for lane in range(lanes):
                if first + lane < n_real:
                    out[first + lane, n, 0] = re[lane]
                    out[first + lane, n, 1] = im[lane]
        for lane in range(lanes):
            if first + lane < n_real:
                out_uniform[first + lane] = total[lane]


@ti.func
def take_rows(t: int, first: int, n_modes: int, n_real: int, u: ti.template(), s: ti.template()):
    """Copy the amplitudes of realisations ``first`` … to the lanes of a tile."""
    for k in range(n_modes):
        for lane in range(s.shape[3]):
            r = ti.min(first + lane, n_real - 1)
            s[t, k, 0, lane] = u[r, k, 0]
            s[t, k, 1, lane] = u[r, k, 1]


@ti.func
def take_weights(
    t: int, first: int, n_forms: ti.template(), n_real: int, w: ti.template(), weight: ti.template()
):
    """Copy the weights of realisations ``first`` … to the lanes of a tile."""
    for e in range(n_forms):
        for lane in range(weight.shape[2]):
            weight[t, e, lane] = w[ti.min(first + lane, n_real - 1), e]


@ti.func
def own_mode(
    t: int, n: int, n_modes: int, n_forms: ti.template(), form: ti.template(),
    mean: ti.template(), sums: ti.template(), sum_start: ti.template(), diffs: ti.template(),
    diff_start: ti.template(), s: ti.template(), weight: ti.template(), total: ti.template(),
    re: ti.template(), im: ti.template(),
):  # fmt: skip
    """What settles at mode n, weighted lane by lane; ``total`` gains what it adds to the mean."""
    a = ti.Vector([form[e, n, 0] for e in ti.static(range(n_forms))])
    b = ti.Vector([form[e, n, 1] for e in ti.static(range(n_forms))])
    g = ti.Vector([mean[e, n] for e in ti.static(range(n_forms))])
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
        re[lane] = ca * x - cb * y
        im[lane] = ca * y + cb * x
        total[lane] = total[lane] + cg * (x * x + y * y)
    # Pairs of modes whose numbers add up to n, then those that differ by n.
    for p in range(sum_start[n], sum_start[n + 1]):
        own_product(t, n_modes + p, p, sums, form, weight, n_forms, False, s, re, im)
    for p in range(diff_start[n], diff_start[n + 1]):
        row = n_modes + sums.shape[0] + p
        own_product(t, row, p, diffs, form, weight, n_forms, True, s, re, im)


@ti.func
def own_product(
    t: int, row: int, p: int, pairs: ti.template(), form: ti.template(), weight: ti.template(),
    n_forms: ti.template(), conjugate: ti.template(), s: ti.template(),
    re: ti.template(), im: ti.template(),
):  # fmt: skip
    """Add a product of two modes, its coefficient weighted lane by lane."""
    i = pairs[p, 0] & ROWS
    j = pairs[p, 1] & ROWS
    a = ti.Vector([form[e, row, 0] for e in ti.static(range(n_forms))])
    b = ti.Vector([form[e, row, 1] for e in ti.static(range(n_forms))])
    for lane in range(s.shape[3]):
        ca = 0.0
        cb = 0.0
        for e in ti.static(range(n_forms)):
            ca = ca + weight[t, e, lane] * a[e]
            cb = cb + weight[t, e, lane] * b[e]
        xr, xi = product(t, i, j, lane, conjugate, s)
        re[lane] = re[lane] + (ca * xr - cb * xi)
        im[lane] = im[lane] + (ca * xi + cb * xr)


@ti.func
def product(t: int, i: int, j: int, lane: int, conjugate: ti.template(), s: ti.template()):
    """U_i U_j of a lane, or U_i U*_j."""
    xr = s[t, i, 0, lane] * s[t, j, 0, lane] - s[t, i, 1, lane] * s[t, j, 1, lane]
    xi = s[t, i, 0, lane] * s[t, j, 1, lane] + s[t, i, 1, lane] * s[t, j, 0, lane]
    if ti.static(conjugate):
        xr = s[t, i, 0, lane] * s[t, j, 0, lane] + s[t, i, 1, lane] * s[t, j, 1, lane]
        xi = s[t, i, 1, lane] * s[t, j, 0, lane] - s[t, i, 0, lane] * s[t, j, 1, lane]
    return xr, xi


@ti.func
def step_on(
    t: int, n_modes: int, power_limit: float, following: ti.template(), state: ti.template()
):
    """Add the growth to the profiles of a tile; those that reach the limit stop there.

    ``following`` [K]: what the rail follows of it.
    """
    lanes = ti.static(state.u.shape[3])
    power = ti.Vector.zero(ti.f64, lanes)
    for mode in range(n_modes):
        k = mode & ROWS
        follows = following[k]
        for lane in range(lanes):
            own = state.factor[t, lane] * follows
            x = state.u[t, k, 0, lane] + own * state.d[t, k, 0, lane]
            y = state.u[t, k, 1, lane] + own * state.d[t, k, 1, lane]
            state.u[t, k, 0, lane] = x
            state.u[t, k, 1, lane] = y
            power[lane] = power[lane] + (x * x + y * y)
    for lane in range(lanes):
        if state.factor[t, lane] > 0.0:
            state.passages[t, lane] = state.passages[t, lane] + 1
            # Written so that an amplitude that is no number stops, too.
            if not power[lane] < power_limit:
                state.factor[t, lane] = 0.0
