"""Displacement of rail and ground along the centreline under a moving oscillating load (Fig. 10).

The bases of Step A give the vertical displacement at every node of the plane of symmetry as well, so
that the field is known at all (k, ω = Ω + kv) of a passing train: the quasi-static line Ω = 0 and
every driving frequency of the profile. Rail and pad join as in ``moving_load``; below zero frequency the
displacement is the conjugate of that at positive frequency, and it is even in k.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from mcsettle.step_a.fem25d.modal import ModalBand
from mcsettle.step_a.fem25d.moving_load import SectionResponse
from mcsettle.step_a.transfer import COMPONENTS, Spectra, WavenumberSpectra


@dataclass(frozen=True)
class FieldSpectra:
    """Downward displacement per unit load per wheelset at one (Ω, v), over both signs of k.

    ``rail`` as of a track's response (without stresses); ``ground`` [Q, D] m/N·m at its wavenumbers.
    """

    rail: Spectra
    ground: np.ndarray


@dataclass(frozen=True, eq=False)
class CentrelineField:
    """Displacement along the centreline of the track and ground of a ``response``."""

    response: SectionResponse

    @property
    def z(self) -> np.ndarray:
        """Heights [D] m, falling from the sleepers' top to the end of the integration depth."""
        return self.response.bases.heights

    @cached_property
    def _modal(self) -> list[ModalBand]:
        """Bands whose outputs are the rail foot and the heights."""
        bands = []
        for band in self.response.bands:
            rows = np.vstack([band.output0[:1], band.centreline])
            bands.append(replace(band, output0=rows, output1=np.zeros_like(rows)))
        return self.response.modal(tuple(bands))

    def spectra(self, speed: float, omegas: np.ndarray) -> Iterator[FieldSpectra]:
        """Spectra at ``speed`` [m/s] for each driving frequency Ω ≥ 0 of ``omegas`` [rad/s]."""
        k, weights = self.response.quadrature.both_signs
        none = np.zeros((k.size, len(COMPONENTS), 0))
        for omega in np.atleast_1d(omegas):  # one by one: there are many heights
            lines = self.response.along_lines(self._modal, 0, speed, np.array([omega]))
            for line in lines:
                yield FieldSpectra(
                    WavenumberSpectra(k, weights, line.receptance, none), line.outputs
                )
