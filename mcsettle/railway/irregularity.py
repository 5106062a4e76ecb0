"""Track irregularity: spectra, random profiles on a periodic window, their standard deviation.

A profile is a sum of waves of the window, positive down,

    Δu(x) = Re Σ U_k e^{+ikx},   k = 2πn / window,

kept to the wavelengths of the 3–35 m band. A realisation is a stationary Gaussian process: its
amplitudes are complex normal numbers, U_k = √(S(k) Δk) (g1 + i g2), so that the expected variance
is Σ S(k) Δk. Its address is (seed, index): in any batch, in any order and on any machine, the same
address gives the same profile. Every sum over modes or points is taken row by row in a fixed order,
so a realisation alone equals the same realisation in a batch, bit for bit.
"""

from collections.abc import Iterable

import numpy as np

from mcsettle.errors import InputError
from mcsettle.railway.spectra import Spectrum

SECTION = 200.0  # m, the length over which the paper takes the standard deviation


def profile_modes(window: float, shortest: float = 3.0, longest: float = 35.0) -> np.ndarray:
    """Mode numbers n of the window with ``shortest`` ≤ window/n ≤ ``longest``, rising.

    Parameters
    ----------
    window, shortest, longest : float, m

    Returns
    -------
    ndarray of int, shape [K]; 6 to 66 for 200 m and 3–35 m.

    Raises
    ------
    InputError
        If a length is not positive or no wave of the window falls in the band.
    """
    if not (0.0 < shortest < longest < np.inf and 0.0 < window < np.inf):
        raise InputError(
            f"window {window} m with band {shortest}–{longest} m; "
            "lengths must be positive and finite, the shortest below the longest"
        )
    # The margin keeps a wave that lies on the edge of the band in spite of rounding.
    first = int(np.ceil(window / longest * (1.0 - 1e-12)))
    last = int(np.floor(window / shortest * (1.0 + 1e-12)))
    if last < first:
        raise InputError(
            f"no wave of a {window} m window lies between {shortest} and {longest} m; "
            "lengthen the window or widen the band"
        )
    return np.arange(first, last + 1)


def wavenumbers(window: float, shortest: float = 3.0, longest: float = 35.0) -> np.ndarray:
    """Wavenumbers of the band, k = 2πn/window [rad/m], shape [K], rising.

    Parameters
    ----------
    window, shortest, longest : float, m

    Raises
    ------
    InputError
        As ``profile_modes``.
    """
    return 2.0 * np.pi * profile_modes(window, shortest, longest) / window


def sample_profiles(
    spectrum: Spectrum,
    wavenumbers: np.ndarray,
    window: float,
    seed: int,
    indices: Iterable[int],
    sd: float | None = None,
    section: float | None = None,
) -> np.ndarray:
    """Complex amplitudes of stationary Gaussian profiles, one row for each realisation index.

    Parameters
    ----------
    spectrum : callable, k [rad/m] -> S(k) [m²/(rad/m)], one-sided
    wavenumbers : ndarray, shape [K], rad/m
        Those of the window's waves (``wavenumbers``).
    window : float, m
        Period of the profile; Δk = 2π/window.
    seed : int
        Study seed, 0 to 2⁶⁴ − 1.
    indices : iterable of int, length R
        Realisation indices, 0 to 2⁶⁴ − 1. Row r depends on (seed, indices[r]) alone.
    sd : float, m, optional
        Rescale each realisation to this standard deviation; otherwise it varies as the spectrum
        gives it.
    section : float, m, optional
        Length over which ``sd`` is meant (``standard_deviation``); by default the complete window.

    Returns
    -------
    ndarray of complex, shape [R, K], m; Δu(x) = Re Σ U_k e^{+ikx}, positive down.

    Raises
    ------
    InputError
        If the seed or an index does not fit 64 bits, or ``sd`` is not positive.
    """
    if sd is not None and not 0.0 < sd < np.inf:
        raise InputError(f"sd is {sd} m; it must be positive, or left out")
    k = np.asarray(wavenumbers, dtype=float)
    scale = np.sqrt(spectrum(k) * 2.0 * np.pi / window)
    rows = [_normals(seed, index, len(k)) for index in indices]
    normals = np.stack(rows) if rows else np.empty((0, len(k), 2))
    # Real and imaginary parts are scaled apart: real products round in the same way in any batch.
    profiles = np.empty(normals.shape[:2], dtype=complex)
    profiles.real = scale * normals[:, :, 0]
    profiles.imag = scale * normals[:, :, 1]
    if sd is None:
        return profiles
    factor = (sd / standard_deviation(profiles, k, section))[:, None]
    profiles.real *= factor
    profiles.imag *= factor
    return profiles


def random_amplitudes(
    seed: int, index: int, n_modes: int, stream: tuple[int, int] = (0, 0)
) -> np.ndarray:
    """Complex normal numbers [K] of one address, of unit variance in each part.

    Each ``stream`` of an address has numbers of its own; (0, 0) is that of the profile.
    """
    normals = _normals(seed, index, n_modes, stream)
    return np.asarray(normals[:, 0] + 1j * normals[:, 1])


def standard_deviation(
    profiles: np.ndarray, wavenumbers: np.ndarray | None = None, section: float | None = None
) -> np.ndarray:
    """Standard deviation of profiles given by their amplitudes.

    Over the complete window it is Parseval's √(½ Σ|U|²), exact. Over a section of it, in
    windows much longer than the section (``default_section``), it is the standard deviation about
    the mean over 0 ≤ x ≤ ``section``, by a quadrature exact to rounding
    (``section_points``).

    Parameters
    ----------
    profiles : ndarray of complex, shape [R, K], m
    wavenumbers : ndarray, shape [K], rad/m
        Needed with ``section`` only.
    section : float, m, optional

    Returns
    -------
    ndarray, shape [R], m.

    Raises
    ------
    InputError
        If ``section`` comes without ``wavenumbers``.
    """
    if section is None:
        return np.asarray(np.sqrt(0.5 * _row_sum(profiles.real**2 + profiles.imag**2)))
    if wavenumbers is None:
        raise InputError("the standard deviation over a section needs the wavenumbers")
    x, weights = section_points(wavenumbers, section)
    heights = to_space(profiles, wavenumbers, x)
    mean = _row_sum(heights * weights)
    return np.asarray(np.sqrt(_row_sum((heights - mean[:, None]) ** 2 * weights)))


def default_section(window: float) -> float | None:
    """Section [m] of the standard deviation: 200 m in windows of 400 m and more, else the window.

    Returns None for the complete window. All sections of a stationary profile are statistically alike,
    so the first one represents them.
    """
    return SECTION if window >= 2.0 * SECTION else None


def section_points(wavenumbers: np.ndarray, section: float) -> tuple[np.ndarray, np.ndarray]:
    """Gauss–Legendre points and weights over 0 ≤ x ≤ section for products of two waves.

    Parameters
    ----------
    wavenumbers : ndarray, shape [K], rad/m
    section : float, m

    Returns
    -------
    x : ndarray, shape [P], m
    weights : ndarray, shape [P]
        They add up to 1: Σ w f(x) is the mean of f over the section.

    Raises
    ------
    InputError
        If ``section`` is not positive.
    """
    if not 0.0 < section < np.inf:
        raise InputError(f"section is {section} m; it must be positive")
    # A product of two waves turns by 2 k_max·section; Gauss points resolve it from half as many
    # points as radians of half that phase, and converge faster than any power thereafter.
    n_points = int(np.ceil(0.5 * float(np.max(wavenumbers)) * section)) + 40
    nodes, weights = np.polynomial.legendre.leggauss(n_points)
    return 0.5 * section * (nodes + 1.0), 0.5 * weights


def to_space(profiles: np.ndarray, wavenumbers: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Profile heights Δu(x) = Re Σ U_k e^{+ikx}.

    Parameters
    ----------
    profiles : ndarray of complex, shape [R, K], m
    wavenumbers : ndarray, shape [K], rad/m
    x : ndarray, shape [X], m

    Returns
    -------
    ndarray, shape [R, X], m, positive down.
    """
    heights = np.zeros((profiles.shape[0], len(x)))
    # Mode by mode and in real numbers: a matrix product would round differently in other batches.
    for mode, k in enumerate(wavenumbers):
        heights += profiles.real[:, mode, None] * np.cos(k * x)
        heights -= profiles.imag[:, mode, None] * np.sin(k * x)
    return heights


def _normals(seed: int, index: int, n_modes: int, stream: tuple[int, int] = (0, 0)) -> np.ndarray:
    """Standard normals of one address, shape [K, 2]; more modes do not change the first ones."""
    for name, number in (("seed", seed), ("realisation index", index)):
        if not 0 <= number < 2**64:
            raise InputError(f"{name} is {number}; it must lie between 0 and 2**64 - 1")
    key = np.array([seed, index], dtype=np.uint64)
    # Streams begin 2¹²⁸ numbers apart.
    counter = np.array([0, 0, *stream], dtype=np.uint64)
    generator = np.random.Generator(np.random.Philox(key=key, counter=counter))
    return generator.standard_normal((n_modes, 2))


def _row_sum(terms: np.ndarray) -> np.ndarray:
    """Sum over the last axis in a fixed order, [R, N] -> [R]: no row depends on its neighbours."""
    total: np.ndarray = np.zeros(terms.shape[0])
    for column in terms.T:
        total += column
    return total
