"""The clock of Step B: which cycles N each passage meets, by day and by update."""

from dataclasses import dataclass

import numpy as np

from mcsettle.railway.settlement_model import SettlementModel
from mcsettle.railway.track import BallastLaw, Law
from mcsettle.step_b.case import Case
from mcsettle.step_b.settlement import cycle_increment, cycle_rate, long_run_rate


@dataclass(frozen=True, eq=False)
class Clock:
    """Cycles N of the groups of every service of a case, E of both, by the day.

    ``before`` [E] cycles at day 0; ``counted`` [E] axles a day that advance them; ``offset`` [E] axles to
    add, for the order of the day; ``renewed`` [E] whether a tamping renews the count (the ballast's);
    ``trains`` [E] a day that settle the track; ``laws``: each with the groups [E] that it governs.
    """

    model: SettlementModel
    before: np.ndarray
    counted: np.ndarray
    offset: np.ndarray
    renewed: np.ndarray
    trains: np.ndarray
    laws: tuple[tuple[Law, np.ndarray], ...]

    def cycles(
        self,
        day: np.ndarray,
        ground_days: np.ndarray | float = 0.0,
        ballast_days: np.ndarray | float = 0.0,
    ) -> np.ndarray:
        """Cycles N [E, …] at fractional ``day``, day-averaged (``cycles_at``)."""
        day = np.asarray(day, dtype=float)
        column = (slice(None), *(None,) * day.ndim)
        since = np.where(self.renewed[column], day + ballast_days, day + ground_days)
        gone = self.counted[column] * since + self.offset[column]
        before = self.before[column]
        return np.maximum(before + self.model.cycles_per_passage * gone, before)

    def daily_weights(
        self,
        day: np.ndarray,
        ground_days: np.ndarray | float = 0.0,
        ballast_days: np.ndarray | float = 0.0,
    ) -> np.ndarray:
        """Growth of the cycle functions per day [R, E] at ``day`` [R] (the function of this name)."""
        model, cycles = self.model, self.cycles(day, ground_days, ballast_days)
        rates = np.empty_like(cycles)
        for law, of_law in self.laws:
            rate = cycle_rate(law, cycles[of_law], long_run_rate(law, model))
            rates[of_law] = rate * self.trains[of_law, None]
        return np.ascontiguousarray(rates.T) * (model.settlement_factor * model.cycles_per_passage)


def clock_of(case: Case) -> Clock:
    """The clock of a case.

    A service meets the N of the middle of its block in the day: its offset from the middle of the day's
    count keeps the order of the timetable to second order in a day's share of N. Where services only
    count or only settle, all meet the middle of the day.
    """
    model, services = case.model, case.timetable.services
    daily, laws = daily_counts(case), model.group_laws
    trains = [s.per_day for s in services]
    if case.settling is not None:
        trains = [n if settles else 0 for n, settles in zip(trains, case.settling, strict=True)]
    total, offset = np.empty(daily.shape), np.zeros(daily.shape)
    for s in range(len(daily)):
        counted = np.where(counted_with(case, s)[:, None], daily, 0.0)
        total[s] = counted.sum(axis=0)
        if not case.is_split:
            offset[s] = counted[:s].sum(axis=0) + 0.5 * daily[s] - 0.5 * total[s]
    n, every = len(services), laws * len(services)
    return Clock(
        model=model,
        before=np.tile([float(model.cycles_before(law)) for law in laws], n),
        counted=total.ravel(),
        offset=offset.ravel(),
        renewed=np.tile([isinstance(law, BallastLaw) for law in laws], n),
        trains=np.repeat(trains, len(laws)),
        laws=tuple((law, np.array([e == law for e in every])) for law in dict.fromkeys(laws)),
    )


def cycles_at(
    case: Case,
    day: np.ndarray,
    ground_days: np.ndarray | float = 0.0,
    ballast_days: np.ndarray | float = 0.0,
) -> np.ndarray:
    """Cycles N [E, …] of each service's groups at fractional ``day``, day-averaged.

    ``ground_days``, ``ballast_days``: days of this traffic before day 0, of all but the ballast and of
    the ballast, whose count alone a tamping renews.
    """
    return clock_of(case).cycles(day, ground_days, ballast_days)


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


def daily_weights(
    case: Case,
    day: np.ndarray,
    ground_days: np.ndarray | float = 0.0,
    ballast_days: np.ndarray | float = 0.0,
) -> np.ndarray:
    """Growth of the cycle functions per day, [R, E], of each service's groups at ``day`` [R].

    Includes ``settlement_factor``; multiplies a form summed over the axles of one train.
    """
    return clock_of(case).daily_weights(day, ground_days, ballast_days)


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
