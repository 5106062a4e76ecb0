"""Do the intervals cover? Every interval that is reported, on ensembles whose truth is known.

    python studies/interval_coverage.py --experiments 400

prints one line an interval: the share of repeated experiments in which the 95 % interval holds the truth,
with its standard error. Intervals of order statistics, of partly unknown values and of weighted sets may
cover more, not less. ``WRONG`` are estimators that must not pass the same test.
"""

import argparse
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy import optimize, stats

from mcsettle import estimate, nested, surrogate, variance
from mcsettle.estimate import Estimate
from mcsettle.observed import log_interval, log_mean
from mcsettle.study_observed import ObservedTable

OF_SET, OF_TRACK, OF_BOTH = 0.5, 0.4, 0.1  # log standard deviations of the rates
MEDIAN = 700.0
TOTAL = float(np.sqrt(OF_SET**2 + OF_TRACK**2 + OF_BOTH**2))
SEEN, SEEN_ERROR = 500.0, 50.0
ISHIGAMI_TOTAL = (0.5576, 0.4424, 0.2437)
ISHIGAMI_FIRST = (0.3139, 0.4424, 0.0)


Outcome = list[tuple[Estimate, float]]


@dataclass(frozen=True)
class Experiment:
    """One interval: ``run`` gives estimates and their truths; ``conservative``: it may cover more."""

    name: str
    run: Callable[[np.random.Generator], Outcome]
    conservative: bool = False


def lognormal(rng: np.random.Generator, n: int) -> np.ndarray:
    """Intervals of n sections, all inputs central."""
    return MEDIAN * np.exp(-OF_TRACK * rng.normal(size=n))


def crossed(rng: np.random.Generator, n_sets: int = 40, n_tracks: int = 40) -> np.ndarray:
    """Intervals of sets crossed with tracks."""
    logs = OF_SET * rng.normal(size=(n_sets, 1)) + OF_TRACK * rng.normal(size=(1, n_tracks))
    return np.asarray(MEDIAN * np.exp(-logs - OF_BOTH * rng.normal(size=(n_sets, n_tracks))))


def cut(days: np.ndarray, horizon: float) -> tuple[np.ndarray, np.ndarray]:
    """Days and censorings at a horizon."""
    late = days > horizon
    return np.where(late, np.nan, days), np.where(late, horizon, np.nan)


def lognormal_quantile(level: float, spread: float) -> float:
    """Quantile of lognormal intervals."""
    return float(MEDIAN * np.exp(spread * stats.norm.ppf(level)))


def quantile_of(level: float, n: int) -> Callable[..., Outcome]:
    """Order statistics of n intervals."""
    truth = lognormal_quantile(level, OF_TRACK)
    return lambda rng: [(estimate.quantile(lognormal(rng, n), level, "d"), truth)]


def censored_quantile(rng: np.random.Generator) -> Outcome:
    """Median of exponential intervals cut at a horizon."""
    days = rng.exponential(600.0, 100)
    return [(estimate.interval_quantile(*cut(days, 700.0), 0.5), 600.0 * np.log(2.0))]


def cut_mean(n: int) -> Callable[..., Outcome]:
    """Mean of exponential intervals cut at a horizon."""
    truth = 600.0 * (1.0 - np.exp(-700.0 / 600.0))  # E min(T, 700)
    return lambda rng: [
        (estimate.restricted_mean(*cut(rng.exponential(600.0, n), 700.0)), float(truth))
    ]


def skew_mean(n: int) -> Callable[..., Outcome]:
    """Mean of n exponential values."""
    return lambda rng: [(estimate.mean(rng.exponential(2.0, n), "GBP"), 2.0)]


def paired_effect(rng: np.random.Generator) -> Outcome:
    """Reductions of pairs; those whose baseline lasts longest are censored, and not at random."""
    base = rng.normal(size=200)
    effect = 10.0 + 3.0 * base + rng.normal(size=200)
    found = estimate.effect_quantile(np.where(base > 1.3, np.nan, effect), 0.5, "%")
    return [(found, 10.0)]


def crossed_quantile_of(level: float) -> Callable[..., Outcome]:
    """Quantile over sets and tracks."""
    truth = lognormal_quantile(level, TOTAL)

    def run(rng: np.random.Generator) -> Outcome:
        days = crossed(rng)
        found = nested.crossed_interval_quantile(days, np.full(days.shape, np.nan), level)
        return [(found, truth)]

    return run


def crossed_censored(rng: np.random.Generator) -> Outcome:
    """Median over sets and tracks, cut at a horizon."""
    return [(nested.crossed_interval_quantile(*cut(crossed(rng), 800.0), 0.5), MEDIAN)]


def crossed_mean_of(n: int) -> Callable[..., Outcome]:
    """Mean over n sets and n tracks."""
    truth = float(MEDIAN * np.exp(0.5 * TOTAL**2))
    return lambda rng: [(nested.crossed_mean(crossed(rng, n, n), "d"), truth)]


def shares(rng: np.random.Generator) -> Outcome:
    """Shares of the variance."""
    split = variance.variance_split(np.log(crossed(rng)), "logarithm")
    squares = np.array([OF_SET, OF_TRACK]) ** 2 / TOTAL**2
    return [(split.parameters, float(squares[0])), (split.sections, float(squares[1]))]


def conditioned(rng: np.random.Generator) -> Outcome:
    """Median interval of other sections, after one section's was observed; 256 sets × 40 tracks."""
    days = crossed(rng, 256, 40)
    entry = ObservedTable(scenario="s", tamping_interval_days=SEEN, error_days=SEEN_ERROR)
    logs = log_mean(log_interval(entry, days))
    weights = np.exp(logs - logs.max())
    found = nested.crossed_quantile(days, days, 0.5, "d", set_weights=weights)
    return [(found, conditioned_median())]


def conditioned_median() -> float:
    """Its truth by quadrature: p(own rate | observed) ∝ prior × E over tracks of the likelihood."""
    grid = np.linspace(-4.0, 4.0, 801)
    inner = np.hypot(OF_TRACK, OF_BOTH)
    days = MEDIAN * np.exp(-OF_SET * grid[:, None] - inner * grid[None, :])
    likelihood = np.exp(-0.5 * ((days - SEEN) / SEEN_ERROR) ** 2) @ stats.norm.pdf(grid)
    posterior = stats.norm.pdf(grid) * likelihood
    posterior /= np.sum(posterior)

    def excess(log_days: float) -> float:
        below = stats.norm.cdf((log_days - np.log(MEDIAN) + OF_SET * grid) / inner)
        return float(posterior @ below) - 0.5

    return float(np.exp(optimize.brentq(excess, np.log(10.0), np.log(1e5))))


def ishigami(rng: np.random.Generator, n: int) -> tuple[np.ndarray, np.ndarray]:
    """Shares and values of n draws."""
    u = stats.qmc.Sobol(3, rng=rng).random(n)
    x = np.pi * (2.0 * u - 1.0)
    y = np.sin(x[:, 0]) + 7.0 * np.sin(x[:, 1]) ** 2 + 0.1 * x[:, 2] ** 4 * np.sin(x[:, 0])
    return u, y[:, None]


def totals(rng: np.random.Generator) -> Outcome:
    """Total indices of Ishigami."""
    found = surrogate.total_order(*ishigami(rng, 128))
    return [_index(*pair) for pair in zip(found.indices, ISHIGAMI_TOTAL, strict=True)]


def firsts(rng: np.random.Generator) -> Outcome:
    """First-order indices of Ishigami."""
    found = variance.first_order(*ishigami(rng, 512))
    return [_index(*pair) for pair in zip(found, ISHIGAMI_FIRST, strict=True)]


def _index(found: tuple[float, float], truth: float) -> tuple[Estimate, float]:
    value, error = found
    ends = value - 1.96 * error, value + 1.96 * error
    return Estimate(value, *ends, error, 0, 0, "1"), truth


def rows_as_independent(rng: np.random.Generator) -> Outcome:
    """As though sets and tracks were not shared."""
    return [(estimate.quantile(crossed(rng).ravel(), 0.5, "d"), MEDIAN)]


def censored_rows_dropped(rng: np.random.Generator) -> Outcome:
    """As though what lasts longer were not there."""
    days = rng.exponential(600.0, 100)
    return [(estimate.quantile(days[days <= 700.0], 0.5, "d"), 600.0 * np.log(2.0))]


def weights_left_out(rng: np.random.Generator) -> Outcome:
    """As though nothing had been observed."""
    days = crossed(rng, 256, 40)
    return [(nested.crossed_quantile(days, days, 0.5, "d"), conditioned_median())]


EXPERIMENTS = (
    Experiment("quantile P5, 100 sections", quantile_of(0.05, 100), True),
    Experiment("quantile P50, 100 sections", quantile_of(0.5, 100), True),
    Experiment("Kaplan–Meier P50, exponential, 31 % censored", censored_quantile, True),
    Experiment("restricted mean, exponential, 100 sections", cut_mean(100)),
    Experiment("restricted mean, exponential, 30 sections", cut_mean(30)),
    Experiment("mean, exponential, 100", skew_mean(100)),
    Experiment("mean, exponential, 30", skew_mean(30)),
    Experiment("paired effect P50, 10 % of pairs censored", paired_effect, True),
    Experiment("sets × sections P5, 40 × 40", crossed_quantile_of(0.05)),
    Experiment("sets × sections P50, 40 × 40", crossed_quantile_of(0.5)),
    Experiment("sets × sections P50, 42 % censored, 40 × 40", crossed_censored),
    Experiment("sets × sections mean, 40 × 40", crossed_mean_of(40)),
    Experiment("sets × sections mean, 20 × 20", crossed_mean_of(20)),
    Experiment("variance shares, 40 × 40", shares),
    Experiment("conditioned P50, 256 × 40", conditioned, True),
    Experiment("total indices, Ishigami, 128 sets", totals, True),
    Experiment("first-order indices, Ishigami, 512 sets", firsts, True),
)
WRONG = (
    Experiment("wrong: all rows independent, P50", rows_as_independent),
    Experiment("wrong: censored rows dropped, P50", censored_rows_dropped),
    Experiment("wrong: weights left out, P50", weights_left_out),
)


def coverage(experiment: Experiment, n: int) -> tuple[float, float]:
    """Share of ``n`` experiments whose intervals hold the truth, and its standard error.

    Estimates of one experiment share their sample: the error is that of the experiments' means.
    """
    hits = []
    for seed in range(n):
        found = experiment.run(np.random.default_rng([2026, seed]))
        hits.append(np.mean([_holds(*pair) for pair in found]))
    least = np.sqrt(0.95 * 0.05 / n)  # that of a nominal interval, if all of few happen to hold
    return float(np.mean(hits)), max(float(np.std(hits) / np.sqrt(n)), float(least))


def passes(experiment: Experiment, n: int, tolerance: float = 3.0) -> bool:
    """Whether the coverage is 95 % within ``tolerance`` standard errors (or more, where it may be)."""
    share, error = coverage(experiment, n)
    high = 1.0 if experiment.conservative else 0.95 + tolerance * error
    return 0.95 - tolerance * error <= share <= high


def _holds(found: Estimate, truth: float) -> bool:
    low = -np.inf if found.lower is None else found.lower
    high = np.inf if found.upper is None else found.upper
    return bool(low <= truth <= high)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--experiments", type=int, default=400)
    parser.add_argument("--only", default="", help="experiments whose name holds this")
    asked = parser.parse_args()
    print("| interval | covers |\n|---|---|")
    for experiment in (*EXPERIMENTS, *WRONG):
        if asked.only in experiment.name:
            share, error = coverage(experiment, asked.experiments)
            print(f"| {experiment.name} | {share:.1%} ± {error:.1%} |", flush=True)


if __name__ == "__main__":
    main()
