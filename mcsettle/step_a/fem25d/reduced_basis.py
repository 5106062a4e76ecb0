"""Reduced basis: a few dozen unknowns that replace those of the section at every (k, ω).

The operator K0 + k K1 + k² K2 - ω² M is affine, so it projects once. A basis serves one band of
wavenumbers. It is grown greedily: solve where the residual of the present basis is largest, add the
solution with its first and second derivatives to k and ω² (one factorisation serves all), until the
last solutions were predicted within the tolerance before they were added.

The projection is Vᴴ A V (Galerkin): the numerical range of A contains that of its projection, and damping
keeps it away from zero. Without the conjugate, or with adjoint solutions for a test space, false
resonances appear between the training points, with errors of up to 100 % in a narrow range of (k, ω).

The residual is measured through a fixed random sketch, which costs little per training point and
does not lose half the digits as a squared norm would. A residual far from the track matters less to
its stresses, so it counts with the inverse square of its distance. It overlooks slow long
waves; so every other solution is placed where the outputs changed most at the last extension.
"""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from scipy.sparse.linalg import SuperLU

from mcsettle.errors import NumericalError
from mcsettle.step_a.fem25d.section import Section
from mcsettle.step_a.fem25d.solve import factorise, outputs

FAR_FIELD = 0.5  # m, distance beyond which residuals count less
ORDER = 2  # of the derivatives to k and ω² that one factorisation gives
VECTORS = (ORDER + 1) * (ORDER + 2) // 2  # a solution and its derivatives
SKETCH = 64  # rows of the random sketch
SKETCH_SEED = 20_240_117
NO_ROWS = np.empty(0, dtype=int)
CONFIRMATIONS = 2  # predicted solutions within the tolerance that end the growth, one of each kind


@dataclass(frozen=True)
class Band:
    """Projected section for wavenumbers in [``lower``, ``upper``] rad/m, r unknowns.

    ``stiffness`` [3, r, r] (K0, K1, K2), ``mass`` [r, r], ``load`` [r]; outputs are
    ``output0 + k output1`` [1 + 4 Z, r]; ``centreline`` [D, r] gives downward displacements.
    """

    lower: float
    upper: float
    stiffness: np.ndarray
    mass: np.ndarray
    load: np.ndarray
    output0: np.ndarray
    output1: np.ndarray
    centreline: np.ndarray
    solves: int

    @property
    def size(self) -> int:
        """Number of reduced unknowns."""
        return int(self.load.size)

    def solve(self, wavenumber: float, omegas: np.ndarray) -> np.ndarray:
        """Reduced unknowns [W, r] at one wavenumber and several ω ≥ 0."""
        k = wavenumber
        a = self.stiffness[0] + k * self.stiffness[1] + k * k * self.stiffness[2]
        matrices = a[None] - (omegas**2)[:, None, None] * self.mass[None]
        loads = np.broadcast_to(self.load[:, None], (omegas.size, self.size, 1))
        return np.asarray(np.linalg.solve(matrices, loads)[..., 0])

    def outputs(self, wavenumber: float, omegas: np.ndarray) -> np.ndarray:
        """Strip displacement and stresses [W, 1 + 4 Z] under a unit load on the strip."""
        rows = self.output0 + wavenumber * self.output1
        return np.asarray(self.solve(wavenumber, omegas) @ rows.T)


@dataclass(frozen=True, eq=False)
class Bases:
    """Bands by rising wavenumber, errors [n] at held-out points, heights [D] m of the centreline."""

    bands: tuple[Band, ...]
    errors: np.ndarray
    heights: np.ndarray


def output_error(approximate: np.ndarray, exact: np.ndarray) -> float:
    """Relative error of the strip displacement or of the stresses, the larger; inputs [1 + 4 Z].

    Stresses are compared with the largest one over depth and component at the same (k, ω).
    """
    return float(_errors(approximate[None], exact[None])[0])


def _errors(approximate: np.ndarray, exact: np.ndarray) -> np.ndarray:
    difference, size = np.abs(approximate - exact), np.abs(exact)
    stress = difference[:, 1:].max(axis=1) / size[:, 1:].max(axis=1)
    return np.asarray(np.maximum(difference[:, 0] / size[:, 0], stress))


class _Growth:
    """Basis under construction for one band; room for ``capacity`` factorisations."""

    def __init__(self, section: Section, capacity: int) -> None:
        k0, _, k2 = section.stiffness
        self.section = section
        self.matrices = [matrix.tocsr() for matrix in (*section.stiffness, section.mass)]
        at = section.basis.doflocs[:, section.free]
        scale = 1.0 / np.sqrt(np.abs(k0.diagonal()) + np.abs(k2.diagonal()))
        scale /= (FAR_FIELD + np.hypot(at[0], at[1])) ** 2
        rng = np.random.Generator(np.random.Philox(key=SKETCH_SEED))
        sketch = rng.standard_normal((SKETCH, section.unknowns))
        self.sketch = (sketch * scale).astype(np.complex128)
        self.sketched_load = self.sketch @ section.load
        # Allocated at full size: growing the arrays by copies took as long as the factorisations.
        n, most = section.unknowns, capacity * VECTORS
        self.size = 0
        self._space = np.empty((n, most), dtype=np.complex128, order="F")
        self._images = [np.empty((n, most), dtype=np.complex128, order="F") for _ in range(4)]
        self._projected = np.empty((4, most, most), dtype=np.complex128)
        self._sketched = np.empty((4, SKETCH, most), dtype=np.complex128)
        self.solves = 0

    @property
    def space(self) -> np.ndarray:
        """Orthonormal basis vectors [n, r]."""
        return self._space[:, : self.size]

    def add(self, wavenumber: float, omega: float) -> np.ndarray:
        """Solve at (k, ω), extend the space, return the exact outputs [1 + 4 Z]."""
        lu = factorise(self.section, wavenumber, omega)
        self.solves += 1
        u = lu.solve(self.section.load.astype(np.complex128))
        self._extend(self._taylor(lu, u, wavenumber))
        return outputs(self.section, wavenumber, u)

    def _taylor(self, lu: SuperLU, u: np.ndarray, wavenumber: float) -> np.ndarray:
        """Taylor coefficients [n, VECTORS] of the solution in k and ω², order by order.

        A u_pq = M u_p,q-1 - (K1 + 2 k K2) u_p-1,q - K2 u_p-2,q, the orders p of k falling.
        """
        _, k1, k2, mass = self.matrices
        orders = [u[:, None]]
        for order in range(1, ORDER + 1):
            last = orders[-1]  # [n, order]: p = order - 1 ... 0
            right = np.zeros((u.size, order + 1), dtype=np.complex128)
            right[:, 1:] += mass @ last
            right[:, :-1] -= k1 @ last + 2.0 * wavenumber * (k2 @ last)
            if order > 1:
                right[:, :-2] -= k2 @ orders[-2]
            orders.append(lu.solve(right))
        return np.column_stack(orders)

    def _extend(self, vectors: np.ndarray) -> None:
        """Extend the space, and the projections of the operator."""
        new = _orthonormal(self.space, vectors)
        old, grown = self.size, self.size + new.shape[1]
        self._space[:, old:grown] = new
        self.size = grown
        for i, matrix in enumerate(self.matrices):
            image = matrix @ new
            self._images[i][:, old:grown] = image
            # The smaller factor is the one to conjugate: (imageᴴ V)ᴴ.
            self._projected[i, :grown, old:grown] = (image.conj().T @ self.space).conj().T
            self._projected[i, old:grown, :old] = new.conj().T @ self._images[i][:, :old]
            self._sketched[i, :, old:grown] = self.sketch @ image

    def band(self, lower: float, upper: float, rows: np.ndarray) -> Band:
        """The present projected operator; ``rows`` [D] as in ``grow_band``."""
        s, p = self.section, self._projected[:, : self.size, : self.size].copy()
        displacement = s.load @ self.space
        out0 = np.vstack([displacement[None], s.stress0 @ self.space])
        out1 = np.vstack([np.zeros((1, self.size)), s.stress1 @ self.space])
        down = -self.space[rows]
        return Band(lower, upper, p[:3], p[3], displacement.conj(), out0, out1, down, self.solves)

    def tried(self, band: Band, wavenumber: float, omegas: np.ndarray
              ) -> tuple[np.ndarray, np.ndarray]:  # fmt: skip
        """Sketched norm of the residual [W] and outputs [W, 1 + 4 Z] at several ω."""
        c = band.solve(wavenumber, omegas)
        s = self._sketched[:, :, : self.size]
        static = s[0] + wavenumber * s[1] + wavenumber**2 * s[2]
        force = c @ static.T - (omegas**2)[:, None] * (c @ s[3].T)
        rows = band.output0 + wavenumber * band.output1
        return np.linalg.norm(force - self.sketched_load, axis=1), c @ rows.T


def _orthonormal(space: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    """Columns that extend an orthonormal ``space`` by ``vectors`` (two Gram–Schmidt passes)."""
    new = vectors / np.linalg.norm(vectors, axis=0)
    for _ in range(2):
        inside = (new.conj().T @ space).conj().T  # no copy of the space
        new = np.linalg.qr(new - space @ inside)[0]
    return np.asarray(new)


TrainingSet = list[tuple[float, np.ndarray]]


def training_set(
    lower: float,
    upper: float,
    max_omega: float,
    max_speed: float,
    wave_speeds: Iterable[float],
    points: int = 7,
    frequencies: int = 30,
) -> TrainingSet:
    """Wavenumbers of a band, each with its frequencies ω ∈ [0, max_omega + k max_speed].

    Chebyshev points over the band (geometric from zero in the first one); frequencies uniform and, for
    the slow waves at small k, geometric; more on the lines ω = k v of constant loads up to the highest
    speed and around the lines ω = k c of the given wave speeds.
    """
    if lower == 0.0:
        k = np.concatenate([[0.0], np.geomspace(upper / 200.0, upper, points - 1)])
    else:
        cheb = (1.0 - np.cos(np.pi * np.arange(points) / (points - 1))) / 2.0
        k = lower + (upper - lower) * cheb
    spread = np.array([0.9, 0.96, 1.0, 1.04, 1.1])
    result = []
    for wavenumber in k:
        highest = max_omega + wavenumber * max_speed
        lines = np.concatenate([wavenumber * c * spread for c in wave_speeds])
        constant = wavenumber * max_speed * np.linspace(0.25, 1.0, 4)
        slow = np.geomspace(1e-4 * max_omega, 0.2 * highest, 12)
        uniform = np.linspace(0.0, highest, frequencies)
        omegas = np.concatenate([uniform, slow, constant, lines])
        result.append((float(wavenumber), np.unique(omegas[omegas <= highest])))
    return result


def grow_band(
    section: Section,
    lower: float,
    upper: float,
    training: TrainingSet,
    tolerance: float,
    least_solves: int = 8,
    max_solves: int = 60,
    rows: np.ndarray = NO_ROWS,
) -> Band:
    """Grow a reduced basis over one band until it predicts its own next solutions.

    Parameters
    ----------
    section : Section
        The full operator.
    lower, upper : float
        Band of wavenumbers [rad/m].
    training : list of (k, ω [W])
        Candidates for the next solution.
    tolerance : float
        Relative error of the outputs that ends the growth.
    least_solves, max_solves : int
        Fewest and most factorisations.
    rows : np.ndarray, optional
        [D] unknowns whose downward displacement the band gives beside its outputs.

    Raises
    ------
    NumericalError
        If the tolerance is not met within ``max_solves``.
    """
    growth = _Growth(section, max_solves)
    middle = training[len(training) // 2]
    growth.add(middle[0], float(middle[1][middle[1].size // 2]))
    ks = np.concatenate([np.full(w.size, k) for k, w in training])
    omegas = np.concatenate([w for _, w in training])
    # Two measures in turn choose the next solution: the residual, which finds resonances, and the
    # change of the outputs by the last extension, which finds slow long waves. The basis is complete
    # when its last predictions, one of each kind, and all changes were within the tolerance.
    confirmed, changes, previous = 0, np.full(ks.size, np.inf), None
    while growth.solves < least_solves or confirmed < CONFIRMATIONS or changes.max() > tolerance:
        if growth.solves >= max_solves:
            raise NumericalError(
                f"the reduced basis for {lower}-{upper} rad/m missed its tolerance {tolerance} "
                f"after {max_solves} solutions; use narrower bands or a larger tolerance"
            )
        band = growth.band(lower, upper, NO_ROWS)
        tried = [growth.tried(band, k, w) for k, w in training]
        outs = np.concatenate([t[1] for t in tried])
        if previous is not None:
            changes = _errors(previous, outs)
        previous = outs
        by_residual = growth.solves % 2 == 1
        at = int(np.argmax(np.concatenate([t[0] for t in tried]) if by_residual else changes))
        error = output_error(outs[at], growth.add(float(ks[at]), float(omegas[at])))
        confirmed = confirmed + 1 if error < tolerance else 0
    return growth.band(lower, upper, rows)
