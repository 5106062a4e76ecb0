"""A homogeneous half-space on the section machinery: surface strip load, no track."""

import numpy as np

from mcsettle.step_a.fem25d.element import isotropic_stiffness
from mcsettle.step_a.fem25d.mesh_lines import growing_lines, uniform_lines, with_border
from mcsettle.step_a.fem25d.pml import Border
from mcsettle.step_a.fem25d.section import Ground, Section, build_section

YOUNG, POISSON, DENSITY = 80e6, 0.3, 1900.0
SHEAR = YOUNG / (2.0 * (1.0 + POISSON))
C_S = float(np.sqrt(SHEAR / DENSITY))
C_P = float(C_S * np.sqrt((2.0 - 2.0 * POISSON) / (1.0 - 2.0 * POISSON)))
HALF_WIDTH = 0.1  # m, of the loaded strip; the half section carries a force of 1, the whole 2
TOTAL = 2.0
DEPTHS = np.array([-1.0, -2.0, -3.0])


def half_space(size: float = 0.1, border: Border | None = None, damping: float = 0.0) -> Section:
    """Half section 5 m wide and deep, graded, with a border, loaded on |y| < HALF_WIDTH."""
    near = uniform_lines([0.0, HALF_WIDTH, 0.8], size)
    side = growing_lines(4.2, size, 1.3, 0.7)
    depth = growing_lines(5.0, size, 1.3, 0.7)
    border = Border() if border is None else border
    y = with_border(np.concatenate([near, near[-1] + side[1:]]), border)
    z = with_border(depth, border)
    ground = Ground(isotropic_stiffness(YOUNG * (1.0 + 2j * damping), POISSON), DENSITY)
    index = np.zeros((y.middle.size, z.middle.size), dtype=int)
    return build_section(y, z, 0.0, [ground], index, (0.0, HALF_WIDTH), DEPTHS, [(0.0, -5.0)])


def surface_unknowns(section: Section, lower: float, upper: float) -> tuple[np.ndarray, np.ndarray]:
    """Indices of uz on the surface for y in (lower, upper), and their y [m]."""
    basis = section.basis
    vertical = np.zeros(basis.N, dtype=bool)
    for dofs in (basis.nodal_dofs, basis.facet_dofs, basis.interior_dofs):
        vertical[dofs[2]] = True
    at = basis.doflocs[:, section.free]
    chosen = vertical[section.free] & (np.abs(at[1]) < 1e-9)
    found = np.flatnonzero(chosen & (at[0] > lower) & (at[0] < upper))
    found = found[np.argsort(at[0, found])]
    return found, at[0, found]
