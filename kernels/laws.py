"""Taichi functions of the physics (twins of mcsettle.step_b.stress and mcsettle.step_b.settlement)."""

import numpy as np
from numpy.polynomial import Chebyshev, Polynomial

from mcsettle.kernels.backend import ti

# Bits of a number in double precision: where its exponent begins, √½, and 1.5 · 2^52, adding which
# rounds to an integer that is then found in the low bits; the same in single precision.
EXPONENT, ROOT, ROUND = 52, 0x3FE6A09E667F3BCD, 1.5 * 2.0**52
EXPONENT_32, ROOT_32, ROUND_32 = 23, 0x3F3504F3, 1.5 * 2.0**23
ROUND_BITS, ROUND_BITS_32 = 0x433 << 52 | 1 << 51, 0x4B400000


def _log_series(square: np.ndarray) -> np.ndarray:
    """log2((1 + s)/(1 − s))/s of s²."""
    s = np.sqrt(square)
    return 2.0 * np.arctanh(s) / (s * np.log(2.0))


def _fit(f: object, degree: int, low: float, high: float) -> tuple[float, ...]:
    """Coefficients of the polynomial through the Chebyshev points of low … high."""
    fitted = Chebyshev.interpolate(f, degree, domain=[low, high])
    return tuple(float(c) for c in fitted.convert(kind=Polynomial).coef)


LARGEST_SQUARE = (3.0 - 8.0**0.5) ** 2
LOG_TERMS = _fit(_log_series, 5, 0.0, LARGEST_SQUARE)
EXP_TERMS = _fit(np.exp2, 9, -0.5, 0.5)
LOG_TERMS_32 = _fit(_log_series, 3, 0.0, LARGEST_SQUARE)
EXP_TERMS_32 = _fit(np.exp2, 5, -0.5, 0.5)


@ti.func
def binary_logarithm(q2: ti.f64) -> ti.f64:
    """log2 of q2 = σ_d² ≥ 0 (of 0: some −200).

    σ_d^m of Eqs. (1) and (2) is 2^(m/2 log2 q2), m ≤ 10, by series, without calls or
    branches, so that loops over lanes vectorise; relative error some 1e-13 (tests). A loop that takes
    the logarithm and another that takes the power of two are quicker than one: each operation waits
    for the one before, and of shorter chains the processor holds more at a time.
    """
    # x = 2^e f with f between √½ and √2
    offset = ti.bit_cast(q2 + 1e-60, ti.i64) + ti.i64((1023 << EXPONENT) - ROOT)
    f = ti.bit_cast((offset & ti.i64((1 << EXPONENT) - 1)) + ti.i64(ROOT), ti.f64)
    e = ti.bit_cast(ti.bit_shr(offset, EXPONENT) | ti.i64(0x433 << EXPONENT), ti.f64)
    s = (f - 1.0) / (f + 1.0)
    return (e - (2.0**52 + 1023.0)) + s * _series(s * s, 6, LOG_TERMS)


@ti.func
def power_of_two(y: ti.f64) -> ti.f64:
    """2^y of |y| < 1000."""
    whole = y + ROUND
    part = _series(y - (whole - ROUND), 10, EXP_TERMS)
    n = ti.bit_cast(whole, ti.i64) - ti.i64(ROUND_BITS)
    return ti.bit_cast(ti.bit_cast(part, ti.i64) + (n << EXPONENT), ti.f64)


@ti.func
def binary_logarithm_32(q2: ti.f32) -> ti.f32:
    """``binary_logarithm`` in single precision; σ_d^m to some 1e-6 (tests)."""
    one = ti.f32(1.0)
    offset = ti.bit_cast(q2 + ti.f32(1e-30), ti.i32) + ti.i32((127 << EXPONENT_32) - ROOT_32)
    f = ti.bit_cast((offset & ti.i32((1 << EXPONENT_32) - 1)) + ti.i32(ROOT_32), ti.f32)
    e = ti.cast(ti.bit_shr(offset, EXPONENT_32) - 127, ti.f32)
    s = (f - one) / (f + one)
    return e + s * _series_32(s * s, 4, LOG_TERMS_32)


@ti.func
def power_of_two_32(y: ti.f32) -> ti.f32:
    """``power_of_two`` in single precision."""
    whole = y + ti.f32(ROUND_32)
    part = _series_32(y - (whole - ti.f32(ROUND_32)), 6, EXP_TERMS_32)
    n = ti.bit_cast(whole, ti.i32) - ti.i32(ROUND_BITS_32)
    return ti.bit_cast(ti.bit_cast(part, ti.i32) + (n << EXPONENT_32), ti.f32)


@ti.func
def _series(x: ti.f64, n: ti.template(), c: ti.template()) -> ti.f64:
    """Σ c_i x^i, n = 2, 6, 10 … terms, in fours: short chains of operations that wait for each other."""
    x2 = x * x
    x4 = x2 * x2
    total = ti.f64(c[n - 2]) + c[n - 1] * x
    for i in ti.static(range(n - 6, -1, -4)):
        total = total * x4 + ((c[i] + c[i + 1] * x) + x2 * (c[i + 2] + c[i + 3] * x))
    return total


@ti.func
def _series_32(x: ti.f32, n: ti.template(), c: ti.template()) -> ti.f32:
    """Σ c_i x^i in single precision, n terms, in twos."""
    x2 = x * x
    total = ti.f32(c[n - 2]) + ti.f32(c[n - 1]) * x
    for i in ti.static(range(n - 4, -1, -2)):
        total = total * x2 + (ti.f32(c[i]) + ti.f32(c[i + 1]) * x)
    return total
