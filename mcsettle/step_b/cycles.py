"""The clock of Step B: which cycles N each passage meets, by day and by update."""

from dataclasses import dataclass

import numpy as np

from mcsettle.railway.track import BallastLaw
from mcsettle.step_b.case import Case
from mcsettle.step_b.settlement import cycle_increment, cycle_rate, long_run_rate


def cycles_at(case: Case, day: np.ndarray, ground_days: np.ndarray | float = 0.0) -> np.ndarray:
    """Cycles N [E, …] of each service's groups at fractional ``day``, day-averaged.

    ``ground_days``: days of this traffic that all but the ballast have had before day 0, since a
    tamping renews the ballast's count alone.

    A service meets the N of the middle of its block in the day: its offset from the middle of the day's
    count keeps the order of the timetable to second order in a day's share of N. Where services only
    count or only settle, all meet the middle of the day.
    """
    model, day = case.model, np.asarray(day, dtype=float)
    daily = daily_counts(case)
    rows = []
    for s in range(len(daily)):
        for g, law in enumerate(model.group_laws):
            axles = daily[:, g]
            counted = np.where(counted_with(case, s), axles, 0.0)
            offset = counted[:s].sum() + 0.5 * axles[s] - 0.5 * counted.sum()
            if case.is_split:
                offset = 0.0
            before = model.cycles_before(law)
            since = day if isinstance(law, BallastLaw) else day + ground_days
            gone = model.cycles_per_passage * (counted.sum() * since + offset)
            rows.append(np.maximum(before + gone, before))
    return np.stack(rows)


def daily_counts(case: Case) -> np.ndarray:
    """Axles [S, G] that each service adds to the count of each group in a day."""
    services = case.timetable.services
    daily = np.stack([s.per_day * _severity(case, i).sum(axis=0) for i, s in enumerate(services)])
    return daily if case.counted is None else np.where(np.array(case.counted)[:, None], daily, 0.0)


def counted_with(case: Case, service: int) -> np.ndarray:
    """Which services [S] advance the count N that ``service`` meets: all, or those of its train."""
    trains = [s.train for s in case.timetable.services]
    shared = case.model.cycles != "per_vehicle"
    return np.array([shared or train == trains[service] for train in trains])


def daily_weights(case: Case, day: np.ndarray, ground_days: np.ndarray | float = 0.0) -> np.ndarray:
    """Growth of the cycle functions per day, [R, E], of each service's groups at ``day`` [R].

    Includes ``settlement_factor``; multiplies a form summed over the axles of one train.
    """
    model = case.model
    laws = model.group_laws * len(case.timetable.services)
    trains = [s.per_day for s in case.timetable.services]
    if case.settling is not None:
        trains = [n if settles else 0 for n, settles in zip(trains, case.settling, strict=True)]
    daily = np.repeat(trains, len(model.group_laws))
    cycles = cycles_at(case, day, ground_days)
    rates = [
        cycle_rate(law, n, long_run_rate(law, model)) * d
        for law, n, d in zip(laws, cycles, daily, strict=True)
    ]
    return np.stack(rates, axis=1) * (model.settlement_factor * model.cycles_per_passage)


@dataclass(frozen=True)
class DayPlan:
    """One day of updates: ``load`` [N] form index, ``service`` [N], ``axles`` [N] passages each.

    ``counts`` [N, G]: what each adds to the count of each settlement group, in axles.
    """

    load: np.ndarray
    service: np.ndarray
    axles: np.ndarray
    counts: np.ndarray

    def passages(self, updates: np.ndarray) -> np.ndarray:
        """Axle passages within the first ``updates`` updates."""
        days, rest = np.divmod(updates, len(self.load))
        within = np.concatenate([[0], np.cumsum(self.axles)])
        return (days * within[-1] + within[rest]).astype(np.int64)


def day_plan(case: Case, by_train: bool) -> DayPlan:
    """Order the updates of one day: every axle, or every train, in timetable order."""
    load, service, axles, counts, first = [], [], [], [], 0
    for s, item in enumerate(case.timetable.services):
        own = 1 if by_train else item.train.n_axles
        load.append(np.tile(np.arange(first, first + own), item.per_day))
        service.append(np.full(own * item.per_day, s))
        axles.append(np.full(own * item.per_day, item.train.n_axles // own))
        severity = _severity(case, s)
        one = severity.sum(axis=0, keepdims=True) if by_train else severity
        counts.append(np.tile(one, (item.per_day, 1)))
        first += own
    return DayPlan(*(np.concatenate(part) for part in (load, service, axles, counts)))


def _severity(case: Case, service: int) -> np.ndarray:
    """What each axle [J, G] of a service counts in each settlement group."""
    if case.severity is not None:
        return case.severity[service]
    shape = case.timetable.services[service].train.n_axles, len(case.model.group_laws)
    return np.ones(shape)


def update_weights(
    case: Case, plan: DayPlan, done: int, count: int
) -> tuple[np.ndarray, np.ndarray]:
    """Form index [count] and cycle growth [count, G] of the updates ``done`` … ``done + count``."""
    model = case.model
    index = np.arange(done, done + count)
    day, within = np.divmod(index, len(plan.load))
    service, counts = plan.service[within], plan.counts
    before = np.zeros((count, counts.shape[1]))
    for s in np.unique(service):
        counted = np.where(counted_with(case, s)[plan.service][:, None], counts, 0)
        start = np.concatenate([np.zeros_like(counted[:1]), np.cumsum(counted, axis=0)])
        met = day[:, None] * start[-1] + start[within]
        before = np.where((service == s)[:, None], met, before)
    weights = np.empty((count, len(model.group_laws)))
    for g, law in enumerate(model.group_laws):
        cycles = model.cycles_before(law) + model.cycles_per_passage * before[:, g]
        own = counts[within, g]
        grown = cycle_increment(
            law, cycles, model.cycles_per_passage * own, long_run_rate(law, model)
        )
        weights[:, g] = model.settlement_factor * grown / own
    return plan.load[within].astype(np.int32), weights
