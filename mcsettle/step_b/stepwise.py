"""March through the timetable: one update per axle passage, or one per train."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mcsettle.step_b.case import Case, Outcome
from mcsettle.step_b.cycles import DayPlan, day_plan, update_weights
from mcsettle.step_b.pointwise import PointwiseLoad, joined, pointwise_load
from mcsettle.step_b.pointwise import tables as pointwise_tables
from mcsettle.step_b.sd_map import Roughness
from mcsettle.step_b.spectral import ModePairs, SettlementForm, axle_form, tables, train_form

if TYPE_CHECKING:
    from mcsettle.kernels.lanes import March


@dataclass(frozen=True)
class Loads:
    """The updates of one day and the forms they apply: A loads, G groups.

    ``form`` [A, G, K + P + M, 2], ``constant`` [A, G] and ``mean`` [A, G, K] as the kernel takes them;
    ``precision`` of the arithmetic, "f64" or "f32" (the state is f64 in both).
    """

    plan: DayPlan
    pairs: ModePairs
    form: np.ndarray
    constant: np.ndarray
    mean: np.ndarray
    precision: str = "f64"

    def begin(self, amplitudes: np.ndarray, power_limit: float) -> "March":
        """Realisations [R, K] ready to march."""
        from mcsettle.kernels.lanes import March

        n_groups = self.constant.shape[1]
        return March(amplitudes, power_limit, tables(self.pairs), n_groups, self.precision)

    @property
    def coefficients(self) -> tuple[np.ndarray, ...]:
        """What ``March.advance`` takes beside the updates."""
        return self.form, self.constant, self.mean


@dataclass(frozen=True)
class Marching:
    """A march between two launches, enough to go on from to the last bit.

    ``done`` updates of the timetable; of R realisations ``amplitudes`` complex [R, K] m, ``active`` [R]
    below the limit, ``updates`` [R] applied, ``uniform`` [R] settlement, m, ``history`` [R, H] m.
    """

    done: int
    amplitudes: np.ndarray
    active: np.ndarray
    updates: np.ndarray
    uniform: np.ndarray
    history: np.ndarray


@dataclass(frozen=True)
class PointwiseLoads:
    """The axles of one day, at every x and depth."""

    plan: DayPlan
    load: PointwiseLoad
    precision: str = "f64"
    coefficients: tuple[np.ndarray, ...] = ()

    def begin(self, amplitudes: np.ndarray, power_limit: float) -> "March":
        """Realisations [R, K] ready to march."""
        from mcsettle.kernels.lanes import PointwiseMarch

        n_groups = self.load.constant.shape[1]
        laid_out = pointwise_tables(self.load)
        return PointwiseMarch(amplitudes, power_limit, laid_out, n_groups, self.precision)


def day_loads(case: Case, pairs: ModePairs, by_train: bool, precision: str = "f64") -> Loads:
    """Fold the coefficients of every axle of every service, or of every train."""
    forms = _forms(case, pairs, by_train)
    form = np.stack([f.packed() for f in forms])
    constant, mean = (np.stack([getattr(f, name) for f in forms]) for name in ("constant", "mean"))
    return Loads(day_plan(case, by_train), pairs, form, constant, mean, precision)


def pointwise_day_loads(case: Case, precision: str = "f64") -> PointwiseLoads:
    """Lay out every axle of every service for the pointwise kernel."""
    loads = [pointwise_load(transfer, case.model, case.window) for transfer in case.transfers]
    return PointwiseLoads(day_plan(case, by_train=False), joined(loads), precision)


def march(
    case: Case,
    amplitudes: np.ndarray,
    sample_days: np.ndarray,
    loads: Loads | PointwiseLoads,
    measure: Roughness,
    tick: Callable[[float], None] | None = None,
    begun: Marching | None = None,
    keep: Callable[[Callable[[], Marching]], None] | None = None,
) -> Outcome:
    """Run realisations [R, K] to the limit or the horizon (arguments: ``Engine.run``).

    ``keep`` is called after every launch with a function that gives the march as it stands; from such
    a march, ``begun``, the same call goes on.
    """
    plan = loads.plan
    state = loads.begin(amplitudes, 2.0 * case.sd_limit**2)
    history = np.full((len(amplitudes), len(sample_days)), np.nan)
    last = int(np.floor(case.horizon * len(plan.load)))
    sample_at = np.rint(sample_days * len(plan.load)).astype(np.int64)
    done = 0
    if begun is not None:
        state.restore(begun.amplitudes, begun.active, begun.updates, begun.uniform)
        history[:], done = begun.history, begun.done
    stops = np.union1d(sample_at[sample_at < last], [last])
    for stop in stops[stops >= done]:
        while done < stop and state.any_active():
            count = int(min(stop - done, state.burst_size()))
            updates = update_weights(case, plan, done, count)
            state.advance(*updates, *loads.coefficients)
            done += count
            if tick is not None:
                tick(done / len(plan.load))
            if keep is not None:
                keep(lambda: _marching(state, done, history))  # noqa: B023 (called at once)
        alive, at = state.is_active(), np.flatnonzero(sample_at == stop)
        history[np.ix_(alive, at)] = measure.sd(state.amplitudes()[alive])[:, None]
    return _outcome(case, plan, state, amplitudes, history, measure)


def _marching(state: "March", done: int, history: np.ndarray) -> Marching:
    return Marching(
        done,
        state.amplitudes(),
        state.is_active(),
        state.updates(),
        state.uniform(),
        history.copy(),
    )


def _outcome(
    case: Case,
    plan: DayPlan,
    state: "March",
    initial: np.ndarray,
    history: np.ndarray,
    measure: Roughness,
) -> Outcome:
    updates, final = state.updates(), state.amplitudes()
    sd_final = measure.sd(final)
    failed = ~np.isfinite(sd_final)
    reached = ~state.is_active() & ~failed
    return Outcome(
        reached=reached,
        failed=failed,
        days=np.where(reached, updates / len(plan.load), np.nan),
        passages=plan.passages(updates),
        sd_initial=measure.sd(initial),
        sd_final=sd_final,
        mean_settlement=state.uniform(),
        amplitudes=final,
        history=history,
        steps=updates,
    )


def _forms(case: Case, pairs: ModePairs, by_train: bool) -> list[SettlementForm]:
    if by_train:
        return [train_form(transfer, case.model, pairs) for transfer in case.transfers]
    return [
        axle_form(transfer, axle, case.model, pairs)
        for transfer in case.transfers
        for axle in range(len(transfer.quasi_static))
    ]
