"""How far the second-order form is off, and what to compute with instead.

The form is exact where every settlement exponent is 2 and the support does not vary. Elsewhere its
relative error grows with the square of the dynamic stress, so it is measured at the start and, the
tracks scaled up, at the limit: against every x and depth, in NumPy, on the realisations of fixed
indices. A whole scenario computes one way.
"""

import numpy as np

from mcsettle.railway.spatial_variability import to_points
from mcsettle.step_a.transfer import TransferFunctions
from mcsettle.step_b.case import ALIKE, Case, Support
from mcsettle.step_b.cycles import daily_weights
from mcsettle.step_b.passage import grid_size, in_band, mode_numbers
from mcsettle.step_b.sd_map import roughness
from mcsettle.step_b.settlement import strain_scale
from mcsettle.step_b.spectral import train_form
from mcsettle.step_b.stress import deviatoric_stress, mean_state
from mcsettle.step_b.susceptibility import VaryingForm, varying_growth

LARGEST_ERROR = 3e-3  # of the growth: some 0.3 % in days at most


def expansion_error(case: Case, amplitudes: np.ndarray, support: Support = ALIKE) -> float:
    """Relative error of the second-order form, against every x and depth, on a sample.

    The sample is the middle car of every service. Largest over the realisations [R, K], and over the
    services, of max|ΔU − ΔU_exact| / max|ΔU_exact|; where the support varies, what is left out is of
    third order in a growth that is mostly forced, and the services of a day count together.
    """
    weights = daily_weights(case, np.zeros(len(amplitudes)))
    n_groups, pairs = len(case.model.group_laws), case.mode_pairs
    errors, sizes = [], []
    for s, transfer in enumerate(case.transfers):
        of_service = weights[:, s * n_groups : (s + 1) * n_groups]
        middle = 4 * (len(transfer.quasi_static) // 8)
        axles = np.arange(middle, min(middle + 4, len(transfer.quasi_static)))
        form = VaryingForm(
            train_form(transfer, case.model, pairs, axles),
            case.group_multipliers,
            case.following,
            case.first_mode,
        )
        fast, _ = varying_growth(form, amplitudes, of_service, pairs, support.fields)
        local = _local(case, support, len(amplitudes))
        slow = np.stack(
            [
                sum(_growth(case, transfer, int(axle), u, w, h) for axle in axles)
                for u, w, h in zip(amplitudes, of_service, local, strict=True)
            ]
        )
        share = len(transfer.quasi_static) / len(axles)
        errors.append(share * (fast - slow))
        sizes.append(share * slow)
    if support.fields is not None:
        errors, sizes = [np.sum(errors, axis=0)], [np.sum(sizes, axis=0)]
    worst = [
        np.abs(error).max(axis=1) / np.abs(size).max(axis=1)
        for error, size in zip(errors, sizes, strict=True)
    ]
    return float(np.max(worst))


def worst_error(case: Case, amplitudes: np.ndarray, support: Support = ALIKE) -> float:
    """``expansion_error`` of the tracks [R, K] as they are and scaled up to the SD limit."""
    sd = roughness(case.transfers[0].wavenumbers, case.window).sd(amplitudes)
    up = np.maximum(case.sd_limit / sd, 1.0)
    twice = np.concatenate([np.arange(len(amplitudes))] * 2)
    both = np.concatenate([amplitudes, amplitudes * up[:, None]])
    return expansion_error(case, both, support[twice])


def _local(case: Case, support: Support, n: int) -> list[np.ndarray | None]:
    """1 + h [G, X] of the settlement groups of each track; None where it is 1."""
    if support.fields is None:
        return [None] * n
    last = case.first_mode + len(case.wavenumbers) - 1
    mixed = np.einsum("fg,rfm->rgm", case.group_multipliers, support.fields)
    return list(1.0 + to_points(mixed, grid_size(last, varies=True)))


def _growth(
    case: Case,
    transfer: TransferFunctions,
    axle: int,
    u: np.ndarray,
    weights: np.ndarray,
    local: np.ndarray | None = None,
) -> np.ndarray:
    """Growth [K] of the amplitudes u [K] under one axle, every x and depth, weights [G].

    ``local`` [G, X] multiplies what the groups settle at each x.
    """
    modes = mode_numbers(transfer.wavenumbers, case.window)
    n_points = grid_size(int(modes.max())) if local is None else local.shape[1]
    spectrum = np.zeros((*transfer.dynamic.shape[2:], n_points // 2 + 1), dtype=complex)
    spectrum[..., modes] = np.moveaxis(u[:, None, None] * transfer.dynamic[axle], 0, -1)
    dynamic = np.fft.irfft(spectrum, n_points) * (n_points / 2.0)  # [4, Z, X]
    mean = mean_state(transfer.quasi_static[axle], transfer.geostatic, case.model.stress)
    sigma_d = deviatoric_stress(*(mean[..., None] + dynamic))
    settlement = np.zeros(n_points)
    for g, layer in enumerate(case.model.settling_layers):
        law, here = case.model.group_laws[g], transfer.grid.layer == layer
        scale = weights[g] * strain_scale(law) * transfer.grid.weights[here]
        settled = scale @ sigma_d[here] ** law.exponent
        settlement += settled if local is None else local[g] * settled
    return case.rail_follows * in_band(settlement, modes)
