"""How far the second-order form is off, and what to compute with instead.

The form is exact where every settlement exponent is 2. Elsewhere its relative error grows with the square
of the dynamic stress, so it is measured at the start and, the tracks scaled up, at the limit: against
every x and depth, in NumPy, on the realisations of fixed indices. A whole scenario computes one way.
"""

import numpy as np

from mcsettle.step_a.transfer import TransferFunctions
from mcsettle.step_b.case import Case
from mcsettle.step_b.cycles import daily_weights
from mcsettle.step_b.passage import grid_size, in_band, mode_numbers
from mcsettle.step_b.sd_map import roughness
from mcsettle.step_b.settlement import strain_scale
from mcsettle.step_b.spectral import growth, mode_pairs, train_form
from mcsettle.step_b.stress import deviatoric_stress, mean_state

LARGEST_ERROR = 3e-3  # of the growth: some 0.3 % in days at most


def expansion_error(case: Case, amplitudes: np.ndarray) -> float:
    """Relative error of the second-order form, against every x and depth, on a sample.

    The sample is the middle car of every service. Largest over the services and the realisations
    [R, K] of max|ΔU − ΔU_exact| / max|ΔU_exact|. Nothing but rounding where every exponent is 2.
    """
    pairs = mode_pairs(mode_numbers(case.transfers[0].wavenumbers, case.window))
    weights = daily_weights(case, np.zeros(len(amplitudes)))
    n_groups, worst = len(case.model.group_laws), 0.0
    for s, transfer in enumerate(case.transfers):
        own = weights[:, s * n_groups : (s + 1) * n_groups]
        middle = 4 * (len(transfer.quasi_static) // 8)
        axles = np.arange(middle, min(middle + 4, len(transfer.quasi_static)))
        form = train_form(transfer, case.model, pairs, axles)
        fast, _ = growth(form, amplitudes, own, pairs)
        for row, (u, w) in enumerate(zip(amplitudes, own, strict=True)):
            slow = sum(_growth(case, transfer, int(axle), u, w) for axle in axles)
            error = np.max(np.abs(fast[row] - slow)) / np.max(np.abs(slow))
            worst = max(worst, float(error))
    return worst


def worst_error(case: Case, amplitudes: np.ndarray) -> float:
    """``expansion_error`` of the tracks [R, K] as they are and scaled up to the SD limit."""
    sd = roughness(case.transfers[0].wavenumbers, case.window).sd(amplitudes)
    up = np.maximum(case.sd_limit / sd, 1.0)
    return expansion_error(case, np.concatenate([amplitudes, amplitudes * up[:, None]]))


def _growth(
    case: Case, transfer: TransferFunctions, axle: int, u: np.ndarray, weights: np.ndarray
) -> np.ndarray:
    """Growth [K] of the amplitudes u [K] under one axle, every x and depth, weights [G]."""
    modes = mode_numbers(transfer.wavenumbers, case.window)
    n_points = grid_size(int(modes.max()))
    spectrum = np.zeros((*transfer.dynamic.shape[2:], n_points // 2 + 1), dtype=complex)
    spectrum[..., modes] = np.moveaxis(u[:, None, None] * transfer.dynamic[axle], 0, -1)
    dynamic = np.fft.irfft(spectrum, n_points) * (n_points / 2.0)  # [4, Z, X]
    mean = mean_state(transfer.quasi_static[axle], transfer.geostatic, case.model.stress)
    sigma_d = deviatoric_stress(*(mean[..., None] + dynamic))
    settlement = np.zeros(n_points)
    for g, layer in enumerate(case.model.settling_layers):
        law, here = case.model.group_laws[g], transfer.grid.layer == layer
        scale = weights[g] * strain_scale(law) * transfer.grid.weights[here]
        settlement += scale @ sigma_d[here] ** law.exponent
    return in_band(settlement, modes)
