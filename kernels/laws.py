"""Taichi functions of the physics (twins of mcsettle.stress and mcsettle.settlement).

Depends on: taichi.
"""

import taichi as ti


@ti.func
def strain_power(q2: ti.f64, exponent: ti.f64) -> ti.f64:
    """σ_d^m from q2 = σ_d² and the exponent m of Eq. (1) or (2); no power call where m = 2."""
    value = q2
    if exponent != 2.0:
        value = q2 ** (0.5 * exponent)
    return value
