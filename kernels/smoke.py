"""A small kernel that shows whether Taichi compiles and computes in double precision here."""

import numpy as np

from mcsettle.kernels.backend import ti


@ti.kernel
def _waves(x: ti.types.ndarray(dtype=ti.f64, ndim=1), y: ti.types.ndarray(dtype=ti.f64, ndim=1)):
    for i in range(x.shape[0]):
        total = ti.f64(0.0)
        for n in range(1, 9):
            total = total + ti.sin(n * x[i]) * ti.exp(-x[i]) / n
        y[i] = total


def largest_error(n_points: int = 4096) -> float:
    """Largest difference between a kernel and NumPy for a sum of eight waves (of order one)."""
    x = np.linspace(0.0, 3.0, n_points)
    found = np.zeros_like(x)
    _waves(x, found)
    n = np.arange(1, 9)
    expected = (np.sin(np.outer(x, n)) * np.exp(-x)[:, None] / n).sum(axis=1)
    return float(np.max(np.abs(found - expected)))
