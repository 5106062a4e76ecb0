"""Spectra of track irregularity: FRA classes, their older one-corner form, the German high and low."""

from collections.abc import Callable
from functools import partial

import numpy as np

from mcsettle.errors import InputError

Spectrum = Callable[[np.ndarray], np.ndarray]

# Roughness A [m²·cycle/m] of FRA classes 1 to 6, for S(n) with n in cycles/m (Hamid & Yang, 1981).
FRA_ROUGHNESS = (16.7217e-7, 9.5250e-7, 5.2917e-7, 2.9633e-7, 1.6722e-7, 0.9525e-7)
FRA_CORNERS = (0.0233, 0.1312)  # cycles/m
# Roughness A_v [m²·rad/m] of FRA classes 1 to 6 for the form with one corner (Berawi, Porto).
ONE_CORNER_ROUGHNESS = (1.2107e-4, 1.0181e-4, 0.6816e-4, 0.5376e-4, 0.2095e-4, 0.0339e-4)
ONE_CORNER = 0.8245  # rad/m
ONE_CORNER_FACTOR = 0.25
# Roughness A_v [m²·rad/m] of the German spectra, and their corners [rad/m].
GERMAN_ROUGHNESS = {"german_low": 4.032e-7, "german_high": 10.80e-7}
GERMAN_CORNERS = (0.0206, 0.8246)
SPECTRA = ("fra", "fra_one_corner", "german_low", "german_high")


def fra(wavenumber: np.ndarray, roughness: float) -> np.ndarray:
    """Two-corner FRA spectrum, S(k) = S(n)/2π with n = k/2π.

    Parameters
    ----------
    wavenumber : ndarray, rad/m
    roughness : float, m²·cycle/m
        A of S(n) = A n3² (n² + n2²) / (n⁴ (n² + n3²)).

    Returns
    -------
    ndarray, m²/(rad/m), one-sided.

    References
    ----------
    Hamid and Yang (1981), Transportation Research Record 838.
    """
    low, high = FRA_CORNERS
    n2 = (np.asarray(wavenumber) / (2.0 * np.pi)) ** 2
    density = roughness * high**2 * (n2 + low**2) / (n2**2 * (n2 + high**2))
    return np.asarray(density / (2.0 * np.pi))


def fra_one_corner(wavenumber: np.ndarray, roughness: float) -> np.ndarray:
    """One-corner FRA spectrum, S(k) = 0.25 A_v kc² / (k² (k² + kc²)).

    Parameters
    ----------
    wavenumber : ndarray, rad/m
    roughness : float, m²·rad/m

    Returns
    -------
    ndarray, m²/(rad/m), one-sided.

    References
    ----------
    M. Berawi, *Improving railway track maintenance using power spectral density*, thesis, Porto.
    """
    k2 = np.asarray(wavenumber) ** 2
    return np.asarray(ONE_CORNER_FACTOR * roughness * ONE_CORNER**2 / (k2 * (k2 + ONE_CORNER**2)))


def german(wavenumber: np.ndarray, roughness: float) -> np.ndarray:
    """German spectrum, S(k) = A_v kc² / ((k² + kr²) (k² + kc²)).

    Parameters
    ----------
    wavenumber : ndarray, rad/m
    roughness : float, m²·rad/m

    Returns
    -------
    ndarray, m²/(rad/m), one-sided.

    References
    ----------
    The spectra of low and high disturbance of the German railways.
    """
    low, high = GERMAN_CORNERS
    k2 = np.asarray(wavenumber) ** 2
    return np.asarray(roughness * high**2 / ((k2 + low**2) * (k2 + high**2)))


def spectrum(name: str = "fra", fra_class: int = 6) -> Spectrum:
    """Spectrum by name: a callable k [rad/m] -> S(k) [m²/(rad/m)], one-sided.

    Parameters
    ----------
    name : str
        ``fra`` (two corners), ``fra_one_corner``, ``german_low`` or ``german_high``.
    fra_class : int
        FRA track class, 1 (rough) to 6 (smooth); the German spectra have no class and ignore it.

    Raises
    ------
    InputError
        If the name or the class is unknown.

    Examples
    --------
    >>> float(spectrum("german_low")(1.0).round(10))
    1.631e-07
    """
    if name not in SPECTRA:
        raise InputError(f"spectrum '{name}' is unknown; choose one of {', '.join(SPECTRA)}")
    if name in GERMAN_ROUGHNESS:
        return partial(german, roughness=GERMAN_ROUGHNESS[name])
    if fra_class not in range(1, 7):
        raise InputError(f"fra_class is {fra_class}; it must be a whole number from 1 to 6")
    if name == "fra":
        return partial(fra, roughness=FRA_ROUGHNESS[fra_class - 1])
    return partial(fra_one_corner, roughness=ONE_CORNER_ROUGHNESS[fra_class - 1])
