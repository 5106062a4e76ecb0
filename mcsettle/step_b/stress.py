"""Deviatoric stress on the track centreline, Eq. (10).

With τxy = τyz = 0 on the plane of symmetry, Eq. (10) in components is
σ_d² = σxx² + σyy² + σzz² − σxx σyy − σyy σzz − σzz σxx + 3 τxz². It has three degrees of freedom:
σ_d = |D σ| with ``DEVIATOR`` D of shape [3, 4], which is what the fast kernels use.
"""

import math

import numpy as np

DEVIATOR = np.array(
    [
        [-0.5, -0.5, 1.0, 0.0],
        [math.sqrt(0.75), -math.sqrt(0.75), 0.0, 0.0],
        [0.0, 0.0, 0.0, math.sqrt(3.0)],
    ]
)


def deviatoric_stress(xx: np.ndarray, yy: np.ndarray, zz: np.ndarray, xz: np.ndarray) -> np.ndarray:
    """Deviatoric (von Mises) stress σ_d [Pa], Eq. (10); all arguments Pa, broadcast.

    >>> float(deviatoric_stress(0.0, 0.0, -60e3, 0.0))
    60000.0
    """
    normal = (xx - yy) ** 2 + (yy - zz) ** 2 + (zz - xx) ** 2
    return np.sqrt(0.5 * normal + 3.0 * np.square(xz))


def mean_state(quasi_static: np.ndarray, geostatic: np.ndarray, stress: str) -> np.ndarray:
    """Stress about which the dynamic part varies, [..., 4, Z] Pa.

    ``stress``: "traffic" (quasi-static only: Li and Selig's definition) or "total" (with geostatic).
    """
    return quasi_static + geostatic if stress == "total" else quasi_static
