"""Modulus reduction and damping of soils and ballast against cyclic shear strain.

Strains are fractions, stresses pascals, damping the ratio D (not percent). Every curve gives G/Gmax
and D; which one a layer follows is a ``Curve``. Sources: Ishibashi and Zhang 1993, Darendeli 2001,
Menq 2003, Vucetic and Dobry 1991, Seed and Idriss 1970 (the last two as tables of half decades).
"""

import math
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Kind = Literal[
    "constant",
    "ishibashi_zhang",
    "vucetic_dobry",
    "darendeli",
    "menq",
    "seed_idriss_mean",
    "seed_idriss_upper",
]

KINDS: tuple[Kind, ...] = get_args(Kind)
ATMOSPHERE = 101.3e3  # Pa
SMALLEST_STRAIN = 1e-8  # below it no curve changes
CYCLES = 10.0  # number of cycles of Darendeli and Menq
FREQUENCY = 1.0  # Hz, as in Darendeli and Menq
STRAINS = 10.0 ** np.arange(-6.0, -1.9, 0.5)  # of the tables
_INDICES = np.array([0.0, 15.0, 30.0, 50.0])
_VUCETIC_G = np.array(
    [
        [1.0, 1.0, 0.96, 0.88, 0.70, 0.47, 0.26, 0.11, 0.03],
        [1.0, 1.0, 0.99, 0.94, 0.81, 0.64, 0.41, 0.22, 0.10],
        [1.0, 1.0, 1.0, 0.98, 0.90, 0.75, 0.53, 0.35, 0.17],
        [1.0, 1.0, 1.0, 1.0, 0.95, 0.84, 0.67, 0.47, 0.25],
    ]
)
_VUCETIC_D = np.array(
    [
        [0.01, 0.01, 0.01, 0.03, 0.054, 0.098, 0.15, 0.203, 0.24],
        [0.01, 0.01, 0.01, 0.026, 0.045, 0.075, 0.116, 0.16, 0.20],
        [0.01, 0.01, 0.01, 0.021, 0.038, 0.059, 0.088, 0.125, 0.169],
        [0.01, 0.01, 0.01, 0.018, 0.029, 0.043, 0.062, 0.095, 0.135],
    ]
)
_SEED = {
    "seed_idriss_mean": (
        np.array([1.0, 0.99, 0.96, 0.88, 0.74, 0.52, 0.29, 0.15, 0.06]),
        np.array([0.0057, 0.0086, 0.017, 0.031, 0.055, 0.095, 0.155, 0.211, 0.246]),
    ),
    "seed_idriss_upper": (  # upper modulus, lower damping
        np.array([1.0, 1.0, 0.99, 0.94, 0.84, 0.65, 0.36, 0.19, 0.08]),
        np.array([0.005, 0.006, 0.008, 0.014, 0.028, 0.053, 0.10, 0.158, 0.215]),
    ),
}


@dataclass(frozen=True)
class Curve:
    """Curve of one layer; parameters that its ``kind`` does not have are ignored.

    ``plasticity_index`` [%] (Ishibashi–Zhang, Vucetic–Dobry, Darendeli), ``ocr`` the
    overconsolidation ratio (Darendeli), ``uniformity_coefficient`` and ``d50`` [m] (Menq).
    """

    kind: Kind = "ishibashi_zhang"
    plasticity_index: float = 0.0
    ocr: float = 1.0
    uniformity_coefficient: float = 3.0
    d50: float = 0.035

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            raise ValueError(f"curve is '{self.kind}'; choose one of {', '.join(KINDS)}")
        if not 0.0 <= self.plasticity_index <= 200.0:
            raise ValueError(
                f"plasticity index is {self.plasticity_index}; it must lie in [0, 200]"
            )
        for name in ("ocr", "uniformity_coefficient"):
            if not 1.0 <= getattr(self, name) <= 1e3:
                raise ValueError(f"{name} is {getattr(self, name)}; it must lie in [1, 1000]")
        if not 0.0 < self.d50 < 10.0:
            raise ValueError(f"d50 is {self.d50} m; it must lie in (0, 10)")


def reduction(curve: Curve, strain: Array, confinement: Array) -> tuple[Array, Array]:
    """G/Gmax and damping ratio of a layer at cyclic shear strains.

    Parameters
    ----------
    curve : Curve
        The layer's curve; "constant" gives 1 and 0.
    strain : np.ndarray
        [N] shear strain (fraction), 0 or more.
    confinement : np.ndarray
        [N] Pa, mean effective stress, positive in compression.

    Returns
    -------
    (G/Gmax [N], D [N])

    Raises
    ------
    ValueError
        If a strain is negative or a confinement not positive.
    """
    gamma, stress = np.broadcast_arrays(np.asarray(strain, float), np.asarray(confinement, float))
    if not (np.all(gamma >= 0.0) and np.all(stress > 0.0)):
        raise ValueError("strains must be 0 or more and confining stresses positive")
    gamma = np.maximum(gamma, SMALLEST_STRAIN)
    if curve.kind == "constant":
        return np.ones_like(gamma), np.zeros_like(gamma)
    if curve.kind == "ishibashi_zhang":
        return _ishibashi_zhang(gamma, stress / 1e3, curve.plasticity_index)
    if curve.kind == "vucetic_dobry":
        return _vucetic_dobry(gamma, curve.plasticity_index)
    if curve.kind == "darendeli":
        return _darendeli(gamma, stress / ATMOSPHERE, curve)
    if curve.kind == "menq":
        return _menq(gamma, stress / ATMOSPHERE, curve)
    modulus, damping = _SEED[curve.kind]
    return _on_table(gamma, modulus), _on_table(gamma, damping)


def _ishibashi_zhang(gamma: Array, stress: Array, index: float) -> tuple[Array, Array]:
    """Ishibashi and Zhang 1993; ``stress`` in kPa."""
    if index <= 15.0:
        n = 3.37e-6 * index**1.404
    elif index <= 70.0:
        n = 7.0e-7 * index**1.976
    else:
        n = 2.7e-5 * index**1.115
    plastic = math.exp(-0.0145 * index**1.3)
    factor = 0.5 * (1.0 + np.tanh(0.492 * np.log((0.000102 + n) / gamma)))
    power = 0.272 * (1.0 - np.tanh(0.4 * np.log(0.000556 / gamma))) * plastic
    ratio = np.minimum(factor * stress**power, 1.0)
    damping = 0.1665 * (1.0 + plastic) * (0.586 * ratio**2 - 1.547 * ratio + 1.0)
    return ratio, damping


def _darendeli(gamma: Array, stress: Array, curve: Curve) -> tuple[Array, Array]:
    """Darendeli 2001; ``stress`` in atmospheres."""
    index, ocr = curve.plasticity_index, curve.ocr
    reference = (0.0352 + 0.0010 * index * ocr**0.3246) * stress**0.3483
    least = (0.8005 + 0.0129 * index * ocr**-0.1069) * stress**-0.2889
    least = least * (1.0 + 0.2919 * math.log(FREQUENCY))
    return _hyperbolic(100.0 * gamma, reference, np.full_like(gamma, 0.919), least)


def _menq(gamma: Array, stress: Array, curve: Curve) -> tuple[Array, Array]:
    """Menq 2003 for gravels; ``stress`` in atmospheres."""
    cu = curve.uniformity_coefficient
    reference = 0.12 * cu**-0.6 * stress ** (0.5 * cu**-0.15)
    power = 0.86 + 0.1 * np.log10(stress)
    least = 0.55 * cu**0.1 * (1e3 * curve.d50) ** -0.3 * stress**-0.05
    return _hyperbolic(100.0 * gamma, reference, power, least)


def _hyperbolic(gamma: Array, reference: Array, a: Array, least: Array) -> tuple[Array, Array]:
    """Modified hyperbola and Masing damping of Darendeli; strains and dampings in percent."""
    ratio = 1.0 / (1.0 + (gamma / reference) ** a)
    x = np.maximum(gamma / reference, 1e-4)  # below, the bracket cancels and tends to 2x/3
    loop = 4.0 * (x - np.log1p(x)) * (1.0 + x) / x**2 - 2.0
    masing = 100.0 / math.pi * loop * np.minimum(gamma / reference / x, 1.0)
    c1 = -1.1143 * a**2 + 1.8618 * a + 0.2523
    c2 = 0.0805 * a**2 - 0.0710 * a - 0.0095
    c3 = -0.0005 * a**2 + 0.0002 * a + 0.0003
    masing = c1 * masing + c2 * masing**2 + c3 * masing**3
    damping = (0.6329 - 0.0057 * math.log(CYCLES)) * ratio**0.1 * masing + least
    return ratio, damping / 100.0


def _vucetic_dobry(gamma: Array, index: float) -> tuple[Array, Array]:
    """Vucetic and Dobry 1991, linear in the plasticity index (constant beyond 50)."""
    modulus, damping = (
        np.array([np.interp(index, _INDICES, column) for column in table.T])
        for table in (_VUCETIC_G, _VUCETIC_D)
    )
    return _on_table(gamma, modulus), _on_table(gamma, damping)


def _on_table(gamma: Array, values: Array) -> Array:
    """Table values over half decades, linear in log strain, constant beyond the ends."""
    return np.interp(np.log10(gamma), np.log10(STRAINS), values)
