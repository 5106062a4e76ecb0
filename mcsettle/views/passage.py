"""Figs. 5 and 6: stress and settlement along the track from one axle, quasi-static and dynamic.

Depends on: irregularity, passage, settlement, stress, transfer, views.stress.
"""

from dataclasses import dataclass, replace

import numpy as np

from mcsettle.irregularity import to_space
from mcsettle.passage import settlement_of_passage
from mcsettle.settlement import SettlementModel
from mcsettle.stress import deviatoric_stress
from mcsettle.transfer import TransferFunctions


@dataclass(frozen=True)
class AxlePassage:
    """One axle over one profile.

    At ``x`` [X] m, when the axle is overhead: ``profile`` m (positive down); deviatoric stress Pa at
    one height: ``total``, of the ``dynamic`` part alone, and ``quasi_static`` (one number). At
    ``places`` [P] m: settlement m of the uppermost settling layer and of all; ``*_quasi_static``
    without a profile (one number each).
    """

    label: str
    x: np.ndarray
    profile: np.ndarray
    total: np.ndarray
    dynamic: np.ndarray
    quasi_static: float
    places: np.ndarray
    first_layer: np.ndarray
    all_layers: np.ndarray
    first_layer_quasi_static: float
    all_layers_quasi_static: float


def axle_passage(
    transfer: TransferFunctions,
    axle: int,
    amplitudes: np.ndarray,
    weights: np.ndarray,
    model: SettlementModel,
    window: float,
    label: str = "",
) -> AxlePassage:
    """Stress and settlement along the window as axle ``axle`` passes.

    Parameters
    ----------
    transfer : TransferFunctions of the train at its speed
    axle : int
    amplitudes : complex [K] m, the profile
    weights : [Z], carry stresses to the height looked at (``views.stress.layer_weights``)
    model : SettlementModel; the cycles are those before the first passage
    window : float, m
    """
    x = np.linspace(0.0, window, 801)
    waves = amplitudes[:, None] * np.exp(1j * np.outer(transfer.wavenumbers, x))
    dynamic = np.real((transfer.dynamic[axle] @ weights).T @ waves)  # [4, X]
    static = transfer.quasi_static[axle] @ weights
    upper = model.settling_layers[0]
    laws = tuple(law if i == upper else None for i, law in enumerate(model.laws))
    first = replace(model, laws=laws)
    cycles = np.array([1.0 if law is None else model.cycles_before(law) for law in model.laws])

    def settlement(which: SettlementModel, profile: np.ndarray) -> np.ndarray:
        return settlement_of_passage(profile, axle, transfer, which, cycles, window)

    flat = np.zeros_like(amplitudes)
    everything = settlement(model, amplitudes)
    return AxlePassage(
        label=label,
        x=x,
        profile=to_space(amplitudes[None], transfer.wavenumbers, x)[0],
        total=deviatoric_stress(*(static[:, None] + dynamic)),
        dynamic=deviatoric_stress(*dynamic),
        quasi_static=float(deviatoric_stress(*static)),
        places=window * np.arange(everything.size) / everything.size,
        first_layer=settlement(first, amplitudes),
        all_layers=everything,
        first_layer_quasi_static=float(settlement(first, flat)[0]),
        all_layers_quasi_static=float(settlement(model, flat)[0]),
    )
