"""A study's tracks from tamping to tamping, to their renewal.

Each cycle is a run of Step B from the profile that the last tamping left, with the ballast's count of
cycles renewed and the ground's going on. Effects on the present cost are formed track by track, with
the same scatter of recovery in every scenario.
"""

from dataclasses import dataclass

import numpy as np

from mcsettle.analysis.tamped_tracks import (
    Tracks,
    Upkeep,
    followed,
    recovery_of,
    with_renewed_ballast,
)
from mcsettle.analysis.tamping import (
    TampingSequence,
    constant_cost,
    present_cost,
    present_cost_slope,
)
from mcsettle.economics import elasticity
from mcsettle.errors import InputError
from mcsettle.railway.scene import Scene
from mcsettle.step_a.transfers import step_a
from mcsettle.step_b.build_case import build_case
from mcsettle.step_b.case import Case, support_of
from mcsettle.step_b.cycle_jump import CycleJump
from mcsettle.study.effects import StudyEffect
from mcsettle.study.schema.economics import EconomicsTable, MaintenanceTable
from mcsettle.study.study import Study
from mcsettle.types import Progress, silent
from mcsettle.units import DAYS_PER_YEAR


@dataclass(frozen=True)
class Life:
    """One variant and scenario: the tampings of R tracks and what they cost [currency/track-km].

    ``cost`` of the sequence, ``constant`` by Eq. (4) with the first interval; ``marginal`` cost of the
    sequence and ``marginal_constant`` by Eqs. (8), (9), in ``unit`` (NaN for the baseline, and where a
    first interval is unknown); costs in ``currency``; ``baseline``: what the marginal costs are against;
    ``sd_after`` [R, C] m after each further tamping.
    """

    variant: str
    scenario: str
    sequence: TampingSequence
    sd_after: np.ndarray
    cost: np.ndarray
    constant: np.ndarray
    marginal: np.ndarray
    marginal_constant: np.ndarray
    unit: str
    currency: str
    baseline: str = ""


def lives(
    study: Study, realisations: int | None = None, progress: Progress = silent, processes: int = 1
) -> list[Life]:
    """Every variant and scenario of ``study``, tamped again and again.

    Raises
    ------
    InputError
        The study has no ``[maintenance]`` or no ``[economics]``, or steps passage by passage.
    """
    table, prices = study.maintenance, study.economics
    if table is None or prices is None:
        raise InputError("tamping again and again needs the tables [maintenance] and [economics]")
    if study.uncertain:
        raise InputError("[maintenance] takes central values; leave [[uncertain]] inputs out")
    prepared = step_a(study.scenes, progress, processes)
    indices = range(realisations or study.run.realisations)
    years, source = table.renewal_years or np.inf, study.initial_profiles()
    typical = min(64, study.run.realisations)
    upkeep = Upkeep(
        recovery_of(table), table.cycles, years * DAYS_PER_YEAR, source, typical, study.seed
    )
    priced = []
    for variant in study.variant_names:
        of_scenario: dict[str, tuple[TampingSequence, np.ndarray]] = {}
        for scenario in study.scenario_names:
            scene = study.scene(variant, scenario)
            case = build_case(scene, prepared)
            text = f"{variant} {scenario}"
            of_scenario[scenario] = tampings(scene, case, table, upkeep, indices, text, progress)
        for scenario in study.scenario_names:
            effects = [e for e in study.effects.values() if e.scenario == scenario]
            for effect in effects or (None,):
                priced.append(_priced(prices, variant, scenario, effect, of_scenario))
    return priced


def tampings(
    scene: Scene,
    case: Case,
    table: MaintenanceTable,
    upkeep: Upkeep,
    indices: range,
    text: str = "",
    progress: Progress = silent,
) -> tuple[TampingSequence, np.ndarray]:
    """Tampings of the realisations ``indices`` after one at day 0, and the SD [R, C] m after each."""
    start, none = upkeep.source.sample(indices), np.zeros(len(indices))
    field = scene.support.settings
    fades = field is not None and field.persistence < 1.0
    tracks = Tracks(
        start, indices, none + 1.0, none, none, none + np.nan,
        lambda gone: support_of(scene, indices, start, gone), fades,
    )  # fmt: skip
    machines = CycleJump(case), CycleJump(with_renewed_ballast(case, table))
    return followed(machines, tracks, upkeep, text, progress)


def _priced(
    prices: EconomicsTable,
    variant: str,
    scenario: str,
    effect: StudyEffect | None,
    of_scenario: dict[str, tuple[TampingSequence, np.ndarray]],
) -> Life:
    """Costs of one scenario, and its marginal costs against a baseline's tracks."""
    money = (prices.tamping_cost_per_track_km, prices.discount_rate)
    sequence, after = of_scenario[scenario]
    unit = baseline = ""
    marginal = marginal_constant = np.full(len(after), np.nan)
    if effect is not None:
        change, baseline = effect.change, effect.baseline
        unit, base = change.unit, of_scenario[baseline][0]
        gamma = elasticity(base.first, sequence.first, change.base, change.changed)
        marginal = present_cost_slope(base, *money) * gamma / change.divisor
        alike = TampingSequence(base.years[:, :1], np.inf, base.open)
        marginal_constant = present_cost_slope(alike, *money) * gamma / change.divisor
    return Life(
        variant,
        scenario,
        sequence,
        after,
        present_cost(sequence, *money),
        constant_cost(sequence, *money),
        marginal,
        marginal_constant,
        unit,
        prices.currency,
        baseline,
    )
