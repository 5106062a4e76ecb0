"""What the spread of a run's numbers consists of, and what remains of it along a line.

For every metric: the split of its variance between parameters, sections and their interaction, the
first-order and total indices of each uncertain input, and the distribution of its mean over lines of
several lengths. For the effects: how much pairing the same tracks has gained, and the cost at the mean
interval, which is not the mean cost.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
import pandas as pd

from mcsettle import economics
from mcsettle.estimate.crossed import crossed_mean
from mcsettle.estimate.estimate import Estimate, Statistic
from mcsettle.estimate.line_mean import line_means
from mcsettle.estimate.resampling import Weights, plain_weights
from mcsettle.estimate.total_index import total_order
from mcsettle.estimate.variance import LEAST_SETS, first_order, spread_scores, variance_split
from mcsettle.storage.tables import input_column
from mcsettle.study.parameter_sets import ParameterSet
from mcsettle.study.study import Study
from mcsettle.summary.results import CENSORED, INTERVAL
from mcsettle.units import DAYS_PER_YEAR

IDENTITY = 1e-12  # relative variance of a paired effect below which it is the same on every track


def matrix(table: pd.DataFrame, column: str, sets: np.ndarray | None = None) -> np.ndarray:
    """A column as [E, R], parameter sets × realisations; NaN where empty or missing.

    ``sets`` [E] are all that the run has; a table from which failed rows are gone may lack some.
    """
    own_sets, row = np.unique(table["parameter_set"].to_numpy(dtype=int), return_inverse=True)
    tracks, track = np.unique(table["realisation"].to_numpy(dtype=int), return_inverse=True)
    if sets is not None:
        row = np.searchsorted(sets, own_sets)[row]
    wide = np.full((len(own_sets if sets is None else sets), len(tracks)), np.nan)
    wide[row, track] = table[column].to_numpy(dtype=float, na_value=np.nan)
    return wide


def sets_of(table: pd.DataFrame) -> np.ndarray:
    """The parameter sets [E] of a table, rising."""
    return np.unique(table["parameter_set"].to_numpy(dtype=int))


def interval_spread(
    study: Study,
    members: Sequence[ParameterSet],
    table: pd.DataFrame,
    weights: Weights = None,
) -> list[Statistic]:
    """Split, indices and lines of the tamping interval in one variant and scenario.

    With ``weights`` [E] of the parameter sets there are no indices: weighted inputs are not
    independent of each other.
    """
    days = matrix(table, INTERVAL)
    censored = np.isnan(days) & ~np.isnan(matrix(table, CENSORED))
    found = list(_split(study, members, table, days, censored, weights))
    if 2 * censored.sum() > np.sum(~np.isnan(days) | censored):
        return found  # the mean over a line is mostly the horizon
    if not censored.any():
        return found + _lines(study, days, "d", "", weights)
    # A section that outlasts the horizon counts with the horizon, in every mean.
    horizon = float(np.nanmin(matrix(table, CENSORED)))
    cut = np.where(censored, horizon, np.minimum(days, horizon))
    return found + _lines(study, cut, "d", f"restricted to day {horizon:g}", weights)


def effect_spread(
    study: Study,
    members: Sequence[ParameterSet],
    scenario: str,
    own: pd.DataFrame,
    effects: pd.DataFrame,
    weights: Weights = None,
) -> dict[str, list[Statistic]]:
    """Split, indices, lines, pairing gain and cost at the mean interval, by metric.

    ``own`` and ``effects`` are the rows of one variant, ``effects`` without failed ones; ``weights``
    as in ``interval_spread``.
    """
    change, prices = study.change(scenario), study.priced
    if change is None or prices is None:
        return {}
    base, other = (
        matrix(own[own["scenario"] == name], INTERVAL) for name in (prices.baseline, scenario)
    )
    sets = sets_of(own)
    sound = ~np.isnan(matrix(effects.assign(sound=1.0), "sound", sets))
    found: dict[str, list[Statistic]] = {}
    for metric in ("reduction_percent", "marginal_cost"):
        values = matrix(effects, metric, sets)
        if not _is_identity(values):
            censored = np.isnan(values) & sound
            found[metric] = list(_split(study, members, own, values, censored, weights))
    if weights is None:  # a matter of the design, not of what is known of the line
        found.setdefault("reduction_percent", []).extend(_pairing(base, other))
    cost = matrix(effects, "marginal_cost", sets)
    if 2 * np.sum(np.isnan(cost) & sound) > np.sum(sound):
        return found  # the known pairs are the short-lived ones: their mean is not the line's
    at_mean = _cost_at_mean(members, scenario, base, other, weights)
    costs = found.setdefault("marginal_cost", [])
    note = "censored pairs left out" if _gaps(cost) else ""
    costs += _lines(study, cost, change.unit, note, weights)
    mean = crossed_mean(cost, change.unit, note, set_weights=weights)
    costs.append(Statistic("section_mean", None, mean))
    costs.append(Statistic("cost_at_mean_interval", None, _plain(at_mean, cost, change.unit)))
    return found


def _split(
    study: Study,
    members: Sequence[ParameterSet],
    table: pd.DataFrame,
    values: np.ndarray,
    censored: np.ndarray,
    weights: Weights,
) -> Iterator[Statistic]:
    """Variance shares, first-order and total indices; nothing with one set or one section.

    Sets that failed altogether are left out.
    """
    kept = np.any(~np.isnan(values) | censored, axis=1)
    of_sets = plain_weights(weights)
    scores, scale = spread_scores(values[kept], censored[kept])
    if min(scores.shape) < 2 or np.ptp(scores) == 0.0:
        return
    split = variance_split(scores, scale, None if of_sets is None else of_sets[kept])
    for part in ("parameters", "sections", "interaction"):
        share = replace(getattr(split, part), n_censored=int(censored.sum()))
        yield Statistic("variance_share", None, share, part)
    if len(scores) < LEAST_SETS or weights is not None:
        return
    paths, drawn = _drawn(study, members, table)
    if not paths:  # what differs between the sets is their grounds
        return
    for path, (index, error) in zip(paths, first_order(drawn[kept], scores), strict=True):
        bounds = index - 1.96 * error, index + 1.96 * error
        note = f"of the variance of the {scale}"
        estimate = Estimate(index, *bounds, error, scores.size, int(censored.sum()), "1", note)
        yield Statistic("first_order_index", None, estimate, path)
    own = [members[e] for e in sets_of(table)[kept].tolist()]
    yield from _totals(own, paths, scores, scale, int(censored.sum()))


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
    found = total_order(shares, scores)
    note = (
        f"of the variance of the {scale}; a spline predicts {found.explained:.0%} of sets left out"
    )
    for path, (index, error) in zip(paths, found.indices, strict=True):
        estimate = Estimate(None, None, None, None, scores.size, n_censored, "1", note)
        if found.sound:
            bounds = max(0.0, index - 1.96 * error), index + 1.96 * error
            estimate = Estimate(index, *bounds, error, scores.size, n_censored, "1", note)
        yield Statistic("total_index", None, estimate, path)


def _lines(
    study: Study, values: np.ndarray, unit: str, note: str, weights: Weights
) -> list[Statistic]:
    """Mean over lines of several lengths, with its quantiles."""
    lines = line_means(values, study.profile.window_m, set_weights=weights, unit=unit, note=note)
    return [statistic for line in lines for statistic in line.statistics]


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
        missing = Estimate(None, None, None, None, n, 0, "1", "the same on every track")
        return [Statistic("pairing_gain", None, missing)]
    blocks = np.array_split(np.arange(n), min(n, 50))
    left = [_gain(np.delete(first, b), np.delete(second, b)) for b in blocks]
    known = np.array([value for value in left if value is not None])
    error = float(np.sqrt((len(known) - 1) * np.var(known))) if len(known) > 1 else None
    dropped = int(np.sum(~both))
    return [
        Statistic("pairing_gain", None, Estimate(gain, None, None, error, n, dropped, "1")),
        Statistic("correlation", None, Estimate(correlation, None, None, None, n, dropped, "1")),
    ]


def _within_sets(days: np.ndarray) -> np.ndarray:
    """Logarithms of [E, R] days less their set's mean; the known ones, flat."""
    known = ~np.isnan(days)
    logs = np.log(days)
    rows = [row[ok] - np.mean(row[ok]) for row, ok in zip(logs, known, strict=True) if ok.any()]
    return np.concatenate(rows)


def _gain(first: np.ndarray, second: np.ndarray) -> float | None:
    paired = float(np.var(second - first))
    unpaired = float(np.var(first) + np.var(second))
    return None if paired <= IDENTITY * max(unpaired, 1e-300) else unpaired / paired


def _cost_at_mean(
    members: Sequence[ParameterSet],
    scenario: str,
    base: np.ndarray,
    other: np.ndarray,
    weights: Weights,
) -> float | None:
    """Marginal cost at the mean intervals of each parameter set, averaged over the sets."""
    found, shares = [], []
    of_sets = plain_weights(weights)
    for e, (member, first, second) in enumerate(zip(members, base, other, strict=False)):
        change, prices = member.study.change(scenario), member.study.priced
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
        found.append(float(cost))
        shares.append(1.0 if of_sets is None else float(of_sets[e]))
    return float(np.average(found, weights=shares)) if sum(shares) > 0.0 else None


def _plain(value: float | None, values: np.ndarray, unit: str) -> Estimate:
    n, missing = int(np.sum(~np.isnan(values))), _gaps(values)
    note = "censored pairs left out" if missing else ""
    return Estimate(value, None, None, None, n, missing, unit, note)


def _gaps(values: np.ndarray) -> int:
    return int(np.sum(np.isnan(values)))


def _is_identity(values: np.ndarray) -> bool:
    known = values[~np.isnan(values)]
    return len(known) == 0 or float(np.ptp(known)) <= 1e-6 * abs(float(np.mean(known)))
