"""Observed order of the 2.5D elements on an evanescent pressure wave, an exact solution.

With φ = e^{-αz} cos βy e^{-ikx} and α² = k² + β² - ω²/c_P² the field u = ∇φ solves the homogeneous
equation: (ũx, uy, uz) = (-k, ∂y, ∂z) φ. Quadratic elements: third order in u, second in stress.
"""

import numpy as np
import skfem

from mcsettle.step_a.fem25d.element import (
    Cells,
    Pattern,
    element_operators,
    isotropic_stiffness,
    vector_basis,
)

K, BETA, OMEGA = 1.3, 1.7, 120.0
YOUNG, POISSON, DENSITY = 80e6, 0.3, 1900.0
C_P2 = YOUNG * (1 - POISSON) / ((1 + POISSON) * (1 - 2 * POISSON)) / DENSITY
ALPHA = np.sqrt(K**2 + BETA**2 - OMEGA**2 / C_P2)


def wave(x):
    decay, cos, sin = np.exp(-ALPHA * x[1]), np.cos(BETA * x[0]), np.sin(BETA * x[0])
    return np.stack([-K * decay * cos, -BETA * decay * sin, -ALPHA * decay * cos])


def error(n: int) -> float:
    line = np.linspace(0.0, 2.0, n + 1) ** 1.2
    mesh = skfem.MeshQuad.init_tensor(line, line)
    basis = vector_basis(mesh)
    count = mesh.nelements
    d = np.repeat(isotropic_stiffness(YOUNG, POISSON)[:, :, None], count, axis=2)
    cells = Cells(d, np.full(count, DENSITY), np.ones(count), np.ones(count))
    pattern = Pattern.of(basis.element_dofs, np.arange(basis.N))
    k0, k1, k2, m = (pattern.added_up(part) for part in element_operators(basis, cells))
    matrix = (k0 + K * k1 + K**2 * k2 - OMEGA**2 * m).tocsc()
    exact = basis.project(wave)
    u = skfem.solve(*skfem.condense(matrix, x=exact.astype(complex), D=basis.get_dofs().all()))
    found = np.asarray(basis.interpolate(u.real))
    difference = found - wave(np.asarray(basis.global_coordinates()))
    return float(np.sqrt(np.sum(difference**2 * basis.dx)))


def test_displacement_converges_with_third_order():
    errors = [error(n) for n in (4, 8, 16)]
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert np.all(orders > 2.7), (errors, orders)  # 3 in the limit
    assert errors[-1] < 1e-3
