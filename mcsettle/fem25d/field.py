"""Displacement of rail and ground along the centreline under a moving oscillating load (Fig. 10).

The bases of Step A know the rail and the stresses. Here bases of the same section are grown with the
vertical displacement at every node of the plane of symmetry among their outputs, so that the field
is at hand at all (k, ω = Ω + kv) of a passing train: the quasi-static line Ω = 0 and every driving
frequency of the profile. The stresses stay among the outputs while the bases grow.
Rail and pad join as in ``moving``; below zero frequency the displacement is the conjugate of that at
positive frequency, and it is even in k.

Depends on: files, transfer, waves, cache, modal, moving, quadrature, reduced, section, track_section,
solve.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np
import scipy.sparse as sp

from mcsettle.fem25d.cache import digest_of, read_bands, write_bands
from mcsettle.fem25d.modal import ModalBand
from mcsettle.fem25d.moving import SectionResponse
from mcsettle.fem25d.reduced import Band, grow_band, training_set
from mcsettle.fem25d.section import Section
from mcsettle.fem25d.solve import outputs, solve
from mcsettle.fem25d.track_section import track_section
from mcsettle.files import cache_folder
from mcsettle.transfer import COMPONENTS, WavenumberSpectra
from mcsettle.waves import rayleigh_speed

VERTICAL = 2  # component of the displacement
HELD_OUT_SEED = 1_605_273
Progress = Callable[[int, int, str], None]


@dataclass(frozen=True)
class FieldSpectra:
    """Downward displacement per unit load per wheelset at one (Ω, v), over both signs of k.

    ``rail`` as of a track's response (without stresses); ``ground`` [Q, D] m/N·m at its wavenumbers.
    """

    rail: WavenumberSpectra
    ground: np.ndarray


@dataclass(frozen=True, eq=False)
class CentrelineField:
    """Displacement at heights ``z`` [D] m of the centreline, falling from the sleepers' top.

    ``errors`` [n] are relative errors of the bases against direct solutions they never saw, two a
    band.
    """

    response: SectionResponse
    z: np.ndarray
    bands: tuple[Band, ...]
    errors: np.ndarray

    @property
    def error_estimate(self) -> float:
        """Largest relative error of the bases at the held-out points."""
        return float(np.max(self.errors))

    @cached_property
    def _modal(self) -> list[ModalBand]:
        return self.response.modal(self.bands)

    def spectra(self, speed: float, omegas: np.ndarray) -> Iterator[FieldSpectra]:
        """Spectra at ``speed`` [m/s] for each driving frequency Ω ≥ 0 of ``omegas`` [rad/s]."""
        k, weights = self.response.quadrature.both_signs()
        none = np.zeros((k.size, len(COMPONENTS), 0))
        for omega in np.atleast_1d(omegas):  # one by one: there are many heights
            lines = self.response.along_lines(self._modal, 0, speed, np.array([omega]))
            for values in lines:
                yield FieldSpectra(WavenumberSpectra(k, weights, values[:, 0], none), values[:, 1:])


def centreline_field(
    response: SectionResponse,
    progress: Progress | None = None,
    cache: Path | None = None,
    use_cache: bool = True,
) -> CentrelineField:
    """Displacement along the centreline of a response's track; bases from disk or grown.

    Raises
    ------
    NumericalError
        If a basis misses its tolerance.
    """
    section, z = field_section(response)
    key = digest_of({"field": response.digest})
    path = (cache_folder() if cache is None else Path(cache)) / f"section-{key[:32]}.npz"
    found = read_bands(path) if use_cache else None
    if found is None:
        found = _grown(section, z.size, response, progress)
        if use_cache:
            write_bands(path, *found)
    return CentrelineField(response, z, *found)


def field_section(response: SectionResponse) -> tuple[Section, np.ndarray]:
    """The response's section, its outputs followed by D downward displacements at heights [D] m."""
    section = track_section(
        response.track, response.integration_depth, response.settings.mesh, response.properties
    )
    rows, z = _centreline(section, -response.integration_depth)
    shape = (rows.size, section.unknowns)
    down = sp.csr_matrix((-np.ones(rows.size, np.complex128), (np.arange(rows.size), rows)), shape)
    none = sp.csr_matrix(0.0 * down)
    return replace(
        section,
        stress0=sp.csr_matrix(sp.vstack([section.stress0, down])),
        stress1=sp.csr_matrix(sp.vstack([section.stress1, none])),
    ), z


def _centreline(section: Section, lowest: float) -> tuple[np.ndarray, np.ndarray]:
    """Free unknowns of the vertical displacement on y = 0, from the top down, and their heights."""
    basis = section.basis
    vertical = np.zeros(basis.N, dtype=bool)
    for dofs in (basis.nodal_dofs, basis.facet_dofs, basis.interior_dofs):
        vertical[dofs[VERTICAL]] = True
    y, z = basis.doflocs[:, section.free]
    at = np.flatnonzero(vertical[section.free] & (np.abs(y) < 1e-9) & (z >= lowest - 1e-9))
    order = at[np.argsort(-z[at])]
    return order, z[order]


def _grown(
    section: Section, heights: int, response: SectionResponse, progress: Progress | None
) -> tuple[tuple[Band, ...], np.ndarray]:
    """Bases of all bands for displacements alone, and the errors of each at two random points."""
    s, bands, errors = response.settings, [], []
    waves = sorted({rayleigh_speed(layer.material) for layer in response.track.ground})
    rng = np.random.Generator(np.random.Philox(key=HELD_OUT_SEED))
    kept = np.r_[0, 1 + section.stress0.shape[0] - heights : 1 + section.stress0.shape[0]]
    for i, (lower, upper) in enumerate(zip((0.0, *s.bands), s.bands, strict=False)):
        training = training_set(lower, upper, s.max_omega, s.max_speed, waves)
        part = section.for_wavenumbers(lower, s.mesh.border)
        grown = grow_band(part, lower, upper, training, s.tolerance, s.max_solves)
        band = replace(grown, output0=grown.output0[kept], output1=grown.output1[kept])
        for driving in (0.0, s.max_omega):
            at, share = rng.random(2)  # on the line of a constant load, and anywhere
            k = lower + (upper - lower) * at
            omega = share * (driving + k * s.max_speed)
            exact = outputs(part, k, solve(part, k, omega))[kept]
            errors.append(_error(band.outputs(k, np.array([omega]))[0], exact))
        bands.append(band)
        if progress is not None:
            progress(i + 1, len(s.bands), "field along the centreline")
    return tuple(bands), np.array(errors)


def _error(approximate: np.ndarray, exact: np.ndarray) -> float:
    """Largest error over rail foot and heights, relative to the largest displacement."""
    return float(np.abs(approximate - exact).max() / np.abs(exact).max())
