"""Strains under a passing train: the quasi-static field along x from a few wavenumbers.

Per unit force the strain ε̃(k, kv) is smooth in k; only the train's spectrum F(k) = Σ P_l e^{ik a_l}
oscillates. ε̃ is interpolated between J wavenumbers (polynomials in log(k + k₀)),
ε̃(k) = Σ_j ε̃_j L_j(k), so that

    ε(x) = (1/π) Re Σ_j ε̃_j ∫ L_j(k) F(k) e^{-ikx} dk = Re Σ_j ε̃_j g_j(x),

with functions g_j that depend on the train alone.
"""

import numpy as np

from mcsettle.railway.traffic import Train
from mcsettle.step_a.fem25d.wavenumber_rule import wavenumber_quadrature

LARGEST = 8.0  # rad/m: bending of the rails has removed 99.5 % of the load's spectrum by then
SHIFT = 0.06  # rad/m, k₀
STEP = 0.1  # m between places along the train
CARS = 2  # cars at either end of the train over which the largest strain is sought
MARGIN = 3.0  # m beyond them


def line_wavenumbers(count: int) -> np.ndarray:
    """Chebyshev points [J] rad/m in log(k + k₀) over (0, LARGEST)."""
    x = -np.cos(np.pi * (np.arange(count) + 0.5) / count)
    lower, upper = np.log(SHIFT), np.log(LARGEST + SHIFT)
    return np.asarray(np.exp((lower + upper) / 2.0 + x * (upper - lower) / 2.0) - SHIFT)


def places(train: Train, cars: int = CARS) -> np.ndarray:
    """Places x [X] m (in the train's coordinate) over the first and last cars of a train.

    The strains of a train are largest at its ends or repeat from car to car: ``cars`` at each end
    (with the coupling between them) and a margin ahead and behind represent all.
    """
    ends = np.concatenate([[0.0], np.cumsum([car.length for car in train.cars])])
    front = (
        train.cars[0].length / 2.0 - train.cars[0].axle_offsets[0]
    )  # of the leading axle, the origin
    count = len(train.cars)
    pieces = [(0, count)] if count <= 2 * cars else [(0, cars), (count - cars, count)]
    candidates = [train.axle_positions]
    for first, last in pieces:
        ahead, behind = front - ends[first] + MARGIN, front - ends[last] - MARGIN
        candidates.append(np.linspace(behind, ahead, int(np.ceil((ahead - behind) / STEP)) + 1))
    x = np.unique(np.concatenate(candidates))
    inside = [(x >= front - ends[b] - MARGIN) & (x <= front - ends[a] + MARGIN) for a, b in pieces]
    return np.asarray(x[np.any(inside, axis=0)])


def along_train(train: Train, wavenumbers: np.ndarray, x: np.ndarray) -> np.ndarray:
    """The functions g_j(x) [J, X] N of a train's static axle forces.

    Parameters
    ----------
    train : Train
        All of its axles act.
    wavenumbers : np.ndarray
        [J] rad/m of ``line_wavenumbers``.
    x : np.ndarray
        [X] m, places in the train's coordinate.
    """
    axles = train.axle_positions
    reach = max(axles.max(), x.max()) - min(axles.min(), x.min())
    rule = wavenumber_quadrature(LARGEST, min(0.1, 18.0 / reach), 12)
    k = rule.nodes
    weights = _lagrange(np.log(wavenumbers + SHIFT), np.log(k + SHIFT)) * rule.weights / np.pi
    spectrum = np.exp(1j * np.outer(k, axles)) @ train.axle_forces
    return np.asarray((weights * spectrum) @ np.exp(-1j * np.outer(k, x)))


def _lagrange(nodes: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Lagrange polynomials [J, N] of J Chebyshev nodes at N points (barycentric)."""
    n = nodes.size
    angle = np.pi * (np.arange(n) + 0.5) / n
    share = (-1.0) ** np.arange(n) * np.sin(angle)
    gap = at[None, :] - nodes[:, None]
    hit = np.abs(gap) < 1e-13
    terms = share[:, None] / np.where(hit, 1.0, gap)
    values = terms / terms.sum(axis=0)
    return np.where(hit.any(axis=0), hit, values)
