"""The few numbers that answer a study's question: intervals, line prices, model forms.

From the tables of a run alone, and only what a first page shows; every number of a run is in
``summary``. Where most of the sections, or of the pairs of sections, are censored there is no number,
only a bound. With observations the parameter sets count by their weights.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd

from mcsettle import economics
from mcsettle.estimate.crossed import CrossedSample
from mcsettle.estimate.estimate import Estimate
from mcsettle.estimate.resampling import SetWeights, as_interval
from mcsettle.estimate.weighted_quantiles import weighted_quantiles
from mcsettle.study.effects import StudyEffect
from mcsettle.study.study import Study
from mcsettle.summary.forms import FormEffect, FormsSummary, summarise_forms
from mcsettle.summary.results import CENSORED, INTERVAL, Results
from mcsettle.summary.samples import effect_samples, floats, interval_sample, matrix, shortening
from mcsettle.summary.summary import cost_exponent, set_weights
from mcsettle.units import DAYS_PER_YEAR

SETTLED = "mean_settlement_mm"
HALF = (0.25, 0.75)  # between which half of the sections lie
BAND = (0.05, 0.5, 0.95)


@dataclass(frozen=True)
class IntervalAnswer:
    """Tamping interval of one scenario in one form: its median with its error, and half of the sections.

    ``half`` [P25, P75] days, None beyond the horizon; ``settlement`` the median uniform settlement [mm]
    at the end.
    """

    median: Estimate
    half: tuple[float | None, float | None]
    settlement: float | None


@dataclass(frozen=True)
class Answers:
    """What the run says, form by form; keys (form, scenario), (form, effect) and effect.

    ``form`` is the one whose numbers stand first, ``forms`` are those that are shown and counted.
    ``horizon_wanted`` [years] is where about half of the sections would have reached their limit; None
    where they have, or where it cannot be known.
    """

    study: Study
    form: str
    forms: tuple[str, ...]
    intervals: Mapping[tuple[str, str], IntervalAnswer]
    effects: Mapping[tuple[str, str], FormEffect]
    summaries: Mapping[str, FormsSummary]
    horizon_wanted: float | None = None

    def effect(self, name: str) -> FormEffect | None:
        """The effect ``name`` in the form that stands first; None without one."""
        return self.effects.get((self.form, name))

    def effects_of(self, scenario: str) -> list[tuple[str, FormEffect]]:
        """Baselines of ``scenario`` and its effects against them, in the form that stands first."""
        return [
            (entry.baseline, effect)
            for entry in self.study.effects.values()
            if entry.scenario == scenario and (effect := self.effect(entry.name)) is not None
        ]


def answers(results: Results, variant: str | None = None) -> Answers:
    """The answers of a finished run; ``variant`` stands first (None: the first form).

    Raises
    ------
    InputError
        There is no such variant.
    """
    study = results.study
    counted = counted_forms(study)
    first = study.variant(variant).name if variant else (counted or study.variant_names)[0]
    forms = (first, *(name for name in counted if name != first))
    intervals, effects = {}, {}
    for form in forms:
        weights = set_weights(results, form)
        days: dict[str, CrossedSample] = {}
        for scenario in study.scenario_names:
            table = results.part("realisations", form, scenario)
            days[scenario] = interval_sample(table)
            if np.any(days[scenario].valid):
                intervals[form, scenario] = _interval(table, days[scenario], weights)
        for name, effect in study.effects.items():
            of_form = _effect(results, form, effect, days, weights)
            if of_form is not None:
                effects[form, name] = of_form
    compared = dict.fromkeys(name for _, name in effects)
    summaries = {
        name: summarise_forms(name, [effects[f, name] for f in counted if (f, name) in effects])
        for name in compared
    }
    wanted = None
    if any(effect.price.value is None for effect in effects.values()):
        wanted = _horizon_wanted(results, first)
    return Answers(study, first, forms, intervals, effects, summaries, wanted)


def counted_forms(study: Study) -> tuple[str, ...]:
    """Variants that are readings of the study's question and calibrated.

    Without any variant marked ``form_of`` all variants are readings; of several questions those of
    the first count.
    """
    marks = [variant.form_of for variant in study.variants if variant.form_of is not None]
    asked = [v.name for v in study.variants if not marks or v.form_of == marks[0]]
    return tuple(name for name in asked if is_calibrated(study, name))


def is_calibrated(study: Study, variant: str) -> bool:
    """Whether the settlement factor of ``variant`` was fitted: it is not 1, or it is uncertain."""
    if variant in study.fitted:
        return True
    paths = {path for entry in study.uncertain for path in entry.paths}
    if paths & {"settlement.settlement_factor", f"variants.{variant}.settlement_factor"}:
        return True
    return study.settlement_settings(variant).settlement_factor != 1.0


def _interval(
    table: pd.DataFrame, days: CrossedSample, weights: SetWeights | None
) -> IntervalAnswer:
    """Median with its error and the middle half of one form and scenario; failed rows are left out."""
    settled = np.where(days.valid, matrix(table, SETTLED), np.nan)
    days = days.weighted(as_interval(weights))
    (median,) = days.interval_quantiles((0.5,))
    low, high = _quantiles(days.highest, days.shares, HALF)
    (middle,) = _quantiles(settled, days.shares, (0.5,))
    return IntervalAnswer(median, (low, high), middle)


def _effect(
    results: Results,
    form: str,
    effect: StudyEffect,
    days: Mapping[str, CrossedSample],
    weights: SetWeights | None,
) -> FormEffect | None:
    """The paired effect of one form; None without any pair. ``days``: intervals by scenario."""
    if results.effects.empty:
        return None
    table = results.pairs(form, effect)
    table = table[table["status"].isin(["paired", "censored"])]
    if table.empty:
        return None
    units = {"marginal_cost": effect.change.unit, "reduction_percent": "%"}
    costs, reductions = effect_samples(table, units, results.sets).values()
    kept = np.isin(results.tracks(form, effect.baseline), np.unique(table["realisation"]))
    sides = [days[name] for name in (effect.baseline, effect.scenario)]
    arrays = (*(side.values for side in sides), *(np.asarray(side.at_least) for side in sides))
    pairs = [np.where(costs.valid, wide[:, kept], np.nan) for wide in arrays]
    if weights is not None:
        exponent = cost_exponent(results.study, days[effect.baseline].values)
        costs = costs.weighted(as_interval(weights, exponent))
        reductions = reductions.weighted(weights)
    sizes = costs.shares
    weight = np.where(costs.valid, sizes, 0.0)
    bound = _at_most(results, effect.name, pairs, weight) if np.any(costs.censored) else None
    surely, maybe = (float(np.sum(weight[s]) / np.sum(weight)) for s in shortening(*pairs))
    (reduction,) = _known_quantiles(reductions, (0.5,))
    low, middle, high = _known_quantiles(costs, BAND)
    return FormEffect(
        *(form, _line_mean(costs), bound, (low, middle, high), reduction, (surely, maybe)),
        is_calibrated(results.study, form),
    )


def _line_mean(costs: CrossedSample) -> Estimate:
    """Mean over the sections: the price of a line; none where most of its pairs are censored."""
    n, unknown = int(np.sum(costs.valid)), int(np.sum(costs.censored))
    if not costs.mostly_known:
        note = f"{n - unknown} of {n} pairs reach the limit"
        return Estimate(None, None, None, None, n, unknown, costs.unit, note)
    note = f"over {n - unknown} of {n} pairs" if unknown else ""
    return replace(costs.section_mean(), n=n, n_censored=unknown, note=note)


def _at_most(
    results: Results, effect: str, pairs: Sequence[np.ndarray], weights: np.ndarray
) -> float | None:
    """Upper bound of the line's mean: every censored pair at the most it can cost.

    ``pairs``: as ``shortening`` takes them, [E, R] each; ``weights`` [E, R], zero where there is no pair.
    """
    total, weight = 0.0, 0.0
    rows = zip(results.members, *pairs, weights, strict=False)
    for member, base, days, base_end, end, shares in rows:
        change, prices = member.study.change(effect), member.study.economics
        if change is None or prices is None:
            continue
        money = prices.tamping_cost_per_track_km, prices.discount_rate
        highest = economics.highest_costs(base, days, base_end, end, change, *money)
        valid = shares > 0.0
        total += float(np.sum((shares * highest)[valid]))
        weight += float(np.sum(shares[valid]))
    return total / weight if weight > 0.0 and np.isfinite(total) else None


def _quantiles(
    values: np.ndarray, shares: np.ndarray, levels: Sequence[float]
) -> list[float | None]:
    """Quantiles of [E, R] values weighted by ``shares``; None where infinite or without any value.

    Linear between order statistics in one complete sample, else the first value to reach the level.
    """
    sample = values[~np.isnan(values)]
    if len(values) == 1 and len(sample) and np.all(np.isfinite(sample)):
        quantiles = np.quantile(sample, levels)
    else:
        quantiles = weighted_quantiles(values, shares, levels)
    return [float(value) if np.isfinite(value) else None for value in quantiles]


def _known_quantiles(effect: CrossedSample, levels: Sequence[float]) -> list[float | None]:
    """Quantiles of an effect over the known pairs; None where the censored ones could be anything."""
    low, high, plain = (
        _quantiles(values, effect.shares, levels)
        for values in (effect.lowest, effect.highest, effect.values)
    )
    if not effect.mostly_known:
        return [a if a == b else None for a, b in zip(low, high, strict=True)]
    return [None if a is None or b is None else k for a, b, k in zip(low, high, plain, strict=True)]


def _horizon_wanted(results: Results, form: str) -> float | None:
    """Years after which about half of the sections would have reached the limit, all scenarios.

    The SD of a censored section is drawn on as a straight line; growth slows down with the cycles, so
    it takes somewhat longer. None where a section's SD does not grow.
    """
    table = results.realisations
    table = table[(table["variant"] == form) & (table["status"] != "failed")]
    columns = (INTERVAL, CENSORED, "sd_initial_mm", "sd_final_mm")
    days, ends, start, final = (floats(table, column) for column in columns)
    with np.errstate(divide="ignore", invalid="ignore"):
        ahead = ends * (results.study.limit.sd_limit_mm - start) / (final - start)
    times = np.where(np.isnan(days), np.where(final > start, ahead, np.inf), days)
    worst = pd.Series(times).groupby(table["scenario"].to_numpy()).median().max()
    return float(worst) / DAYS_PER_YEAR if np.isfinite(worst) else None
