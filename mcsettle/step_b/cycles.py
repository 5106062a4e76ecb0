"""The clock of Step B: which cycles N each passage meets, by day and by update."""

from dataclasses import dataclass

import numpy as np

from mcsettle.railway.track import BallastLaw
from mcsettle.step_b.case import Case
from mcsettle.step_b.settlement import cycle_increment, cycle_rate


def cycles_at(case: Case, day: np.ndarray, ground_days: np.ndarray | float = 0.0) -> np.ndarray:
    """Cycles N [E, …] of each service's groups at fractional ``day``, day-averaged.

    ``ground_days``: days of this traffic that all but the ballast have had before day 0, since a
    tamping renews the ballast's count alone.

    A service meets the N of the middle of its block in the day: its offset from the middle of the day's
    count keeps the order of the timetable to second order in a day's share of N.
    """
    model, day = case.model, np.asarray(day, dtype=float)
    axles = np.array([s.per_day * s.train.n_axles for s in case.timetable.services], dtype=float)
    rows = []
    for s, own in enumerate(axles):
        counted = np.where(counted_with(case, s), axles, 0.0)
        offset = counted[:s].sum() + 0.5 * own - 0.5 * counted.sum()
        for law in model.group_laws:
            before = model.cycles_before(law)
            since = day if isinstance(law, BallastLaw) else day + ground_days
            gone = model.cycles_per_passage * (counted.sum() * since + offset)
            rows.append(np.maximum(before + gone, before))
    return np.stack(rows)


def counted_with(case: Case, service: int) -> np.ndarray:
    """Which services [S] advance the count N that ``service`` meets: all, or those of its train."""
    trains = [s.train for s in case.timetable.services]
    shared = case.model.cycles == "shared"
    return np.array([shared or train == trains[service] for train in trains])


def daily_weights(case: Case, day: np.ndarray, ground_days: np.ndarray | float = 0.0) -> np.ndarray:
    """Growth of the cycle functions per day, [R, E], of each service's groups at ``day`` [R].

    Includes ``settlement_factor``; multiplies a form summed over the axles of one train.
    """
    model = case.model
    laws = model.group_laws * len(case.timetable.services)
    daily = np.repeat([s.per_day for s in case.timetable.services], len(model.group_laws))
    cycles = cycles_at(case, day, ground_days)
    rates = [cycle_rate(law, n) * d for law, n, d in zip(laws, cycles, daily, strict=True)]
    return np.stack(rates, axis=1) * (model.settlement_factor * model.cycles_per_passage)


@dataclass(frozen=True)
class DayPlan:
    """One day of updates: ``load`` [N] form index, ``service`` [N], ``axles`` [N] passages each."""

    load: np.ndarray
    service: np.ndarray
    axles: np.ndarray

    def passages(self, updates: np.ndarray) -> np.ndarray:
        """Axle passages within the first ``updates`` updates."""
        days, rest = np.divmod(updates, len(self.load))
        within = np.concatenate([[0], np.cumsum(self.axles)])
        return (days * within[-1] + within[rest]).astype(np.int64)


def day_plan(case: Case, by_train: bool) -> DayPlan:
    """Order the updates of one day: every axle, or every train, in timetable order."""
    load, service, axles, first = [], [], [], 0
    for s, item in enumerate(case.timetable.services):
        own = 1 if by_train else item.train.n_axles
        load.append(np.tile(np.arange(first, first + own), item.per_day))
        service.append(np.full(own * item.per_day, s))
        axles.append(np.full(own * item.per_day, item.train.n_axles // own))
        first += own
    return DayPlan(*(np.concatenate(part) for part in (load, service, axles)))


def update_weights(
    case: Case, plan: DayPlan, done: int, count: int
) -> tuple[np.ndarray, np.ndarray]:
    """Form index [count] and cycle growth [count, G] of the updates ``done`` … ``done + count``."""
    model = case.model
    index = np.arange(done, done + count)
    day, within = np.divmod(index, len(plan.load))
    service, axles = plan.service[within], plan.axles[within]
    before = np.zeros(count)
    for s in np.unique(service):
        counted = np.where(counted_with(case, s)[plan.service], plan.axles, 0)
        start = np.concatenate([[0], np.cumsum(counted)])
        before = np.where(service == s, day * start[-1] + start[within], before)
    weights = np.empty((count, len(model.group_laws)))
    for g, law in enumerate(model.group_laws):
        cycles = model.cycles_before(law) + model.cycles_per_passage * before
        grown = cycle_increment(law, cycles, model.cycles_per_passage * axles)
        weights[:, g] = model.settlement_factor * grown / axles
    return plan.load[within].astype(np.int32), weights
