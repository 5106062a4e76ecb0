"""What the spread of a run's numbers consists of, and what remains of it along a line.

For every metric: the split of its variance between parameters, sections and their interaction, the
first-order and total indices of each uncertain input, and the distribution of its mean over lines of
several lengths. For the effects: how much pairing the same tracks has gained, and the cost at the mean
interval, which is not the mean cost.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np
import pandas as pd

from mcsettle import economics
from mcsettle.estimate.crossed import CrossedSample
from mcsettle.estimate.estimate import Estimate, Statistic
from mcsettle.estimate.line_mean import LENGTHS_KM, line_means
from mcsettle.estimate.total_index import total_order
from mcsettle.estimate.variance import LEAST_SETS, first_order, spread_scores, variance_split
from mcsettle.railway.measured_profiles import Record
from mcsettle.storage.tables import input_column
from mcsettle.study.effects import StudyEffect
from mcsettle.study.parameter_sets import ParameterSet
from mcsettle.study.study import Study
from mcsettle.summary.results import INTERVAL
from mcsettle.summary.samples import matrix, sets_of
from mcsettle.units import DAYS_PER_YEAR

IDENTITY = (
    1e-12  # relative variance of a paired effect below which it is the same in every realisation
)


def interval_spread(
    study: Study, members: Sequence[ParameterSet], table: pd.DataFrame, days: CrossedSample
) -> list[Statistic]:
    """Split, indices and lines of the tamping interval in one variant and scenario.

    With weighted parameter sets there are no indices: weighted inputs are not independent of each
    other.
    """
    statistics = list(_split(study, members, table, days))
    if days.mostly_known:  # else the mean over a line is mostly the horizon
        statistics += _lines(study, days.restricted())
    return statistics


def effect_spread(
    study: Study,
    members: Sequence[ParameterSet],
    effect: StudyEffect,
    sides: Sequence[pd.DataFrame],
    effects: Mapping[str, CrossedSample],
) -> dict[str, list[Statistic]]:
    """Split, indices, lines, pairing gain and cost at the mean interval, by metric.

    ``sides`` are the rows of baseline and scenario in one variant, ``effects`` its paired effects by
    metric.
    """
    base, other = (matrix(side, INTERVAL) for side in sides)
    statistics = {
        metric: list(_split(study, members, sides[0], effects[metric]))
        for metric in ("reduction_percent", "marginal_cost")
        if not _is_identity(effects[metric].values)
    }
    cost = effects["marginal_cost"]
    if not cost.mostly_known:
        return statistics  # the known pairs are the short-lived ones: nothing of the line's
    if cost.weights is None:  # a matter of the design, not of what is known of the line
        statistics.setdefault("reduction_percent", []).extend(_pairing(base, other))
    missing = int(np.sum(np.isnan(cost.values)))
    cost = replace(cost, note="censored pairs left out" if missing else "")
    at_mean = Estimate(
        _cost_at_mean(members, effect.name, base, other, cost.shares[:, 0]),
        *(None, None, None, cost.values.size - missing, missing, cost.unit, cost.note),
    )
    costs = statistics.setdefault("marginal_cost", [])
    costs += _lines(study, cost)
    costs.append(Statistic("section_mean", None, cost.mean()))
    costs.append(Statistic("cost_at_mean_interval", None, at_mean))
    return statistics


def _split(
    study: Study, members: Sequence[ParameterSet], table: pd.DataFrame, sample: CrossedSample
) -> Iterator[Statistic]:
    """Variance shares, first-order and total indices; nothing with one set or one section.

    Sets that failed altogether are left out.
    """
    kept, n_censored = np.any(sample.valid, axis=1), int(np.sum(sample.censored))
    scores, scale = spread_scores(sample.values[kept], sample.censored[kept])
    if min(scores.shape) < 2 or np.ptp(scores) == 0.0:
        return
    weighted = sample.weights is not None
    split = variance_split(scores, scale, sample.shares[kept, 0] if weighted else None)
    for part in ("parameters", "sections", "interaction"):
        share = replace(getattr(split, part), n_censored=n_censored)
        yield Statistic("variance_share", None, share, part)
    if len(scores) < LEAST_SETS or weighted:
        return
    paths, drawn = _drawn(study, members, table)
    if not paths:  # what differs between the sets is their grounds
        return
    note = f"of the variance of the {scale}"
    for path, (index, error) in zip(paths, first_order(drawn[kept], scores), strict=True):
        estimate = _index(index, error, scores.size, n_censored, note)
        yield Statistic("first_order_index", None, estimate, path)
    sets = [members[e] for e in sets_of(table)[kept].tolist()]
    yield from _totals(sets, paths, scores, scale, n_censored)


def _drawn(
    study: Study, members: Sequence[ParameterSet], table: pd.DataFrame
) -> tuple[list[str], np.ndarray]:
    """Inputs that bear on the variant of ``table``, and what was drawn of them [E, D].

    A fitted factor follows from the other inputs, so its draw is its share of its own posterior.
    """
    variant = str(table["variant"].iloc[0])
    others = tuple(f"variants.{name}." for name in study.variant_names if name != variant)
    paths = [e.input for e in study.uncertain if not e.input.startswith(others)]
    sets = table.groupby("parameter_set")
    indices = sets_of(table)
    fitted = {entry.input for entry in study.fitted.values()}
    shares = {e: member.shares for e, member in enumerate(members)}
    columns = [
        [shares[e][path] for e in indices.tolist()]
        if path in fitted
        else sets[input_column(path)].first().to_numpy(dtype=float)
        for path in paths
    ]
    return paths, np.array(columns, dtype=float).T


def _totals(
    members: Sequence[ParameterSet],
    paths: list[str],
    scores: np.ndarray,
    scale: str,
    n_censored: int,
) -> Iterator[Statistic]:
    """Total indices, not given where the spline through the sets does not follow them."""
    shares = np.array([[member.shares[path] for path in paths] for member in members])
    total = total_order(shares, scores)
    note = (
        f"of the variance of the {scale}; a spline predicts {total.explained:.0%} of sets left out"
    )
    for path, (index, error) in zip(paths, total.indices, strict=True):
        estimate = Estimate(None, None, None, None, scores.size, n_censored, "1", note)
        if total.sound:
            estimate = _index(index, error, scores.size, n_censored, note, least=0.0)
        yield Statistic("total_index", None, estimate, path)


def _index(
    index: float, error: float, n: int, n_censored: int, note: str, least: float = -np.inf
) -> Estimate:
    """An index with its 95 % interval, which does not go below ``least``."""
    reach = 1.96 * error
    bounds = max(least, index - reach), index + reach
    return Estimate(index, *bounds, error, n, n_censored, "1", note)


def _lines(study: Study, sample: CrossedSample) -> list[Statistic]:
    """Mean over lines of several lengths, with its quantiles."""
    lines = line_means(sample, study.profile.window_m, line_lengths(study.record()))
    return [statistic for line in lines for statistic in line.statistics]


def line_lengths(record: Record | None) -> tuple[float, ...]:
    """Lengths [km] of the lines looked at: of a measured line none is longer than itself."""
    if record is None:
        return LENGTHS_KM
    parts = record.sections
    whole = float(f"{1e-3 * (parts.ends - parts.starts).sum() * parts.step:.3g}")
    return (*(length for length in LENGTHS_KM if length < whole), whole)


def _pairing(base: np.ndarray, other: np.ndarray) -> list[Statistic]:
    """Variance of log(T₂/T₁) unpaired over paired, and the correlation of log T₁ with log T₂.

    Between tracks within a parameter set: that the sets are shared too is not counted.
    """
    both = (base > 0.0) & (other > 0.0)  # known, and not at the limit from the start
    n = int(np.sum(both))
    if n < 3:
        return []
    first, second = (_within_sets(np.where(both, days, np.nan)) for days in (base, other))
    gain, correlation = _gain(first, second), float(np.corrcoef(first, second)[0, 1])
    if gain is None:
        missing = Estimate(None, None, None, None, n, 0, "1", "the same in every realisation")
        return [Statistic("pairing_gain", None, missing)]
    blocks = np.array_split(np.arange(n), min(n, 50))
    left = [_gain(np.delete(first, b), np.delete(second, b)) for b in blocks]
    gains = np.array([value for value in left if value is not None])
    error = float(np.sqrt((len(gains) - 1) * np.var(gains))) if len(gains) > 1 else None
    dropped = int(np.sum(~both))
    return [
        Statistic("pairing_gain", None, Estimate(gain, None, None, error, n, dropped, "1")),
        Statistic("correlation", None, Estimate(correlation, None, None, None, n, dropped, "1")),
    ]


def _within_sets(days: np.ndarray) -> np.ndarray:
    """Logarithms of [E, R] days less their set's mean; the known ones, flat."""
    finite = ~np.isnan(days)
    logs = np.log(days)
    rows = [row[ok] - np.mean(row[ok]) for row, ok in zip(logs, finite, strict=True) if ok.any()]
    return np.concatenate(rows)


def _gain(first: np.ndarray, second: np.ndarray) -> float | None:
    paired = float(np.var(second - first))
    unpaired = float(np.var(first) + np.var(second))
    return None if paired <= IDENTITY * max(unpaired, 1e-300) else unpaired / paired


def _cost_at_mean(
    members: Sequence[ParameterSet],
    effect: str,
    base: np.ndarray,
    other: np.ndarray,
    weights: np.ndarray,
) -> float | None:
    """Marginal cost at the mean intervals of each parameter set, averaged with ``weights`` [E]."""
    costs, shares = [], []
    for e, (member, first, second) in enumerate(zip(members, base, other, strict=False)):
        change, prices = member.study.change(effect), member.study.economics
        both = ~np.isnan(first) & ~np.isnan(second)
        if change is None or prices is None or not np.any(both):
            continue
        days, changed = float(np.mean(first[both])), float(np.mean(second[both]))
        gamma = economics.elasticity(days, changed, change.base, change.changed)
        cost = economics.marginal_cost(
            float(gamma),
            days / DAYS_PER_YEAR,
            prices.tamping_cost_per_track_km,
            prices.discount_rate,
            change.divisor,
        )
        costs.append(float(cost))
        shares.append(float(weights[e]))
    return float(np.average(costs, weights=shares)) if sum(shares) > 0.0 else None


def _is_identity(values: np.ndarray) -> bool:
    sample = values[~np.isnan(values)]
    return len(sample) == 0 or float(np.ptp(sample)) <= 1e-6 * abs(float(np.mean(sample)))
