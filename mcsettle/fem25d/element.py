"""2.5D finite elements: quadratic quadrilaterals with three displacements a node.

With u = (i ũx, uy, uz) e^{i(ωt - kx)} the strains are e = E0 u + k E1 u with real operators,

    E0 u = (0, ∂y uy, ∂z uz, ∂z uy + ∂y uz, ∂y ũx, ∂z ũx),    E1 u = (ũx, 0, 0, 0, -uy, -uz),

in the order xx, yy, zz, yz, xy/i, xz/i, so that the stiffness K0 + k K1 + k² K2 - ω² M is symmetric
(complex only by damping and by the border's stretch). Stretched coordinates divide each derivative
by the cell's complex stretch and multiply its area.

Depends on: nothing of the package.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp
import skfem

DISPLACEMENTS = 3
INTORDER = 4


@dataclass(frozen=True)
class Cells:
    """Material and stretch of every element, index as in the mesh.

    ``stiffness`` [6, 6, E] Pa, complex symmetric; ``density`` [E] kg/m³; ``stretch_y`` and
    ``stretch_z`` [E], complex length over mesh length.
    """

    stiffness: np.ndarray
    density: np.ndarray
    stretch_y: np.ndarray
    stretch_z: np.ndarray


def strain_operators(u: Any, stretch_y: Any, stretch_z: Any) -> tuple[list[Any], list[Any]]:
    """Strains E0 u and E1 u of a field with ``value`` [3, ...] and ``grad`` [3, 2, ...]."""
    ux, uy, uz = u.value
    (ux_y, ux_z), (uy_y, uy_z), (uz_y, uz_z) = u.grad
    e0 = [
        None,
        uy_y / stretch_y,
        uz_z / stretch_z,
        uy_z / stretch_z + uz_y / stretch_y,
        ux_y / stretch_y,
        ux_z / stretch_z,
    ]
    return e0, [ux, None, None, None, -uy, -uz]


def _energy(stiffness: np.ndarray, a: list[Any], b: list[Any]) -> Any:
    """Σ a_i D_ij b_j over the entries present (axial block full, shears diagonal)."""
    total: Any = 0.0
    for i in range(6):
        for j in range(3) if i < 3 else (i,):
            if a[i] is not None and b[j] is not None:
                total = total + stiffness[i, j] * a[i] * b[j]
    return total


def vector_basis(mesh: skfem.Mesh) -> skfem.Basis:
    """Basis of the three displacements on nine-node quadrilaterals."""
    element = skfem.ElementVector(skfem.ElementQuad2(), DISPLACEMENTS)
    return skfem.Basis(mesh, element, intorder=INTORDER)


def assemble_operators(basis: skfem.Basis, cells: Cells) -> tuple[sp.csc_matrix, ...]:
    """Assemble K0 [N/m²], K1 [N/m], K2 [N] and M [kg/m] per metre of track.

    Returns
    -------
    tuple of csc_matrix
        (K0, K1, K2, M), complex symmetric, all with one and the same sparsity pattern.
    """

    def field(values: np.ndarray) -> np.ndarray:
        return values[..., None]

    d, sy, sz = field(cells.stiffness), field(cells.stretch_y), field(cells.stretch_z)
    area, rho = sy * sz, field(cells.density)

    def stiffness(order: int) -> Callable[..., Any]:
        def form(u: Any, v: Any, w: Any) -> Any:
            a0, a1 = strain_operators(u, sy, sz)
            b0, b1 = strain_operators(v, sy, sz)
            if order == 0:
                return area * _energy(d, a0, b0)
            if order == 2:
                return area * _energy(d, a1, b1)
            return area * (_energy(d, a0, b1) + _energy(d, a1, b0))

        return form

    def mass(u: Any, v: Any, w: Any) -> Any:
        return area * rho * (u[0] * v[0] + u[1] * v[1] + u[2] * v[2])

    forms = [stiffness(0), stiffness(1), stiffness(2), mass]
    parts = [skfem.BilinearForm(f, dtype=np.complex128).coo_data(basis) for f in forms]
    return _common_pattern(parts, basis.N)


def _common_pattern(parts: list[Any], n: int) -> tuple[sp.csc_matrix, ...]:
    """Sum duplicates of all parts into matrices that share indices and pointers."""
    row, col = parts[0].indices
    key, inverse = np.unique(col.astype(np.int64) * n + row, return_inverse=True)
    indices = (key % n).astype(np.int32)
    indptr = np.searchsorted(key, np.arange(n + 1, dtype=np.int64) * n).astype(np.int32)
    matrices = []
    for part in parts:
        data = np.bincount(inverse, part.data.real) + 1j * np.bincount(inverse, part.data.imag)
        matrices.append(sp.csc_matrix((data, indices, indptr), shape=(n, n)))
    return tuple(matrices)


def isotropic_stiffness(youngs_modulus: complex, poisson: float) -> np.ndarray:
    """Stiffness [6, 6] Pa of an isotropic material, in the order of the strains."""
    mu = youngs_modulus / (2.0 * (1.0 + poisson))
    lam = 2.0 * mu * poisson / (1.0 - 2.0 * poisson)
    d = np.zeros((6, 6), dtype=np.complex128)
    d[:3, :3] = lam
    d[np.arange(3), np.arange(3)] += 2.0 * mu
    d[np.arange(3, 6), np.arange(3, 6)] = mu
    return d


def smeared_stiffness(
    youngs_modulus: complex, poisson: float, fill: float, axial_ratio: float
) -> np.ndarray:
    """Stiffness [6, 6] Pa of sleepers smeared along the track (orthotropic).

    E_x = ``axial_ratio`` E without Poisson coupling to x; E_y, E_z and all three shear moduli are
    those of the material times ``fill`` (sleeper width over spacing).
    """
    e = fill * youngs_modulus
    d = np.zeros((6, 6), dtype=np.complex128)
    d[0, 0] = axial_ratio * youngs_modulus
    d[1, 1] = d[2, 2] = e / (1.0 - poisson**2)
    d[1, 2] = d[2, 1] = poisson * e / (1.0 - poisson**2)
    d[np.arange(3, 6), np.arange(3, 6)] = e / (2.0 * (1.0 + poisson))
    return d
