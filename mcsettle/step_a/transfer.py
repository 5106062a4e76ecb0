"""What Step B may know of Step A: moving-load transfer functions of one train at one speed.

A track model answers one question (``TrackResponse.spectra``): the response along the track
centreline, in the wavenumber domain, to a unit load per wheelset that oscillates at Ω and moves at v.
With the time factor e^{iωt} and the wavenumber factor e^{-ikx} that load excites (k, ω = Ω + kv), and
at distance s ahead of the load the response is

    f(s) = e^{iΩt} (1/2π) ∫ f̃(k, Ω + kv) e^{-iks} dk.

``TransferFunctions`` holds, for every axle of a train, the quasi-static stress when that axle is
overhead and the dynamic stress per unit complex profile amplitude, with all axles acting.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Protocol

import numpy as np

COMPONENTS = ("xx", "yy", "zz", "xz")


@dataclass(frozen=True)
class DepthGrid:
    """Quadrature over depth on the track centreline.

    ``z`` [Z] m (up, 0 at the subgrade surface), falling; ``weights`` [Z] m, thickness each point
    stands for; ``layer`` [Z] index into the track's layers. Within each layer the weights add up to
    its height (for the last one to the integration depth).
    """

    z: np.ndarray
    weights: np.ndarray
    layer: np.ndarray


class Spectra(Protocol):
    """Response to a unit moving load at one (Ω, v) as quadrature over wavenumber, both signs."""

    @property
    def wavenumbers(self) -> np.ndarray:
        """Wavenumbers k [Q] rad/m, always the same object for one rule."""
        ...

    @property
    def weights(self) -> np.ndarray:
        """Weights [Q] rad/m that integrate over k; the factor 1/2π is *not* in them."""
        ...

    @property
    def receptance(self) -> np.ndarray:
        """The rail's ũ(k, Ω + kv) [Q] m/N·m, positive down."""
        ...

    @property
    def stress(self) -> np.ndarray:
        """Stress [Q, 4, Z] Pa/N·m in the order of ``COMPONENTS``, positive in tension."""
        ...

    def stress_under(self, factors: np.ndarray) -> np.ndarray:
        """Sums [J, 4, Z] of the stress over the wavenumbers with ``factors`` [J, Q]."""
        ...


@dataclass(frozen=True)
class WavenumberSpectra:
    """``Spectra`` all of whose stresses are known: [Q], [Q], [Q] and [Q, 4, Z]."""

    wavenumbers: np.ndarray
    weights: np.ndarray
    receptance: np.ndarray
    stress: np.ndarray

    def stress_under(self, factors: np.ndarray) -> np.ndarray:
        """Sums [J, 4, Z] of the stress over the wavenumbers with ``factors`` [J, Q]."""
        flat = self.stress.reshape(self.wavenumbers.size, -1)
        return np.asarray((factors @ flat).reshape(factors.shape[0], *self.stress.shape[1:]))


class TrackResponse(Protocol):
    """Step A of one track: everything the interaction needs, for any speed and frequency."""

    @property
    def grid(self) -> DepthGrid:
        """Depths at which stresses are given."""
        ...

    @property
    def geostatic(self) -> np.ndarray:
        """Geostatic stress [4, Z] Pa (compression negative, xz zero)."""
        ...

    @property
    def rayleigh_speed(self) -> float:
        """Rayleigh wave speed of the lowest layer [m/s] (``inf`` where none limits the model)."""
        ...

    @property
    def digest(self) -> str:
        """Hex digest of everything the response depends on."""
        ...

    @property
    def rail_bending_stiffness(self) -> float:
        """EI of one rail [N m²]."""
        ...

    def standing(self, wavenumbers: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Response to a standing load per wheelset (ω → 0) at ``wavenumbers`` [K] rad/m.

        Receptance [K] m/N·m and stress [K, 4, Z] Pa/N·m, as in ``Spectra``.
        """
        ...

    def spectra(self, speed: float, omegas: np.ndarray) -> Iterator[Spectra]:
        """Spectra at ``speed`` [m/s] for each driving frequency Ω of ``omegas`` [rad/s], in order.

        Ω = 0 is the quasi-static case of a constant moving load.
        """
        ...


@dataclass(frozen=True)
class TransferFunctions:
    """Step A for one train at one speed on one track; J axles, K profile modes, Z depths.

    ``wavenumbers`` [K] rad/m of the profile modes; ``quasi_static`` [J, 4, Z] Pa with axle j overhead;
    ``dynamic`` [J, K, 4, Z] complex, Pa per metre of profile amplitude; ``force`` [J, K] complex, N per
    metre of amplitude, phase at the instant and place of axle j; ``track_compliance`` [K] complex, m/N
    (a single axle's own term, Eq. 13); ``geostatic`` [4, Z] Pa; ``rail_deflection`` [J] m quasi-static;
    ``following`` [K] the part of a settlement that the rail follows where its bending counts, else None.

    With the profile Δu(x) = Re Σ U_k e^{ikx}, the dynamic stress at x under axle j is
    Re Σ U_k dynamic[j, k] e^{ikx}.
    """

    train: str
    speed: float
    wavenumbers: np.ndarray
    grid: DepthGrid
    quasi_static: np.ndarray
    dynamic: np.ndarray
    force: np.ndarray
    track_compliance: np.ndarray
    geostatic: np.ndarray
    rail_deflection: np.ndarray
    digest: str
    following: np.ndarray | None = None
