"""Two runs, or two studies, side by side: paired on the tracks they share.

Two runs have the same tracks where seed and profile agree; then every track is compared with itself,
and the difference is known far better than either interval. Otherwise the two samples are
independent and only their medians are set beside each other.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from mcsettle.errors import InputError
from mcsettle.estimate.crossed import CrossedSample
from mcsettle.estimate.estimate import Estimate
from mcsettle.estimate.sample import effect_quantile, interval_quantile
from mcsettle.study.effects import StudyEffect
from mcsettle.study.study import Study
from mcsettle.study.written import study_data
from mcsettle.summary.results import CENSORED, INTERVAL, KEYS, Results
from mcsettle.summary.samples import floats

SILENT = ("title", "reference", "calibration", "sources", "stated")


@dataclass(frozen=True)
class Difference:
    """One input that differs: its key path and what each study has (None: it has no such input)."""

    path: str
    first: Any
    second: Any


@dataclass(frozen=True)
class Row:
    """One quantity of one variant and scenario, or effect by its name, in both runs.

    ``first`` and ``second`` are medians; ``change``: P5, P50 and P95 of the paired change, empty where
    the runs do not share tracks; ``unit`` of the medians, ``change_unit`` of the change.
    """

    variant: str
    scenario: str
    metric: str
    unit: str
    first: Estimate
    second: Estimate
    change_unit: str
    change: tuple[Estimate, ...] = ()


@dataclass(frozen=True)
class Comparison:
    """What differs between two runs; ``shared`` realisations, ``unpaired`` says why there are none."""

    differences: tuple[Difference, ...]
    only: tuple[str, ...]
    shared: int
    unpaired: str
    rows: tuple[Row, ...]


def compare(first: Results, second: Results) -> Comparison:
    """Every variant and scenario that both runs have.

    Raises
    ------
    InputError
        They have none in common.
    """
    scenes = [(v, s) for v in first.study.variant_names for s in first.study.scenario_names]
    others = {(v, s) for v in second.study.variant_names for s in second.study.scenario_names}
    common = [scene for scene in scenes if scene in others]
    if not common:
        raise InputError(
            "the two runs have no variant and scenario of the same names: "
            f"{_names(scenes)} and {_names(sorted(others))}"
        )
    why = _why_unpaired(first.study, second.study)
    rows: list[Row] = []
    for variant, scenario in common:
        paired = not why and _same_spectrum(first, second, variant)
        rows += _rows(first, second, variant, scenario, paired)
    one, other = (set(results.realisations["realisation"].unique()) for results in (first, second))
    shared = 0 if why else len(one & other)
    only = [f"{v} {s}: only in the first" for v, s in scenes if (v, s) not in others]
    only += [f"{v} {s}: only in the second" for v, s in sorted(others) if (v, s) not in scenes]
    differences = tuple(study_differences(first.study, second.study))
    return Comparison(differences, tuple(only), shared, why, tuple(rows))


def study_differences(first: Study, second: Study) -> Iterator[Difference]:
    """Inputs that differ, by key path; titles, references and records left out."""
    one, other = (dict(_flat(study_data(study))) for study in (first, second))
    for path in dict.fromkeys([*one, *other]):
        if path.split(".")[0] in SILENT or path.endswith(".title"):
            continue
        if one.get(path) != other.get(path):
            yield Difference(path, one.get(path), other.get(path))


def _rows(
    first: Results, second: Results, variant: str, scenario: str, paired: bool
) -> Iterator[Row]:
    tables = [results.sound(variant, scenario) for results in (first, second)]
    if not any(table.empty for table in tables):
        medians = [interval_quantile(floats(t, INTERVAL), floats(t, CENSORED), 0.5) for t in tables]
        change = _interval_change(*tables) if paired else ()
        yield Row(variant, scenario, INTERVAL, "d", medians[0], medians[1], "%", change)
    if first.effects.empty or second.effects.empty:
        return
    for effect in first.study.effects.values():
        if effect.scenario == scenario:
            yield from _effect_rows(first, second, variant, effect, paired)


def _effect_rows(
    first: Results, second: Results, variant: str, effect: StudyEffect, paired: bool
) -> Iterator[Row]:
    """An effect that both runs have, in one unit."""
    same = (effect.scenario, effect.baseline, effect.change.unit)
    others = second.study.effects.values()
    if same not in [(e.scenario, e.baseline, e.change.unit) for e in others]:
        return
    tables = [r.pairs(variant, effect) for r in (first, second)]
    parts = [part[~part["status"].isin(["failed", "at_limit"])] for part in tables]
    if any(part.empty for part in parts):
        return
    for metric, unit in (("reduction_percent", "%"), ("marginal_cost", effect.change.unit)):
        medians = [effect_quantile(floats(part, metric), 0.5, unit) for part in parts]
        change = _effect_change(parts[0], parts[1], metric, unit) if paired else ()
        yield Row(variant, effect.name, metric, unit, medians[0], medians[1], unit, change)


def _interval_change(first: pd.DataFrame, second: pd.DataFrame) -> tuple[Estimate, ...]:
    """Quantiles of 100 (T₂/T₁ − 1) [%] on the same tracks, bounded where one is censored."""
    both = first.merge(second, on=KEYS, suffixes=("_1", "_2"))
    both = both[(floats(both, f"{INTERVAL}_1") != 0.0) & (floats(both, f"{INTERVAL}_2") != 0.0)]
    if both.empty:
        return ()
    one, other = (
        CrossedSample(floats(both, f"{INTERVAL}_{i}"), "d", floats(both, f"{CENSORED}_{i}"))
        for i in (1, 2)
    )
    values = 100.0 * (other.values / one.values - 1.0)
    lower = 100.0 * (other.lowest / one.highest - 1.0)
    upper = np.where(other.censored, np.inf, 100.0 * (other.highest / one.lowest - 1.0))
    return tuple(effect_quantile(values, p, "%", lower, upper) for p in (0.05, 0.5, 0.95))


def _effect_change(
    first: pd.DataFrame, second: pd.DataFrame, metric: str, unit: str
) -> tuple[Estimate, ...]:
    """Quantiles of the difference of a paired effect on the same tracks."""
    both = first.merge(second, on=KEYS, suffixes=("_1", "_2"))
    if both.empty:
        return ()
    values = floats(both, f"{metric}_2") - floats(both, f"{metric}_1")
    return tuple(effect_quantile(values, p, unit) for p in (0.05, 0.5, 0.95))


def _why_unpaired(first: Study, second: Study) -> str:
    """Why the same index is not the same track in both; empty where it is."""
    if first.seed != second.seed:
        return f"seeds {first.seed} and {second.seed}: other realisations"
    if first.profile != second.profile:
        return "the initial profiles are described differently"
    if first.uncertain != second.uncertain or first.correlations != second.correlations:
        return "the uncertain inputs differ: the same parameter set is not the same draw"
    return ""


def _same_spectrum(first: Results, second: Results, variant: str) -> bool:
    """Whether a variant draws its tracks from one spectrum in both runs."""
    one, other = (results.study.variant(variant) for results in (first, second))
    return (one.spectrum, one.fra_class) == (other.spectrum, other.fra_class)


def _flat(data: Any, path: str = "") -> Iterator[tuple[str, Any]]:
    if isinstance(data, Mapping):
        for key, value in data.items():
            yield from _flat(value, f"{path}.{key}" if path else str(key))
    elif isinstance(data, list | tuple) and data and isinstance(data[0], Mapping):
        for place, value in enumerate(data):
            name = value.get("name", value.get("input", place + 1))
            yield from _flat(value, f"{path}.{name}")
    else:
        yield path, data


def _names(scenes: list[tuple[str, str]]) -> str:
    shown = ", ".join(f"{v} {s}" for v, s in scenes[:6])
    return shown + (", …" if len(scenes) > 6 else "")
