"""Fast evaluation: at each quadrature wavenumber the reduced operator is diagonalised once.

With A = K(k) - σM, T = A⁻¹M = X μ X⁻¹ and δ = ω² - σ the solution is X (1 - δμ)⁻¹ X⁻¹ A⁻¹ f, so that
every further frequency costs one weighted sum over modes.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mcsettle.step_a.fem25d.reduced_basis import Band
from mcsettle.step_a.fem25d.settings import Settings


@dataclass(frozen=True)
class ModalBand:
    """Modes at the quadrature nodes ``nodes`` (a slice, N long) of one band.

    ``shift`` [N] rad²/s², ``mu`` [N, r] s²/rad², ``modes`` [N, r, 1 + 4 Z] outputs.
    """

    nodes: slice
    shift: np.ndarray
    mu: np.ndarray
    modes: np.ndarray

    def outputs(self, omegas: np.ndarray) -> np.ndarray:
        """Section outputs [W, N, 1 + 4 Z] at frequencies [W, N] rad/s (only ω² matters)."""
        delta = omegas.T**2 - self.shift[:, None]
        amplitudes = 1.0 / (1.0 - delta[:, :, None] * self.mu[:, None, :])
        return np.asarray((amplitudes @ self.modes).transpose(1, 0, 2))


def modal_bands(bands: Sequence[Band], nodes: np.ndarray, settings: Settings) -> list[ModalBand]:
    """Diagonalise every band at its share of the rising wavenumbers ``nodes`` [rad/m]."""
    uppers = np.array([band.upper for band in bands])
    owner = np.minimum(np.searchsorted(uppers, nodes), uppers.size - 1)
    starts = np.searchsorted(owner, np.arange(uppers.size + 1))
    result = []
    for i, band in enumerate(bands):
        at = slice(int(starts[i]), int(starts[i + 1]))
        if at.stop > at.start:
            result.append(_diagonalised(band, at, nodes[at], settings))
    return result


def _diagonalised(band: Band, at: slice, k: np.ndarray, settings: Settings) -> ModalBand:
    highest = settings.max_omega + k * settings.max_speed
    shift = (0.5 * highest) ** 2
    k3 = k[:, None, None]
    matrix = band.stiffness[0] + k3 * band.stiffness[1] + k3**2 * band.stiffness[2]
    matrix = matrix - shift[:, None, None] * band.mass
    right = np.concatenate([band.mass, band.load[:, None]], axis=1)
    solved = np.linalg.solve(matrix, np.broadcast_to(right, (k.size, *right.shape)))
    mu, vectors = np.linalg.eig(solved[:, :, :-1])
    amplitudes = np.linalg.solve(vectors, solved[:, :, -1:])[..., 0]
    rows = band.output0 + k3 * band.output1
    modes = (rows @ vectors) * amplitudes[:, None, :]
    return ModalBand(at, shift, mu, np.ascontiguousarray(modes.transpose(0, 2, 1)))
