"""Do the intervals cover? Every interval that is reported, on ensembles whose truth is known.

    python studies/interval_coverage.py --experiments 400

prints one line an interval: the share of repeated experiments in which the 95 % interval holds the truth,
with its standard error. Intervals of order statistics, of partly unknown values and of weighted sets may
cover more, not less. ``WRONG`` are estimators that must not pass the same test.
"""

import argparse
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache
from types import SimpleNamespace
from typing import Any

import numpy as np
from scipy import optimize, stats

from mcsettle.analysis import calibration
from mcsettle.estimate import sample, total_index, variance
from mcsettle.estimate.crossed import CrossedSample
from mcsettle.estimate.estimate import LEVELS, Estimate
from mcsettle.estimate.likelihood import Likelihood, likelihood_of, log_of
from mcsettle.estimate.line_mean import line_means
from mcsettle.estimate.observation import Observation
from mcsettle.estimate.refit import weights_of_fits
from mcsettle.estimate.resampling import as_interval
from mcsettle.run.factor_fit import draw_factor
from mcsettle.study.distributions import distribution

OF_SET, OF_TRACK, OF_BOTH = 0.5, 0.4, 0.1  # log standard deviations of the rates
MEDIAN = 700.0
TOTAL = float(np.sqrt(OF_SET**2 + OF_TRACK**2 + OF_BOTH**2))
SEEN, SEEN_ERROR = 500.0, 50.0
ISHIGAMI_TOTAL = (0.5576, 0.4424, 0.2437)
ISHIGAMI_FIRST = (0.3139, 0.4424, 0.0)


Outcome = list[tuple[Estimate, float]]


@dataclass(frozen=True)
class Experiment:
    """One interval: ``run`` gives estimates and their truths; ``conservative``: it may cover more.

    ``least``: what it is known to cover where that is less than nominal; docs/uncertainty.md says why.
    """

    name: str
    run: Callable[[np.random.Generator], Outcome]
    conservative: bool = False
    least: float = 0.95


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
    return lambda rng: [(sample.quantile(lognormal(rng, n), level, "d"), truth)]


def censored_quantile(rng: np.random.Generator) -> Outcome:
    """Median of exponential intervals cut at a horizon."""
    days = rng.exponential(600.0, 100)
    return [(sample.interval_quantile(*cut(days, 700.0), 0.5), 600.0 * np.log(2.0))]


def cut_mean(n: int) -> Callable[..., Outcome]:
    """Mean of exponential intervals cut at a horizon."""
    truth = 600.0 * (1.0 - np.exp(-700.0 / 600.0))  # E min(T, 700)
    return lambda rng: [
        (sample.restricted_mean(*cut(rng.exponential(600.0, n), 700.0)), float(truth))
    ]


def skew_mean(n: int) -> Callable[..., Outcome]:
    """Mean of n exponential values."""
    return lambda rng: [(sample.mean(rng.exponential(2.0, n), "GBP"), 2.0)]


def paired_effect(rng: np.random.Generator) -> Outcome:
    """Reductions of pairs; those whose baseline lasts longest are censored, and not at random."""
    base = rng.normal(size=200)
    effect = 10.0 + 3.0 * base + rng.normal(size=200)
    found = sample.effect_quantile(np.where(base > 1.3, np.nan, effect), 0.5, "%")
    return [(found, 10.0)]


def crossed_quantile_of(level: float) -> Callable[..., Outcome]:
    """Quantile over sets and tracks."""
    truth = lognormal_quantile(level, TOTAL)

    def run(rng: np.random.Generator) -> Outcome:
        days = crossed(rng)
        found = CrossedSample(days, "d").interval_quantiles((level,))[0]
        return [(found, truth)]

    return run


def crossed_censored(rng: np.random.Generator) -> Outcome:
    """Median over sets and tracks, cut at a horizon."""
    days, ends = cut(crossed(rng), 800.0)
    return [(CrossedSample(days, "d", ends).interval_quantiles((0.5,))[0], MEDIAN)]


def crossed_mean_of(n: int) -> Callable[..., Outcome]:
    """Mean over n sets and n tracks."""
    truth = float(MEDIAN * np.exp(0.5 * TOTAL**2))
    return lambda rng: [(CrossedSample(crossed(rng, n, n), "d").mean(), truth)]


def line_truth(count: int, of_set: float, inner: float) -> tuple[float, ...]:
    """P5, P50, P95 of the mean over ``count`` sections of lognormal intervals, and its mean.

    From 400 000 lines and the sum's moments; beyond ten sections the sum is a Pearson III curve.
    """
    rng, n = np.random.default_rng(1), 400_000
    square = np.expm1(inner**2)
    mean = np.exp(0.5 * inner**2)
    if count <= 10:
        lines = np.exp(inner * rng.normal(size=(n, count))).mean(axis=1)
    else:
        skew = (square + 3.0) * np.sqrt(square / count)
        lines = stats.pearson3.rvs(skew, mean, mean * np.sqrt(square / count), n, random_state=rng)
    rates = stats.norm.ppf((rng.permutation(n) + 0.5) / n)
    found = np.quantile(MEDIAN * lines * np.exp(of_set * rates), LEVELS)
    return *(float(v) for v in found), float(MEDIAN * mean * np.exp(0.5 * of_set**2))


@cache
def known_line(count: int, nested_: bool) -> tuple[float, ...]:
    """Truth of ``line_of``."""
    return line_truth(
        count, *((OF_SET, np.hypot(OF_TRACK, OF_BOTH)) if nested_ else (0.0, OF_TRACK))
    )


def line_of(km: float, level: int, n_sets: int, n_tracks: int) -> Callable[..., Outcome]:
    """P5, P50, P95 or mean (``level`` 0 to 3) of the mean over ``km`` of sections of 200 m."""

    def run(rng: np.random.Generator) -> Outcome:
        days = crossed(rng, n_sets, n_tracks) if n_sets > 1 else lognormal(rng, n_tracks)[None, :]
        line = line_means(CrossedSample(days, "d"), 200.0, (km,))[0]
        truth = known_line(line.sections, n_sets > 1)[level]
        return [((*line.quantiles, line.mean)[level], truth)]

    return run


def lines_of(kms: tuple[float, ...], n_sets: int, n_tracks: int) -> tuple[Experiment, ...]:
    """An experiment for every length and level."""
    what = f"{n_sets} × {n_tracks}" if n_sets > 1 else f"{n_tracks} sections"
    found = [
        Experiment(f"line of {km:g} km, {name}, {what}", line_of(km, k, n_sets, n_tracks), True)
        for km in kms
        for k, name in enumerate(("P5", "P50", "P95"))
    ]
    return *found, Experiment(f"line, mean, {what}", line_of(kms[0], 3, n_sets, n_tracks))


def shares(rng: np.random.Generator) -> Outcome:
    """Shares of the variance."""
    split = variance.variance_split(np.log(crossed(rng)), "logarithm")
    squares = np.array([OF_SET, OF_TRACK]) ** 2 / TOTAL**2
    return [(split.parameters, float(squares[0])), (split.sections, float(squares[1]))]


def conditioned_on(renewed: bool) -> Callable[..., Outcome]:
    """Median interval of other sections, after one section's was observed; 256 sets × 40 tracks.

    ``renewed``: the weights are computed anew for the tracks of every resample.
    """

    def run(rng: np.random.Generator) -> Outcome:
        days = crossed(rng, 256, 40)
        entry = Observation(None, SEEN, SEEN_ERROR)
        weights = Likelihood((log_of(entry, days),), ()).weights()
        given = weights if renewed else weights.values
        found = CrossedSample(days, "d", weights=given).quantiles((0.5,))[0]
        return [(found, conditioned_median())]

    return run


def conditioned_line(rng: np.random.Generator) -> Outcome:
    """Median over lines of 10 km instead."""
    days = crossed(rng, 256, 40)
    entry = Observation(None, SEEN, SEEN_ERROR)
    weights = Likelihood((log_of(entry, days),), ()).weights()
    lines = line_means(CrossedSample(days, "d", weights=weights), 200.0, (10.0,))
    found = lines[0].quantiles[1]
    return [(found, conditioned_line_median())]


class KnownSearch(calibration.Search):
    """Intervals exp(spread) 30 000 days / factor^1.5 on given tracks, instead of an engine's.

    The spread grows with the factor, so that no scaling of the days is exact.
    """

    def __init__(self, z: np.ndarray) -> None:
        self.z, self.known, self.evaluations = z, {}, 0
        self.case: Any = SimpleNamespace(horizon=18_250.0)

    def outcome(self, factor: float, days: np.ndarray | None = None) -> Any:
        """Days of all tracks at this factor."""
        spread = (OF_TRACK + 0.02 * np.log(factor)) * self.z
        tracks = 3e4 / factor**1.5 * np.exp(spread)
        return SimpleNamespace(
            failed=np.zeros(len(tracks), bool),
            intervals=lambda horizon: (tracks, np.where(tracks < horizon, np.nan, horizon)),
        )


def calibrated(rng: np.random.Generator) -> Outcome:
    """Factor of ``mcsettle calibrate`` for a median of 697 days, from 100 tracks."""
    factor, low, high, _ = KnownSearch(rng.normal(size=100)).interval(697.0)
    ends = sorted([low, high], key=lambda end: np.inf if end is None else end)
    return [(Estimate(factor, ends[0], ends[1], None, 100, 0, "1"), (3e4 / 697.0) ** (2.0 / 3.0))]


def fitted_factor(sections: int) -> Callable[..., Outcome]:
    """Factor that one set fits to an observed interval (or median of several): its own posterior.

    The truth is drawn from the prior, the line's sections from the population, with 64 tracks to fit.
    """
    prior = distribution("log_uniform", {"low": 1.0, "high": 3000.0})

    def run(rng: np.random.Generator) -> Outcome:
        truth = float(np.exp(rng.uniform(*np.log([3.0, 1000.0]))))
        log_days = np.log(3e4) + OF_TRACK * rng.normal(size=64)
        line = np.log(3e4 / truth) + OF_TRACK * rng.normal(size=sections)
        seen = float(np.exp(np.median(line)) * (1.0 + 0.03 * rng.normal()))
        entry = Observation(None, seen, 0.03 * seen, sections=sections)

        def likelihood(logs: np.ndarray, wanted: np.ndarray, n_tracks: int) -> np.ndarray:
            days = np.exp(log_days[None, :n_tracks] - wanted[:, None])
            return likelihood_of([entry], lambda _: days).plain()

        ends = [draw_factor(likelihood, prior, share, 1.0).factor for share in (0.025, 0.5, 0.975)]
        return [(Estimate(ends[1], ends[0], ends[2], None, 64, 0, "1"), truth)]

    return run


def conditioned_fitted(rng: np.random.Generator) -> Outcome:
    """Median interval of other sections where every set fits its factor; 64 sets × 64 tracks.

    The Monte Carlo error alone: the observed median is what it is, and so is the truth.
    """
    prior = distribution("log_uniform", {"low": 1.0, "high": 3000.0})
    entry = Observation(None, 697.0, 35.0, sections=100)
    base = np.log(crossed(rng, 64, 64) / MEDIAN * 3e4)
    rows, logs = [], []
    for own, share in zip(base, (rng.permutation(64) + rng.random(64)) / 64.0, strict=True):

        def likelihood(_: np.ndarray, wanted: np.ndarray, n: int, own: Any = own) -> np.ndarray:
            days = np.exp(own[None, :n] - wanted[:, None])
            return likelihood_of([entry], lambda _: days).plain()

        fit = draw_factor(likelihood, prior, float(share), 1.0)
        rows.append(np.exp(own) / fit.factor)
        logs.append(fit.log_evidence)
    days = np.array(rows)

    def longer(stretch: np.ndarray) -> Likelihood:
        return Likelihood((), ((entry, np.exp(stretch)[:, None] * days),))

    fitted = weights_of_fits(longer, np.exp(np.array(logs) - max(logs)), 64)
    weights = as_interval(fitted)
    return [(CrossedSample(days, "d", weights=weights).quantiles((0.5,))[0], 697.0)]


def own_posterior() -> tuple[np.ndarray, np.ndarray]:
    """Rates [n] of a set and their probabilities given the observation: prior × E of the likelihood."""
    grid = np.linspace(-4.0, 4.0, 801)
    inner = np.hypot(OF_TRACK, OF_BOTH)
    days = MEDIAN * np.exp(-OF_SET * grid[:, None] - inner * grid[None, :])
    likelihood = np.exp(-0.5 * ((days - SEEN) / SEEN_ERROR) ** 2) @ stats.norm.pdf(grid)
    posterior = stats.norm.pdf(grid) * likelihood
    return grid, np.asarray(posterior / np.sum(posterior))


def conditioned_median() -> float:
    """Truth of ``conditioned_on`` by quadrature."""
    grid, posterior = own_posterior()
    inner = np.hypot(OF_TRACK, OF_BOTH)

    def excess(log_days: float) -> float:
        below = stats.norm.cdf((log_days - np.log(MEDIAN) + OF_SET * grid) / inner)
        return float(posterior @ below) - 0.5

    return float(np.exp(optimize.brentq(excess, np.log(10.0), np.log(1e5))))


def conditioned_line_median(count: int = 50) -> float:
    """Truth of ``conditioned_line``: a sum of ``count`` lognormals is a Pearson III curve."""
    grid, posterior = own_posterior()
    square = np.expm1(OF_TRACK**2 + OF_BOTH**2)
    mean, skew = np.sqrt(1.0 + square), (square + 3.0) * np.sqrt(square / count)
    own = stats.pearson3(skew, mean, mean * np.sqrt(square / count))

    def excess(log_days: float) -> float:
        return float(posterior @ own.cdf(np.exp(log_days + OF_SET * grid) / MEDIAN)) - 0.5

    return float(np.exp(optimize.brentq(excess, np.log(10.0), np.log(1e5))))


def ishigami(rng: np.random.Generator, n: int) -> tuple[np.ndarray, np.ndarray]:
    """Shares and values of n draws."""
    u = stats.qmc.Sobol(3, rng=rng).random(n)
    x = np.pi * (2.0 * u - 1.0)
    y = np.sin(x[:, 0]) + 7.0 * np.sin(x[:, 1]) ** 2 + 0.1 * x[:, 2] ** 4 * np.sin(x[:, 0])
    return u, y[:, None]


def totals(rng: np.random.Generator) -> Outcome:
    """Total indices of Ishigami."""
    found = total_index.total_order(*ishigami(rng, 128))
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
    return [(sample.quantile(crossed(rng).ravel(), 0.5, "d"), MEDIAN)]


def censored_rows_dropped(rng: np.random.Generator) -> Outcome:
    """As though what lasts longer were not there."""
    days = rng.exponential(600.0, 100)
    return [(sample.quantile(days[days <= 700.0], 0.5, "d"), 600.0 * np.log(2.0))]


def weights_left_out(rng: np.random.Generator) -> Outcome:
    """As though nothing had been observed."""
    days = crossed(rng, 256, 40)
    return [(CrossedSample(days, "d").quantiles((0.5,))[0], conditioned_median())]


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
    *lines_of((1.0, 10.0, 100.0), 1, 100),
    *lines_of((0.2, 1.0, 10.0, 100.0), 64, 64),
    *lines_of((100.0,), 128, 64),
    Experiment("variance shares, 40 × 40", shares),
    Experiment("conditioned P50, 256 × 40", conditioned_on(True), True),
    Experiment("conditioned P50 of a line of 10 km, 256 × 40", conditioned_line, True),
    Experiment("conditioned P50, factor fitted, 64 × 64", conditioned_fitted, True),
    Experiment("factor of calibrate, 100 realisations", calibrated, True),
    Experiment("factor fitted to one section, 64 realisations", fitted_factor(1), least=0.89),
    Experiment(
        "factor fitted to the median of 100 sections, 64 realisations", fitted_factor(100), True
    ),
    Experiment("total indices, Ishigami, 128 sets", totals, True),
    Experiment("first-order indices, Ishigami, 512 sets", firsts, True),
)
WRONG = (
    Experiment("wrong: all rows independent, P50", rows_as_independent),
    Experiment("wrong: censored rows dropped, P50", censored_rows_dropped),
    Experiment("wrong: weights left out, P50", weights_left_out),
)


def outcomes(experiment: Experiment, n: int) -> Iterator[Outcome]:
    """What ``n`` experiments give."""
    return (experiment.run(np.random.default_rng([2026, seed])) for seed in range(n))


def width(experiment: Experiment, n: int) -> float:
    """Width of the first interval over what 95 % of normal estimates with their scatter would span."""
    found = [outcome[0][0] for outcome in outcomes(experiment, n)]
    closed = [e.upper - e.lower for e in found if e.lower is not None and e.upper is not None]
    scatter = np.std([e.value for e in found if e.value is not None])
    return float(np.mean(closed) / (2.0 * stats.norm.ppf(0.975) * scatter))


def coverage(experiment: Experiment, n: int) -> tuple[float, float]:
    """Share of ``n`` experiments whose intervals hold the truth, and its standard error.

    Estimates of one experiment share their sample: the error is that of the experiments' means.
    """
    hits = [np.mean([_holds(*pair) for pair in found]) for found in outcomes(experiment, n)]
    least = np.sqrt(0.95 * 0.05 / n)  # that of a nominal interval, if all of few happen to hold
    return float(np.mean(hits)), max(float(np.std(hits) / np.sqrt(n)), float(least))


def passes(experiment: Experiment, n: int, tolerance: float = 3.0) -> bool:
    """Whether the coverage is 95 % within ``tolerance`` standard errors (or more, where it may be)."""
    share, error = coverage(experiment, n)
    high = 1.0 if experiment.conservative else 0.95 + tolerance * error
    return experiment.least - tolerance * error <= share <= high


def _holds(found: Estimate, truth: float) -> bool:
    low = -np.inf if found.lower is None else found.lower
    high = np.inf if found.upper is None else found.upper
    return bool(low <= truth <= high)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--experiments", type=int, default=400)
    parser.add_argument("--only", default="", help="experiments whose name holds this")
    parser.add_argument(
        "--widths", action="store_true", help="their widths over the scatter instead"
    )
    asked = parser.parse_args()
    print(f"| interval | {'width over scatter' if asked.widths else 'covers'} |\n|---|---|")
    for experiment in (*EXPERIMENTS, *WRONG):
        if asked.only not in experiment.name:
            continue
        if asked.widths:
            print(f"| {experiment.name} | {width(experiment, asked.experiments):.2f} |", flush=True)
        else:
            share, error = coverage(experiment, asked.experiments)
            print(f"| {experiment.name} | {share:.1%} ± {error:.1%} |", flush=True)


if __name__ == "__main__":
    main()
