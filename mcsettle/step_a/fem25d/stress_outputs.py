"""Stress on the centreline as rows of a sparse matrix, and the displacements there.

Derivatives of quadratic elements are most accurate at the 2 × 2 Gauss points. The rows therefore
evaluate the stress there, extrapolate it to y = 0 in y² (all four components are even in y) and
interpolate it in z within a layer.
"""

import numpy as np
import scipy.sparse as sp
import skfem

from mcsettle.step_a.fem25d.element import Cells, strain_operators

ROWS = (0, 1, 2, 5)  # xx, yy, zz, xz of the strains' order
VERTICAL = 2  # component of the displacement
NEIGHBOURS = 4  # Gauss points in an interpolation over z


def stress_operators(
    basis: skfem.Basis,
    cells: Cells,
    place: np.ndarray,
    z: np.ndarray,
    layer_bounds: list[tuple[float, float]],
) -> tuple[sp.csr_matrix, sp.csr_matrix]:
    """Matrices S0, S1 [4 Z, N] with (S0 + k S1) u = (σxx, σyy, σzz, τxz) at the heights z [Pa].

    Parameters
    ----------
    basis, cells, place
        Mesh basis, materials and (column, row) of the elements.
    z : np.ndarray
        [Z] m, heights on the centreline.
    layer_bounds : list of (upper, lower)
        Heights [m] between which the stress is smooth.

    Raises
    ------
    ValueError
        If a height lies in no layer (on an interface, say).
    """
    column = np.flatnonzero(place[0] == 0)
    gauss = (1.0 + np.array([-1.0, 1.0]) / np.sqrt(3.0)) / 2.0
    points = np.stack([a.ravel() for a in np.meshgrid(gauss, gauss)])
    local = skfem.Basis(
        basis.mesh, basis.elem, elements=column, quadrature=(points, np.full(4, 0.25))
    )
    y, height = np.asarray(local.global_coordinates())
    weights = _to_centreline(y, height, z, layer_bounds)
    rows0, rows1 = _point_rows(local, cells, column)
    spread = sp.kron(sp.eye(len(ROWS)), weights)
    return sp.csr_matrix(spread @ rows0), sp.csr_matrix(spread @ rows1)


def centreline(
    basis: skfem.Basis, free: np.ndarray, lowest: float
) -> tuple[np.ndarray, np.ndarray]:
    """Vertical displacements on y = 0 from the top down to the height ``lowest`` [m].

    Returns
    -------
    (places among the unknowns ``free`` [D], heights [D] m)
    """
    vertical = np.zeros(basis.N, dtype=bool)
    for dofs in (basis.nodal_dofs, basis.facet_dofs, basis.interior_dofs):
        vertical[dofs[VERTICAL]] = True
    y, z = basis.doflocs[:, free]
    at = np.flatnonzero(vertical[free] & (np.abs(y) < 1e-9) & (z >= lowest - 1e-9))
    order = at[np.argsort(-z[at])]
    return order, z[order]


def _point_rows(
    local: skfem.Basis, cells: Cells, column: np.ndarray
) -> tuple[sp.csr_matrix, sp.csr_matrix]:
    """Stress at the Gauss points of the centre column, [4 P, N] each."""
    n_points = column.size * local.X.shape[1]
    number = np.arange(n_points).reshape(column.size, -1)
    d = cells.stiffness[:, :, column]
    shape = (len(ROWS) * n_points, local.N)
    rows = (np.arange(len(ROWS))[:, None, None] * n_points + number).ravel()
    total = [sp.csr_matrix(shape, dtype=np.complex128) for _ in range(2)]
    for dof in range(local.Nbfun):
        unknown = np.broadcast_to(local.element_dofs[dof][:, None], (len(ROWS), *number.shape))
        strains = strain_operators(
            local.basis[dof][0], cells.stretch_y[column], cells.stretch_z[column]
        )
        for order, strain in enumerate(strains):
            stress = np.einsum("ije,jeq->ieq", d, strain)[list(ROWS)]
            stress[-1] *= 1j  # u = (i ũx, uy, uz)
            part = sp.csr_matrix((stress.ravel(), (rows, unknown.ravel())), shape)
            total[order] = sp.csr_matrix(total[order] + part)
    return total[0], total[1]


def _to_centreline(
    y: np.ndarray, height: np.ndarray, z: np.ndarray, layer_bounds: list[tuple[float, float]]
) -> sp.csr_matrix:
    """Weights [Z, P] of the values at Gauss points for those at (0, z).

    Across: f = a + b y² through the two columns of Gauss points gives f(0). Down: the Lagrange
    polynomial through the nearest levels of the same layer, because stresses jump at interfaces.
    """
    y, height = y.ravel(), height.ravel()
    inside_a_layer = [any(lower < place < upper for upper, lower in layer_bounds) for place in z]
    if not all(inside_a_layer):
        raise ValueError(
            f"heights {z} m must lie inside the layers {layer_bounds}: on an interface the stress "
            "has two values"
        )
    levels, level = np.unique(np.round(height, 9), return_inverse=True)
    y1, y2 = y.min(), y.max()
    at_centre = np.where(y < (y1 + y2) / 2.0, y2**2, -(y1**2)) / (y2**2 - y1**2)
    extrapolate = sp.csr_matrix((at_centre, (level, np.arange(y.size))), (levels.size, y.size))
    interpolate = sp.lil_matrix((z.size, levels.size))
    for upper, lower in layer_bounds:
        inside = np.flatnonzero((levels < upper) & (levels > lower))
        for i in np.flatnonzero((z < upper) & (z > lower)):
            near = inside[np.argsort(np.abs(levels[inside] - z[i]))[:NEIGHBOURS]]
            for j in near:
                others = levels[near[near != j]]
                interpolate[i, j] = np.prod((z[i] - others) / (levels[j] - others))
    return sp.csr_matrix(sp.csr_matrix(interpolate) @ extrapolate)
