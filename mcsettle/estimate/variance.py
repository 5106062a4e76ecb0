"""What the variance of a crossed sample [E, R] consists of: parameters, sections, single inputs.

The variance splits by the two-way random-effects analysis of variance, the parameter sets weighted by
shares p (1/E each unless the sets are conditioned on observations): with P = Σ p² and R tracks,

    interaction                  V = Σ p e² / ((1 − P)(R − 1)),   e the residuals of rows and columns
    parameters  Var E[Y | set]     = Σ p (Y_set − Ȳ)² / (1 − P) − V / R
    sections    Var E[Y | track]   = Σ (Y_track − Ȳ)² / (R − 1) − V P,

each unbiased for any E and R. By the law of total variance the first is what the inputs cause
(epistemic) and the other two are what differs between track sections (aleatory).

References: Searle, Casella and McCulloch (1992), Variance Components, chapter 4; Plischke (2012),
Reliability Engineering and System Safety 101, 54–60 (indices from given data).
"""

from dataclasses import dataclass

import numpy as np
from scipy import special

from mcsettle.errors import InputError
from mcsettle.estimate.estimate import CONFIDENCE, Estimate, finite

LEAST_SETS = 32  # for first-order indices


@dataclass(frozen=True)
class Split:
    """Shares of the variance of ``scale``, each with its standard error (jackknife).

    ``parameters`` + ``sections`` + ``interaction`` = 1. An estimate of a small share can be negative.
    """

    scale: str
    parameters: Estimate
    sections: Estimate
    interaction: Estimate


def variance_split(scores: np.ndarray, scale: str, set_weights: np.ndarray | None = None) -> Split:
    """Split of the variance of ``scores`` [E, R] (``spread_scores``), E and R at least 2.

    ``set_weights`` [E] are relative weights of the parameter sets (default: all alike).

    Raises
    ------
    InputError
        Fewer than two sets or realisations, or values missing.
    """
    if min(scores.shape) < 2 or not np.all(np.isfinite(scores)):
        raise InputError(
            f"the variance of {scores.shape[0]} parameter sets × {scores.shape[1]} realisations "
            "cannot be split; it needs two of each, all with a result"
        )
    weights = np.ones(len(scores)) if set_weights is None else np.asarray(set_weights, dtype=float)
    shares = _shares(scores, weights)
    errors = np.sqrt(_jackknife(scores, weights, 0) + _jackknife(scores, weights, 1))
    reach = float(special.stdtrit(min(scores.shape) - 1, 0.5 + 0.5 * CONFIDENCE))
    parts = [
        Estimate(float(v), *_share_limits(float(v), float(e), reach), finite(e), scores.size, 0, "1",
                 f"of the variance of the {scale}")
        for v, e in zip(shares, errors, strict=True)
    ]  # fmt: skip
    return Split(scale, *parts)


def _share_limits(share: float, error: float, reach: float) -> tuple[float | None, float | None]:
    """Limits ``reach`` standard errors off, on the scale of log-odds where the share has one.

    An estimated share is skew; its log-odds hardly are.
    """
    if not 0.0 < share < 1.0 or not error < min(share, 1.0 - share):
        return finite(share - reach * error), finite(share + reach * error)
    odds, wide = np.log(share / (1.0 - share)), reach * error / (share * (1.0 - share))
    ends = 1.0 / (1.0 + np.exp(-np.array([odds - wide, odds + wide])))
    return finite(float(ends[0])), finite(float(ends[1]))


def spread_scores(values: np.ndarray, censored: np.ndarray) -> tuple[np.ndarray, str]:
    """Scores whose variance is split, and their name: logarithms if all are known, else ranks.

    A rank does not ask by how much a censored interval exceeds the horizon: all of them share the
    highest ranks. Realisations that failed in any set are left out.

    Parameters
    ----------
    values : ndarray, shape [E, R], positive; NaN where censored or failed
    censored : ndarray of bool, shape [E, R]
    """
    sound = np.all(~np.isnan(values) | censored, axis=0)
    values, censored = values[:, sound], censored[:, sound]
    if values.size and not np.any(censored):
        if np.all(values > 0.0):
            return np.log(values), "logarithm"
        return values, "value"
    from scipy import stats  # takes long to import, and few need it

    filled = np.where(censored, np.inf, values)
    return stats.rankdata(filled).reshape(filled.shape) / max(filled.size, 1), "rank"


def first_order(inputs: np.ndarray, scores: np.ndarray) -> list[tuple[float, float]]:
    """First-order index of each input: the share of the whole variance its value alone explains.

    The sets are binned by the input; the variance of the bins' means beyond what the scatter within
    the bins causes is the input's, as in a one-way analysis of variance, for any shape of dependence
    that the bins resolve. The error is that of the sets (jackknife) and the whole of that correction,
    which is too large for a Sobol sequence by an amount not known. Inputs that are correlated share
    what they explain.

    Parameters
    ----------
    inputs : ndarray, shape [E, D]
    scores : ndarray, shape [E, R]

    Returns
    -------
    list of (index, standard error) in the order of the inputs.
    """
    total = total_variance(scores)
    means = np.mean(scores, axis=1)
    indices = []
    for column in np.asarray(inputs, dtype=float).T:
        bins = _bins(column)
        sizes = np.bincount(bins).astype(float)
        sums = np.bincount(bins, weights=means)
        of_bin = np.eye(len(sizes))[bins]  # [E, bins], to leave out one set at a time
        square = np.sum(means**2) - np.append(0.0, means**2)
        left = _between_bins(
            np.vstack([sizes, sizes - of_bin]),
            np.vstack([sums, sums - of_bin * means[:, None]]),
            square,
        )
        jackknife = (len(means) - 1) * np.var(left[1:])
        evenness = float(_scatter(sizes, sums, square[0])[0])
        error = np.sqrt(jackknife + evenness**2)
        indices.append((float(left[0] / total), float(error / total)))
    return indices


def total_variance(scores: np.ndarray) -> float:
    """Variance of ``scores`` [E, R] over sets and tracks drawn at random."""
    if scores.shape[1] == 1:
        return float(np.var(scores, ddof=1))
    return float(np.sum(components(scores, np.ones(len(scores)))))


def _bins(column: np.ndarray) -> np.ndarray:
    """Bin of each set, equal counts along the rising input."""
    n_bins = max(2, round(np.sqrt(len(column)) / 1.25))
    order = np.argsort(np.argsort(column, kind="stable"))
    return np.asarray(order * n_bins // len(column), dtype=int)


def _between_bins(sizes: np.ndarray, sums: np.ndarray, square: np.ndarray) -> np.ndarray:
    """Variance of the bins' means, corrected for the scatter within the bins.

    ``sizes`` and ``sums`` [n, B] of the bins and the sum of squares [n] of all, n times.
    """
    count, n_bins = np.sum(sizes, axis=1), sizes.shape[1]
    grand = np.sum(sums, axis=1) / count
    between = np.sum(sums**2 / sizes, axis=1)
    spread = (between - count * grand**2) / (n_bins - 1)
    return np.asarray(spread / _typical(sizes) - _scatter(sizes, sums, square))


def _scatter(sizes: np.ndarray, sums: np.ndarray, square: np.ndarray) -> np.ndarray:
    """What the scatter within the bins adds to the variance of their means, were the sets independent.

    Of a Sobol sequence, which fills the other inputs evenly in every bin, it adds less: anything from
    nothing to this.
    """
    sizes, sums = np.atleast_2d(sizes), np.atleast_2d(sums)
    between = np.sum(sums**2 / sizes, axis=1)
    within = (square - between) / (np.sum(sizes, axis=1) - sizes.shape[1])
    return np.asarray(within / _typical(sizes))


def _typical(sizes: np.ndarray) -> np.ndarray:
    """Sets [n] in a bin, as the variance of the bins' means has it."""
    count = np.sum(sizes, axis=1)
    return np.asarray((count - np.sum(sizes**2, axis=1) / count) / (sizes.shape[1] - 1))


def components(scores: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Variances (parameters, sections, interaction) of [E, R], sets weighted by [E]."""
    shares = weights / np.sum(weights)
    crowd = float(np.sum(shares**2))  # 1/E where all are alike
    n_tracks = scores.shape[1]
    of_track = shares @ scores
    grand = np.mean(of_track)
    of_set = np.mean(scores, axis=1) - grand
    rest = scores - of_set[:, None] - of_track[None, :]
    of_rest = np.sum(shares[:, None] * rest**2) / ((1.0 - crowd) * (n_tracks - 1))
    between_sets = np.sum(shares * of_set**2) / (1.0 - crowd)
    between_tracks = np.sum((of_track - grand) ** 2) / (n_tracks - 1)
    return np.array([between_sets - of_rest / n_tracks, between_tracks - of_rest * crowd, of_rest])


def _shares(scores: np.ndarray, weights: np.ndarray) -> np.ndarray:
    parts = components(scores, weights)
    total = np.sum(parts)
    return parts / total if total > 0.0 else np.full(3, np.nan)


def _jackknife(scores: np.ndarray, weights: np.ndarray, axis: int) -> np.ndarray:
    """Variance of the shares from leaving out one set (or realisation) at a time, blocks if many."""
    n = scores.shape[axis]
    if n < 3:
        return np.full(3, np.nan)
    left = []
    for block in np.array_split(np.arange(n), min(n, 200)):
        kept = weights if axis else np.delete(weights, block)
        left.append(_shares(np.delete(scores, block, axis=axis), kept))
    return np.asarray((len(left) - 1) * np.var(np.array(left), axis=0))
