"""Step B for thousands of realisations: advance the profiles until they reach the SD limit.

Three steppings of one right-hand side: "every_axle" updates the profile after each axle passage, in
timetable order; "every_train" freezes it over each train; "cycle_jump" integrates the same growth over
many days at once, the cycle functions exactly and only the feedback of the profile approximated, with
an error estimate and a step of its own for each realisation. The clock counts axle passages; a day is
the timetable's.

Depends on: passage, roughness, settlement, spectral, stepping, traffic, transfer, mcsettle.kernels.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from mcsettle.passage import mode_numbers
from mcsettle.roughness import Roughness, roughness
from mcsettle.settlement import SettlementModel, cycle_increment, cycle_rate
from mcsettle.spectral import ModePairs, SettlementForm, axle_form, mode_pairs, train_form
from mcsettle.stepping import integrate
from mcsettle.traffic import Timetable
from mcsettle.transfer import TransferFunctions

STEPPINGS = ("cycle_jump", "every_axle", "every_train")
TOLERANCE = 1e-8


@dataclass(frozen=True)
class Case:
    """One scenario as the engine sees it, SI but for days.

    ``transfers``: one per service of the timetable. ``window`` m, ``sd_limit`` m, ``horizon`` days.
    """

    timetable: Timetable
    transfers: tuple[TransferFunctions, ...]
    model: SettlementModel
    window: float
    sd_limit: float
    horizon: float

    def __post_init__(self) -> None:
        if len(self.transfers) != len(self.timetable.services):
            raise ValueError("a case needs one set of transfer functions per service")


@dataclass(frozen=True)
class Outcome:
    """What became of R realisations; NaN days where the limit was not reached.

    ``days`` [R] fractional days to the limit; ``passages`` [R] axle passages simulated; ``sd_initial``
    and ``sd_final`` [R] m; ``amplitudes`` complex [R, K] m at the end; ``mean_settlement`` [R] m;
    ``history`` [R, H] m at the sample days (NaN after the stop); ``reached``, ``failed`` [R];
    ``steps`` [R] integration steps (cycle jump) or updates.
    """

    reached: np.ndarray
    failed: np.ndarray
    days: np.ndarray
    passages: np.ndarray
    sd_initial: np.ndarray
    sd_final: np.ndarray
    mean_settlement: np.ndarray
    amplitudes: np.ndarray
    history: np.ndarray
    steps: np.ndarray


def run(
    case: Case,
    amplitudes: np.ndarray,
    sample_days: np.ndarray,
    stepping: str = "cycle_jump",
    threads: int | None = None,
    tolerance: float = TOLERANCE,
    factor: np.ndarray | None = None,
    tick: Callable[[float], None] | None = None,
) -> Outcome:
    """Run realisations with initial amplitudes complex [R, K] until limit or horizon.

    Parameters
    ----------
    case : Case
    amplitudes : complex [R, K], m
    sample_days : [H] rising days at which the SD is recorded
    stepping : one of ``STEPPINGS``
    threads : Taichi threads (None: all)
    tolerance : of the cycle jump, relative per step
    factor : [R] multiplies ``settlement_factor`` (cycle jump only), default 1
    tick : called with the day reached, for progress

    Returns
    -------
    Outcome
    """
    if stepping not in STEPPINGS:
        raise ValueError(f"stepping is '{stepping}'; choose one of {STEPPINGS}")
    from mcsettle.kernels import runtime

    runtime.start(threads)
    modes = mode_numbers(case.transfers[0].wavenumbers, case.window)
    pairs = mode_pairs(modes)
    measure = roughness(case.transfers[0].wavenumbers, case.window)
    if stepping == "cycle_jump":
        return _cycle_jump(case, amplitudes, sample_days, pairs, measure, tolerance, factor)
    if measure.basis is not None or factor is not None:
        raise ValueError("every_axle and every_train need a window below 400 m and one factor")
    by_train = stepping == "every_train"
    return _march(case, amplitudes, sample_days, pairs, measure, by_train, tick)


def cycles_at(case: Case, day: np.ndarray) -> np.ndarray:
    """Cycles N [E, …] of each service's groups at fractional ``day``, day-averaged.

    With one shared count, a service meets the N of the middle of its block in the day: its offset from
    the middle of the day keeps the order of the timetable to second order in a day's share of N.
    """
    model, day = case.model, np.asarray(day, dtype=float)
    axles = np.array([s.per_day * s.train.n_axles for s in case.timetable.services], dtype=float)
    middle = np.cumsum(axles) - 0.5 * axles
    rows = []
    for s, own in enumerate(axles):
        shared = model.cycles == "shared"
        daily = axles.sum() if shared else own
        offset = middle[s] - 0.5 * axles.sum() if shared else 0.0
        for law in model.group_laws:
            before = model.cycles_before(law)
            gone = model.cycles_per_passage * (daily * day + offset)
            rows.append(np.maximum(before + gone, before))
    return np.stack(rows)


class _Rate:
    """Growth of the state per unit of s = log(1 + day/scale), evaluated by the spectral kernel."""

    def __init__(self, case: Case, pairs: ModePairs, factor: np.ndarray, scale: float) -> None:
        self.case, self.pairs, self.factor, self.scale = case, pairs, factor, scale
        forms = [train_form(transfer, case.model, pairs) for transfer in case.transfers]
        self.form = SettlementForm(*(np.concatenate(c) for c in zip(*map(_parts, forms), strict=True)))
        self.packed = self.form.packed()

    def __call__(self, time: np.ndarray, state: np.ndarray, rows: np.ndarray) -> np.ndarray:
        day = self.scale * np.expm1(time)
        weights = self.weights(day) * (self.factor[rows] * (day + self.scale))[:, None]
        return evaluate(self.form, self.packed, state, weights, self.pairs)

    def weights(self, day: np.ndarray) -> np.ndarray:
        """Cycle growth per day of each service's groups, [R, E]."""
        case, model = self.case, self.case.model
        cycles = cycles_at(case, day)
        laws = model.group_laws * len(case.timetable.services)
        daily = np.repeat([s.per_day for s in case.timetable.services], len(model.group_laws))
        rates = [cycle_rate(law, n) * d for law, n, d in zip(laws, cycles, daily, strict=True)]
        return np.stack(rates, axis=1) * (model.settlement_factor * model.cycles_per_passage)


def evaluate(
    form: SettlementForm,
    packed: np.ndarray,
    state: np.ndarray,
    weights: np.ndarray,
    pairs: ModePairs,
) -> np.ndarray:
    """Growth of states complex [R, K + 1] (last column: uniform settlement) by the Taichi kernel."""
    from mcsettle.kernels import spectral

    n, n_modes = state.shape[0], state.shape[1] - 1
    u = np.ascontiguousarray(state[:, :-1]).view(float).reshape(n, n_modes, 2)
    growth, uniform = np.empty_like(u), np.empty(n)
    spectral.evaluate_rates(
        u, np.ascontiguousarray(weights), packed, form.constant, form.mean, _tables(pairs), growth, uniform
    )
    out = np.empty(state.shape, dtype=complex)
    out[:, :-1] = growth.view(complex)[..., 0]
    out[:, -1] = uniform
    return out


def _cycle_jump(
    case: Case,
    amplitudes: np.ndarray,
    sample_days: np.ndarray,
    pairs: ModePairs,
    measure: Roughness,
    tolerance: float,
    factor: np.ndarray | None,
) -> Outcome:
    model = case.model
    before = min(model.cycles_before(law) for law in model.group_laws)
    scale = before / (model.cycles_per_passage * case.timetable.passages_per_day)
    factors = np.ones(len(amplitudes)) if factor is None else np.asarray(factor, dtype=float)
    rate = _Rate(case, pairs, factors, scale)
    state = np.concatenate([amplitudes, np.zeros((len(amplitudes), 1))], axis=1).astype(complex)
    path = integrate(
        rate, state, float(np.log1p(case.horizon / scale)), case.sd_limit, measure,
        np.log1p(sample_days / scale), tolerance,
    )  # fmt: skip
    day = scale * np.expm1(path.time)
    return Outcome(
        reached=path.reached,
        failed=path.failed,
        days=np.where(path.reached, day, np.nan),
        passages=np.rint(day * case.timetable.passages_per_day).astype(np.int64),
        sd_initial=measure.sd(amplitudes),
        sd_final=measure.sd(path.state[:, :-1]),
        mean_settlement=path.state[:, -1].real,
        amplitudes=path.state[:, :-1],
        history=path.sd,
        steps=path.steps,
    )


def _march(
    case: Case,
    amplitudes: np.ndarray,
    sample_days: np.ndarray,
    pairs: ModePairs,
    measure: Roughness,
    by_train: bool,
    tick: Callable[[float], None] | None,
) -> Outcome:
    """Update after every axle, or after every train, in timetable order."""
    from mcsettle.kernels import spectral

    plan = _day_plan(case, by_train)
    forms = _forms(case, pairs, by_train)
    packed = np.stack([form.packed() for form in forms])
    constant = np.stack([form.constant for form in forms])
    mean = np.stack([form.mean for form in forms])
    state = spectral.March(amplitudes, 2.0 * case.sd_limit**2, _tables(pairs), packed.shape[1])
    history = np.full((len(amplitudes), len(sample_days)), np.nan)
    limit = int(np.floor(case.horizon * len(plan.load)))
    stops = np.unique(np.minimum(np.rint(sample_days * len(plan.load)), limit)).astype(np.int64)
    stops = np.union1d(stops, [limit])
    done = 0
    for stop in stops:
        while done < stop and state.any_active():
            count = int(min(stop - done, state.burst_size()))
            load, weights = _burst(case, plan, done, count)
            state.advance(load, weights, packed, constant, mean)
            done += count
            if tick is not None:
                tick(done / len(plan.load))
        at = np.flatnonzero(np.rint(sample_days * len(plan.load)) == stop)
        alive = state.is_active()
        history[np.ix_(alive, at)] = measure.sd(state.amplitudes()[alive])[:, None]
    updates = state.updates()
    reached = ~state.is_active()
    final = state.amplitudes()
    failed = ~np.isfinite(measure.sd(final))
    day = updates / len(plan.load)
    return Outcome(
        reached=reached & ~failed,
        failed=failed,
        days=np.where(reached & ~failed, day, np.nan),
        passages=plan.passages(updates),
        sd_initial=measure.sd(amplitudes),
        sd_final=measure.sd(final),
        mean_settlement=state.uniform(),
        amplitudes=final,
        history=history,
        steps=updates,
    )


@dataclass(frozen=True)
class _DayPlan:
    """One day of updates: ``load`` [N] form index, ``service`` [N], ``axles`` [N] passages each."""

    load: np.ndarray
    service: np.ndarray
    axles: np.ndarray

    def passages(self, updates: np.ndarray) -> np.ndarray:
        """Axle passages within the first ``updates`` updates."""
        days, rest = np.divmod(updates, len(self.load))
        within = np.concatenate([[0], np.cumsum(self.axles)])
        return (days * within[-1] + within[rest]).astype(np.int64)


def _day_plan(case: Case, by_train: bool) -> _DayPlan:
    load, service, axles, first = [], [], [], 0
    for s, item in enumerate(case.timetable.services):
        own = 1 if by_train else item.train.n_axles
        load.append(np.tile(np.arange(first, first + own), item.per_day))
        service.append(np.full(own * item.per_day, s))
        axles.append(np.full(own * item.per_day, item.train.n_axles // own))
        first += own
    return _DayPlan(*(np.concatenate(part) for part in (load, service, axles)))


def _forms(case: Case, pairs: ModePairs, by_train: bool) -> list[SettlementForm]:
    if by_train:
        return [train_form(transfer, case.model, pairs) for transfer in case.transfers]
    return [
        axle_form(transfer, axle, case.model, pairs)
        for transfer in case.transfers
        for axle in range(len(transfer.quasi_static))
    ]


def _burst(case: Case, plan: _DayPlan, done: int, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Form index [count] and cycle growth [count, G] of the updates ``done`` … ``done + count``."""
    model = case.model
    index = np.arange(done, done + count)
    day, within = np.divmod(index, len(plan.load))
    service, axles = plan.service[within], plan.axles[within]
    before = np.zeros(count)
    if model.cycles == "shared":
        start = np.concatenate([[0], np.cumsum(plan.axles)])
        before = day * start[-1] + start[within]
    else:
        for s in range(len(case.timetable.services)):
            own = np.where(plan.service == s, plan.axles, 0)
            start = np.concatenate([[0], np.cumsum(own)])
            before = np.where(service == s, day * start[-1] + start[within], before)
    weights = np.empty((count, len(model.group_laws)))
    for g, law in enumerate(model.group_laws):
        cycles = model.cycles_before(law) + model.cycles_per_passage * before
        grown = cycle_increment(law, cycles, model.cycles_per_passage * axles)
        weights[:, g] = model.settlement_factor * grown / axles
    return plan.load[within].astype(np.int32), weights


def _parts(form: SettlementForm) -> tuple[np.ndarray, ...]:
    return (form.constant, form.mean, form.linear, form.sums, form.differences)


def _tables(pairs: ModePairs) -> tuple[np.ndarray, ...]:
    return (pairs.sums, pairs.sum_start, pairs.differences, pairs.difference_start)


def batches(n: int, size: int) -> Iterator[range]:
    """Index ranges of at most ``size`` realisations covering 0 … n − 1."""
    for first in range(0, n, size):
        yield range(first, min(n, first + size))
