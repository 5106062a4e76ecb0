"""Estimators of crossed samples on ensembles with known answers; a wrong one fails the same test.

The ensembles are those of settlement in closed form: the interval is a constant over a rate, and the
rate a product of lognormal factors of the parameter set, of the track, and of both together.
"""

import numpy as np
import pytest
from scipy import stats

from mcsettle.errors import InputError
from mcsettle.estimate import variance
from mcsettle.estimate.crossed import CrossedSample
from mcsettle.estimate.line_mean import line_means
from mcsettle.estimate.sample import quantile
from mcsettle.estimate.total_index import total_order

EXPERIMENTS, SETS, TRACKS = 150, 40, 40
SPREAD = {"parameters": 0.5, "sections": 0.4, "interaction": 0.1}


def intervals(seed: int, shape=(SETS, TRACKS), spread=SPREAD) -> np.ndarray:
    """Days [E, R]: 700 / (rate of the set × rate of the track × rate of both)."""
    rng = np.random.default_rng([7, seed])
    of_set = rng.normal(0.0, spread["parameters"], shape[0])[:, None]
    of_track = rng.normal(0.0, spread["sections"], shape[1])[None, :]
    both = rng.normal(0.0, spread["interaction"], shape)
    return 700.0 * np.exp(-(of_set + of_track + both))


def covers(estimate, truth: float) -> bool:
    low = -np.inf if estimate.lower is None else estimate.lower
    high = np.inf if estimate.upper is None else estimate.upper
    return low <= truth <= high


def assert_nominal(hits: list[bool], most: float = 1.0) -> None:
    """Coverage of 95 % within three standard errors of what so many experiments can tell."""
    error = np.sqrt(0.95 * 0.05 / len(hits))
    assert 0.95 - 3 * error <= np.mean(hits) <= min(most, 0.95 + 3 * error)


def total_log_sd() -> float:
    return float(np.sqrt(sum(s**2 for s in SPREAD.values())))


@pytest.mark.parametrize("level", [0.05, 0.5])
def test_quantile_intervals_cover_at_their_rate(level):
    truth = 700.0 * np.exp(total_log_sd() * stats.norm.ppf(level))
    hits = [
        covers(CrossedSample(intervals(i), "d", seed=i).interval_quantiles((level,))[0], truth)
        for i in range(EXPERIMENTS)
    ]
    assert_nominal(hits)


def test_an_estimator_that_takes_all_rows_for_independent_does_not_cover():
    """The same test, the same ensembles, the interval of 1600 independent rows."""
    hits = [covers(quantile(intervals(i).ravel(), 0.5, "d"), 700.0) for i in range(100)]
    with pytest.raises(AssertionError):
        assert_nominal(hits)
    assert np.mean(hits) < 0.6


def test_means_of_two_sets_or_tracks_have_an_interval():
    """Student's quantile of one degree of freedom lies beyond every resample: the ends are theirs."""
    for values in (np.array([[1.0, 2.0]]), np.array([[1.0, 2.0], [1.0, 2.0]]), np.ones((2, 2))):
        found = CrossedSample(values, "d").mean()
        assert found.lower <= found.value <= found.upper


def test_means_cover_at_their_rate():
    truth = 700.0 * np.exp(0.5 * total_log_sd() ** 2)
    hits = [
        covers(CrossedSample(intervals(i), "d", seed=i).mean(), truth) for i in range(EXPERIMENTS)
    ]
    # The mean of a skew sample has a percentile interval that is a little short: 40 sets of a
    # lognormal with log SD 0.5 cost about a hundredth.
    assert 0.90 <= np.mean(hits) <= 0.99


def test_censoring_at_a_horizon_does_not_bias():
    """Exponential intervals whose mean differs between sets; two fifths are censored."""
    rng = np.random.default_rng(11)
    truth = float(
        np.median(rng.exponential(600.0, 2_000_000) * np.exp(rng.normal(0, 0.3, 2_000_000)))
    )
    horizon, hits, naive = 700.0, [], []
    for i in range(120):
        own = np.random.default_rng([3, i])
        days = own.exponential(600.0, (1, TRACKS)) * np.exp(own.normal(0, 0.3, (SETS, 1)))
        late = days > horizon
        seen, ends = np.where(late, np.nan, days), np.where(late, horizon, np.nan)
        sample = CrossedSample(seen, "d", ends, seed=i)
        hits.append(covers(sample.interval_quantiles((0.5,))[0], truth))
        naive.append(np.nanmedian(seen))
    assert_nominal(hits)
    assert np.mean(naive) < 0.75 * truth  # what dropping the censored rows would say


def test_beyond_the_horizon_a_quantile_is_not_reached():
    days = intervals(1, (8, 8))
    horizon = float(np.quantile(days, 0.6))
    late = days > horizon
    seen, ends = np.where(late, np.nan, days), np.where(late, horizon, np.nan)
    rows = CrossedSample(seen, "d", ends).interval_statistics()
    high = next(s.estimate for s in rows if s.level == 0.95)
    assert high.value is None
    assert "not reached" in high.note
    assert high.n_censored == late.sum()
    mean = rows[-1]
    assert mean.statistic == "restricted_mean"
    assert mean.estimate.value == pytest.approx(np.minimum(days, horizon).mean())


def test_effects_of_censored_pairs_are_bounded():
    values = np.arange(100.0).reshape(10, 10)
    values[9, 5:] = np.nan  # five of the highest are unknown
    rows = CrossedSample(values, "%", -np.inf).effect_statistics()
    middle = next(s.estimate for s in rows if s.level == 0.5)
    assert middle.n_censored == 5
    assert "worst case 44 to 49" in middle.note
    assert 44 <= middle.value <= 49
    assert not any(s.statistic == "mean" for s in rows)
    exact = CrossedSample(np.arange(100.0).reshape(10, 10), "%").effect_statistics()
    assert next(s.estimate for s in exact if s.level == 0.5).value == 49.0
    assert exact[-1].estimate.value == pytest.approx(49.5)


def test_growth_censored_at_the_limit_is_not_given_where_it_matters():
    values, limit = np.linspace(0.1, 0.9, 90).reshape(9, 10), np.full((9, 10), np.nan)
    values[values > 0.45], limit[np.isnan(values)] = np.nan, 0.45
    limit = np.where(np.isnan(values), 0.45, np.nan)
    sample = CrossedSample(values, "mm", limit)
    low, middle, high = (s.estimate for s in sample.certain_statistics())
    assert low.value == pytest.approx(0.14, abs=0.01)
    assert (middle.value, high.value) == (None, None)


def test_the_split_is_unbiased_for_few_sets_and_tracks():
    """Mean over experiments of each variance, against the known ones, in standard errors."""
    mixed = {"parameters": 0.3, "sections": 0.4, "interaction": 0.6}
    logs = [np.log(intervals(i, (8, 6), mixed)) for i in range(2000)]
    parts = np.array([variance.components(own, np.ones(len(own))) for own in logs])
    truth = np.array([0.3**2, 0.4**2, 0.6**2])
    error = parts.std(axis=0, ddof=1) / np.sqrt(len(parts))
    np.testing.assert_array_less(np.abs(parts.mean(axis=0) - truth), 4 * error)
    # The plain variance of the sets' means takes a share of the interaction for the parameters'.
    plain = np.array([own.mean(axis=1).var(ddof=1) for own in logs])
    assert plain.mean() - truth[0] > 0.9 * truth[2] / 6


def test_the_errors_of_the_split_are_those_of_repeated_experiments():
    splits = [
        variance.variance_split(np.log(intervals(i, (24, 24))), "logarithm") for i in range(60)
    ]
    values = np.array([s.parameters.value for s in splits])
    told = np.mean([s.parameters.standard_error for s in splits])
    assert told == pytest.approx(values.std(ddof=1), rel=0.3)  # 60 experiments know it to 10 %
    assert splits[0].parameters.value + splits[0].sections.value + splits[0].interaction.value == (
        pytest.approx(1.0)
    )


def test_scores_are_safe_with_censoring():
    days = intervals(2, (6, 7))
    scores, scale = variance.spread_scores(days, np.zeros(days.shape, bool))
    assert scale == "logarithm"
    np.testing.assert_array_equal(scores, np.log(days))
    late = days > np.median(days)
    days = np.where(late, np.nan, days)
    days[0, 3], late[0, 3] = np.nan, False  # a failure takes its realisation out
    scores, scale = variance.spread_scores(days, late)
    assert (scale, scores.shape) == ("rank", (6, 6))
    kept = np.delete(late, 3, axis=1)
    assert len(np.unique(scores[kept])) == 1
    assert scores[kept].min() > scores[~kept].max()
    with pytest.raises(InputError, match="cannot be split"):
        variance.variance_split(scores[:1], "rank")


def ishigami(shares: np.ndarray) -> np.ndarray:
    x = np.pi * (2.0 * shares - 1.0)
    return np.sin(x[:, 0]) + 7.0 * np.sin(x[:, 1]) ** 2 + 0.1 * x[:, 2] ** 4 * np.sin(x[:, 0])


def test_first_order_indices_of_ishigami():
    """0.3139, 0.4424 and 0; 45 bins lose under a hundredth of a sine."""
    shares = stats.qmc.Sobol(3, rng=np.random.default_rng(5)).random(2048)
    found = variance.first_order(shares, ishigami(shares)[:, None])
    for (value, error), truth in zip(found, [0.3139, 0.4424, 0.0], strict=True):
        assert abs(value - truth) < 3 * error + 0.01
        assert error < 0.03


def test_first_order_indices_with_tracks_and_with_censoring():
    """A set's lognormal rate is the product of two inputs' effects: 0.8 and 0.2 of its variance."""
    rng = np.random.default_rng(9)
    found = []
    for _ in range(40):
        inputs = rng.random((64, 3))
        normal = stats.norm.ppf(inputs)
        of_set = 0.5 * (np.sqrt(0.8) * normal[:, 0] - np.sqrt(0.2) * normal[:, 1])
        logs = of_set[:, None] + 0.5 * rng.normal(size=32)[None, :]
        days = np.exp(logs)
        late = days > np.quantile(days, 0.7)
        ranks, _ = variance.spread_scores(np.where(late, np.nan, days), late)
        found.append([[v for v, _ in variance.first_order(inputs, s)] for s in (logs, ranks)])
    plain, ranked = np.mean(found, axis=0)
    # Half of the variance is the tracks'. Six bins hold 0.93 of a normal's variance between them.
    np.testing.assert_allclose(plain, [0.5 * 0.8, 0.5 * 0.2, 0.0], atol=0.05)
    np.testing.assert_allclose(ranked, [0.5 * 0.8, 0.5 * 0.2, 0.0], atol=0.07)


def test_total_indices_of_ishigami():
    """0.5576, 0.4424 and 0.2437 (its two parts of x₁ and x₃ together), in standard errors."""
    misses = []
    for seed in range(10):
        shares = stats.qmc.Sobol(3, rng=np.random.default_rng(seed)).random(128)
        found = total_order(shares, ishigami(shares)[:, None])
        assert found.sound
        pairs = zip(found.indices, [0.5576, 0.4424, 0.2437], strict=True)
        misses.append([(value - truth) / error for (value, error), truth in pairs])
        # First-order indices (0.3139, 0.4424, 0) are none of these: the same test fails for them.
        assert abs(0.3139 - found.indices[0][0]) > 3 * found.indices[0][1]
    assert np.max(np.abs(misses)) < 3.0
    assert np.sqrt(np.mean(np.square(misses))) < 1.0


def test_total_indices_count_the_interaction_with_the_tracks():
    """Log-linear in six of eight inputs, and one of them steeper on some tracks than on others."""
    steep = np.array([0.6, 0.5, 0.4, 0.3, 0.2, 0.1, 0.0, 0.0])
    shares = stats.qmc.Sobol(8, rng=np.random.default_rng(3)).random(64)
    normal, tracks = stats.norm.ppf(shares), np.random.default_rng(4).normal(size=64)
    tracks = (tracks - tracks.mean()) / tracks.std(ddof=1)
    scores = (normal @ steep)[:, None] + 0.5 * tracks + 0.3 * normal[:, :1] * tracks
    found = total_order(shares, scores)
    whole = np.sum(steep**2) + 0.5**2 + 0.3**2
    truth = steep**2 / whole
    truth[0] += 0.3**2 / whole
    assert found.explained > 0.9
    for (value, error), expected in zip(found.indices, truth, strict=True):
        assert abs(value - expected) < 3 * error + 0.005


def test_a_spline_that_does_not_follow_the_sets_gives_no_indices():
    rng = np.random.default_rng(8)
    found = total_order(rng.random((64, 4)), rng.normal(size=(64, 1)))
    assert not found.sound


def test_along_a_line_sections_average_out_and_parameters_do_not():
    days = intervals(4, (50, 400), {"parameters": 0.0, "sections": 0.4, "interaction": 0.3})
    lines = {line.length_km: line for line in line_means(CrossedSample(days, "d"), 200.0)}
    assert [line.sections for line in lines.values()] == [1, 5, 50, 500]
    width = {km: line.quantiles[2].value - line.quantiles[0].value for km, line in lines.items()}
    assert width[10.0] / width[1.0] == pytest.approx(np.sqrt(5 / 50), rel=0.15)
    assert lines[100.0].quantiles[1].value == pytest.approx(days.mean(), rel=0.02)
    assert lines[0.2].quantiles[1].value == pytest.approx(np.median(days), rel=0.05)
    days = intervals(4, (50, 400), {**SPREAD, "sections": 0.1})
    uncertain = line_means(CrossedSample(days, "d"), 200.0)
    first, last = ([q.value for q in uncertain[k].quantiles] for k in (0, -1))
    assert (last[2] / last[0]) == pytest.approx(first[2] / first[0], rel=0.2)


def test_lines_leave_out_what_is_unknown():
    values = np.array([[1.0, np.nan], [np.nan, np.nan]])
    line = line_means(CrossedSample(values, "d"), 200.0, (0.2,))[0]
    assert line.sections == 1
    assert {(q.value, q.n, q.n_censored) for q in line.quantiles} == {(1.0, 1, 3)}
    assert line_means(CrossedSample(np.full((2, 2), np.nan), "d"), 200.0) == []
