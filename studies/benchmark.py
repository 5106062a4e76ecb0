"""Axle passages a second: the kernels beside NumPy, SciPy's FFT and Numba, same physics, one run.

Every design advances the same tracks by the same passages of the same 11-car passenger train on the
closed-form track; its error is that of the change of the profile over one train against the definition
(``mcsettle.passage``). Run on a quiet machine: ``make bench`` (options: realisations, seconds a design).
"""

import argparse
import os
import platform
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import scipy.fft

from mcsettle import passage
from mcsettle.beam import beam_response
from mcsettle.case import Case
from mcsettle.clock import update_weights
from mcsettle.interaction import precompute
from mcsettle.irregularity import sample_profiles, spectrum, wavenumbers
from mcsettle.kernels import march as kernel_march
from mcsettle.kernels import runtime
from mcsettle.march import day_loads, pointwise_day_loads
from mcsettle.pointwise import pointwise_growth, pointwise_load
from mcsettle.settlement import SettlementModel, cycle_increment, strain_scale
from mcsettle.spectral import ModePairs, axle_form, growth, mode_pairs, tables, train_form
from mcsettle.stress import DEVIATOR
from mcsettle.track import TOY_TRACK
from mcsettle.traffic import Service, Timetable, Train
from mcsettle.transfer import TransferFunctions
from mcsettle.units import KMH
from mcsettle.vehicle import PASSENGER

WINDOW = 200.0
CYCLES = 1e5
AXLES = 44


def main() -> None:
    """Measure every design and print one table."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--realisations", type=int, default=1024)
    options.add_argument("--seconds", type=float, default=3.0)
    given = options.parse_args()
    runtime.start()
    transfer, model, tracks = problem(given.realisations)
    truth = definition(transfer, model, tracks[:1])
    print(machine())
    print(f"{'design':<52}{'passages/s':>12}{'CPU/wall':>10}{'error':>10}")
    for name, build in DESIGNS.items():
        try:
            advance, change = build(transfer, model, tracks)
        except ImportError as error:
            print(f"{name:<52}{'not measured: ' + str(error)}")
            continue
        error = np.max(np.abs(change - truth)) / np.max(np.abs(truth)) if change is not None else 0
        rate, busy = timed(advance, given.seconds)
        print(f"{name:<52}{rate:>12.4g}{busy:>10.2f}{error:>10.1e}")


def problem(n: int) -> tuple[TransferFunctions, SettlementModel, np.ndarray]:
    """Transfer functions, settlement model and ``n`` tracks."""
    k = wavenumbers(WINDOW)
    train = Train("passenger", (PASSENGER,) * 11)
    transfer = precompute(train, 201 * KMH, beam_response(TOY_TRACK), k)
    model = SettlementModel(tuple(layer.law for layer in TOY_TRACK.layers))
    return transfer, model, sample_profiles(spectrum(), k, WINDOW, 1, range(n), sd=1.03e-3)


def definition(transfer: TransferFunctions, model: SettlementModel, u: np.ndarray) -> np.ndarray:
    """Change of the amplitudes over the first train by the definition, frozen profile, [K]."""
    modes = passage.mode_numbers(transfer.wavenumbers, WINDOW)
    change = np.zeros(u.shape[1], dtype=complex)
    for axle in range(len(transfer.quasi_static)):
        cycles = np.full(len(model.laws), CYCLES + AXLES / 2.0)  # the middle of the train
        grown = passage.settlement_of_passage(u[0], axle, transfer, model, cycles, WINDOW)
        change += passage.in_band(grown, modes)
    return change


def timed(advance: Callable[[], int], seconds: float) -> tuple[float, float]:
    """Best rate of passages a second of wall time, and CPU time over wall time of that call."""
    advance()
    best, busy, end = 0.0, 0.0, time.perf_counter() + seconds
    while time.perf_counter() < end or best == 0.0:
        wall, cpu = time.perf_counter(), time.process_time()
        done = advance()
        wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
        if done / wall > best:
            best, busy = done / wall, cpu / wall
    return best, busy


def weights_of(model: SettlementModel) -> np.ndarray:
    """Growth of the cycle functions in one passage, [1, G]."""
    return np.array(
        [[float(cycle_increment(law, CYCLES + AXLES / 2.0, 1.0)) for law in model.group_laws]]
    )


def pairs_of(transfer: TransferFunctions) -> ModePairs:
    """Mode pairs of the benchmark's window."""
    return mode_pairs(passage.mode_numbers(transfer.wavenumbers, WINDOW))


def numpy_one(transfer, model, tracks):
    """One realisation, one passage at a time: the definition itself."""
    cycles = np.full(len(model.laws), CYCLES)

    def advance() -> int:
        u = tracks[0]
        for axle in range(8):
            u, _ = passage.passage(u, axle, transfer, model, cycles, WINDOW)
        return 8

    return advance, definition(transfer, model, tracks[:1])


def numpy_form(transfer, model, tracks):
    """The second-order form, batched NumPy."""
    pairs, w, u = pairs_of(transfer), weights_of(model), tracks[:64]
    forms = [axle_form(transfer, j, model, pairs) for j in range(4)]
    change = growth(train_form(transfer, model, pairs), tracks[:1], w, pairs)[0][0]

    def advance() -> int:
        for form in forms:
            growth(form, u, w, pairs)
        return len(forms) * len(u)

    return advance, change


def scipy_low_rank(transfer, model, tracks):
    """The same second-order mathematics through SciPy's FFT: a few fields, squared and summed."""
    modes = passage.mode_numbers(transfer.wavenumbers, WINDOW)
    n_points = 256
    w = weights_of(model)[0]
    bases = [low_rank(transfer, j, model, w, modes) for j in range(len(transfer.quasi_static))]

    def settle(u: np.ndarray, basis: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
        linear, fields = basis
        full = np.zeros((len(u), len(fields) + 1, n_points // 2 + 1), dtype=complex)
        full[:, 0, modes] = linear * u
        full[:, 1:, modes] = fields * u[:, None, :]
        x = scipy.fft.irfft(full, n_points, workers=2) * (n_points / 2)
        total = x[:, 0] + np.einsum("rfx,rfx->rx", x[:, 1:], x[:, 1:])
        return 2.0 / n_points * scipy.fft.rfft(total, workers=2)[:, modes]

    change = sum(settle(tracks[:1], basis)[0] for basis in bases)
    u = tracks[:64]

    def advance() -> int:
        for basis in bases[:8]:
            settle(u, basis)
        return 8 * len(u)

    return advance, change


def low_rank(transfer, axle, model, w, modes, tolerance=1e-6):
    """Linear field [K] and fields [F, K] whose squares add up to the second-order settlement."""
    rows, linear = [], np.zeros(len(modes), dtype=complex)
    for group, layer in enumerate(model.settling_layers):
        law, here = model.laws[layer], transfer.grid.layer == layer
        p0 = DEVIATOR @ transfer.quasi_static[axle][:, here]
        response = np.einsum("dc,kcz->kdz", DEVIATOR, transfer.dynamic[axle][:, :, here])
        weight, m = w[group] * strain_scale(law) * transfer.grid.weights[here], law.exponent
        q2 = np.sum(p0**2, axis=0)
        first = weight * (m / 2) * q2 ** (m / 2 - 1)
        second = weight * (m / 2) * (m / 2 - 1) / 2 * q2 ** (m / 2 - 2)
        linear += 2.0 * np.einsum("dz,kdz,z->k", p0, response, first)
        for z in range(len(q2)):
            form = first[z] * np.eye(3) + 4.0 * second[z] * np.outer(p0[:, z], p0[:, z])
            rows.append(np.linalg.cholesky(form).T @ response[:, :, z].T)
    stack = np.concatenate(rows)
    _, s, v = np.linalg.svd(np.concatenate([stack.real, stack.imag], axis=1), full_matrices=False)
    keep = s > tolerance * s[0]
    fields = s[keep, None] * v[keep]
    return linear, fields[:, : len(modes)] + 1j * fields[:, len(modes) :]


def numba_lanes(transfer, model, tracks):
    """The second-order form in Numba, realisations innermost, as the kernel lays it out."""
    import numba

    pairs, lanes = pairs_of(transfer), 64
    w = weights_of(model)[0]
    packed = axle_form(transfer, 0, model, pairs).packed()
    form = np.einsum("g,gcx->cx", w, packed)
    n_tiles, n_modes = len(tracks) // lanes, tracks.shape[1]
    state = np.ascontiguousarray(
        np.stack([tracks.real, tracks.imag], -1)[: n_tiles * lanes]
        .reshape(n_tiles, lanes, n_modes, 2)
        .transpose(0, 2, 3, 1)
    )

    @numba.njit(parallel=True, fastmath=False)
    def burst(u, n_steps, form, sums, sum_start, diffs, diff_start):
        for t in numba.prange(u.shape[0]):
            d = np.zeros(u.shape[1:])
            for _ in range(n_steps):
                for n in range(u.shape[1]):
                    for lane in range(64):
                        x, y = u[t, n, 0, lane], u[t, n, 1, lane]
                        d[n, 0, lane] = form[n, 0] * x - form[n, 1] * y
                        d[n, 1, lane] = form[n, 0] * y + form[n, 1] * x
                    for p in range(sum_start[n], sum_start[n + 1]):
                        i, j = sums[p, 0], sums[p, 1]
                        a, b = form[u.shape[1] + p, 0], form[u.shape[1] + p, 1]
                        for lane in range(64):
                            xr = u[t, i, 0, lane] * u[t, j, 0, lane]
                            xr -= u[t, i, 1, lane] * u[t, j, 1, lane]
                            xi = u[t, i, 0, lane] * u[t, j, 1, lane]
                            xi += u[t, i, 1, lane] * u[t, j, 0, lane]
                            d[n, 0, lane] += a * xr - b * xi
                            d[n, 1, lane] += a * xi + b * xr
                    for p in range(diff_start[n], diff_start[n + 1]):
                        i, j = diffs[p, 0], diffs[p, 1]
                        q = u.shape[1] + sums.shape[0] + p
                        a, b = form[q, 0], form[q, 1]
                        for lane in range(64):
                            xr = u[t, i, 0, lane] * u[t, j, 0, lane]
                            xr += u[t, i, 1, lane] * u[t, j, 1, lane]
                            xi = u[t, i, 1, lane] * u[t, j, 0, lane]
                            xi -= u[t, i, 0, lane] * u[t, j, 1, lane]
                            d[n, 0, lane] += a * xr - b * xi
                            d[n, 1, lane] += a * xi + b * xr
                for n in range(u.shape[1]):
                    for c in range(2):
                        for lane in range(64):
                            u[t, n, c, lane] += d[n, c, lane]

    args = tables(pairs)

    def advance() -> int:
        burst(state, 44, form, *args)
        return 44 * n_tiles * lanes

    return advance, None


def march_kernel(by_train: bool):
    """The production kernel: one update per axle, or one per train."""

    def build(transfer, model, tracks):
        case = one_service(transfer, model)
        pairs = pairs_of(transfer)
        loads = day_loads(case, pairs, by_train)
        change = one_train(case, pairs, loads, tracks, by_train)
        state = kernel_march.March(tracks, 2.0, tables(pairs), loads.constant.shape[1])
        per_update, done = 44 if by_train else 1, [0]

        def advance() -> int:
            count = max(state.burst_size(), 4)
            updates = update_weights(case, loads.plan, done[0], count)
            state.advance(*updates, loads.form, loads.constant, loads.mean)
            done[0] += count
            return per_update * count * len(tracks)

        return advance, change

    return build


def one_train(case, pairs, loads, tracks, by_train):
    """Change over the first train of track 0, at weights of the first passage."""
    state = kernel_march.March(tracks[:1].copy(), 2.0, tables(pairs), loads.constant.shape[1])
    count = 1 if by_train else 44
    load, weights = update_weights(case, loads.plan, 0, count)
    state.advance(load, weights, loads.form, loads.constant, loads.mean)
    return state.amplitudes()[0] - tracks[0]


def pointwise_kernel(transfer, model, tracks):
    """Every x and depth, any exponent, a whole train at frozen profiles."""
    load = pointwise_load(transfer, model, WINDOW)
    w, axles = np.repeat(weights_of(model), len(tracks), axis=0), np.arange(load.n_axles)
    change = pointwise_growth(load, axles, tracks[:1], w[:1])[0][0]

    def advance() -> int:
        pointwise_growth(load, axles, tracks, w)
        return len(axles) * len(tracks)

    return advance, change


def pointwise_march(transfer, model, tracks):
    """Every x and depth, profiles updated after every axle."""
    case = one_service(transfer, model)
    loads = pointwise_day_loads(case)
    first = loads.begin(tracks[:1], 2.0)
    first.advance(*update_weights(case, loads.plan, 0, AXLES))
    change = first.amplitudes()[0] - tracks[0]
    state, done = loads.begin(tracks, 2.0), [0]

    def advance() -> int:
        count = state.burst_size()
        state.advance(*update_weights(case, loads.plan, done[0], count))
        done[0] += count
        return count * len(tracks)

    return advance, change


def one_service(transfer: TransferFunctions, model: SettlementModel) -> Case:
    """Seventy-two trains a day, far from any limit."""
    service = Service(Train("passenger", (PASSENGER,) * 11), 201 * KMH, 72)
    return Case(Timetable((service,)), (transfer,), model, WINDOW, 1.0, 1e9)


DESIGNS = {
    "NumPy, the definition, one realisation": numpy_one,
    "NumPy, second-order form, 64 realisations": numpy_form,
    "SciPy FFT, the same mathematics, 64 realisations": scipy_low_rank,
    "Numba, second-order form, lanes": numba_lanes,
    "Taichi, every x and depth, frozen over a train": pointwise_kernel,
    "Taichi, every x and depth, every axle": pointwise_march,
    "Taichi, second-order form, every axle": march_kernel(by_train=False),
    "Taichi, second-order form, every train": march_kernel(by_train=True),
}


def machine() -> str:
    """One line on the machine and what dense products reach on it."""
    a = np.random.default_rng(0).standard_normal((1024, 1024))
    rates = []
    for _ in range(5):
        start = time.perf_counter()
        a @ a
        rates.append(2 * 1024**3 / (time.perf_counter() - start) / 1e9)
    info = Path("/proc/cpuinfo")
    lines = info.read_text(encoding="utf-8").splitlines() if info.exists() else []
    models = [line.split(":")[1].strip() for line in lines if "model name" in line]
    threads = os.environ.get("OPENBLAS_NUM_THREADS", "all")
    product = f"f64 matrix product {max(rates):.0f} GF/s ({threads} BLAS threads)"
    return f"{(models or [platform.processor()])[0]}, {os.cpu_count()} cores; {product}"


if __name__ == "__main__":
    main()
