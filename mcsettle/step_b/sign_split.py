"""Why an added service shortens or lengthens the interval: what it roughens, and what it hardens.

The axles of an added service settle the track, and they advance the cycles N, on which every layer
hardens for the trains that ran before. Each is an experiment of its own on the same tracks: the added
service settles while its cycles are not counted, or is counted while it does not settle. All four cases
(baseline, both, and either alone) are one timetable of the services kept, added and removed, with flags.
"""

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass, replace

import numpy as np

from mcsettle.railway.traffic import Service, Timetable
from mcsettle.step_a.transfer import TransferFunctions
from mcsettle.step_b.case import ALIKE, Case, Outcome, Support
from mcsettle.step_b.cycle_jump import CycleJump, Forms, day_scale
from mcsettle.step_b.cycles import clock_of, daily_weights

NODES = 32  # of the mean of the weights over an interval

Run = tuple[Service, TransferFunctions]
Flags = tuple[tuple[bool, ...], tuple[bool, ...]]  # of the services that settle, and that count


@dataclass(frozen=True)
class JoinedTraffic:
    """Services of a baseline and of a scenario in one day.

    ``before`` and ``after``: for each service whether it runs in the baseline, and in the scenario.
    """

    timetable: Timetable
    transfers: tuple[TransferFunctions, ...]
    before: tuple[bool, ...]
    after: tuple[bool, ...]

    @property
    def added(self) -> int:
        """Axles a day that only the scenario has."""
        return self.axles(np.array(self.after) & ~np.array(self.before))

    def axles(self, which: Sequence[bool] | np.ndarray) -> int:
        """Axles a day of some of the services."""
        services = self.timetable.services
        return sum(s.per_day * s.train.n_axles for s, w in zip(services, which, strict=True) if w)


def joined_traffic(base: Sequence[Run], other: Sequence[Run]) -> JoinedTraffic:
    """The services of a scenario, ``other``, those of the baseline kept apart from what is added.

    A train that runs at one speed more often is kept as often as before, and added for the rest. Services
    that only the baseline has come last.
    """
    left: dict[tuple[object, float], int] = {}
    for service, _ in base:
        key = service.train, service.speed
        left[key] = left.get(key, 0) + service.per_day
    parts: list[tuple[Service, TransferFunctions, bool, bool]] = []
    for service, transfer in other:
        key = service.train, service.speed
        kept = min(left.get(key, 0), service.per_day)
        left[key] = left.get(key, 0) - kept
        for n, was in ((kept, True), (service.per_day - kept, False)):
            if n:
                parts.append((replace(service, per_day=n), transfer, was, True))
    for service, transfer in base:
        key = service.train, service.speed
        gone, left[key] = min(left[key], service.per_day), max(left[key] - service.per_day, 0)
        if gone:
            parts.append((replace(service, per_day=gone), transfer, True, False))
    services, transfers, before, after = zip(*parts, strict=True)
    return JoinedTraffic(Timetable(services), transfers, before, after)


@dataclass(frozen=True)
class SignSplit:
    """The change of the interval on R tracks, split; NaN where one of the four runs is censored.

    ``reduction`` [R] of the interval, percent of the baseline's; ``by_roughening`` with the added axles
    settling but not counted, ``by_hardening`` counted but not settling. ``roughening`` [R] what an added
    axle roughens relative to the mean one of the baseline, ξ; ``break_even`` [R] the ξ at which the
    interval would not change, ξ*, NaN where cycles are not shared; ``leverage`` [R] of a small relative
    change of the rate on the interval, 1/(1 − ξ*).
    """

    reduction: np.ndarray
    by_roughening: np.ndarray
    by_hardening: np.ndarray
    roughening: np.ndarray
    break_even: np.ndarray
    leverage: np.ndarray


def sign_split(
    case: Case,
    traffic: JoinedTraffic,
    amplitudes: np.ndarray,
    support: Support = ALIKE,
    forms: Forms | None = None,
) -> SignSplit:
    """Split the change that ``traffic`` makes on tracks [R, K] m, by the second-order form.

    Parameters
    ----------
    case : Case of the joined traffic
    traffic : JoinedTraffic, which has added services
    amplitudes : complex [R, K], initial profile amplitudes, m
    support, forms : as for the engine
    """
    forms = {} if forms is None else forms
    engine = CycleJump(case, forms=forms)
    before, after = traffic.before, traffic.after
    engines = {
        (settling, counted): _flagged(engine, settling, counted, forms)
        for settling in (before, after)
        for counted in (before, after)
    }
    runs = _runs(engines, amplitudes, support)
    first, both = runs[before, before], runs[after, after]
    known = np.all([run.reached & (run.days > 0.0) for run in runs.values()], axis=0)
    start, end = (np.where(known, run.days, 1.0) for run in (first, both))

    def reduction(days: np.ndarray) -> np.ndarray:
        return np.where(known, 100.0 * (1.0 - np.where(known, days, 1.0) / start), np.nan)

    def growth(name: CycleJump, weights: np.ndarray) -> np.ndarray:
        embed = name.measure.embed
        change, _ = name.growth(first.amplitudes, weights, support.fields)
        return np.asarray(np.sum(embed(first.amplitudes) * embed(change), axis=1))

    alone, hardened = engines[before, before], engines[before, after]
    whole = growth(alone, _total_weights(alone.case, start))
    of_base = growth(hardened, _total_weights(hardened.case, end))
    at_end = growth(alone, daily_weights(alone.case, start) * start[:, None])
    n, kept = traffic.axles(before), traffic.axles(np.array(before) & np.array(after))
    with np.errstate(divide="ignore", invalid="ignore"):
        roughening = np.where(known, (n * whole / of_base - kept) / traffic.added, np.nan)
        leverage = np.where(known, whole / at_end, np.nan)
    shared = case.model.cycles != "per_vehicle"
    return SignSplit(
        reduction=reduction(both.days),
        by_roughening=reduction(runs[after, before].days),
        by_hardening=reduction(runs[before, after].days),
        roughening=roughening,
        break_even=1.0 - 1.0 / leverage if shared else np.full(len(amplitudes), np.nan),
        leverage=leverage,
    )


def _flagged(
    engine: CycleJump, settling: tuple[bool, ...], counted: tuple[bool, ...], forms: Forms
) -> CycleJump:
    """The engine with some services settling and some counted; its coefficients are the same."""
    case = replace(engine.case, settling=settling, counted=counted)
    if case.severity is not None:  # few combinations stand for the weights of this case alone
        return CycleJump(case, forms=forms)
    flagged = copy(engine)
    flagged.case = case
    return flagged


def _runs(
    engines: dict[Flags, CycleJump], amplitudes: np.ndarray, support: Support
) -> dict[Flags, Outcome]:
    """The tracks in every flagged case, together where the cases share their coefficients."""
    every = list(engines.values())
    if any(engine.growth is not every[0].growth for engine in every):
        none = np.zeros(0)
        return {key: e.run(amplitudes, none, support=support) for key, e in engines.items()}
    outcomes = every[0].run_flagged([engine.case for engine in every], amplitudes, support)
    return dict(zip(engines, outcomes, strict=True))


def _total_weights(case: Case, days: np.ndarray) -> np.ndarray:
    """Growth of the cycle functions [R, E] from the start to ``days`` [R]."""
    scale, clock = day_scale(case), clock_of(case)
    nodes, shares = np.polynomial.legendre.leggauss(NODES)
    end, total = np.log1p(days / scale), np.zeros(1)
    for node, share in zip(nodes, shares, strict=True):
        time = 0.5 * (1.0 + node) * end
        size = 0.5 * share * end * scale * np.exp(time)
        total = total + clock.daily_weights(scale * np.expm1(time)) * size[:, None]
    return total
