"""A track section whose moduli change element by element: operators computed once, scaled for each set.

Element matrices are linear in the (complex) modulus of their element. A ``Frame`` computes them once;
every further set of properties is one weighted sum. Elements of the absorbing border take the
properties of the outermost regular element of their row (at the sides) or of the deepest one of
their column (below), because the border represents ground that continues unchanged.
"""

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
import skfem

from mcsettle.railway.track import SectionTrack, depth_below_subgrade
from mcsettle.step_a.fem25d.element import Pattern, element_operators, strain_operators
from mcsettle.step_a.fem25d.mesh_lines import Lines
from mcsettle.step_a.fem25d.pml import Border
from mcsettle.step_a.fem25d.section import Grid, MeshSettings, strip_load, within
from mcsettle.step_a.fem25d.track_section import (
    ElementProperties,
    rail_foot,
    stiffness_factors,
    table_damping,
    track_grid,
    track_lines,
    track_top,
)
from mcsettle.units import GRAVITY

LEAST_CONFINEMENT = 1e3  # Pa; curves are not known below it


@dataclass(frozen=True)
class SoftElements:
    """The R regular elements of ballast, sub-ballast and ground, and the elements that follow them.

    ``number`` [R] in the order of the grid, ``y``, ``z`` [R] m of their centres, ``area`` [R] m²,
    ``layer`` [R] index of the track's layer, ``confinement`` [R] Pa; ``source`` [E] is for every
    element of the grid the regular one whose properties it takes, -1 for the sleepers.
    """

    number: np.ndarray
    y: np.ndarray
    z: np.ndarray
    area: np.ndarray
    layer: np.ndarray
    confinement: np.ndarray
    source: np.ndarray

    def spread(self, track: SectionTrack, grid: Grid, scale: np.ndarray, damping: np.ndarray
               ) -> ElementProperties:  # fmt: skip
        """Properties of all elements from those [R] of the regular ones."""
        given = table_damping(track)[grid.material]
        soft = self.source >= 0
        return ElementProperties(
            np.where(soft, scale[self.source], 1.0), np.where(soft, damping[self.source], given)
        )


@dataclass(frozen=True)
class Frame:
    """Operators of a track section for any properties of its elements.

    ``local`` (K0, K1, K2) [E, s, s] with the moduli of the layers; ``strain0 + k strain1`` [6 R, n]
    gives the strains at the centres of the soft elements.
    """

    track: SectionTrack
    grid: Grid
    elements: SoftElements
    pattern: Pattern
    local: tuple[np.ndarray, np.ndarray, np.ndarray]
    mass: sp.csc_matrix
    load: np.ndarray
    strain0: sp.csr_matrix
    strain1: sp.csr_matrix
    lines: tuple[Lines, Lines]
    border: Border

    def needed(self, wavenumber: float) -> np.ndarray:
        """Unknowns inside the border that ``wavenumber`` ≥ 0 [rad/m] needs."""
        reach = self.border.reach_at(wavenumber)
        return within(self.grid.basis, self.grid.free, self.lines, reach)

    def stiffness(self, properties: ElementProperties) -> tuple[sp.csc_matrix, ...]:
        """K0, K1, K2 of the free unknowns."""
        factor = stiffness_factors(self.track, self.grid, properties)[:, None, None]
        return tuple(self.pattern.added_up(part * factor) for part in self.local)


def track_frame(track: SectionTrack, integration_depth: float, mesh: MeshSettings) -> Frame:
    """Frame of a track section; parameters as in ``track_section``."""
    grid = track_grid(track, integration_depth, mesh)
    elements = soft_elements(track, grid)
    pattern = Pattern.of(grid.basis.element_dofs, grid.free)
    k0, k1, k2, mass = element_operators(grid.basis, grid.cells)
    strain0, strain1 = _strain_rows(grid, elements.number)
    return Frame(
        track,
        grid,
        elements,
        pattern,
        (k0, k1, k2),
        pattern.added_up(mass),
        strip_load(grid.basis, rail_foot(track), track_top(track))[grid.free],
        strain0,
        strain1,
        track_lines(track, integration_depth, mesh),
        mesh.border,
    )


def soft_elements(track: SectionTrack, grid: Grid) -> SoftElements:
    """Places and confining stresses of the elements that soften."""
    real = (grid.cells.stretch_y == 1.0) & (grid.cells.stretch_z == 1.0)
    column, row = grid.place
    number = np.flatnonzero(real & (grid.material > 0))
    at = np.full((column.max() + 1, row.max() + 1), -1)
    at[column[number], row[number]] = np.arange(number.size)
    last = column[number].max(), row[number].max()
    source = np.where(
        grid.material > 0, at[np.minimum(column, last[0]), np.minimum(row, last[1])], -1
    )
    corners = grid.basis.mesh.p[:, grid.basis.mesh.t[:, number]]
    y, z = corners.mean(axis=1)
    span = corners.max(axis=1) - corners.min(axis=1)
    layer = grid.material[number] - 1
    stress = confinement(track, y, z, layer)
    return SoftElements(number, y, z, span[0] * span[1], layer, stress, source)


def confinement(track: SectionTrack, y: np.ndarray, z: np.ndarray, layer: np.ndarray) -> np.ndarray:
    """Mean effective stress (1 + 2 K0) σ_v / 3 [Pa] at places (y, z) of layers; all [N].

    σ_v is the weight above: of the layers above the place and, within the embankment's
    width, of rails and sleepers spread over the width of the layer (at least 1 kPa; no water).
    """
    s, rail = track.sleeper, track.rail
    superstructure = (
        2.0 * rail.mass_per_length + s.material.density * s.fill * s.height * s.length
    )  # kg/m
    widths = [np.inf if w.width is None else w.width for w in track.layers]
    base = [w for w in widths if np.isfinite(w)]
    spread = np.array([w if np.isfinite(w) else max(base, default=s.length) for w in widths])
    covered = np.abs(y) < spread[layer] / 2.0
    vertical = np.where(covered, superstructure * GRAVITY / spread[layer], 0.0)
    upper = depth_below_subgrade(track.layers)
    for w, width in zip(track.layers, widths, strict=True):
        thickness = np.clip(upper - np.maximum(z, upper - w.height), 0.0, None)
        over = np.abs(y) < width / 2.0
        vertical += np.where(over, w.material.density * GRAVITY * thickness, 0.0)
        upper -= w.height
    k0 = np.array([w.k0 for w in track.layers])[layer]
    return np.maximum((1.0 + 2.0 * k0) / 3.0 * vertical, LEAST_CONFINEMENT)


def _strain_rows(grid: Grid, number: np.ndarray) -> tuple[sp.csr_matrix, sp.csr_matrix]:
    """Strains xx, yy, zz, yz, xy/i, xz/i at element centres as rows [6 R, n]."""
    local = skfem.Basis(
        grid.basis.mesh,
        grid.basis.elem,
        elements=number,
        quadrature=(np.full((2, 1), 0.5), np.ones(1)),
    )
    shape = (6 * number.size, local.N)
    rows = np.arange(shape[0])
    ones = np.ones(number.size)
    total = [sp.csr_matrix(shape) for _ in range(2)]
    for dof in range(local.Nbfun):
        columns = np.tile(local.element_dofs[dof], 6)
        for order, strain in enumerate(strain_operators(local.basis[dof][0], ones, ones)):
            part = sp.csr_matrix((strain.real.ravel(), (rows, columns)), shape)
            total[order] = sp.csr_matrix(total[order] + part)
    return sp.csr_matrix(total[0][:, grid.free]), sp.csr_matrix(total[1][:, grid.free])
