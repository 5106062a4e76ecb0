"""One input at a time: what its P10 and P90 do to every median, on the same tracks.

The others keep their central values, so correlations play no part here. What an input does in company
is the first-order index of a run (``summary_spread``); this is the cheap look before it.
"""

from dataclasses import dataclass

import numpy as np

from mcsettle import economics
from mcsettle.estimate.sample import effect_quantile, interval_quantile
from mcsettle.step_a.transfers import TransferStore, step_a
from mcsettle.step_b.build_case import build_case
from mcsettle.step_b.case import Outcome, support_of
from mcsettle.step_b.cycle_jump import CycleJump
from mcsettle.study.effects import StudyEffect
from mcsettle.study.study import Study
from mcsettle.study.transfer_store import transfer_store
from mcsettle.summary.results import INTERVAL
from mcsettle.types import Progress

ENDS = (0.1, 0.9)


@dataclass(frozen=True)
class Bar:
    """Medians of one metric of one scenario or effect, by name, with one input at its low and high end.

    ``low`` and ``high`` are the values of the input, ``at_low`` and ``at_high`` the medians (None:
    not reached or not identified), ``central`` the median with every input central.
    """

    scenario: str
    metric: str
    unit: str
    input: str
    low: float
    high: float
    at_low: float | None
    at_high: float | None
    central: float | None

    @property
    def swing(self) -> float:
        """Distance between the ends; infinite where one is unknown."""
        if self.at_low is None or self.at_high is None:
            return np.inf
        return abs(self.at_high - self.at_low)


def tornado(
    study: Study,
    variant: str | None = None,
    realisations: int = 32,
    progress: Progress | None = None,
    processes: int = 1,
) -> list[Bar]:
    """Bars of every scenario and metric, the widest first within each.

    Parameters
    ----------
    study : Study, with uncertain inputs
    variant : None: the first
    realisations : tracks, the same for every run
    progress, processes : as for ``run_study``
    """
    variant = variant or study.variant_names[0]
    shared_transfers = transfer_store(study)
    runs: dict[str, Outcome] = {}
    medians = _medians(study, variant, realisations, shared_transfers, runs, processes)
    bars: list[Bar] = []
    for place, entry in enumerate(study.uncertain):
        if progress is not None:
            progress("Inputs, one at a time", place, len(study.uncertain))
        low, high = (float(v) for v in entry.built().quantile(np.array(ENDS)))
        ends = []
        for value in (low, high):
            member = study.with_inputs(dict.fromkeys(entry.paths, value))
            ends.append(_medians(member, variant, realisations, shared_transfers, runs, processes))
        for key, (unit, central) in medians.items():
            at = [end[key][1] for end in ends]
            bars.append(Bar(*key, unit, entry.input, low, high, at[0], at[1], central))
    order = list(medians)
    return sorted(bars, key=lambda b: (order.index((b.scenario, b.metric)), -b.swing))


def _medians(
    study: Study,
    variant: str,
    realisations: int,
    shared_transfers: TransferStore,
    runs: dict[str, Outcome],
    processes: int,
) -> dict[tuple[str, str], tuple[str, float | None]]:
    """(unit, median) by (scenario, metric); ``runs`` keeps what need not be repeated."""
    outcomes = {}
    prepared = None
    for scenario in study.scenario_names:
        key = study.step_b_key(variant, scenario)
        if key not in runs:
            prepared = prepared or step_a(study.scenes, None, processes, shared_transfers)
            scene, indices = study.scene(variant, scenario), range(realisations)
            profiles = scene.profiles.sample(indices)
            support = support_of(scene, indices, profiles)
            engine = CycleJump(build_case(scene, prepared))
            runs[key] = engine.run(profiles, np.zeros(0), support=support)
        outcomes[scenario] = runs[key]
    found: dict[tuple[str, str], tuple[str, float | None]] = {}
    for scenario, outcome in outcomes.items():
        median = interval_quantile(*_days(study, outcome), 0.5)
        found[scenario, INTERVAL] = ("d", median.value)
        for effect in study.effects.values():
            if effect.scenario == scenario:
                found |= _effects(study, effect, outcomes)
    return found


def _effects(
    study: Study, effect: StudyEffect, outcomes: dict[str, Outcome]
) -> dict[tuple[str, str], tuple[str, float | None]]:
    prices, change = study.economics, effect.change
    assert prices is not None
    base, own = (_days(study, outcomes[name]) for name in (effect.baseline, effect.scenario))
    effects = economics.paired_effects(
        base[0],
        own[0],
        base[1],
        own[1],
        change,
        prices.tamping_cost_per_track_km,
        prices.discount_rate,
    )
    sound = effects.status != "failed"
    found: dict[tuple[str, str], tuple[str, float | None]] = {}
    for metric, unit in (("reduction_percent", "%"), ("marginal_cost", change.unit)):
        values = getattr(effects, metric)[sound]
        median = effect_quantile(values, 0.5, unit).value if len(values) else None
        found[effect.name, metric] = (unit, median)
    return found


def _days(study: Study, outcome: Outcome) -> tuple[np.ndarray, np.ndarray]:
    """Days and censorings of an outcome; NaN in both where it failed."""
    horizon = study.limit.horizon_days
    ends = np.where(outcome.reached | outcome.failed, np.nan, horizon)
    return np.where(outcome.failed, np.nan, outcome.days), ends
