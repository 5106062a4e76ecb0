"""Results on many grounds: intervals and costs by segment, and over the line.

Each ground counts by its probability within its segment, each of its tracks alike. Grounds that failed
leave a share of the segment's probability unknown; it is reported, not spread over the others in
silence. A segment is one part of the line like any other: the data give no lengths.
"""

from dataclasses import dataclass

import numpy as np
import pandas as pd

from mcsettle.economics import perpetual_present_value
from mcsettle.errors import InputError
from mcsettle.estimate.estimate import LEVELS
from mcsettle.estimate.weighted_quantiles import weighted_quantiles
from mcsettle.storage.location import Where
from mcsettle.study.study import Study
from mcsettle.summary.results import INTERVAL, read_results
from mcsettle.summary.samples import beside
from mcsettle.units import DAYS_PER_YEAR


@dataclass(frozen=True)
class SegmentRow:
    """One segment (or the whole line) in one variant and scenario.

    ``grounds`` run and ``failed``; ``known``: probability of the grounds that have results; ``days``
    and ``cost`` [currency/track-km, Eq. (4)] at ``LEVELS`` by weight (days are ``inf`` beyond the
    horizon), ``mean_cost``, ``marginal`` mean against its first baseline (NaN: none), each over the known
    share.
    """

    segment: str
    grounds: int
    failed: int
    known: float
    days: tuple[float, ...]
    cost: tuple[float, ...]
    mean_cost: float
    marginal: float


@dataclass(frozen=True)
class GroundReport:
    """All segments of a finished run, the line last."""

    study: Study
    variant: str
    scenario: str
    rows: tuple[SegmentRow, ...]
    line: SegmentRow
    reasons: tuple[str, ...]


def ground_report(
    folder: Where, variant: str | None = None, scenario: str | None = None
) -> GroundReport:
    """Intervals and costs by segment of the run in ``folder`` (first variant and scenario).

    Raises
    ------
    InputError
        It is no finished run of a study with grounds.
    """
    results = read_results(folder, finished=False, prices_only=True)
    study = results.study
    if study.grounds_table is None:
        raise InputError(
            f"{folder} is of a study without [grounds]; 'mcsettle summarise' tells of it"
        )
    variant = study.variant(variant or study.variant_names[0]).name
    scenario = study.scenario(scenario or study.scenario_names[0]).name
    frame = _weighted(study, results.part("realisations", variant, scenario).copy())
    frame["marginal"] = np.nan
    effect = next((e for e in study.effects.values() if e.scenario == scenario), None)
    if effect is not None:
        pairs = results.pairs(variant, effect)
        (frame["marginal"],) = beside(frame, pairs, ("marginal_cost",))
    rows = [_row(name, part) for name, part in frame.groupby("segment", sort=False)]
    reasons = frame.loc[frame["status"] == "failed", "failure"].dropna().unique()
    return GroundReport(study, variant, scenario, tuple(rows), _row("line", frame), tuple(reasons))


def _weighted(study: Study, frame: pd.DataFrame) -> pd.DataFrame:
    """``frame``, rows of one variant and scenario, with segment, weight, days and cost."""
    every = study.grounds()
    grounds = [every[i] for i in frame["parameter_set"]]
    tracks = frame.groupby("parameter_set")["realisation"].transform("size")
    frame["segment"] = [ground.segment for ground in grounds]
    frame["weight"] = np.array([ground.probability for ground in grounds]) / tracks
    censored = frame["status"] == "censored"
    frame["days"] = frame[INTERVAL].astype(float).where(~censored, np.inf)
    priced = study.economics
    years = np.minimum(frame["days"].to_numpy(), study.limit.horizon_days) / DAYS_PER_YEAR
    cost = np.full(len(years), np.nan)
    if priced is not None:
        positive = years > 0.0
        money = priced.tamping_cost_per_track_km, priced.discount_rate
        cost[positive] = perpetual_present_value(*money, years[positive])
    frame["cost"] = cost
    return frame


def _row(name: object, part: pd.DataFrame) -> SegmentRow:
    failed = part["status"] == "failed"
    sound = part[~failed]
    n_failed = int(part.loc[failed, "parameter_set"].nunique())
    # Over the line each segment counts alike; what was not asked for is not known either.
    probability = float(sound["weight"].sum()) / part["segment"].nunique()
    weights = sound["weight"].to_numpy()
    return SegmentRow(
        str(name),
        int(sound["parameter_set"].nunique()),
        n_failed,
        probability,
        tuple(weighted_quantiles(sound["days"].to_numpy(), weights, LEVELS).tolist()),
        tuple(weighted_quantiles(sound["cost"].to_numpy(), weights, LEVELS).tolist()),
        _mean(sound["cost"].to_numpy(), weights),
        _mean_of_most(sound["marginal"].to_numpy(), weights),
    )


def _mean_of_most(values: np.ndarray, weights: np.ndarray) -> float:
    """Mean over the pairs with both intervals; NaN where most of the weight is of censored ones."""
    finite = np.isfinite(values)
    most = 2.0 * float(np.sum(weights[finite])) >= float(np.sum(weights))
    return _mean(values, weights) if most else np.nan


def _mean(values: np.ndarray, weights: np.ndarray) -> float:
    finite = np.isfinite(values)
    return float(np.average(values[finite], weights=weights[finite])) if finite.any() else np.nan
