"""Where the profiles of a line grow between two dates: by wavelength, and beside what was there."""

import numpy as np


def increment_by_wave(
    first: np.ndarray, second: np.ndarray, wavenumbers: np.ndarray, edges: np.ndarray
) -> list[tuple[float, float, float, float]]:
    """Where profiles grew between two dates: by band of wavelengths.

    Parameters
    ----------
    first, second : ndarray, complex, shape [S, K], m
        Amplitudes of the same sections on two dates.
    wavenumbers : ndarray, shape [K], rad/m
    edges : ndarray, shape [B + 1], m
        Rising wavelengths that part the bands.

    Returns
    -------
    list of (shortest, longest, growth, correlation)
        ``growth``: SD of the increment over SD of the first profile [-]; ``correlation`` of the
        increment with the first profile, over all sections: 1 where hollows deepen, 0 where new ones
        arise.
    """
    wavelength, added = 2.0 * np.pi / wavenumbers, second - first
    rows: list[tuple[float, float, float, float]] = []
    for shortest, longest in zip(edges[:-1], edges[1:], strict=True):
        band = (wavelength >= shortest) & (wavelength < longest)
        power = np.sum(np.abs(first[:, band]) ** 2)
        gained = np.sum(np.abs(added[:, band]) ** 2)
        if not power > 0.0 or not gained > 0.0:
            continue
        shared = np.sum((added[:, band] * np.conj(first[:, band])).real)
        growth, correlation = np.sqrt(gained / power), shared / np.sqrt(power * gained)
        rows.append((float(shortest), float(longest), float(growth), float(correlation)))
    return rows
