"""Standard deviation of the profile as a squared length of a linear map, for every window.

The engine's form of ``irregularity.standard_deviation``: over the whole window SD² = ½ Σ|U_k|²
(Parseval); in windows of 400 m and more the SD of the first 200 m about their mean, the section that
will be tamped embedded in a longer track.
"""

from dataclasses import dataclass

import numpy as np

from mcsettle.railway.irregularity import default_section, section_points


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


def roughness(wavenumbers: np.ndarray, window: float) -> Roughness:
    """SD of a profile with modes ``wavenumbers`` [K] on a periodic window [m]."""
    section = default_section(window)
    if section is None:
        return Roughness(None)
    x, weights = section_points(wavenumbers, section)
    phase = np.outer(wavenumbers, x)
    waves = np.stack([np.cos(phase), -np.sin(phase)], axis=1).reshape(-1, len(x))
    return Roughness((waves - (waves @ weights)[:, None]) * np.sqrt(weights))
