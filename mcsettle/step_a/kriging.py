"""Universal kriging of many outputs at once: a polynomial trend and a smooth remainder between points.

Every output is a weighted sum of its values at the training points, with the same weights w(x):

    [K  P] [w]   [k(x)]
    [Pᵀ 0] [μ] = [p(x)],

K the Matérn 5/2 correlation of the points, P the terms of the trend. So a prediction is exact at the
points and reproduces the trend's polynomials. The lengths of correlation and the degree of the trend are
those of least error when each point is left out, which takes no new fit: with
Q = K⁻¹ − K⁻¹P (PᵀK⁻¹P)⁻¹ PᵀK⁻¹ the error at point i is Q_i: Y / Q_ii (Dubrule 1983). Of the
outputs Y only their inner products Y Yᴴ are needed.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations_with_replacement

import numpy as np

NUGGET = 1e-9  # on the diagonal of K, so that near points do not make it singular
LENGTHS = tuple(float(length) for length in 2.0 ** np.arange(-1.0, 6.0))  # SDs of an input
FIRST_LENGTH = 4.0
SWEEPS = 3  # over the inputs, at most
DEGREES = (0, 1, 2)
FEWEST = 1.5  # points for each term of a trend
SPREAD_LENGTH = 2.5  # SDs of an input
SPREAD_NUGGET = 3e-3  # of the mean variance: so that points side by side teach little
INDEPENDENT = 1e-6  # share of a trend's term that the terms before it do not explain


@dataclass(frozen=True, eq=False)
class Kriging:
    """Weights of N training points anywhere in D inputs.

    ``points`` [N, D] and ``lengths`` [D] in SDs of the inputs; ``terms``: the trend's monomials, each
    the inputs that it multiplies; ``inverse`` [N, N] is Q, ``trend`` [N, T] K⁻¹P (PᵀK⁻¹P)⁻¹ and
    ``spread`` [T, T] (PᵀK⁻¹P)⁻¹.
    """

    points: np.ndarray
    lengths: np.ndarray
    terms: tuple[tuple[int, ...], ...]
    inverse: np.ndarray
    trend: np.ndarray
    spread: np.ndarray

    def weights(self, at: np.ndarray) -> np.ndarray:
        """Weights [M, N] of the training points at ``at`` [M, D]."""
        near = correlation(at, self.points, self.lengths)
        return np.asarray(near @ self.inverse + monomials(at, self.terms) @ self.trend.T)

    def deviations(self, at: np.ndarray) -> np.ndarray:
        """SDs [M] of the error at ``at`` [M, D], relative to that of the remainder."""
        near, unexplained = correlation(at, self.points, self.lengths), monomials(at, self.terms)
        variance = (
            1.0
            - np.einsum("mn,nl,ml->m", near, self.inverse, near)
            - 2.0 * np.einsum("mn,nt,mt->m", near, self.trend, unexplained)
            + np.einsum("mt,ts,ms->m", unexplained, self.spread, unexplained)
        )
        return np.sqrt(np.maximum(variance, 0.0))

    def covariance(self, at: np.ndarray) -> np.ndarray:
        """Covariance [M, M] of the errors at ``at`` [M, D]; its diagonal is that of ``deviations``."""
        near, unexplained = correlation(at, self.points, self.lengths), monomials(at, self.terms)
        cross = near @ self.trend @ unexplained.T
        both = near @ self.inverse @ near.T - unexplained @ self.spread @ unexplained.T
        return np.asarray(correlation(at, at, self.lengths) - both - cross - cross.T)

    def left_out(self) -> tuple[np.ndarray, np.ndarray]:
        """What is predicted at each of the points without it.

        Returns
        -------
        Weights [N, N], zero on the diagonal, and SDs [N] as ``deviations`` gives them.
        """
        own = np.diag(self.inverse)
        weights = np.eye(len(own)) - self.inverse / own[:, None]
        np.fill_diagonal(weights, 0.0)
        return weights, 1.0 / np.sqrt(own)


def fitted(points: np.ndarray, gram: np.ndarray, lengths: np.ndarray | None = None) -> Kriging:
    """Kriging of outputs with inner products ``gram`` [N, N] at ``points`` [N, D].

    ``lengths`` [D] of correlation, where they are known.

    Raises
    ------
    ValueError
        If there are fewer than two points.
    """
    if len(points) < 2:
        raise ValueError(f"{len(points)} training points; at least 2 are needed")
    best: tuple[float, Kriging] | None = None
    for degree in DEGREES:
        terms = independent(points, all_terms(points.shape[1], degree))
        if degree > 0 and FEWEST * len(terms) > len(points):
            continue
        if lengths is None:
            loss, kriging = _lengths_of_least_error(points, gram, terms)
        else:
            kriging = conditioned(points, lengths, terms)
            loss = float(np.mean(left_out_errors(kriging, gram)))
        if best is None or loss < best[0]:
            best = loss, kriging
    assert best is not None
    return best[1]


def conditioned(
    points: np.ndarray, lengths: np.ndarray, terms: tuple[tuple[int, ...], ...]
) -> Kriging:
    """Kriging with given lengths [D] and trend at ``points`` [N, D]."""
    matrix = correlation(points, points, lengths) + NUGGET * np.eye(len(points))
    basis = monomials(points, terms)
    solved = np.linalg.solve(matrix, np.concatenate([np.eye(len(points)), basis], axis=1))
    inverse, along = solved[:, : len(points)], solved[:, len(points) :]
    spread = np.linalg.inv(basis.T @ along)
    trend = along @ spread
    inverse = inverse - trend @ along.T
    return Kriging(points, lengths, terms, 0.5 * (inverse + inverse.T), trend, spread)


def left_out_errors(kriging: Kriging, gram: np.ndarray) -> np.ndarray:
    """Norms [N] of the errors where each point is left out; ``gram`` [N, N] as in ``fitted``."""
    errors = kriging.left_out()[0] - np.eye(len(gram))
    return np.sqrt(np.maximum(np.einsum("in,nm,im->i", errors, gram, errors), 0.0))


def remainder(kriging: Kriging, gram: np.ndarray) -> float:
    """SD of what the trend leaves, from the errors where each point is left out."""
    return float(np.sqrt(np.mean((left_out_errors(kriging, gram) / kriging.left_out()[1]) ** 2)))


def most_telling(covariance: np.ndarray, given: Sequence[int], n: int) -> list[int]:
    """The ``n`` points that next lower the mean variance over all of them the most, one by one.

    ``covariance`` [P, P] of what is not known of the points, before those ``given`` are.
    """
    rest, chosen = covariance.copy(), list(given)
    nugget = SPREAD_NUGGET * float(np.mean(np.diag(covariance)))
    for place in range(min(len(given) + n, len(rest))):
        variance = np.diag(rest) + nugget
        if place >= len(given):
            gain = np.sum(rest**2, axis=0) / variance
            gain[chosen] = -1.0
            chosen.append(int(np.argmax(gain)))
        rest -= np.outer(rest[:, chosen[place]], rest[chosen[place]]) / variance[chosen[place]]
    return chosen[len(given) :]


def isotropic(points: np.ndarray) -> np.ndarray:
    """Correlation [P, P] of ``points`` [P, D] before anything is learnt: one length for all inputs."""
    return correlation(points, points, np.full(points.shape[1], SPREAD_LENGTH))


def correlation(a: np.ndarray, b: np.ndarray, lengths: np.ndarray) -> np.ndarray:
    """Matérn 5/2 correlation [A, B] of points [A, D] and [B, D].

    >>> correlation(np.zeros((1, 2)), np.zeros((1, 2)), np.ones(2)).item()
    1.0
    """
    apart = (a[:, None, :] - b[None, :, :]) / lengths
    distance = np.sqrt(5.0 * np.sum(apart**2, axis=-1))
    return np.asarray((1.0 + distance + distance**2 / 3.0) * np.exp(-distance))


def all_terms(n_inputs: int, degree: int) -> tuple[tuple[int, ...], ...]:
    """Monomials up to ``degree``: constant, linear, squares and products, in this order.

    >>> all_terms(2, 2)
    ((), (0,), (1,), (0, 0), (0, 1), (1, 1))
    """
    inputs = range(n_inputs)
    return tuple(
        term for n in range(degree + 1) for term in combinations_with_replacement(inputs, n)
    )


def monomials(at: np.ndarray, terms: tuple[tuple[int, ...], ...]) -> np.ndarray:
    """Values [M, T] of the monomials ``terms`` at ``at`` [M, D]."""
    return np.stack([np.prod(at[:, list(term)], axis=1) for term in terms], axis=1)


def independent(
    points: np.ndarray, terms: tuple[tuple[int, ...], ...]
) -> tuple[tuple[int, ...], ...]:
    """Those of ``terms`` that the points [N, D] can tell from the terms before them."""
    chosen: list[tuple[int, ...]] = []
    basis = np.zeros((len(points), 0))
    for term, column in zip(terms, monomials(points, terms).T, strict=True):
        rest = column - basis @ (basis.T @ column)
        rest = rest - basis @ (basis.T @ rest)
        if float(np.linalg.norm(rest)) > INDEPENDENT * max(float(np.linalg.norm(column)), 1e-300):
            basis = np.column_stack([basis, rest / np.linalg.norm(rest)])
            chosen.append(term)
    return tuple(chosen)


def _lengths_of_least_error(
    points: np.ndarray, gram: np.ndarray, terms: tuple[tuple[int, ...], ...]
) -> tuple[float, Kriging]:
    """Lengths from ``LENGTHS``, input by input until none improves."""

    def at(lengths: np.ndarray) -> tuple[float, Kriging]:
        kriging = conditioned(points, lengths, terms)
        return float(np.mean(left_out_errors(kriging, gram))), kriging

    best = at(np.full(points.shape[1], FIRST_LENGTH))
    for _ in range(SWEEPS):
        before = best[0]
        for d in range(points.shape[1]):
            for length in LENGTHS:
                lengths = best[1].lengths.copy()
                if length == lengths[d]:
                    continue
                lengths[d] = length
                tried = at(lengths)
                if tried[0] < best[0]:
                    best = tried
        if best[0] >= before:
            break
    return best
