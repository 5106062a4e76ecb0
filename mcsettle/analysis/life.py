"""A study's tracks from tamping to tamping, to their renewal.

Each cycle is a run of Step B from the profile that the last tamping left, with the ballast's count of
cycles renewed and the ground's going on. Effects on the present cost are formed track by track, with
the same scatter of recovery in every scenario.
"""

from dataclasses import dataclass, replace

import numpy as np

from mcsettle.analysis.tamping import (
    Recovery,
    Sequence,
    constant_cost,
    present_cost,
    present_cost_slope,
)
from mcsettle.economics import elasticity
from mcsettle.errors import InputError
from mcsettle.railway.initial_profiles import InitialProfiles
from mcsettle.railway.irregularity import (
    default_section,
    random_amplitudes,
    standard_deviation,
)
from mcsettle.railway.scene import Scene
from mcsettle.step_a.transfers import step_a
from mcsettle.step_b.build_case import build_case
from mcsettle.step_b.case import Case, support_of
from mcsettle.step_b.cycle_jump import CycleJump
from mcsettle.study.effects import StudyEffect
from mcsettle.study.schema.economics import MaintenanceTable
from mcsettle.study.study import Study
from mcsettle.types import Progress
from mcsettle.units import DAYS_PER_YEAR, MM

_SHAPE_STREAM = 0x54A9E


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
    sequence: Sequence
    sd_after: np.ndarray
    cost: np.ndarray
    constant: np.ndarray
    marginal: np.ndarray
    marginal_constant: np.ndarray
    unit: str
    currency: str
    baseline: str = ""


def lives(
    study: Study,
    realisations: int | None = None,
    progress: Progress | None = None,
    processes: int = 1,
) -> list[Life]:
    """Every variant and scenario of ``study``, tamped again and again.

    Raises
    ------
    InputError
        The study has no ``[maintenance]`` or no ``[economics]``, or steps passage by passage.
    """
    table = study.maintenance
    if table is None or study.economics is None:
        raise InputError("tamping again and again needs the tables [maintenance] and [economics]")
    if study.uncertain:
        raise InputError("[maintenance] takes central values; leave [[uncertain]] inputs out")
    prepared = step_a(study.scenes, progress, processes)
    indices = range(realisations or study.run.realisations)
    found = []
    for variant in study.variant_names:
        own: dict[str, tuple[Sequence, np.ndarray]] = {}
        for scenario in study.scenario_names:
            scene = study.scene(variant, scenario)
            own[scenario] = tampings(
                study,
                scene,
                build_case(scene, prepared),
                table,
                indices,
                f"{variant} {scenario}",
                progress,
            )
        for scenario in study.scenario_names:
            effects = [e for e in study.effects.values() if e.scenario == scenario]
            found += [_priced(study, variant, scenario, e, own) for e in effects]
            if not effects:
                found.append(_priced(study, variant, scenario, None, own))
    return found


def tampings(
    study: Study,
    scene: Scene,
    case: Case,
    table: MaintenanceTable,
    indices: range,
    text: str = "",
    progress: Progress | None = None,
) -> tuple[Sequence, np.ndarray]:
    """Tampings of the realisations ``indices`` after one at day 0, and the SD [R, C] m after each."""
    source, typical = study.initial_profiles(), min(64, study.run.realisations)
    start = source.sample(indices)
    recovery = recovery_of(table)
    later = case
    if table.ballast_cycles_after is not None:
        model = replace(case.model, ballast_cycles_before=table.ballast_cycles_after)
        later = replace(case, model=model)
    first, further = CycleJump(case), CycleJump(later)
    profiles, life = start.copy(), (table.renewal_years or np.inf) * DAYS_PER_YEAR
    n, field = len(start), scene.support.settings
    fades = field is not None and field.persistence < 1.0
    day, ground, factor = np.zeros(n), np.zeros(n), np.ones(n)
    alive, is_open = np.ones(n, bool), np.zeros(n, bool)
    days, after = [], []
    for tamping in range(1, table.cycles + 1):
        if not alive.any():
            break
        if progress is not None:
            progress(f"Tampings of {text}", tamping - 1, table.cycles)
        machine = first if tamping == 1 else further
        at = np.flatnonzero(alive)
        if tamping == 1 or (recovery is not None and fades):
            support = support_of(scene, indices, start, tamping - 1)
        outcome = machine.run(
            profiles[at], np.zeros(0), factor[at], ground_days=ground[at], support=support[at]
        )
        day[at] += np.where(outcome.reached, outcome.days, case.horizon)
        due = day[at] < life
        going = outcome.reached & due & (outcome.days > 0.0)
        is_open[at[~going & due]] = True
        alive[at[~going]] = False
        at, ends = at[going], outcome.amplitudes[going]
        days.append(np.where(alive, day, np.nan))
        after.append(np.full(n, np.nan))
        if recovery is None:  # perfect: the next cycle is the first one again
            after[-1][at] = standard_deviation(start[at], *_section(source))
            continue
        ground[at] = 0.0 if recovery.ground_renewed else day[at]
        factor[at] *= 1.0 + recovery.damage
        own = [indices[i] for i in at]
        rough = standard_deviation(ends, *_section(source))
        after[-1][at] = recovery.sd_after(rough, study.seed, own, tamping)
        left = start[at], ends, after[-1][at]
        profiles[at] = _tamped(source, recovery, *left, own, tamping, typical)
    if np.isfinite(life):  # tamped as often as is followed, and not renewed yet
        is_open |= alive
    if progress is not None:
        progress(f"Tampings of {text}", table.cycles, table.cycles)
    years = np.stack(days, axis=1) / DAYS_PER_YEAR
    return Sequence(years, life / DAYS_PER_YEAR, is_open), np.stack(after, axis=1)


def recovery_of(table: MaintenanceTable) -> Recovery | None:
    """What a tamping leaves; None: it makes the track what it was at the start."""
    if table.recovery == "perfect":
        return None
    return Recovery(
        intercept=(table.intercept_mm or 0.0) * MM,
        slope=table.slope or 0.0,
        scatter=table.scatter_mm * MM,
        floor=table.floor_mm * MM,
        shape=table.shape,
        damage=table.damage_per_tamping,
        ground_renewed=table.ground_renewed,
    )


def _tamped(
    source: InitialProfiles,
    recovery: Recovery,
    start: np.ndarray,
    ends: np.ndarray,
    sd: np.ndarray,
    indices: list[int],
    tamping: int,
    typical: int,
) -> np.ndarray:
    """Profiles [R, K] m after a tamping, of SD ``sd`` [R] m."""
    shape = {"scaled": ends, "initial": start}.get(recovery.shape)
    if shape is None:  # the waves of the start, other phases and heights
        stream, n = source.seed ^ _SHAPE_STREAM, start.shape[1]
        drawn = [random_amplitudes(stream, i, n * tamping)[-n:] for i in indices]
        shape = np.array(drawn).reshape(start.shape) * _typical(source, typical)
    return np.asarray(shape * (sd / standard_deviation(shape, *_section(source)))[:, None])


def _typical(source: InitialProfiles, count: int) -> np.ndarray:
    """Root mean square amplitude [K] m of the first ``count`` profiles, by mode."""
    profiles = source.sample(range(count))
    return np.asarray(np.sqrt(np.mean(np.abs(profiles) ** 2, axis=0)))


def _section(source: InitialProfiles) -> tuple[np.ndarray, float | None]:
    return source.wavenumbers, default_section(source.window)


def _priced(
    study: Study,
    variant: str,
    scenario: str,
    effect: StudyEffect | None,
    own: dict[str, tuple[Sequence, np.ndarray]],
) -> Life:
    """Costs of one scenario, and its marginal costs against a baseline's tracks."""
    economics = study.economics
    assert economics is not None
    money = (economics.tamping_cost_per_track_km, economics.discount_rate)
    sequence, after = own[scenario]
    unit = baseline = ""
    marginal = marginal_constant = np.full(len(after), np.nan)
    if effect is not None:
        change, baseline = effect.change, effect.baseline
        unit, base = change.unit, own[baseline][0]
        gamma = elasticity(base.first, sequence.first, change.base, change.changed)
        marginal = present_cost_slope(base, *money) * gamma / change.divisor
        alike = Sequence(base.years[:, :1], np.inf, base.open)
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
        economics.currency,
        baseline,
    )
