"""Read this first: one axle passage over one realisation, in plain NumPy. The definition of Step B.

The profile is Δu(x) = Re Σ_k U_k e^{ikx} on a periodic window, positive downwards. When axle j of a
train stands at x, the centreline below it carries

    stress(x, z) = quasi-static + dynamic + (geostatic, if stress = "total"),
    dynamic(x, z) = Re Σ_k U_k dynamic[j, k, :, z] e^{ikx},

its deviatoric part σ_d follows Eq. (10), every layer strains by Eq. (1) or (2), and the strains times
thickness add up to the settlement of x. The profile grows by the settlement's content in the band of
its own modes; the mean is uniform settlement and does not roughen the track.
"""

import numpy as np

from mcsettle.railway.settlement_model import SettlementModel
from mcsettle.step_a.transfer import TransferFunctions
from mcsettle.step_b.settlement import long_run_rate, strain_increment
from mcsettle.step_b.stress import deviatoric_stress, mean_state


def grid_size(highest_mode: int, varies: bool = False) -> int:
    """Points on the window so that products of two modes, and a little more, do not alias.

    With support that ``varies`` in modes up to twice the highest, products of three do not alias into
    the band. Of the form 16 · 2^a · 3^b, which the fast kernel transforms.
    """
    least = max(16.0, (5.0 if varies else 3.8) * highest_mode + varies)
    sizes = [16 * 2**a * 3**b for a in range(24) for b in range(16)]
    return min(size for size in sizes if size >= least)


def mode_numbers(wavenumbers: np.ndarray, window: float) -> np.ndarray:
    """Integer mode numbers n = k window / 2π, shape [K]."""
    modes = np.rint(wavenumbers * window / (2.0 * np.pi)).astype(int)
    if not np.allclose(modes * 2.0 * np.pi / window, wavenumbers, rtol=1e-9):
        raise ValueError(f"the wavenumbers are not modes of a window of {window} m")
    return modes


def settlement_of_passage(
    amplitudes: np.ndarray,
    axle: int,
    transfer: TransferFunctions,
    model: SettlementModel,
    cycles: np.ndarray,
    window: float,
    susceptibility: np.ndarray | None = None,
) -> np.ndarray:
    """Settlement at every x due to one passage of axle ``axle``.

    Parameters
    ----------
    amplitudes : complex [K], profile amplitudes U_k, m
    axle : index of the axle in the train
    transfer : TransferFunctions of the train at its speed
    model : SettlementModel
    cycles : [L] cycles N each track layer has seen before this passage
    window : length of the periodic window, m
    susceptibility : [L, X] h of each track layer at every x: its strain is multiplied by 1 + h

    Returns
    -------
    [X] settlement in m, positive down, at x = window · (0 … X−1)/X
    """
    modes = mode_numbers(transfer.wavenumbers, window)
    n_points = grid_size(int(modes.max())) if susceptibility is None else susceptibility.shape[1]
    x = np.arange(n_points) / n_points
    waves = np.exp(2j * np.pi * np.outer(x, modes))
    dynamic = np.real(np.einsum("xk,k,kcz->cxz", waves, amplitudes, transfer.dynamic[axle]))
    mean = mean_state(transfer.quasi_static[axle], transfer.geostatic, model.stress)
    sigma_d = deviatoric_stress(*(mean[:, None, :] + dynamic))
    settlement = np.zeros(n_points)
    for index, law in enumerate(model.laws):
        here = transfer.grid.layer == index
        if law is not None and here.any():
            strain = strain_increment(
                law,
                sigma_d[:, here],
                cycles[index],
                model.cycles_per_passage,
                long_run_rate(law, model),
            )
            settled = strain @ transfer.grid.weights[here]
            if susceptibility is not None:
                settled = (1.0 + susceptibility[index]) * settled
            settlement += settled
    return model.settlement_factor * settlement


def in_band(settlement: np.ndarray, modes: np.ndarray) -> np.ndarray:
    """Complex amplitudes [K] of ``settlement`` [X] at the mode numbers ``modes`` [K]."""
    return 2.0 * np.fft.rfft(settlement)[modes] / settlement.size


def passage(
    amplitudes: np.ndarray,
    axle: int,
    transfer: TransferFunctions,
    model: SettlementModel,
    cycles: np.ndarray,
    window: float,
    susceptibility: np.ndarray | None = None,
    following: np.ndarray | float = 1.0,
) -> tuple[np.ndarray, float]:
    """Advance one realisation by one axle passage.

    Parameters as ``settlement_of_passage``; ``following`` [K] is the part of the settlement that the
    rail follows (1 without its bending).

    Returns
    -------
    complex [K] new profile amplitudes, m, and the uniform settlement of this passage, m
    """
    settlement = settlement_of_passage(
        amplitudes, axle, transfer, model, cycles, window, susceptibility
    )
    modes = mode_numbers(transfer.wavenumbers, window)
    return amplitudes + following * in_band(settlement, modes), float(settlement.mean())
