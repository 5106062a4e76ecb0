"""Taichi functions of the physics (twins of mcsettle.stress and mcsettle.settlement).

Depends on: taichi.
"""

import numpy as np
import taichi as ti
from numpy.polynomial import Chebyshev, Polynomial

LARGEST_EXPONENT = 10.0
ROUND = 1.5 * 2.0**52  # adding it rounds to an integer, found in the low bits
ROUND_BITS = 0x4338000000000000


def _log_series(square: np.ndarray) -> np.ndarray:
    """log2((1 + s)/(1 − s))/s of s²."""
    s = np.sqrt(square)
    return 2.0 * np.arctanh(s) / (s * np.log(2.0))


def _fit(f: object, degree: int, low: float, high: float) -> tuple[float, ...]:
    """Coefficients of the polynomial through the Chebyshev points of low … high."""
    fitted = Chebyshev.interpolate(f, degree, domain=[low, high])
    return tuple(float(c) for c in fitted.convert(kind=Polynomial).coef)


LOG_TERMS = _fit(_log_series, 5, 0.0, (3.0 - 8.0**0.5) ** 2)
EXP_TERMS = _fit(np.exp2, 9, -0.5, 0.5)


@ti.func
def strain_power(q2: ti.f64, exponent: ti.f64) -> ti.f64:
    """σ_d^m from q2 = σ_d² ≥ 0 and the exponent m ≤ LARGEST_EXPONENT of Eq. (1) or (2).

    2^(m/2 log2 q2) by series, without calls or branches, so that loops over lanes vectorise; relative
    error some 1e-13 (tests). Zero gives next to nothing.
    """
    x = q2 + 1e-60
    bits = ti.bit_cast(x, ti.i64)
    # x = 2^e f with f between √½ and √2
    offset = bits + ti.i64((1023 << 52) - 0x3FE6A09E667F3BCD)
    e = ti.bit_shr(offset, ti.i64(52))
    f = ti.bit_cast(bits - (e << 52) + ti.i64(1023 << 52), ti.f64)
    s = (f - 1.0) / (f + 1.0)
    power = ti.bit_cast(e | ti.i64(0x4330000000000000), ti.f64) - (2.0**52 + 1023.0)
    y = (0.5 * exponent) * (power + s * _series(s * s, 6, LOG_TERMS))
    whole = y + ROUND
    n = ti.bit_cast(whole, ti.i64) - ti.i64(ROUND_BITS)
    scale = ti.bit_cast((n + 1023) << 52, ti.f64)
    return scale * _series(y - (whole - ROUND), 10, EXP_TERMS)


@ti.func
def _series(x: ti.f64, n: ti.template(), c: ti.template()) -> ti.f64:
    """Σ c_i x^i, n = 2, 6, 10 … terms, in fours: short chains of operations that wait for each other."""
    x2 = x * x
    x4 = x2 * x2
    total = ti.f64(c[n - 2]) + c[n - 1] * x
    for i in ti.static(range(n - 6, -1, -4)):
        total = total * x4 + ((c[i] + c[i + 1] * x) + x2 * (c[i + 2] + c[i + 3] * x))
    return total
