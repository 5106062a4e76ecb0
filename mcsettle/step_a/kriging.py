"""Universal kriging of many outputs at once: a polynomial trend and a smooth remainder between points.

Every output is a weighted sum of its values at the training points, with the same weights w(x):

    [K  P] [w]   [k(x)]
    [Pᵀ 0] [μ] = [p(x)],

K the Matérn 5/2 correlation of the points, P the terms of the trend. So a prediction is exact at the
points and reproduces the trend's polynomials. The lengths of correlation and the degree of the trend are
those of least error when groups of points are left out, which takes no new fit: with
Q = K⁻¹ − K⁻¹P (PᵀK⁻¹P)⁻¹ PᵀK⁻¹ the error at a group G is (Q_GG)⁻¹ Q_G: Y (Dubrule 1983). Of the
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
FEWEST = 1.5  # groups of points for each term of a trend in what differs between groups
SPREAD_LENGTH = 2.5  # SDs of an input
SPREAD_NUGGET = 3e-3  # so that points side by side teach little
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
        near = correlation(at, self.points, self.lengths)
        unexplained = monomials(at, self.terms)
        cross = np.einsum("mn,nt,mt->m", near, self.trend, unexplained)
        variance = (
            1.0
            - np.einsum("mn,nl,ml->m", near, self.inverse, near)
            - 2.0 * cross
            + np.einsum("mt,ts,ms->m", unexplained, self.spread, unexplained)
        )
        return np.sqrt(np.maximum(variance, 0.0))

    def left_out(self, group: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """What is predicted at the points ``group`` [G] without them.

        Returns
        -------
        Weights [G, N], zero at the group, and SDs [G] as ``deviations`` gives them.
        """
        own = np.linalg.inv(self.inverse[np.ix_(group, group)])
        weights = -own @ self.inverse[group]
        weights[:, group] = 0.0
        return weights, np.sqrt(np.maximum(np.diag(own), 0.0))


def fitted(points: np.ndarray, gram: np.ndarray, groups: Sequence[np.ndarray]) -> Kriging:
    """Kriging of outputs with inner products ``gram`` [N, N] at ``points`` [N, D].

    ``groups``: indices of points that are left out together where lengths and trend are compared.

    Raises
    ------
    ValueError
        If there are fewer than two groups.
    """
    if len(groups) < 2:
        raise ValueError(f"{len(groups)} groups of training points; at least 2 are needed")
    best: tuple[float, Kriging] | None = None
    within = inputs_within(points, groups)
    for degree in DEGREES:
        terms = independent(points, trend_terms(points.shape[1], degree, within))
        between = [term for term in terms if not within & set(term)]
        if degree > 0 and FEWEST * len(between) > len(groups):
            continue
        loss, found = _lengths_of_least_error(points, gram, groups, terms)
        if best is None or loss < best[0]:
            best = loss, found
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


def left_out_loss(kriging: Kriging, gram: np.ndarray, groups: Sequence[np.ndarray]) -> float:
    """Mean over the groups of the norm of the error where each is left out."""
    losses = []
    for group in groups:
        weights, _ = kriging.left_out(group)
        weights[np.arange(len(group)), group] -= 1.0
        squares = np.einsum("gn,nm,gm->g", weights, gram, weights)
        losses.append(np.sqrt(np.maximum(squares, 0.0).mean()))
    return float(np.mean(losses))


def next_spread(points: np.ndarray, chosen: Sequence[int], n: int) -> list[int]:
    """The ``n`` of ``points`` [P, D] that next lower the mean variance over all of them the most.

    ``chosen``: those that are computed already. With one length for all inputs, so that nothing but
    the points decides.
    """
    lengths = np.full(points.shape[1], SPREAD_LENGTH)
    covariance = correlation(points, points, lengths)
    order = list(chosen)
    for place in range(len(chosen) + min(n, len(points) - len(chosen))):
        gain = np.sum(covariance**2, axis=0) / (np.diag(covariance) + SPREAD_NUGGET)
        gain[order] = -1.0
        best = order[place] if place < len(chosen) else int(np.argmax(gain))
        if place >= len(chosen):
            order.append(best)
        column = covariance[:, best].copy()
        covariance -= np.outer(column, column) / (column[best] + SPREAD_NUGGET)
    return order[len(chosen) :]


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


def trend_terms(n_inputs: int, degree: int, within: set[int]) -> tuple[tuple[int, ...], ...]:
    """``all_terms``; a linear trend may have another slope at each value of the inputs ``within``.

    Effects compare such values (speeds) within a group, where an error that they share cancels.

    >>> trend_terms(2, 1, {1})
    ((), (0,), (1,), (0, 1))
    """
    terms = all_terms(n_inputs, degree)
    if degree != 1:
        return terms
    products = [term for term in all_terms(n_inputs, 2) if len(within & set(term)) == 1]
    return terms + tuple(term for term in products if len(set(term)) == 2)


def inputs_within(points: np.ndarray, groups: Sequence[np.ndarray]) -> set[int]:
    """Inputs that differ between the points [N, D] of one group."""
    spans = np.max([np.ptp(points[group], axis=0) for group in groups], axis=0)
    return {int(i) for i in np.flatnonzero(spans > 0.0)}


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
    points: np.ndarray,
    gram: np.ndarray,
    groups: Sequence[np.ndarray],
    terms: tuple[tuple[int, ...], ...],
) -> tuple[float, Kriging]:
    """Lengths from ``LENGTHS``, input by input until none improves."""

    def at(lengths: np.ndarray) -> tuple[float, Kriging]:
        kriging = conditioned(points, lengths, terms)
        return left_out_loss(kriging, gram, groups), kriging

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
