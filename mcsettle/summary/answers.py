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
from mcsettle.summary.samples import effect_samples, interval_sample, matrix
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
        own = (e for e in self.study.effects.values() if e.scenario == scenario)
        found = ((e.baseline, self.effect(e.name)) for e in own)
        return [(baseline, effect) for baseline, effect in found if effect is not None]


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
            found = _effect(results, form, effect, days, weights)
            if found is not None:
                effects[form, name] = found
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
    pairs = _Pairs.of([days[n] for n in (effect.baseline, effect.scenario)], kept, costs.valid)
    if weights is not None:
        exponent = cost_exponent(results.study, days[effect.baseline].values)
        costs = costs.weighted(as_interval(weights, exponent))
        reductions = reductions.weighted(weights)
    sizes = costs.shares
    bound = _at_most(results, effect.name, pairs, sizes) if np.any(costs.censored) else None
    (reduction,) = _known_quantiles(reductions, (0.5,))
    low, middle, high = _known_quantiles(costs, BAND)
    return FormEffect(
        *(form, _line_mean(costs), bound, (low, middle, high), reduction, pairs.shortening(sizes)),
        is_calibrated(results.study, form),
    )


@dataclass(frozen=True)
class _Pairs:
    """Intervals of baseline and scenario [E, R] days, NaN where censored or not a pair; ends likewise."""

    base: np.ndarray
    days: np.ndarray
    base_end: np.ndarray
    end: np.ndarray
    valid: np.ndarray

    @classmethod
    def of(cls, sides: Sequence[CrossedSample], kept: np.ndarray, valid: np.ndarray) -> "_Pairs":
        """Pairs of baseline and scenario: the tracks ``kept`` of both, ``valid`` [E, R] of these."""
        base, base_end, days, end = (
            np.where(valid, wide[:, kept], np.nan)
            for own in sides
            for wide in (own.values, np.asarray(own.at_least))
        )
        return cls(base, days, base_end, end, valid)

    def shortening(self, sizes: np.ndarray) -> tuple[float, float]:
        """Least and largest share of the pairs whose interval shortens."""
        latest = np.where(np.isnan(self.days), np.inf, self.days)
        earliest = np.where(np.isnan(self.base), self.base_end, self.base)
        surely = self.valid & (latest < earliest)
        shortest = np.where(np.isnan(self.days), self.end, self.days)
        longest = np.where(np.isnan(self.base), np.inf, self.base)
        maybe = self.valid & (shortest < longest)
        total = float(np.sum(sizes[self.valid]))
        return float(np.sum(sizes[surely])) / total, float(np.sum(sizes[maybe])) / total


def _line_mean(costs: CrossedSample) -> Estimate:
    """Mean over the sections: the price of a line; none where most of its pairs are censored."""
    n, unknown = int(np.sum(costs.valid)), int(np.sum(costs.censored))
    if not costs.mostly_known:
        note = f"{n - unknown} of {n} pairs reach the limit"
        return Estimate(None, None, None, None, n, unknown, costs.unit, note)
    note = f"over {n - unknown} of {n} pairs" if unknown else ""
    return replace(costs.section_mean(), n=n, n_censored=unknown, note=note)


def _at_most(results: Results, effect: str, pairs: _Pairs, sizes: np.ndarray) -> float | None:
    """Upper bound of the line's mean: every censored pair at the most it can cost."""
    total, weight = 0.0, 0.0
    for e, member in enumerate(results.members[: len(pairs.base)]):
        change, prices = member.study.change(effect), member.study.economics
        if change is None or prices is None:
            continue
        money = prices.tamping_cost_per_track_km, prices.discount_rate
        arrays = pairs.base[e], pairs.days[e], pairs.base_end[e], pairs.end[e]
        highest = economics.highest_costs(*arrays, change, *money)
        valid = pairs.valid[e]
        total += float(np.sum((sizes[e] * highest)[valid]))
        weight += float(np.sum(sizes[e][valid]))
    return total / weight if weight > 0.0 and np.isfinite(total) else None


def _quantiles(
    values: np.ndarray, shares: np.ndarray, levels: Sequence[float]
) -> list[float | None]:
    """Quantiles of [E, R] values weighted by ``shares``; None where infinite or without any value.

    Linear between order statistics in one complete sample, else the first value to reach the level.
    """
    known = values[~np.isnan(values)]
    if len(values) == 1 and len(known) and np.all(np.isfinite(known)):
        quantiles = np.quantile(known, levels)
    else:
        quantiles = weighted_quantiles(values, shares, levels)
    return [float(value) if np.isfinite(value) else None for value in quantiles]


def _known_quantiles(effect: CrossedSample, levels: Sequence[float]) -> list[float | None]:
    """Quantiles of an effect over the known pairs; None where the censored ones could be anything."""
    low, high, known = (
        _quantiles(values, effect.shares, levels)
        for values in (effect.lowest, effect.highest, effect.values)
    )
    if not effect.mostly_known:
        return [a if a == b else None for a, b in zip(low, high, strict=True)]
    return [None if a is None or b is None else k for a, b, k in zip(low, high, known, strict=True)]


def _horizon_wanted(results: Results, form: str) -> float | None:
    """Years after which about half of the sections would have reached the limit, all scenarios.

    The SD of a censored section is drawn on as a straight line; growth slows down with the cycles, so
    it takes somewhat longer. None where a section's SD does not grow.
    """
    table = results.realisations
    table = table[(table["variant"] == form) & (table["status"] != "failed")]
    days = table[INTERVAL].to_numpy(dtype=float, na_value=np.nan)
    ends = table[CENSORED].to_numpy(dtype=float, na_value=np.nan)
    start, final = (table[c].to_numpy(dtype=float) for c in ("sd_initial_mm", "sd_final_mm"))
    with np.errstate(divide="ignore", invalid="ignore"):
        ahead = ends * (results.study.limit.sd_limit_mm - start) / (final - start)
    times = np.where(np.isnan(days), np.where(final > start, ahead, np.inf), days)
    worst = pd.Series(times).groupby(table["scenario"].to_numpy()).median().max()
    return float(worst) / DAYS_PER_YEAR if np.isfinite(worst) else None
