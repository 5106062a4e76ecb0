"""Mesh, materials, load and outputs of a symmetric half cross-section.

``build_section`` turns plain descriptions (mesh lines, a material for every cell, the loaded strip,
the depths of the outputs) into the matrices that ``solve`` works on.
"""

from dataclasses import dataclass, replace
from typing import Any, TypeVar

import numpy as np
import scipy.sparse as sp
import skfem

from mcsettle.step_a.fem25d.element import (
    DISPLACEMENTS,
    Cells,
    Pattern,
    element_operators,
    vector_basis,
)
from mcsettle.step_a.fem25d.mesh_lines import Lines, element_columns, structured_mesh
from mcsettle.step_a.fem25d.pml import Border
from mcsettle.step_a.fem25d.stress_outputs import stress_operators


@dataclass(frozen=True)
class MeshSettings:
    """Element sizes [m] near the track, their growth and largest size, side width, border.

    ``axial_ratio``: E_x of the smeared sleepers over E of their concrete, so small that it does not
    matter: sleepers apart do not bend along the track, and what lies between them is left out.
    """

    size: float = 0.15
    growth: float = 1.3
    largest: float = 0.9
    side: float = 0.4
    border: Border = Border()
    axial_ratio: float = 1e-5

    def __post_init__(self) -> None:
        if not (self.size > 0.0 and self.largest > 0.0 and self.side > 0.0 and self.growth >= 1.0):
            raise ValueError(
                f"mesh sizes are {self.size}, {self.largest}, {self.side} m and growth "
                f"{self.growth}; sizes must be positive and growth at least 1"
            )
        if not self.axial_ratio > 0.0:
            raise ValueError(f"axial_ratio is {self.axial_ratio}; it must be positive")


@dataclass(frozen=True)
class Section:
    """Matrices of a cross-section on its free unknowns, n in number.

    ``stiffness`` (K0, K1, K2) and ``mass`` are complex symmetric and share a pattern; ``load`` [n]
    is a unit downward force spread over the strip, so ``load @ u`` is the mean downward
    displacement there; ``stress0 + k stress1`` [4 Z, n] gives the stresses, component by component.
    ``y`` and ``depth`` are the mesh lines.
    """

    stiffness: tuple[sp.csc_matrix, sp.csc_matrix, sp.csc_matrix]
    mass: sp.csc_matrix
    load: np.ndarray
    stress0: sp.csr_matrix
    stress1: sp.csr_matrix
    basis: skfem.Basis
    free: np.ndarray
    y: Lines
    depth: Lines

    @property
    def unknowns(self) -> int:
        """Number of free unknowns."""
        return int(self.load.size)

    def for_wavenumbers(self, lowest: float, border: Border) -> "Section":
        """The section with the border that wavenumbers of ``lowest`` [rad/m] and above need.

        The border is cut at a mesh line, so that the matrices are blocks of these.
        """
        inside = within(self.basis, self.free, (self.y, self.depth), border.reach_at(lowest))
        if inside.size == self.free.size:
            return self
        k0, k1, k2, mass = (m[inside][:, inside].tocsc() for m in (*self.stiffness, self.mass))
        return replace(
            self,
            stiffness=(k0, k1, k2),
            mass=mass,
            load=self.load[inside],
            stress0=self.stress0[:, inside].tocsr(),
            stress1=self.stress1[:, inside].tocsr(),
            free=self.free[inside],
        )


def within(
    basis: skfem.Basis, free: np.ndarray, lines: tuple[Lines, Lines], reach: float
) -> np.ndarray:
    """Those of the unknowns ``free`` whose distance into the border is below the cut at ``reach`` m."""
    across, up = basis.doflocs[:, free]
    down = basis.mesh.p[1].max() - up
    return np.flatnonzero((across < lines[0].cut(reach)) & (down < lines[1].cut(reach)))


@dataclass(frozen=True)
class Ground:
    """A material for the elements: ``stiffness`` [6, 6] Pa and ``density`` kg/m³."""

    stiffness: np.ndarray
    density: float


Scalar = TypeVar("Scalar", float, np.ndarray)


def damped(youngs_modulus: float, damping: Scalar, convention: str) -> Any:
    """Complex modulus E (1 + 2iξ) or, for ``loss_factor``, E (1 + iξ) at ω > 0 [Pa]."""
    factor = 2.0 if convention == "damping_ratio" else 1.0
    return youngs_modulus * (1.0 + 1j * factor * damping)


def build_section(
    y: Lines,
    depth: Lines,
    top: float,
    materials: list[Ground],
    index: np.ndarray,
    strip: tuple[float, float],
    z: np.ndarray,
    layer_bounds: list[tuple[float, float]],
    factor: np.ndarray | None = None,
) -> Section:
    """Assemble a half section that is symmetric about y = 0.

    Parameters
    ----------
    y, depth : Lines
        Mesh lines from the centreline outwards and from ``top`` downwards.
    top : float
        Height z of the highest line [m].
    materials, index
        ``index`` [columns, rows] picks the material of each cell; -1 leaves the cell out.
    strip : (float, float)
        Loaded part of the top line [m].
    z : np.ndarray
        [Z] m, heights on the centreline where stresses are given.
    layer_bounds : list of (upper, lower)
        Heights [m] between which stresses are smooth; each z lies in one.
    factor : np.ndarray, optional
        [E] complex, multiplies the stiffness of each element (in the order of ``laid_out``).

    Returns
    -------
    Section
    """
    grid = laid_out(y, depth, top, materials, index)
    basis, free, cells = grid.basis, grid.free, grid.cells
    if factor is not None:
        cells = replace(cells, stiffness=cells.stiffness * factor)
    pattern = Pattern.of(basis.element_dofs, free)
    operators = [pattern.added_up(part) for part in element_operators(basis, cells)]
    stress0, stress1 = stress_operators(basis, cells, grid.place, z, layer_bounds)
    return Section(
        (operators[0], operators[1], operators[2]),
        operators[3],
        strip_load(basis, strip, top)[free],
        sp.csr_matrix(stress0[:, free]),
        sp.csr_matrix(stress1[:, free]),
        basis,
        free,
        y,
        depth,
    )


@dataclass(frozen=True)
class Grid:
    """Elements of a half section: their basis, free unknowns, materials and places.

    ``place`` [2, E] column and row (counted downwards); ``material`` [E] index of the material.
    """

    basis: skfem.Basis
    free: np.ndarray
    cells: Cells
    place: np.ndarray
    material: np.ndarray


def laid_out(
    y: Lines, depth: Lines, top: float, materials: list[Ground], index: np.ndarray
) -> Grid:
    """Elements on mesh lines; parameters as in ``build_section``."""
    mesh, place = structured_mesh(y, depth, top)
    mesh = mesh.restrict(np.flatnonzero(index[place[0], place[1]] >= 0))
    place = element_columns(mesh, y, depth, top)
    chosen = index[place[0], place[1]]
    cells = Cells(
        np.stack([m.stiffness for m in materials])[chosen].transpose(1, 2, 0),
        np.array([m.density for m in materials])[chosen],
        y.stretch[place[0]],
        depth.stretch[place[1]],
    )
    basis = vector_basis(mesh)
    free = _free_unknowns(basis, y.position[-1], top - depth.position[-1])
    return Grid(basis, free, cells, place, chosen)


def _free_unknowns(basis: skfem.Basis, y_end: float, z_end: float) -> np.ndarray:
    """All unknowns but those of the fixed outer border and uy on the plane of symmetry."""
    component = np.zeros(basis.N, dtype=int)
    for dofs in (basis.nodal_dofs, basis.facet_dofs, basis.interior_dofs):
        for c in range(DISPLACEMENTS):
            component[dofs[c]] = c
    at, span = basis.doflocs, max(abs(y_end), abs(z_end))
    fixed = np.isclose(at[0], y_end, rtol=0, atol=1e-9 * span)
    fixed |= np.isclose(at[1], z_end, rtol=0, atol=1e-9 * span)
    fixed |= (component == 1) & (np.abs(at[0]) < 1e-9)
    return np.flatnonzero(~fixed)


def strip_load(basis: skfem.Basis, strip: tuple[float, float], top: float) -> np.ndarray:
    """Nodal forces of a unit downward force, even over a strip of the top line [N]."""

    def on_strip(x: np.ndarray) -> np.ndarray:
        return np.asarray((x[0] > strip[0]) & (x[0] < strip[1]) & (np.abs(x[1] - top) < 1e-9))

    facets = basis.mesh.facets_satisfying(on_strip)
    if facets.size == 0:
        raise ValueError(f"no element edge lies on the loaded strip {strip} at z = {top} m")
    edge = skfem.FacetBasis(basis.mesh, basis.elem, facets=facets, intorder=4)
    width = strip[1] - strip[0]
    return np.asarray(skfem.LinearForm(lambda v, w: -v[2] / width).assemble(edge))
