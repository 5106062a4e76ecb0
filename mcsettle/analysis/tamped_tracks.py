"""Tracks followed from tamping to tamping, each cycle a run of Step B from what the last tamping left.

The ballast's count of cycles begins anew, the ground's goes on.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from mcsettle.analysis.tamping import Recovery, TampingSequence
from mcsettle.railway.initial_profiles import InitialProfiles
from mcsettle.railway.irregularity import default_section, random_amplitudes, standard_deviation
from mcsettle.step_b.case import Case, Support
from mcsettle.step_b.cycle_jump import CycleJump
from mcsettle.study.schema.economics import MaintenanceTable
from mcsettle.types import Progress, silent
from mcsettle.units import DAYS_PER_YEAR, MM

_SHAPE_STREAM = 0x54A9E


@dataclass(frozen=True, eq=False)
class Tracks:
    """R tracks where their following begins.

    ``profiles`` complex [R, K] m; ``indices`` addresses of what is random at a tamping; ``factor`` [R]
    on the settlement factor; ``age`` [R] days since the tamping before; ``elapsed`` [R] days that have
    gone by on day 0; ``overdue`` [R] m: SD of those beyond their limit on day 0, NaN for the others.
    ``support``: of the tracks after so many tampings, which ``fades`` or stays as it is.
    """

    profiles: np.ndarray
    indices: Sequence[int]
    factor: np.ndarray
    age: np.ndarray
    elapsed: np.ndarray
    overdue: np.ndarray
    support: Callable[[int], Support]
    fades: bool


@dataclass(frozen=True, eq=False)
class Upkeep:
    """How tracks are kept: ``recovery`` of a tamping (None: perfect), at most ``cycles``, ``life`` days.

    ``source`` of profiles, of which the first ``typical`` give the spectrum of a redrawn shape; ``seed``
    of the scatter.
    """

    recovery: Recovery | None
    cycles: int
    life: float
    source: InitialProfiles
    typical: int
    seed: int


def followed(
    machines: tuple[CycleJump, CycleJump],
    tracks: Tracks,
    upkeep: Upkeep,
    text: str = "",
    progress: Progress = silent,
) -> tuple[TampingSequence, np.ndarray]:
    """Follow ``tracks`` from tamping to tamping; also the SD [R, C] m after each.

    ``machines``: to the first tamping, and from one to the next.
    """
    recovery, n = upkeep.recovery, len(tracks.profiles)
    profiles, factor = tracks.profiles.copy(), tracks.factor.copy()
    day, ground = -tracks.elapsed, tracks.age.copy()
    alive, is_open = np.ones(n, bool), np.zeros(n, bool)
    days, after = [], []
    for tamping in range(1, upkeep.cycles + 1):
        if not alive.any():
            break
        progress(f"Tampings of {text}", tamping - 1, upkeep.cycles)
        at, first = np.flatnonzero(alive), tamping == 1
        machine = machines[0] if first else machines[1]
        if first or (recovery is not None and tracks.fades):
            support = tracks.support(tamping - 1)
        aged = tracks.age[at] if first else None
        outcome = machine.run(profiles[at], np.zeros(0), factor[at], ground[at], support[at], aged)
        day[at] += np.where(outcome.reached, outcome.days, machine.case.horizon)
        now = first & ~np.isnan(tracks.overdue[at])
        day[at] = np.where(now, 0.0, np.maximum(day[at], 0.0))
        due = day[at] < upkeep.life
        going = now | (outcome.reached & due & (outcome.days > 0.0))
        is_open[at[~going & due]] = True
        alive[at[~going]] = False
        at, ends, now = at[going], outcome.amplitudes[going], now[going]
        days.append(np.where(alive, day, np.nan))
        after.append(np.full(n, np.nan))
        if recovery is None:  # perfect: the next cycle is the first one again
            after[-1][at] = standard_deviation(profiles[at], *_section(upkeep.source))
            continue
        since = day + tracks.age + tracks.elapsed
        ground[at] = 0.0 if recovery.ground_renewed else since[at]
        factor[at] *= 1.0 + recovery.damage
        rough = standard_deviation(ends, *_section(upkeep.source))
        rough = np.where(now, tracks.overdue[at], rough)
        own = [tracks.indices[i] for i in at]
        after[-1][at] = recovery.sd_after(rough, upkeep.seed, own, tamping)
        left = tracks.profiles[at], ends, after[-1][at]
        profiles[at] = _tamped(upkeep, recovery, *left, own, tamping)
    if np.isfinite(upkeep.life):  # tamped as often as is followed, and not renewed yet
        is_open |= alive
    progress(f"Tampings of {text}", upkeep.cycles, upkeep.cycles)
    years = np.stack(days, axis=1) / DAYS_PER_YEAR
    return TampingSequence(years, upkeep.life / DAYS_PER_YEAR, is_open), np.stack(after, axis=1)


def with_renewed_ballast(case: Case, table: MaintenanceTable) -> Case:
    """The case after a tamping: the ballast's count begins where ``table`` says."""
    if table.ballast_cycles_after is None:
        return case
    model = replace(case.model, ballast_cycles_before=table.ballast_cycles_after)
    return replace(case, model=model)


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
    upkeep: Upkeep,
    recovery: Recovery,
    start: np.ndarray,
    ends: np.ndarray,
    sd: np.ndarray,
    indices: list[int],
    tamping: int,
) -> np.ndarray:
    """Profiles [R, K] m after a tamping, of SD ``sd`` [R] m."""
    source = upkeep.source
    shape = {"scaled": ends, "initial": start}.get(recovery.shape)
    if shape is None:  # the waves of the start, other phases and heights
        stream, n = source.seed ^ _SHAPE_STREAM, start.shape[1]
        drawn = [random_amplitudes(stream, i, n * tamping)[-n:] for i in indices]
        shape = np.array(drawn).reshape(start.shape) * _typical(source, upkeep.typical)
    return np.asarray(shape * (sd / standard_deviation(shape, *_section(source)))[:, None])


def _typical(source: InitialProfiles, count: int) -> np.ndarray:
    """Root mean square amplitude [K] m of the first ``count`` profiles, by mode."""
    profiles = source.sample(range(count))
    return np.asarray(np.sqrt(np.mean(np.abs(profiles) ** 2, axis=0)))


def _section(source: InitialProfiles) -> tuple[np.ndarray, float | None]:
    return source.wavenumbers, default_section(source.window)
