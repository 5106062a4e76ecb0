"""The absorbing border: coordinates that turn complex and grow, element by element.

Beyond the real region each element has a complex length h_j = h_0 q^j e^{-iθ_j}. With the time
factor e^{iωt} an outgoing wave e^{-iκs} decays as e^{κ Im s} and an evanescent field e^{-κs} as
e^{-κ Re s}: an angle of 45° serves both, and geometric growth carries the border to a few
kilometres, so that one frequency-independent stretch works for waves and for the static limit
k → 0, ω → 0 alike. Since no length depends on ω the operator stays affine in k, k² and ω².

Below the wave speeds every field decays sideways at a fixed share of k or faster, so that for
wavenumbers of k and more the border may end at a multiple of 1/k.
"""

import math
from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq


@dataclass(frozen=True)
class Border:
    """Absorbing border: ``elements``, total ``length`` |s| [m], final ``angle`` [rad], ``ramp``.

    The angle rises linearly from zero over the first ``ramp`` elements. For wavenumbers from k > 0
    on, ``decays / k`` of the length is enough, but at least ``least`` [m].
    """

    elements: int = 13
    length: float = 4000.0
    angle: float = math.pi / 4.0
    ramp: int = 3
    decays: float = 12.0
    least: float = 5.0

    def __post_init__(self) -> None:
        if self.elements < 1 or self.ramp < 1:
            raise ValueError(
                f"the border has {self.elements} elements and a ramp of {self.ramp}; both must be "
                "at least 1"
            )
        if not (self.length > 0.0 and 0.0 <= self.angle < math.pi / 2.0):
            raise ValueError(
                f"border length is {self.length} m and angle {self.angle} rad; they must be "
                "positive and in [0, π/2)"
            )
        if not (self.decays > 0.0 and self.least > 0.0):
            raise ValueError(
                f"the border ends after {self.decays} decay lengths and {self.least} m at least; "
                "both must be positive"
            )

    def reach_at(self, lowest: float) -> float:
        """Length |s| [m] that wavenumbers of ``lowest`` ≥ 0 [rad/m] and above need."""
        return (
            self.length
            if lowest <= 0.0
            else min(self.length, max(self.decays / lowest, self.least))
        )


def border_lengths(first: float, border: Border) -> np.ndarray:
    """Complex element lengths [n] m of an absorbing border next to an element of length ``first``.

    Parameters
    ----------
    first : float
        Length of the last real element [m]; the border continues it with a constant ratio.
    border : Border
        Number of elements, total length, angle.

    Returns
    -------
    np.ndarray
        [n] m, complex; the moduli grow geometrically and add up to ``border.length``.
    """
    n = border.elements
    powers = np.arange(1, n + 1)
    if first * n >= border.length:
        ratio = 1.0
    else:
        ratio = brentq(lambda q: first * np.sum(q**powers) - border.length, 1.0, 1e3)
    angle = border.angle * np.minimum(1.0, powers / border.ramp)
    return np.asarray(first * ratio**powers * np.exp(-1j * angle))
