"""Settlement at every x and depth under axle passages (twin of ``step_b.passage``): the reference.

Any settlement law and exponent; nothing is expanded. Stress fields are synthesised on the grid from the
profile's modes, two real fields in one complex transform, and what a passage settles is transformed
back (mcsettle.kernels.fourier). State, lanes and tiles as in the spectral kernels. The arrays over x
belong to workers, each of which takes every WORKERS-th tile, so that they stay in its cache:
2.3 kB a point, 0.6 MB each on a window of 200 m and 6 MB on one of 2 km. In single precision (``w``) the
state and the sums over passages are in double precision all the same.
"""

import functools

import numpy as np

from mcsettle.kernels.backend import bundle, ti
from mcsettle.kernels.fourier import POINTS, forwards
from mcsettle.kernels.pointwise_tile import (
    GROUPS,
    Rows,
    add_linear,
    add_power,
    add_two,
    begin_power,
    clear_rows,
    collect,
    first_pass,
    give_back,
    inner_passes,
    pick_weights,
    put_one,
    rows_of,
    take_up,
    weigh,
)
from mcsettle.kernels.spectral import CAPACITY, LANES, PRECISIONS, State, step_on

WORKERS = 16
# What becomes of a transform's fields: squares, two deviators of a first or next depth, their third
# (3), or the fields as they are.
SQUARES, BEGIN, NEXT, PLAIN = 0, 1, 2, 4


@bundle
class Scratch:
    """Arrays over x of the workers, ``w`` [worker, row, lane], and what each realisation's growth of the
    cycle functions is multiplied by, ``own`` [tile, group, lane]; where the support varies ``factors``
    [tile, P X, lane] of the strain in P parts, x in the transforms' order.
    """

    own: ti.Field
    w: ti.Field
    factors: ti.Field


@bundle
class Workspace:
    """Fields of one band and grid, allocated once and reused for every batch (as spectral's)."""

    state: State
    rows: Rows
    scratch: Scratch
    owner: list[object]


def workspace(
    n_modes: int, n_points: int, n_groups: int, precision: str = "f64", n_factors: int = 0
) -> Workspace:
    """Room for such a band and grid, rounded up: another shape compiles the kernels again."""
    if n_groups > GROUPS:
        raise ValueError(f"{n_groups} settlement groups; at most {GROUPS} here")
    return _allocated(-(-n_modes // 64) * 64, n_points, precision, n_factors)


@functools.cache
def _allocated(n_modes: int, n_points: int, precision: str, n_factors: int) -> Workspace:
    rows, lanes = rows_of(n_points, n_factors > 0), LANES[precision]
    n_tiles = CAPACITY // lanes
    u, d = (ti.field(ti.f64, shape=(n_tiles, n_modes, 2, lanes)) for _ in range(2))
    own = ti.field(ti.f64, shape=(n_tiles, GROUPS, lanes))
    factor, uniform = (ti.field(ti.f64, shape=(n_tiles, lanes)) for _ in range(2))
    passages = ti.field(ti.i64, shape=(n_tiles, lanes))
    w = ti.field(PRECISIONS[precision], shape=(WORKERS, rows.count, lanes))
    factors = ti.field(ti.f64, shape=(n_tiles, max(n_factors, 1), lanes))
    return Workspace(State(u, u, d, factor, uniform, passages), rows, Scratch(own, w, factors), [])


@ti.kernel
def burst(
    axle: ti.types.ndarray(dtype=ti.i32, ndim=1),  # [N] axle of each passage, in order
    growth: ti.types.ndarray(dtype=ti.f64, ndim=2),  # [N, G] growth of the cycle functions
    start: ti.types.ndarray(dtype=ti.i32, ndim=1),  # [J + 1] first transform of each axle
    kind: ti.types.ndarray(dtype=ti.i32, ndim=2),  # [T, 3] kind, groups of the two fields
    law: ti.types.ndarray(dtype=ti.f64, ndim=2),  # [T, 2] coefficient, exponent
    response: ti.types.ndarray(
        dtype=ti.f64, ndim=3
    ),  # [T, X/2, 4] of U_n (U_0 = 1), of U*_n at X/2 − n
    linear: ti.types.ndarray(dtype=ti.f64, ndim=4),  # [J, G, K, 2]
    constant: ti.types.ndarray(dtype=ti.f64, ndim=2),  # [J, G]
    wave: ti.types.ndarray(dtype=ti.f64, ndim=2),  # [X, 2] cos, sin of 2π x / X
    band: ti.types.ndarray(dtype=ti.i32, ndim=1),  # first mode; butterflies of two modes: from, to
    closes: ti.types.ndarray(dtype=ti.i32, ndim=1),  # [T] part that ends with the transform, or −1
    following: ti.types.ndarray(dtype=ti.f64, ndim=1),  # [K] what the rail follows
    rows: ti.template(),
    scratch: ti.template(),
    frozen: ti.i32,  # 1: profiles stay as they are, their growth adds up in ``state.d``
    power_limit: ti.f64,  # 2 sd_limit²
    n_tiles: ti.i32,
    n_groups: ti.i32,
    varies: ti.template(),  # whether the strain has factors
    state: ti.template(),
):
    """Advance every active realisation by the given passages, or collect its growth under them."""
    w = ti.static(scratch.w)
    for worker in range(WORKERS):
        p = worker & (WORKERS - 1)
        w[p, 0, 0] = ti.cast(
            state.u[0, 0, 0, 0], w.dtype
        )  # see the spectral module's note on vectorisation
        n_modes, first = linear.shape[2], band[0]
        for turn in range((n_tiles - p + WORKERS - 1) // WORKERS):
            t = (p + turn * WORKERS) & (state.u.shape[0] - 1)
            clear_rows(p, rows.up, rows.weights, w)
            put_one(p, rows.up, w)
            for step in range(axle.shape[0]):
                j = axle[step]
                # A passage over a profile of its own begins anew; growth at a frozen one adds up.
                if frozen == 0 or step == 0:
                    clear_rows(p, rows.settled, rows.squared[0], w)
                    clear_rows(p, rows.grown, rows.weights, w)
                    if ti.static(varies):
                        clear_rows(p, rows.gathered, rows.count, w)
                    take_up(p, t, rows, n_modes, first, state.u, w)
                weigh(p, t, j, step, n_groups, growth, constant, rows, scratch, state)
                add_linear(p, rows, j, first, linear, w)
                # Two fields at a time from modes to x, where they settle.
                for c in range(start[j], start[j + 1]):
                    first_pass(p, c, rows, response, wave, band, w)
                    pick_weights(p, kind[c, 1], kind[c, 2], law[c, 0], rows, w)
                    for quarter in range(4):
                        begin = quarter * rows.q
                        inner_passes(p, begin, rows, wave, w)
                        if kind[c, 0] == SQUARES:
                            add_two(p, begin, True, rows, w)
                        elif kind[c, 0] == BEGIN:
                            begin_power(p, begin, rows, 0, w)
                        elif kind[c, 0] == NEXT:
                            begin_power(p, begin, rows, 1, w)
                        elif kind[c, 0] == PLAIN:
                            add_two(p, begin, False, rows, w)
                        else:
                            add_power(p, begin, law[c, 1], rows, w)
                    if ti.static(varies):
                        if closes[c] >= 0:
                            gather(p, t, closes[c], rows, scratch)
                # What has settled, back to modes.
                if frozen == 0 or step == axle.shape[0] - 1:
                    if ti.static(varies):
                        take_gathered(p, rows, scratch)
                    forwards(w, p, rows.settled, rows.q, rows.points, wave)
                    collect(p, t, rows, n_modes, first, wave, state, w)
                    give_back(p, t, rows, n_modes, first, state.d, w)
                if frozen == 0:
                    step_on(t, n_modes, power_limit, following, state)


@ti.func
def gather(p: int, t: int, part: int, rows: ti.template(), scratch: ti.template()):
    """Multiply what a part of the groups has settled at every x, and begin the next part."""
    w, factors = ti.static(scratch.w, scratch.factors)
    q, s, g = ti.static(rows.q, rows.settled, rows.gathered)
    quarter = ti.static(rows.points // 4)
    for n in range(rows.points):
        i = ((n // quarter) * q + n % quarter) & POINTS
        at = part * rows.points + n
        for lane in range(w.shape[2]):
            factor = ti.cast(factors[t, at, lane], w.dtype)
            w[p, i + g, lane] = w[p, i + g, lane] + factor * w[p, i + s, lane]
            w[p, i + s, lane] = 0.0


@ti.func
def take_gathered(p: int, rows: ti.template(), scratch: ti.template()):
    """What has settled in all parts."""
    w = ti.static(scratch.w)
    s, g = ti.static(rows.settled, rows.gathered)
    for row in range(4 * rows.q):
        i = row & POINTS
        for lane in range(w.shape[2]):
            w[p, i + s, lane] = w[p, i + g, lane]


@ti.kernel
def fill(
    amplitudes: ti.types.ndarray(dtype=ti.f64, ndim=3),  # [R, K, 2]
    weights: ti.types.ndarray(dtype=ti.f64, ndim=2),  # [R, G]
    n_tiles: ti.i32,
    own: ti.template(),
    state: ti.template(),
):
    """Put realisations into lanes; those left over repeat the last."""
    for t in range(n_tiles):
        for lane in range(state.u.shape[3]):
            r = ti.min(t * state.u.shape[3] + lane, amplitudes.shape[0] - 1)
            state.factor[t, lane] = 1.0
            state.uniform[t, lane] = 0.0
            for g in range(weights.shape[1]):
                own[t, g, lane] = weights[r, g]
            for k in range(amplitudes.shape[1]):
                state.u[t, k, 0, lane] = amplitudes[r, k, 0]
                state.u[t, k, 1, lane] = amplitudes[r, k, 1]


@ti.kernel
def put_factors(
    factors: ti.types.ndarray(dtype=ti.f64, ndim=2),  # [R, P X]
    n_tiles: ti.i32,
    to: ti.template(),
):
    """Put the factors of the strain into lanes; those left over repeat the last."""
    for t in range(n_tiles):
        for row in range(factors.shape[1]):
            for lane in range(to.shape[2]):
                to[t, row, lane] = factors[
                    ti.min(t * to.shape[2] + lane, factors.shape[0] - 1), row
                ]


@ti.kernel
def fetch(
    d: ti.template(),
    uniform: ti.template(),
    change: ti.types.ndarray(dtype=ti.f64, ndim=3),  # [R, K, 2], written
    total: ti.types.ndarray(dtype=ti.f64, ndim=1),  # [R], written
):
    """Take growth and uniform settlement out of the lanes."""
    for r in range(change.shape[0]):
        t = r // d.shape[3]
        lane = r % d.shape[3]
        total[r] = uniform[t, lane]
        for k in range(change.shape[1]):
            change[r, k, 0] = d[t, k, 0, lane]
            change[r, k, 1] = d[t, k, 1, lane]


def evaluate(
    u: np.ndarray,  # [R, K, 2]
    weights: np.ndarray,  # [R, G]
    axles: np.ndarray,  # [N]
    tables: tuple[np.ndarray, ...],  # ``start`` to ``closes`` of ``burst``
    factors: np.ndarray | None,  # [R, P X] of the strain, or none
    change: np.ndarray,  # [R, K, 2], written
    uniform: np.ndarray,  # [R], written
) -> None:
    """Growth under ``axles`` at frozen profiles, any number of realisations."""
    n_groups = weights.shape[1]
    varies = factors is not None
    n_factors = 0 if factors is None else factors.shape[1]
    w = workspace(u.shape[1], len(tables[6]), n_groups, "f64", n_factors)
    follows = np.ones(u.shape[1])
    w.owner[:] = ["evaluate"]
    ones = np.ones((len(axles), n_groups))
    for first in range(0, len(u), CAPACITY):
        part = slice(first, min(first + CAPACITY, len(u)))
        n_tiles = -(-(part.stop - first) // LANES["f64"])
        fill(u[part], weights[part], n_tiles, w.scratch.own, w.state)
        if factors is not None:
            put_factors(factors[part], n_tiles, w.scratch.factors)
        burst(
            axles,
            ones,
            *tables,
            follows,
            w.rows,
            w.scratch,
            1,
            0.0,
            n_tiles,
            n_groups,
            varies,
            w.state,
        )
        fetch(w.state.d, w.state.uniform, change[part], uniform[part])
