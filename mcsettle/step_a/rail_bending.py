"""The rail's own bending: load that moves from hollows to humps.

A rail that is straight when free presses less where it dips. Where the support has settled by e, the rail
takes the shape U = H e and the force on the pads under one rail changes by −EI k⁴ U per metre, whatever
the support. With ũ and σ̃ the response of the track to a standing load (k, ω → 0) per wheelset,

    H = 1 − 2 EI k⁴ ũ,    stress per metre of profile = −EI k⁴ σ̃* / (½ − EI k⁴ ũ).

The profile is e^{+ikx}, the response e^{−ikx}: hence the conjugate. A standing load loses no energy:
of ũ, σxx, σyy and σzz the real part counts, of σxz, which is odd, the imaginary one.
"""

from dataclasses import dataclass, replace

import numpy as np

from mcsettle.step_a.transfer import TrackResponse, TransferFunctions


@dataclass(frozen=True)
class RailBending:
    """Of K profile modes: ``stress`` complex [K, 4, Z] Pa per metre of profile, of the standing load;
    ``following`` [K] the part H of a settlement of the support that the rail follows.
    """

    stress: np.ndarray
    following: np.ndarray


def rail_bending(response: TrackResponse, wavenumbers: np.ndarray) -> RailBending:
    """The standing load of a bent rail on the track of ``response``, at ``wavenumbers`` [K] rad/m."""
    receptance, stress = response.standing(wavenumbers)
    force = response.rail_bending_stiffness * np.asarray(wavenumbers, dtype=float) ** 4
    own = stress.real.astype(complex)
    own[:, 3] = -1j * stress[:, 3].imag
    scale = -force / (0.5 - force * receptance.real)
    return RailBending(scale[:, None, None] * own, 1.0 - 2.0 * force * receptance.real)


def with_rail_bending(
    transfer: TransferFunctions,
    response: TrackResponse,
    small_strain: TrackResponse,
    share: float,
    digest: str,
) -> TransferFunctions:
    """``transfer`` on the track of ``response`` with ``share`` of the standing load of its bent rail.

    What the rail follows is one for all services: that of the track at ``small_strain``.
    """
    bending = rail_bending(response, transfer.wavenumbers)
    following = rail_bending(small_strain, transfer.wavenumbers).following
    return replace(
        transfer,
        dynamic=transfer.dynamic + share * bending.stress,
        following=following,
        digest=digest,
    )
