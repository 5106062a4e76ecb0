"""Wave speeds of a ground that follow from its material alone.

Depends on: track.
"""

import numpy as np

from mcsettle.track import Material


def rayleigh_speed(material: Material) -> float:
    """Speed of the Rayleigh wave of a half-space of ``material`` [m/s], from its secular equation.

    With x = (c_R/c_S)² and r = (c_S/c_P)²: x³ - 8x² + (24 - 16 r) x - 16 (1 - r) = 0.

    >>> round(rayleigh_speed(Material(2.5e8, 0.25, 1000.0, 0.0)) / (1e5 / 1e3) ** 0.5 / 31.6228, 4)
    0.9194
    """
    ratio = (material.shear_wave_speed / material.pressure_wave_speed) ** 2
    roots = np.roots([1.0, -8.0, 24.0 - 16.0 * ratio, -16.0 * (1.0 - ratio)])
    real = roots[np.abs(roots.imag) < 1e-9].real
    x = real[(real > 0.0) & (real < 1.0)].min()
    return float(material.shear_wave_speed * np.sqrt(x))
