"""Quadrature over wavenumber, and the jump that hysteretic damping puts into the integrand.

The panels are short enough for e^{-iks} at the far end of a train. The response of the ground
is smoother: its poles are ξ k away from the real axis. ``Support`` has the fewer
wavenumbers at which it is computed.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

FIRST = 0.005  # rad/m, first panel next to k = 0
FAR = 3.0  # rad/m, beyond which panels lengthen again
FAR_GROWTH = 0.006  # further panel length per wavenumber there


@dataclass(frozen=True)
class Quadrature:
    """Composite Gauss–Legendre rule over (0, k_max].

    ``edges`` [P + 1] rad/m of the panels, ``nodes`` and ``weights`` [P n] rad/m, ``points`` n.
    """

    edges: np.ndarray
    nodes: np.ndarray
    weights: np.ndarray
    points: int

    @cached_property
    def both_signs(self) -> tuple[np.ndarray, np.ndarray]:
        """Nodes and weights [2 P n] rad/m over [-k_max, k_max].

        Always the same object: phases are cached by its identity.
        """
        return (
            np.concatenate([-self.nodes[::-1], self.nodes]),
            np.concatenate([self.weights[::-1], self.weights]),
        )


def wavenumber_quadrature(
    k_max: float, panel: float, points: int, ratio: float = 0.2
) -> Quadrature:
    """Panels of at most ``ratio`` k near k = 0, no longer than ``panel`` below 3 rad/m [rad/m].

    A panel of length h integrates e^{-iks} for |s| h / 2 up to about the number of its points.
    Beyond 3 rad/m the integrand is small (the rails' bending filters it) and panels lengthen.
    """
    edges = [0.0, min(FIRST, k_max)]
    while edges[-1] < k_max:
        k = edges[-1]
        step = min(ratio * k, panel + FAR_GROWTH * max(0.0, k - FAR))
        edges.append(k + step)
    edges[-1] = k_max
    if len(edges) > 2 and edges[-1] - edges[-2] < 0.3 * (edges[-2] - edges[-3]):
        del edges[-2]
    x, w = np.polynomial.legendre.leggauss(points)
    e = np.array(edges)
    half = np.diff(e)[:, None] / 2.0
    nodes = (e[:-1, None] + half) + half * x
    return Quadrature(e, nodes.ravel(), (half * w).ravel(), points)


@dataclass(frozen=True)
class Support:
    """Wavenumbers ``nodes`` [M] rad/m from which a smooth response follows at all of a rule.

    ``pieces`` are (nodes of the support, nodes of the rule, matrix): the values there are the
    matrix times those at the support; None where both are the same.
    """

    nodes: np.ndarray
    pieces: tuple[tuple[slice, slice, np.ndarray | None], ...]

    def spread(self, values: np.ndarray) -> np.ndarray:
        """Complex values [W, N, J] at the rule's nodes from those [W, M, J] at the support."""
        count = self.pieces[-1][1].stop
        at_nodes = np.empty((values.shape[0], count, values.shape[2]), dtype=np.complex128)
        for support, rule, matrix in self.pieces:
            part = np.ascontiguousarray(values[:, support])
            if matrix is None:
                at_nodes[:, rule] = part
            else:  # real times complex, as real times real
                at_nodes[:, rule] = (matrix @ part.view(np.float64)).view(np.complex128)
        return at_nodes

    def gathered(self, factors: np.ndarray, nodes: slice) -> tuple[slice, np.ndarray]:
        """Factors of the support's values that give the sum of ``factors`` times those at the rule.

        ``factors`` [J, n] complex stand at the rule's ``nodes``.

        Returns
        -------
        (slice of the support, factors [J, M] there)
            From the first piece that has some of the nodes to the last.
        """
        halves = np.stack([factors.real, factors.imag])  # real times complex, as real times real
        sums, places = [], []
        for support, rule, matrix in self.pieces:
            first, last = max(rule.start, nodes.start), min(rule.stop, nodes.stop)
            if first >= last:
                continue
            part = halves[:, :, first - nodes.start : last - nodes.start]
            rows = np.eye(rule.stop - rule.start) if matrix is None else matrix
            sums.append(part @ rows[first - rule.start : last - rule.start])
            places.append(support)
        real, imaginary = np.concatenate(sums, axis=2)
        return slice(places[0].start, places[-1].stop), real + 1j * imaginary


def smooth_support(quadrature: Quadrature, damping: float, ratio: float = 3.3) -> Support:
    """Support of responses of a ground with damping ratio ξ of ``damping`` or more.

    Panels are joined while their length stays below ``ratio`` ξ k; the response is interpolated in each
    piece through as many Gauss–Legendre points as a panel has.
    """
    edges, n = quadrature.edges, quadrature.points
    x = np.polynomial.legendre.leggauss(n)[0]
    # Lagrange polynomials through the Gauss points, by their Legendre coefficients.
    inverse = np.linalg.inv(np.polynomial.legendre.legvander(x, n - 1))
    nodes: list[np.ndarray] = []
    pieces: list[tuple[slice, slice, np.ndarray | None]] = []
    first = 0
    while first < edges.size - 1:
        last = first + 1
        while (
            last < edges.size - 1
            and edges[last + 1] - edges[first] <= ratio * damping * edges[first]
        ):
            last += 1
        rule = slice(first * n, last * n)
        support = slice(len(pieces) * n, (len(pieces) + 1) * n)
        middle, half = (edges[last] + edges[first]) / 2.0, (edges[last] - edges[first]) / 2.0
        matrix = None
        if last > first + 1:
            at = (quadrature.nodes[rule] - middle) / half
            matrix = np.polynomial.legendre.legvander(at, n - 1) @ inverse
        nodes.append(middle + half * x)
        pieces.append((support, rule, matrix))
        first = last
    return Support(np.concatenate(nodes), tuple(pieces))


def jump_shares(quadrature: Quadrature, place: float) -> tuple[slice, np.ndarray] | None:
    """Nodes of the panel that contains a jump, and the share of each node's weight below it.

    With f = f₁ below ``place`` [rad/m] and f₂ above, both smooth over the complete panel, the values
    share f₁ + (1 - share) f₂ at the panel's nodes integrate the pieces exactly for polynomials.

    Returns
    -------
    (slice, shares [n]) or None
        None where the jump lies outside the rule or on an edge.
    """
    at = int(np.searchsorted(quadrature.edges, place, side="right")) - 1
    if not 0 <= at < quadrature.edges.size - 1:
        return None
    lower, upper = quadrature.edges[at], quadrature.edges[at + 1]
    n = quadrature.points
    x = np.polynomial.legendre.leggauss(n)[0]
    cut = 2.0 * (place - lower) / (upper - lower) - 1.0
    # ∫_{-1}^{cut} of each Lagrange polynomial, by its Legendre coefficients (2l+1)/2 w_i P_l(x_i).
    values = np.polynomial.legendre.legvander(x, n - 1)
    ends = np.polynomial.legendre.legvander(np.array([cut]), n)[0]
    integral = np.empty(n)
    integral[0] = cut + 1.0
    for degree in range(1, n):
        integral[degree] = (ends[degree + 1] - ends[degree - 1]) / (2 * degree + 1)
    shares = (values * (2.0 * np.arange(n) + 1.0) / 2.0) @ integral
    return slice(at * n, (at + 1) * n), shares
