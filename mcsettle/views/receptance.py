"""Rail receptance over wavenumber and frequency, straight from the track model.

Depends on: beam, fem25d, transfer.
"""

from dataclasses import dataclass

import numpy as np

from mcsettle.beam import BeamResponse
from mcsettle.fem25d import SectionResponse
from mcsettle.transfer import TrackResponse


@dataclass(frozen=True)
class ReceptanceMap:
    """``receptance`` [K, W] m/(N/m), modulus of ũ(k, ω), over k [K] rad/m and ω [W] rad/s.

    Rail displacement for a unit load per wheelset, waves e^{i(ωt - kx)}. ``lines``: label and speed
    [m/s] of the lines ω = k v worth drawing; ``ground_speed`` [m/s] and what it is called.
    """

    wavenumbers: np.ndarray
    omegas: np.ndarray
    receptance: np.ndarray
    lines: tuple[tuple[str, float], ...]
    ground_speed: float
    ground_label: str


def receptance_map(
    response: TrackResponse,
    wavenumbers: np.ndarray,
    omegas: np.ndarray,
    lines: tuple[tuple[str, float], ...],
) -> ReceptanceMap:
    """|ũ(k, ω)| of a section or a beam track for k > 0 and ω ≥ 0.

    Raises
    ------
    TypeError
        If the response is neither.
    """
    if isinstance(response, SectionResponse):
        rows = [response.at(k, omegas)[:, 0] for k in wavenumbers.tolist()]
        speed, label = response.lowest_rayleigh_speed, "Rayleigh wave of the ground"
    elif isinstance(response, BeamResponse):
        rows = [_beam(response, k, omegas) for k in wavenumbers.tolist()]
        speed, label = response.rayleigh_speed, "critical speed of the beam"
    else:
        raise TypeError(f"no receptance of a {type(response).__name__}")
    return ReceptanceMap(wavenumbers, omegas, np.abs(np.array(rows)), lines, speed, label)


def _beam(response: BeamResponse, wavenumber: float, omegas: np.ndarray) -> np.ndarray:
    """ũ(k, ω) = 1 / 2[EI k⁴ (1 + iη_r) - m ω² + s (1 + iη)] at ω > 0."""
    rail, track = response.track.rail, response.track
    bending = rail.bending_stiffness * wavenumber**4 * (1.0 + 1j * rail.damping)
    support = track.support_stiffness * (1.0 + 1j * track.support_damping)
    return np.asarray(0.5 / (bending - rail.mass_per_length * omegas**2 + support))
