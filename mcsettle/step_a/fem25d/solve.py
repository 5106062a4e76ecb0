"""Direct solution of one cross-section at one wavenumber and frequency."""

from typing import Any

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spla

from mcsettle.step_a.fem25d.section import Section

# Symmetric-mode minimum degree: half the time of the default. Larger panels are unsafe.
SUPERLU: dict[str, Any] = {
    "permc_spec": "MMD_AT_PLUS_A",
    "options": {"SymmetricMode": True},
    "diag_pivot_thresh": 1e-3,
    "relax": 20,
    "panel_size": 16,
}


def operator(section: Section, wavenumber: float, omega: float) -> sp.csc_matrix:
    """Dynamic stiffness K0 + k K1 + k² K2 - ω² M at ω ≥ 0, complex symmetric [n, n]."""
    k0, k1, k2 = section.stiffness
    data = k0.data + wavenumber * k1.data + wavenumber**2 * k2.data - omega**2 * section.mass.data
    return sp.csc_matrix((data, k0.indices, k0.indptr), shape=k0.shape)


def factorise(section: Section, wavenumber: float, omega: float) -> spla.SuperLU:
    """LU factors of the dynamic stiffness at ``wavenumber`` [rad/m], ``omega`` ≥ 0 [rad/s]."""
    return spla.splu(operator(section, wavenumber, omega), **SUPERLU)


def solve(section: Section, wavenumber: float, omega: float) -> np.ndarray:
    """Displacements u = (ũx, uy, uz) [n] m under a unit load on the strip."""
    lu = factorise(section, wavenumber, omega)
    return np.asarray(lu.solve(section.load.astype(np.complex128)))


def outputs(section: Section, wavenumber: float, u: np.ndarray) -> np.ndarray:
    """Mean displacement of the strip (down) and the stresses of a solution u, [1 + 4 Z]."""
    stress = section.stress0 @ u + wavenumber * (section.stress1 @ u)
    return np.concatenate([[section.load @ u], stress])
