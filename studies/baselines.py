"""What the benchmark compares the kernels with: NumPy, SciPy's FFT and Numba on the same problem.

Each design takes (transfer, model, tracks) and returns a function that advances them and says by how many
passages, and the change of track 0 over one train, or None.
"""

import numpy as np
import scipy.fft

from mcsettle.railway.irregularity import sample_profiles, wavenumbers
from mcsettle.railway.settlement_model import SettlementModel
from mcsettle.railway.spectra import spectrum
from mcsettle.railway.track import TOY_TRACK
from mcsettle.railway.traffic import Train
from mcsettle.railway.vehicle import PASSENGER
from mcsettle.step_a.beam import beam_response
from mcsettle.step_a.interaction import precompute
from mcsettle.step_a.transfer import TransferFunctions
from mcsettle.step_b import passage
from mcsettle.step_b.mode_pairs import ModePairs, mode_pairs
from mcsettle.step_b.settlement import cycle_increment, strain_scale
from mcsettle.step_b.spectral import axle_form, growth, train_form
from mcsettle.step_b.stress import DEVIATOR, mean_state
from mcsettle.units import KMH

WINDOW = 200.0
CYCLES = 1e5
AXLES = 44


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


def numpy_fields(transfer, model, tracks):
    """One realisation, one passage at a time: every stress field by an inverse transform."""
    modes, n_points = passage.mode_numbers(transfer.wavenumbers, WINDOW), 256
    means = [mean_state(q, transfer.geostatic, model.stress) for q in transfer.quasi_static]
    layers = [transfer.grid.layer == layer for layer in model.settling_layers]
    w = weights_of(model)[0]
    spectrum_of = np.zeros((*transfer.dynamic.shape[2:], n_points // 2 + 1), dtype=complex)
    responses = np.ascontiguousarray(np.moveaxis(transfer.dynamic, 1, -1))  # [J, 4, Z, K]
    first, last = modes[0], modes[-1] + 1

    def settle(u: np.ndarray, axle: int) -> np.ndarray:
        np.multiply(responses[axle], u * (n_points / 2), out=spectrum_of[..., first:last])
        xx, yy, zz, xz = means[axle][..., None] + scipy.fft.irfft(spectrum_of, n_points)
        q2 = (xx * xx + yy * yy + zz * zz - xx * yy - yy * zz - zz * xx) + 3.0 * xz * xz
        total = np.zeros(n_points)
        for g, (law, here) in enumerate(zip(model.group_laws, layers, strict=True)):
            scale = w[g] * strain_scale(law) * transfer.grid.weights[here]
            total += scale @ (q2[here] if law.exponent == 2.0 else q2[here] ** (law.exponent / 2))
        return 2.0 / n_points * scipy.fft.rfft(total)[first:last]

    change = sum(settle(tracks[0], j) for j in range(len(means)))

    def advance() -> int:
        u = tracks[0].copy()
        for axle in range(AXLES):
            u += settle(u, axle)
        return AXLES

    return advance, change


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
    forms = axle_form(transfer, 0, model, pairs)
    every = np.concatenate([forms.linear, forms.sums, forms.differences], axis=1)
    form = np.einsum("g,gcx->cx", w, np.stack([every.real, every.imag], axis=-1))
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

    args = pairs.sums, pairs.sum_start, pairs.differences, pairs.difference_start

    def advance() -> int:
        burst(state, 44, form, *args)
        return 44 * n_tiles * lanes

    return advance, None
