"""One input at a time: what its P10 and P90 do to every median, on the same tracks.

The others keep their central values, so correlations play no part here. What an input does in company
is the first-order index of a run (``summary_spread``); this is the cheap look before it.
"""

from dataclasses import dataclass

import numpy as np

from mcsettle.estimate.sample import effect_quantile, interval_quantile
from mcsettle.run.columns import Days, paired
from mcsettle.step_a.transfers import TransferStore, step_a
from mcsettle.step_b.build_case import build_case
from mcsettle.step_b.case import Outcome, support_of
from mcsettle.step_b.cycle_jump import CycleJump
from mcsettle.study.study import Study
from mcsettle.study.transfer_store import transfer_store
from mcsettle.summary.results import INTERVAL
from mcsettle.types import Progress, silent

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
    progress: Progress = silent,
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
    days: dict[str, Days] = {}
    scenes = [scene for scene in study.scenes if scene.variant == variant]
    prepared = None
    for scene in scenes:
        key = study.step_b_key(variant, scene.scenario)
        if key not in runs:
            prepared = prepared or step_a(scenes, workers=processes, store=shared_transfers)
            profiles = scene.profiles.sample(range(realisations))
            support = support_of(scene, range(realisations), profiles)
            engine = CycleJump(build_case(scene, prepared))
            runs[key] = engine.run(profiles, np.zeros(0), support=support)
        days[scene.scenario] = runs[key].intervals(scene.horizon)
    medians: dict[tuple[str, str], tuple[str, float | None]] = {}
    for scenario in days:
        medians[scenario, INTERVAL] = ("d", interval_quantile(*days[scenario], 0.5).value)
        for effect in study.effects.values():
            if effect.scenario != scenario:
                continue
            effects = paired(effect, study.economics, days[effect.baseline], days[scenario])
            for metric, unit in (("reduction_percent", "%"), ("marginal_cost", effect.change.unit)):
                values = getattr(effects, metric)[effects.status != "failed"]
                median = effect_quantile(values, 0.5, unit).value if len(values) else None
                medians[effect.name, metric] = (unit, median)
    return medians
