"""Total-order indices from the sets that were run anyway: a smoothing spline through them, by parts.

On the cumulative probabilities u ∈ [0, 1]^D of the inputs a Gaussian process with the kernel

    K(u, v) = σ² Π_i (1 + θ_i k(u_i, v_i)) + nugget,
    k(x, y) = B₁(x) B₁(y) + B₂(x) B₂(y)/4 − B₄(|x − y|)/24        (Bernoulli polynomials: ∫ k dx = 0)

is a sum of orthogonal parts, one for each group of inputs, so that the variance of every part is a
quadratic form in the coefficients and no sampling is needed. θ_i and the nugget maximise the likelihood.
The total index of an input is the share of all parts that contain it: what would remain of the variance
if every other input were known, its interaction with the track section included. Censored rows enter
as ranks (``variance.spread_scores``). Correlations between inputs are left aside: these are indices of
the same inputs drawn independently.

References: Durrande, Ginsbourger, Roustant and Carraro (2013), ANOVA kernels and RKHS of zero mean
functions for model-based sensitivity analysis, Journal of Multivariate Analysis 115, 57–67; Wahba (1990),
Spline Models for Observational Data, chapter 10.
"""

from dataclasses import dataclass

import numpy as np

from mcsettle.estimate.variance import variance_split

LEAST_EXPLAINED = (
    0.7  # of the variance between sets, left out one by one; below that no index is given
)
MOST_SETS = 512  # the first ones: a Sobol sequence fills the inputs with any number of them
LEARN_SETS = 192  # for the hyperparameters
BLOCKS = 20  # of sets, left out one at a time for the errors
THETA, NUGGET = (1e-3, 1e5), (1e-8, 1.0)


@dataclass(frozen=True)
class TotalOrder:
    """Total index and standard error by input, and the share the spline predicts of sets left out."""

    indices: list[tuple[float, float]]
    explained: float

    @property
    def sound(self) -> bool:
        """Whether the spline follows the sets well enough for the indices to mean something."""
        return self.explained >= LEAST_EXPLAINED


def total_order(shares: np.ndarray, scores: np.ndarray) -> TotalOrder:
    """Total-order index of each input, as a share of the whole variance of ``scores``.

    Parameters
    ----------
    shares : ndarray, shape [E, D]
        Cumulative probabilities of the inputs drawn.
    scores : ndarray, shape [E, R]
        The same tracks in every set; all known.
    """
    inputs, values = shares[:MOST_SETS], scores[:MOST_SETS]
    kernels = np.array([_kernel(column, column) for column in inputs.T])
    spread = values - np.mean(values, axis=0)
    n_learn = min(len(inputs), LEARN_SETS)
    theta, nugget = _learnt(kernels[:, :n_learn, :n_learn], spread[:n_learn])
    parts = _parts(inputs, theta)
    kernel = np.prod(1.0 + theta[:, None, None] * kernels, axis=0)
    kernel[np.diag_indices_from(kernel)] += nugget
    inverse = _inverse(kernel)
    missed = (inverse @ spread) / np.diag(inverse)[:, None]
    explained = 1.0 - float(np.sum(missed**2) / np.sum(spread**2))
    caused, unsure = _caused_by_inputs(scores)
    whole = _shares_of_parts(parts, inverse @ spread)
    left = []
    for block in np.array_split(np.arange(len(inputs)), min(BLOCKS, len(inputs))):
        kept = np.setdiff1d(np.arange(len(inputs)), block)
        grid = np.ix_(kept, kept)
        centred = values[kept] - np.mean(values[kept], axis=0)
        few = [part[grid] for part in parts]
        left.append(_shares_of_parts(few, _inverse(kernel[grid]) @ centred))
    error = np.sqrt((len(left) - 1) * np.var(np.array(left), axis=0))
    # What the spline does not follow belongs to some input: half of it, at worst, to the wrong one.
    error = np.hypot(error, 0.5 * (1.0 - explained) * np.sqrt(whole * (1.0 - whole)))
    pairs = zip(caused * whole, np.hypot(caused * error, unsure * whole), strict=True)
    return TotalOrder([(float(v), float(e)) for v, e in pairs], explained)


def _caused_by_inputs(scores: np.ndarray) -> tuple[float, float]:
    """Share of the whole variance that inputs cause, with the tracks too, and its standard error."""
    if scores.shape[1] == 1:
        return 1.0, 0.0
    sections = variance_split(scores, "").sections
    return 1.0 - (sections.value or 0.0), sections.standard_error or 0.0


def _learnt(kernels: np.ndarray, spread: np.ndarray) -> tuple[np.ndarray, float]:
    """θ [D] and the nugget that maximise the likelihood of ``spread`` [n, R]."""
    # The tracks are R draws of one process, so they share θ and nugget, and σ² has a closed form: what
    # is left is n R/2 log σ² + R/2 log det K over R, with its exact gradient in log θ. That takes the
    # derivative of a product for every input: all factors but one (``_products_without``).
    n_inputs, n = len(kernels), len(spread)
    from scipy import linalg, optimize  # take long to import, and few need them

    bounds = [tuple(np.log(THETA))] * n_inputs + [tuple(np.log(NUGGET))]

    def cost(point: np.ndarray) -> tuple[float, np.ndarray]:
        theta, nugget = np.exp(point[:-1]), float(np.exp(point[-1]))
        factors = 1.0 + theta[:, None, None] * kernels
        without = _products_without(factors)
        kernel = without[0] * factors[0]
        kernel[np.diag_indices(n)] += nugget
        try:
            root = linalg.cholesky(kernel, lower=True)
        except linalg.LinAlgError:
            return 1e10, np.zeros(n_inputs + 1)
        inverse = linalg.cho_solve((root, True), np.eye(n))
        solved = inverse @ spread
        square = float(np.sum(spread * solved))
        value = 0.5 * n * np.log(square / spread.size) + float(np.sum(np.log(np.diag(root))))
        slope = 0.5 * (inverse - (n / square) * (solved @ solved.T))
        rise = theta * np.einsum("ab,iab,iab->i", slope, without, kernels, optimize=True)
        return value, np.append(rise, nugget * np.trace(slope))

    start = np.append(np.full(n_inputs, np.log(5.0)), np.log(1e-3))
    optimum = optimize.minimize(
        cost, start, jac=True, method="L-BFGS-B", bounds=bounds, options={"maxiter": 60}
    )
    return np.exp(optimum.x[:-1]), float(np.exp(optimum.x[-1]))


def _parts(inputs: np.ndarray, theta: np.ndarray) -> list[np.ndarray]:
    """Forms [n, n] of the whole variance, and of what remains of it without each input."""
    nodes, weights = np.polynomial.legendre.leggauss(40)
    nodes, weights = 0.5 * (nodes + 1.0), 0.5 * weights
    factors = []
    for column, own in zip(inputs.T, theta, strict=True):
        at_nodes = own * _kernel(column, nodes)
        factors.append(1.0 + (at_nodes * weights) @ at_nodes.T)
    without = _products_without(np.array(factors))
    return [without[0] * factors[0] - 1.0, *(one - 1.0 for one in without)]


def _shares_of_parts(parts: list[np.ndarray], coefficients: np.ndarray) -> np.ndarray:
    """Total share [D] of each input in the variance of the spline, mean over the tracks."""
    forms = np.array([np.einsum("ar,ab,br->", coefficients, p, coefficients, optimize=True)
                      for p in parts])  # fmt: skip
    if not forms[0] > 0.0:
        return np.zeros(len(parts) - 1)
    return np.asarray(np.clip(1.0 - forms[1:] / forms[0], 0.0, 1.0))


def _products_without(factors: np.ndarray) -> np.ndarray:
    """Products [D, n, n] of all factors but one."""
    before, after = np.ones_like(factors), np.ones_like(factors)
    for i in range(1, len(factors)):
        before[i] = before[i - 1] * factors[i - 1]
        after[-1 - i] = after[-i] * factors[-i]
    return np.asarray(before * after)


def _inverse(kernel: np.ndarray) -> np.ndarray:
    from scipy import linalg

    return np.asarray(linalg.cho_solve(linalg.cho_factor(kernel, lower=True), np.eye(len(kernel))))


def _kernel(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """K [n, m], with a mean of its diagonal of 1."""
    first = np.outer(x - 0.5, y - 0.5)
    second = 0.25 * np.outer(x**2 - x + 1.0 / 6.0, y**2 - y + 1.0 / 6.0)
    apart = np.abs(x[:, None] - y[None, :])
    fourth = (apart**4 - 2.0 * apart**3 + apart**2 - 1.0 / 30.0) / 24.0
    return np.asarray((first + second - fourth) / (1.0 / 12.0 + 1.0 / 720.0 + 1.0 / 720.0))
