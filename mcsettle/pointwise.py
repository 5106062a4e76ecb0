"""The passage at every x and depth, for many realisations: what the spectral form is checked against.

Depends on: passage, settlement, stress, transfer, mcsettle.kernels.
"""

from dataclasses import dataclass

import numpy as np

from mcsettle.passage import grid_size, mode_numbers
from mcsettle.settlement import SettlementModel, strain_scale
from mcsettle.stress import DEVIATOR, mean_state
from mcsettle.transfer import TransferFunctions


@dataclass(frozen=True)
class PointwiseLoad:
    """One train as the pointwise kernel takes it: J axles, Z settling depths, X grid points.

    ``response`` [J, Z, 3, K, 2] Pa/m and ``mean`` [J, Z, 3] Pa are deviators; ``coefficient`` [Z] is
    strain scale times thickness; ``exponent``, ``group`` [Z]; ``waves`` [X, K, 2].
    """

    response: np.ndarray
    mean: np.ndarray
    coefficient: np.ndarray
    exponent: np.ndarray
    group: np.ndarray
    waves: np.ndarray


def pointwise_load(
    transfer: TransferFunctions, model: SettlementModel, window: float
) -> PointwiseLoad:
    """Lay the transfer functions out for the pointwise kernel."""
    grid, groups = transfer.grid, model.settling_layers
    here = np.flatnonzero(np.isin(grid.layer, groups))
    group = np.searchsorted(groups, grid.layer[here]).astype(np.int32)
    laws = [model.group_laws[g] for g in group]
    state = mean_state(transfer.quasi_static, transfer.geostatic, model.stress)[..., here]
    response = np.einsum("dc,jkcz->jzdk", DEVIATOR, transfer.dynamic[..., here])
    modes = mode_numbers(transfer.wavenumbers, window)
    x = np.arange(grid_size(int(modes.max())))
    phase = 2.0 * np.pi * np.outer(x, modes) / len(x)
    return PointwiseLoad(
        response=np.ascontiguousarray(np.stack([response.real, response.imag], axis=-1)),
        mean=np.ascontiguousarray(np.einsum("dc,jcz->jzd", DEVIATOR, state)),
        coefficient=grid.weights[here] * [strain_scale(law) for law in laws],
        exponent=np.array([law.exponent for law in laws]),
        group=group,
        waves=np.ascontiguousarray(np.stack([np.cos(phase), np.sin(phase)], axis=-1)),
    )


def pointwise_growth(
    load: PointwiseLoad, axles: np.ndarray, amplitudes: np.ndarray, weights: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Growth under the given axles at a frozen profile, by the Taichi kernel.

    Parameters
    ----------
    load : PointwiseLoad
    axles : indices of the axles that pass
    amplitudes : complex [R, K], m
    weights : [R, G] growth of each group's cycle function times the settlement factor

    Returns
    -------
    complex [R, K] growth of the amplitudes, m, and [R] uniform settlement, m
    """
    from mcsettle.kernels import pointwise, runtime

    runtime.start()
    n, n_modes = amplitudes.shape
    u = np.ascontiguousarray(amplitudes).view(float).reshape(n, n_modes, 2)
    growth, uniform = np.zeros_like(u), np.zeros(n)
    w = np.ascontiguousarray(weights, dtype=float)
    for j in axles:
        pointwise.add_passage(
            u, w, load.response[j], load.mean[j], load.coefficient, load.exponent,
            load.group, load.waves, growth, uniform,
        )  # fmt: skip
    return growth.view(complex)[..., 0], uniform
