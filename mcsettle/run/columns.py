"""Columns of the result tables from what the engine returned; NaN is written as null."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from mcsettle import economics
from mcsettle.estimate.conditioning import Conditioning
from mcsettle.railway.scene import Scene
from mcsettle.step_b.case import Outcome
from mcsettle.storage.tables import input_column
from mcsettle.study.effects import StudyEffect
from mcsettle.study.parameter_sets import ParameterSet
from mcsettle.study.schema.economics import EconomicsTable
from mcsettle.summary.summary import SummaryRow
from mcsettle.units import DAYS_PER_YEAR, MGT, MM

Days = tuple[np.ndarray, np.ndarray]  # intervals, days censored at: [R] each, NaN for none
FAILURE = "the profile overflowed or the step collapsed"


def realisation_columns(
    member: ParameterSet, scene: Scene, indices: range, outcome: Outcome
) -> dict[str, Any]:
    """Columns of the ``realisations`` table for one batch, the drawn inputs last."""
    timetable, n = scene.timetable, len(outcome.days)
    reached, failed = outcome.reached, outcome.failed
    days_run = outcome.passages / timetable.passages_per_day
    columns = {
        "variant": [scene.variant] * n,
        "scenario": [scene.scenario] * n,
        "parameter_set": np.full(n, member.index, np.int32),
        "realisation": np.arange(indices.start, indices.stop),
        "status": np.where(failed, "failed", np.where(reached, "reached", "censored")).tolist(),
        "tamping_interval_days": outcome.days,
        "censored_at_days": outcome.intervals(scene.horizon)[1],
        "passages": outcome.passages,
        "tonnage_mgt": days_run * timetable.mass_per_day / MGT,
        "sd_initial_mm": outcome.sd_initial / MM,
        "sd_final_mm": outcome.sd_final / MM,
        "mean_settlement_mm": outcome.mean_settlement / MM,
        "sd_growth_1y_mm": _growth_in_a_year(scene, outcome) / MM,
        "failure": [FAILURE if f else None for f in failed],
    }
    return columns | input_columns(member, n)


def input_columns(member: ParameterSet, n: int) -> dict[str, np.ndarray]:
    """The drawn inputs of a parameter set, [n] each, under their columns' names."""
    return {input_column(path): np.full(n, value) for path, value in member.values.items()}


def history_columns(
    member: ParameterSet, scene: Scene, indices: range, outcome: Outcome
) -> dict[str, Any]:
    """Columns of the ``history`` table: SD at the sample days before the end, and at the end."""
    days = np.broadcast_to(scene.sample_days, outcome.history.shape)
    end = np.where(outcome.reached, outcome.days, scene.horizon)
    days = np.column_stack([days, end])
    # A track at its limit before any traffic has its end among the samples already.
    ended = outcome.reached & (outcome.days > 0.0)
    sd = np.column_stack([outcome.history, np.where(ended, outcome.sd_final, np.nan)])
    row, column = np.nonzero(np.isfinite(sd))
    n = len(row)
    return {
        "variant": [scene.variant] * n,
        "scenario": [scene.scenario] * n,
        "parameter_set": np.full(n, member.index, np.int32),
        "realisation": row + indices.start,
        "day": days[row, column],
        "sd_mm": sd[row, column] / MM,
    }


def effect_columns(
    member: ParameterSet,
    variant: str,
    indices: range,
    effect: StudyEffect,
    effects: economics.Effects,
) -> dict[str, Any]:
    """Columns of the ``effects`` table for the realisations ``indices`` of ``effects``."""
    n = len(indices)
    return {
        "variant": [variant] * n,
        "scenario": [effect.scenario] * n,
        "baseline": [effect.baseline] * n,
        "parameter_set": np.full(n, member.index, np.int32),
        "realisation": np.arange(indices.start, indices.stop),
        "status": effects.status.tolist(),
        "reduction_percent": effects.reduction_percent,
        "elasticity": effects.elasticity,
        "marginal_cost": effects.marginal_cost,
        "effect": [effect.change.effect] * n,
    }


def paired(
    effect: StudyEffect, prices: EconomicsTable | None, base: Days, days: Days
) -> economics.Effects:
    """``economics.paired_effects`` of the days of the baseline and of the scenario."""
    assert prices is not None  # without them a study has no effects
    money = prices.tamping_cost_per_track_km, prices.discount_rate
    return economics.paired_effects(base[0], days[0], base[1], days[1], effect.change, *money)


def parameter_columns(members: list[ParameterSet], units: Mapping[str, str]) -> dict[str, Any]:
    """Columns of the ``parameters`` table: every drawn input of every parameter set.

    ``units`` of the inputs by their columns, where they have one.
    """
    rows = [(m.index, path, value) for m in members for path, value in m.values.items()]
    return {
        "parameter_set": np.array([row[0] for row in rows], np.int32),
        "input": [row[1] for row in rows],
        "value": [row[2] for row in rows],
        "unit": [units.get(input_column(row[1]), "1") for row in rows],
    }


def weight_columns(conditionings: Sequence[Conditioning]) -> dict[str, Any]:
    """Columns of the ``weights`` table: every parameter set of every variant."""
    logs = np.concatenate([one.log_likelihood for one in conditionings])
    return {
        "variant": [one.variant for one in conditionings for _ in one.log_likelihood],
        "parameter_set": np.concatenate(
            [np.arange(len(one.log_likelihood), dtype=np.int32) for one in conditionings]
        ),
        "weight": np.concatenate([one.weights for one in conditionings]),
        "log_likelihood": [float(v) if np.isfinite(v) else None for v in logs],
    }


def joined(parts: list[dict[str, Any]]) -> dict[str, Any]:
    """Columns of several batches, one after the other."""
    return {key: [v for part in parts for v in part[key]] for key in parts[0]}


def _growth_in_a_year(scene: Scene, outcome: Outcome) -> np.ndarray:
    if scene.horizon < DAYS_PER_YEAR:
        return np.full(len(outcome.days), np.nan)
    year = int(np.flatnonzero(scene.sample_days == DAYS_PER_YEAR)[0])
    return np.asarray(outcome.history[:, year] - outcome.sd_initial)


def summary_columns(rows: list[SummaryRow]) -> dict[str, list[Any]]:
    """Columns of the ``summary`` table, in the order of ``rows``."""
    flat = [
        (row, statistic)
        for row in rows
        for statistic in (*row.statistics, *row.spread, *row.conditioned)
    ]
    columns: dict[str, list[Any]] = {
        "variant": [row.variant for row, _ in flat],
        "scenario": [row.scenario for row, _ in flat],
        "baseline": [row.baseline for row, _ in flat],
        "metric": [row.metric for row, _ in flat],
        "statistic": [s.statistic for _, s in flat],
        "subject": [s.subject for _, s in flat],
        "level": [s.level for _, s in flat],
    }
    names = {"lower": "lo", "upper": "hi"}
    for key in ("value", "lower", "upper", "standard_error", "n", "n_censored", "unit", "note"):
        columns[names.get(key, key)] = [getattr(s.estimate, key) for _, s in flat]
    return columns
