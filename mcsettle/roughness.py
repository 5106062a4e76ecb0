"""Standard deviation of the profile as a squared length of a linear map, for every window.

On a window shorter than two sections the SD is taken over the whole window, SD² = ½ Σ|U_k|²
(Parseval). On a longer window it is the SD over the first section (200 m by default) of the track,
mean removed: the section that will be tamped, embedded in a longer track.

Depends on: nothing of the package.
"""

from dataclasses import dataclass

import numpy as np

SECTION = 200.0  # m, the length over which track quality is judged


@dataclass(frozen=True)
class Roughness:
    """Linear map from amplitudes to numbers whose squares add up to the variance.

    ``basis`` is None for the whole window (the map is U/√2), else real [2K, P].
    """

    basis: np.ndarray | None

    def embed(self, amplitudes: np.ndarray) -> np.ndarray:
        """Map complex [..., K] to real [..., P] (P = 2K for a whole window), in m."""
        real = np.ascontiguousarray(amplitudes).view(float)
        if self.basis is None:
            return real * np.sqrt(0.5)
        # One product per row: the library's order of summation then never depends on the batch.
        return (real[..., None, :] @ self.basis)[..., 0, :]

    def sd(self, amplitudes: np.ndarray) -> np.ndarray:
        """Standard deviation [...] in m of profiles with complex amplitudes [..., K]."""
        return np.sqrt(np.sum(self.embed(amplitudes) ** 2, axis=-1))


def roughness(wavenumbers: np.ndarray, window: float, section: float = SECTION) -> Roughness:
    """SD of a profile with modes ``wavenumbers`` [K] on a periodic window [m]."""
    if window < 2.0 * section:
        return Roughness(None)
    n_points = int(np.ceil(section * wavenumbers.max() / np.pi * 1.25))
    x = (np.arange(n_points) + 0.5) / n_points * section
    phase = np.outer(wavenumbers, x)
    waves = np.stack([np.cos(phase), -np.sin(phase)], axis=1).reshape(-1, n_points)
    return Roughness((waves - waves.mean(axis=1, keepdims=True)) / np.sqrt(n_points))
