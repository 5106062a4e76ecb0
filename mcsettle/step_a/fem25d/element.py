"""2.5D finite elements: quadratic quadrilaterals with three displacements per node.

With u = (i ũx, uy, uz) e^{i(ωt - kx)} the strains are e = E0 u + k E1 u with real operators,

    E0 u = (0, ∂y uy, ∂z uz, ∂z uy + ∂y uz, ∂y ũx, ∂z ũx),    E1 u = (ũx, 0, 0, 0, -uy, -uz),

in the order xx, yy, zz, yz, xy/i, xz/i, so that the stiffness K0 + k K1 + k² K2 - ω² M is symmetric
(complex only by damping and by the border's stretch). Stretched coordinates divide each derivative
by the cell's complex stretch and multiply its area.
"""

from dataclasses import dataclass

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


def strain_operators(
    field: skfem.DiscreteField, stretch_y: np.ndarray, stretch_z: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Strains E0 u and E1 u [6, E, Q] of a field u given at Q points of E elements.

    ``stretch_y`` and ``stretch_z`` [E] are the complex stretches of the elements.
    """
    ux, uy, uz = np.asarray(field)
    (ux_y, ux_z), (uy_y, uy_z), (uz_y, uz_z) = np.asarray(field.grad)
    sy, sz = stretch_y[:, None], stretch_z[:, None]
    e0 = np.zeros((6, *ux.shape), dtype=np.complex128)
    e1 = np.zeros_like(e0)
    e0[1], e0[2], e0[3] = uy_y / sy, uz_z / sz, uy_z / sz + uz_y / sy
    e0[4], e0[5] = ux_y / sy, ux_z / sz
    e1[0], e1[4], e1[5] = ux, -uy, -uz
    return e0, e1


def vector_basis(mesh: skfem.Mesh) -> skfem.Basis:
    """Basis of the three displacements on nine-node quadrilaterals."""
    element = skfem.ElementVector(skfem.ElementQuad2(), DISPLACEMENTS)
    return skfem.Basis(mesh, element, intorder=INTORDER)


def element_operators(basis: skfem.Basis, cells: Cells) -> tuple[np.ndarray, ...]:
    """K0 [N/m²], K1 [N/m], K2 [N] and M [kg/m] of every element, [E, shapes, shapes], per m of track."""
    volume = basis.dx * (cells.stretch_y * cells.stretch_z)[:, None]
    shapes = [basis.basis[i][0] for i in range(basis.Nbfun)]
    strains = [strain_operators(shape, cells.stretch_y, cells.stretch_z) for shape in shapes]
    b0, b1 = (_by_element(np.stack([s[order] for s in strains])) for order in range(2))
    d = cells.stiffness.transpose(2, 0, 1)[:, None] * volume[:, :, None, None]
    values = _by_element(np.stack([np.asarray(shape) for shape in shapes]))
    density = (cells.density[:, None] * volume)[:, :, None, None] * np.eye(DISPLACEMENTS)
    k01 = _pairs(b0, d, b1)
    return (
        _pairs(b0, d, b0),
        k01 + k01.transpose(0, 2, 1),
        _pairs(b1, d, b1),
        _pairs(values, density, values),
    )


@dataclass(frozen=True)
class Pattern:
    """Where the entries of element matrices go in a sparse matrix of ``size`` unknowns.

    ``kept`` marks the entries [E s s] whose row and column both are unknowns, ``place`` the stored
    number of each; ``indices`` and ``indptr`` as in a csc_matrix.
    """

    size: int
    kept: np.ndarray
    place: np.ndarray
    indices: np.ndarray
    indptr: np.ndarray

    @classmethod
    def of(cls, dofs: np.ndarray, free: np.ndarray) -> "Pattern":
        """Pattern of elements with unknowns ``dofs`` [shapes, E], of which ``free`` are kept."""
        n = free.size
        number = np.full(int(max(dofs.max(), free.max())) + 1, -1, dtype=np.int64)
        number[free] = np.arange(n)
        numbers = number[dofs.T]
        both = (numbers[:, None, :] >= 0) & (numbers[:, :, None] >= 0)
        pairs = (numbers[:, None, :] * n + numbers[:, :, None])[both]
        key, place = np.unique(pairs, return_inverse=True)
        indptr = np.searchsorted(key, np.arange(n + 1, dtype=np.int64) * n).astype(np.int32)
        return cls(n, both.ravel(), place.ravel(), (key % n).astype(np.int32), indptr)

    def added_up(self, part: np.ndarray) -> sp.csc_matrix:
        """Element matrices [E, shapes, shapes] added up into one matrix."""
        flat = part.ravel()[self.kept].astype(np.complex128)
        data = np.bincount(self.place, flat.real) + 1j * np.bincount(self.place, flat.imag)
        return sp.csc_matrix((data, self.indices, self.indptr), shape=(self.size, self.size))


def _by_element(fields: np.ndarray) -> np.ndarray:
    """[shapes, components, E, Q] as [E, Q, components, shapes]."""
    return np.ascontiguousarray(fields.transpose(2, 3, 1, 0))


def _pairs(a: np.ndarray, d: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Element matrices Σ_q aᵀ d b, [E, shapes, shapes]."""
    return np.asarray((a.transpose(0, 1, 3, 2) @ (d @ b)).sum(axis=1))


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
