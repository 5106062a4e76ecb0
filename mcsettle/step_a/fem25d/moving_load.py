"""Step A as Step B sees it: the response of a ballasted track to a moving oscillating load.

The reduced section gives H, the mean displacement under the rail foot, and the stresses per unit
pad force; ``line_spectra`` joins rail and pad. σxx, σyy, σzz and the displacement are even in k, τxz is
odd.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from mcsettle.railway.track import SectionTrack, rayleigh_speed
from mcsettle.step_a.depths import geostatic_stress
from mcsettle.step_a.fem25d.depth_grid import depth_grid
from mcsettle.step_a.fem25d.line_spectra import LineSpectra, line_spectra, rail_coupling
from mcsettle.step_a.fem25d.modal import ModalBand, modal_bands
from mcsettle.step_a.fem25d.reduced_basis import Band, Bases
from mcsettle.step_a.fem25d.settings import Settings
from mcsettle.step_a.fem25d.track_section import ElementProperties
from mcsettle.step_a.fem25d.wavenumber_rule import (
    Quadrature,
    Support,
    smooth_support,
    wavenumber_quadrature,
)
from mcsettle.step_a.transfer import DepthGrid

CHUNK = 8  # driving frequencies evaluated together


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
        return wavenumber_quadrature(s.bands[-1], s.panel, s.panel_points, s.panel_ratio)

    @cached_property
    def _support(self) -> Support:
        factor = 0.5 if self.track.damping_convention == "loss_factor" else 1.0
        least = min(layer.material.damping for layer in self.track.layers)
        return smooth_support(self.quadrature, factor * least, self.settings.piece_ratio)

    @cached_property
    def _modal(self) -> list[ModalBand]:
        return self.modal(self.bands)

    def spectra(self, speed: float, omegas: np.ndarray) -> Iterator[LineSpectra]:
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
            part = omegas[start : start + CHUNK]
            yield from self.along_lines(self._modal, self.grid.z.size, speed, part)

    def modal(self, bands: tuple[Band, ...]) -> list[ModalBand]:
        """``bands`` diagonalised at the wavenumbers of the support."""
        return modal_bands(bands, self._support.nodes, self.settings)

    def along_lines(
        self, modal: list[ModalBand], odd: int, speed: float, omegas: np.ndarray
    ) -> Iterator[LineSpectra]:
        """Rail and ground per unit force per wheelset on ω = Ω + k v, for each Ω.

        ``modal`` give the mean displacement of the rail foot and D further outputs per unit pad
        force; the last ``odd`` of them are odd in k, the others even.
        """
        # k < 0 is k > 0 at ω = Ω - kv.
        at_support = np.concatenate(
            [omegas[:, None] + v * self._support.nodes for v in (speed, -speed)]
        )
        parts = [band.outputs(at_support[:, band.nodes]) for band in modal]
        ground = np.concatenate(parts, axis=1)
        foot = self._support.spread(ground[:, :, :1])[:, :, 0]
        rule, outputs = (self.quadrature, self._support), ground[:, :, 1:]
        for i, omega in enumerate(omegas.tolist()):
            j = i + omegas.size
            pair, feet = (outputs[i], outputs[j]), (foot[i], foot[j])
            yield line_spectra(self.track, rule, pair, feet, odd, speed, omega)

    def at(self, wavenumber: float, omegas: np.ndarray) -> np.ndarray:
        """Rail receptance and stresses [W, 1 + 4 Z] at one k ≥ 0 and several ω ≥ 0.

        Straight from the reduced bases, for checks and plots; units as in ``WavenumberSpectra``.
        """
        uppers = np.array([band.upper for band in self.bands])
        band = self.bands[min(int(np.searchsorted(uppers, wavenumber)), uppers.size - 1)]
        values = band.outputs(wavenumber, omegas)
        k = np.full(omegas.size, wavenumber)
        receptance, force = rail_coupling(self.track, k, omegas, values[:, 0])
        return np.column_stack([receptance, values[:, 1:] * force[:, None]])
