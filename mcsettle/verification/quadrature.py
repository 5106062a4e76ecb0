"""Adaptive quadrature of vector functions, many panels at a time."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from mcsettle.errors import NumericalError

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

_POINTS = 12  # Gauss points per panel
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(_POINTS)
_MAX_LEVELS = 40  # halvings of a panel
_SHARE = 0.02  # of the tolerance that any panel may use; accepted panels are far more accurate


def integrate(
    function: Callable[[Array], ComplexArray], edges: Array, tolerance: float
) -> ComplexArray:
    """Integral of ``function`` from the first edge to the last.

    Panels are halved until the two halves agree with the panel itself.

    Parameters
    ----------
    function
        Takes points [P], returns values [G, P] (G integrals at once).
    edges
        First panels, rising; place an edge wherever the integrand is rough.
    tolerance
        Error of each integral relative to the integral of its modulus.

    Raises
    ------
    NumericalError
        If some panel does not converge (a pole on the path, as on undamped ground).
    """
    lower, upper = edges[:-1], edges[1:]
    estimate, size = _panels(function, lower, upper)
    total = np.zeros(estimate.shape[0], dtype=complex)
    scale, span = size.sum(axis=1), float(edges[-1] - edges[0])
    for _ in range(_MAX_LEVELS):
        middle = 0.5 * (lower + upper)
        halves, size = _panels(
            function, np.concatenate([lower, middle]), np.concatenate([middle, upper])
        )
        left, right = np.split(halves, 2, axis=1)
        scale = np.maximum(scale, np.abs(total))
        error = np.max(np.abs(left + right - estimate) / (tolerance * scale[:, None]), axis=0)
        done = error <= np.maximum((upper - lower) / span, _SHARE)
        total += (left + right)[:, done].sum(axis=1)
        if np.all(done):
            return total
        open_ = ~done
        estimate = np.concatenate([left[:, open_], right[:, open_]], axis=1)
        lower = np.concatenate([lower[open_], middle[open_]])
        upper = np.concatenate([middle[open_], upper[open_]])
    raise NumericalError(
        f"the integral does not converge near {lower[0]:.6g}; is there a pole on the path "
        "(ground without damping)?"
    )


def _panels(
    function: Callable[[Array], ComplexArray], lower: Array, upper: Array
) -> tuple[ComplexArray, Array]:
    """Integrals over panels and of the modulus, [G, panels] each."""
    half = 0.5 * (upper - lower)
    points = 0.5 * (upper + lower)[:, None] + half[:, None] * _NODES
    values = function(points.ravel())
    values = values.reshape(values.shape[0], lower.size, _POINTS)
    weights = half[:, None] * _WEIGHTS
    return (values * weights).sum(axis=2), (np.abs(values) * weights).sum(axis=2)
