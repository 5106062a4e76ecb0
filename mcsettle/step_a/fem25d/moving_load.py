"""Step A as Step B sees it: the response of a ballasted track to a moving oscillating load.

The reduced section gives H, the mean displacement under the rail foot, and the stresses per unit
pad force. Rail (EI k⁴ - m ω²) and pad (p = k_p + iωc_p) join in closed form: with the support
stiffness S = 1/(1/p + H) a force F on one rail gives the rail F/(EI k⁴ - mω² + S) and the pad S
times that. A unit force per wheelset is F = 1/2 on each rail.

Below zero frequency the hysteretic moduli are conjugate, so response(k, -ω) = conj response(-k, ω);
σxx, σyy, σzz and the displacement are even in k, τxz is odd.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from mcsettle.railway.track import SectionTrack, rayleigh_speed
from mcsettle.step_a.depths import geostatic_stress
from mcsettle.step_a.fem25d.depth_grid import depth_grid
from mcsettle.step_a.fem25d.modal import ModalBand, modal_bands
from mcsettle.step_a.fem25d.reduced_basis import Band, Bases
from mcsettle.step_a.fem25d.settings import Settings
from mcsettle.step_a.fem25d.track_section import ElementProperties
from mcsettle.step_a.fem25d.wavenumber_rule import (
    Quadrature,
    Support,
    jump_shares,
    smooth_support,
    wavenumber_quadrature,
)
from mcsettle.step_a.transfer import DepthGrid, WavenumberSpectra

CHUNK = 8  # driving frequencies evaluated together


def rail_coupling(
    track: SectionTrack,
    k: np.ndarray,
    omega: np.ndarray,
    foot: np.ndarray,
    sign: np.ndarray | float = 1.0,
) -> tuple[np.ndarray, np.ndarray]:
    """Rail receptance [m/N·m] and force on one pad [N/N] under a unit force per wheelset.

    ``foot`` is the mean displacement under the rail foot per unit pad force [m/N·m] at the
    wavenumbers ``k`` [rad/m] and frequencies ``omega`` [rad/s]; ``sign`` that of the frequency
    whose moduli are meant. All [N].
    """
    rail, pad = track.rail, track.pad
    factor = 2.0 if track.damping_convention == "damping_ratio" else 1.0
    bending = rail.bending_stiffness * (1.0 + 1j * factor * rail.damping * sign)
    free = bending * k**4 - rail.mass_per_length * omega**2
    support = 1.0 / (1.0 / (pad.stiffness + 1j * omega * pad.damping) + foot)
    receptance = 0.5 / (free + support)
    return receptance, support * receptance


@dataclass(frozen=True, eq=False)
class SectionResponse:
    """Response of a section track to a unit moving load per wheelset (a ``TrackResponse``).

    ``load`` gives the reduced bases; it is called when they are first needed.
    ``properties`` are those of the elements where the soil is equivalent-linear; the wave speeds are
    those of the layers at small strains.
    """

    track: SectionTrack
    integration_depth: float
    settings: Settings
    load: Callable[[], Bases]
    digest: str
    properties: ElementProperties | None = None

    @cached_property
    def bases(self) -> Bases:
        """The reduced bases."""
        return self.load()

    @property
    def bands(self) -> tuple[Band, ...]:
        """The bases' bands, by rising wavenumber."""
        return self.bases.bands

    @property
    def errors(self) -> np.ndarray:
        """Relative errors [n] against direct solutions at random (k, ω) outside the training set."""
        return self.bases.errors

    @cached_property
    def grid(self) -> DepthGrid:
        """Depths at which stresses are given."""
        return depth_grid(self.track, self.integration_depth)

    @cached_property
    def geostatic(self) -> np.ndarray:
        """Geostatic stress [4, Z] Pa (compression negative, xz zero)."""
        return geostatic_stress(self.track.layers, self.grid)

    @property
    def rayleigh_speed(self) -> float:
        """Rayleigh wave speed of the lowest layer [m/s]."""
        return rayleigh_speed(self.track.layers[-1].material)

    @property
    def rail_bending_stiffness(self) -> float:
        """EI of one rail [N m²]."""
        return self.track.rail.bending_stiffness

    def standing(self, wavenumbers: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Response to a standing load at ``wavenumbers`` [K] rad/m; see ``TrackResponse``."""
        both = np.concatenate([self.at(float(k), np.zeros(1)) for k in np.atleast_1d(wavenumbers)])
        return both[:, 0], both[:, 1:].reshape(len(both), 4, -1)

    @property
    def lowest_rayleigh_speed(self) -> float:
        """Rayleigh wave speed of the softest ground layer [m/s]."""
        return min(rayleigh_speed(layer.material) for layer in self.track.ground)

    @property
    def error_estimate(self) -> float:
        """Largest relative error of the reduced bases at the held-out points."""
        return float(np.max(self.errors))

    @property
    def solves(self) -> int:
        """Direct solutions spent on the bases."""
        return sum(band.solves for band in self.bands)

    @cached_property
    def quadrature(self) -> Quadrature:
        """Rule over positive wavenumbers."""
        s = self.settings
        return wavenumber_quadrature(s.bands[-1], s.panel, s.panel_points)

    @cached_property
    def _support(self) -> Support:
        factor = 0.5 if self.track.damping_convention == "loss_factor" else 1.0
        least = min(layer.material.damping for layer in self.track.layers)
        return smooth_support(self.quadrature, factor * least)

    @cached_property
    def _modal(self) -> list[ModalBand]:
        return self.modal(self.bands)

    def spectra(self, speed: float, omegas: np.ndarray) -> Iterator[WavenumberSpectra]:
        """Spectra at ``speed`` [m/s] for each driving frequency Ω of ``omegas`` [rad/s], in order.

        Raises
        ------
        ValueError
            If the speed or a frequency lies outside the range of the settings.
        """
        omegas = np.atleast_1d(np.asarray(omegas, dtype=float))
        s = self.settings
        if not 0.0 < speed <= s.max_speed:
            raise ValueError(f"speed is {speed} m/s; it must lie in (0, {s.max_speed}]")
        if omegas.size and not (omegas.min() >= 0.0 and omegas.max() <= s.max_omega):
            raise ValueError(
                f"driving frequencies span {omegas.min()}-{omegas.max()} rad/s; they must lie in "
                f"[0, {s.max_omega}]"
            )
        for start in range(0, omegas.size, CHUNK):
            yield from self._chunk(speed, omegas[start : start + CHUNK])

    def _chunk(self, speed: float, omegas: np.ndarray) -> Iterator[WavenumberSpectra]:
        """Spectra for a few driving frequencies at once."""
        k, weights = self.quadrature.both_signs
        for both in self.along_lines(self._modal, self.grid.z.size, speed, omegas):
            stress = both[:, 1:].reshape(k.size, 4, -1)
            yield WavenumberSpectra(k, weights, np.ascontiguousarray(both[:, 0]), stress)

    def modal(self, bands: tuple[Band, ...]) -> list[ModalBand]:
        """``bands`` diagonalised at the wavenumbers of the support."""
        return modal_bands(bands, self._support.nodes, self.settings)

    def along_lines(
        self, modal: list[ModalBand], odd: int, speed: float, omegas: np.ndarray
    ) -> Iterator[np.ndarray]:
        """Rail and ground per unit force per wheelset on ω = Ω + k v, [2 N, 1 + D] for each Ω.

        ``modal`` give the mean displacement of the rail foot and D further outputs per unit pad
        force; the last ``odd`` of them are odd in k, the others even.
        """
        q = self.quadrature
        ahead = omegas[:, None] + q.nodes * speed
        behind = omegas[:, None] - q.nodes * speed
        # The ground is computed at the wavenumbers of the support and interpolated between them; rail
        # and pad, which vary faster, are added at every wavenumber. k < 0 is k > 0 at ω = Ω - kv.
        at_support = np.concatenate(
            [omegas[:, None] + v * self._support.nodes for v in (speed, -speed)]
        )
        parts = [band.outputs(at_support[:, band.nodes]) for band in modal]
        ground = self._support.spread(np.concatenate(parts, axis=1))
        for i, omega in enumerate(omegas):
            positive = self._coupled(ground[i], odd, q.nodes, ahead[i], 1.0)
            reverse = ground[omegas.size + i]
            sign = np.where(behind[i] >= 0.0, 1.0, -1.0)
            negative = self._coupled(reverse, odd, q.nodes, behind[i], sign)
            jump = jump_shares(q, omega / speed) if omega > 0.0 else None
            if jump is not None:  # damping changes sign inside this panel
                at, share = jump
                plus, minus = (
                    self._coupled(reverse[at], odd, q.nodes[at], behind[i][at], side)
                    for side in (1.0, -1.0)
                )
                negative[at] = share[:, None] * plus + (1.0 - share)[:, None] * minus
            negative[:, negative.shape[1] - odd :] *= -1.0
            yield np.concatenate([negative[::-1], positive])

    def at(self, wavenumber: float, omegas: np.ndarray) -> np.ndarray:
        """Rail receptance and stresses [W, 1 + 4 Z] at one k ≥ 0 and several ω ≥ 0.

        Straight from the reduced bases, for checks and plots; units as in ``WavenumberSpectra``.
        """
        uppers = np.array([band.upper for band in self.bands])
        band = self.bands[min(int(np.searchsorted(uppers, wavenumber)), uppers.size - 1)]
        values = band.outputs(wavenumber, omegas)
        k = np.full(omegas.size, wavenumber)
        return self._coupled(values, self.grid.z.size, k, omegas, 1.0)

    def _coupled(
        self,
        ground: np.ndarray,
        odd: int,
        k: np.ndarray,
        omega: np.ndarray,
        sign: np.ndarray | float,
    ) -> np.ndarray:
        """Rail receptance and outputs under a unit force per wheelset, [N, 1 + D].

        ``ground`` are the outputs with the moduli of positive frequency, the last ``odd`` of them
        odd in k; ``sign`` is the sign of the frequency whose moduli are meant.
        """
        sign = np.broadcast_to(np.asarray(sign, dtype=float), k.shape)
        values = np.where(sign[:, None] > 0.0, ground, ground.conj())
        values[:, values.shape[1] - odd :] *= sign[:, None]
        receptance, force = rail_coupling(self.track, k, omega, values[:, 0], sign)
        values = values * force[:, None]
        values[:, 0] = receptance
        return np.asarray(values)
