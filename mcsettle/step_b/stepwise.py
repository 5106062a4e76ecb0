"""March through the timetable: one update per axle passage, or one per train."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mcsettle.step_b.case import ALIKE, Case, Outcome, Support
from mcsettle.step_b.cycles import DayPlan, day_plan, update_weights
from mcsettle.step_b.mode_pairs import ModePairs
from mcsettle.step_b.pointwise import PointwiseLoad, joined, load_parts, pointwise_load
from mcsettle.step_b.pointwise import tables as pointwise_tables
from mcsettle.step_b.sd_map import Roughness, roughness
from mcsettle.step_b.spectral import (
    SettlementForm,
    axle_form,
    march_tables,
    train_form,
)
from mcsettle.step_b.susceptibility import real_pairs

if TYPE_CHECKING:
    from mcsettle.kernels import lanes


@dataclass(frozen=True)
class Loads:
    """The updates of one day and the forms they apply: A loads, G groups.

    ``form`` [A, G, K + P + M, 2], ``constant`` [A, G] and ``mean`` [A, G, K] as the kernel takes them;
    ``precision`` of the arithmetic, "f64" or "f32" (the state is f64 in both). ``multipliers`` [F, G]
    of the fields of susceptibility, ``following`` [K] of the rail.
    """

    plan: DayPlan
    pairs: ModePairs
    form: np.ndarray
    constant: np.ndarray
    mean: np.ndarray
    precision: str
    multipliers: np.ndarray
    following: np.ndarray

    def begin(
        self, amplitudes: np.ndarray, power_limit: float, support: Support = ALIKE
    ) -> "lanes.March":
        """Realisations [R, K] ready to march."""
        from mcsettle.kernels.lanes import March

        waves = None if support.fields is None else real_pairs(support.fields)
        return March(
            amplitudes, power_limit, march_tables(self.pairs), self.pairs.first,
            self.constant.shape[1], self.precision, support.factor, self.following, waves,
            self.multipliers,
        )  # fmt: skip

    @property
    def coefficients(self) -> tuple[np.ndarray, ...]:
        """What ``March.advance`` takes beside the updates."""
        return self.form, self.constant, self.mean


@dataclass(frozen=True)
class MarchState:
    """A march between two launches: enough to go on from, to the last bit.

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
    following: np.ndarray
    precision: str = "f64"
    coefficients: tuple[np.ndarray, ...] = ()

    def begin(
        self, amplitudes: np.ndarray, power_limit: float, support: Support = ALIKE
    ) -> "lanes.March":
        """Realisations [R, K] ready to march."""
        from mcsettle.kernels.lanes import PointwiseMarch

        n_groups, fields = self.load.constant.shape[1], support.fields
        factors = None if fields is None else self.load.strain_factors(fields)
        return PointwiseMarch(
            amplitudes, power_limit, pointwise_tables(self.load), self.load.first_mode, n_groups,
            self.precision, support.factor, self.following, factors,
        )  # fmt: skip


def day_loads(case: Case, pairs: ModePairs, by_train: bool, precision: str = "f64") -> Loads:
    """Fold the coefficients of every axle of every service, or of every train."""
    forms = _forms(case, pairs, by_train)
    form = np.stack([f.packed(pairs.terms.order) for f in forms])
    constant, mean = (np.stack([getattr(f, name) for f in forms]) for name in ("constant", "mean"))
    return Loads(
        day_plan(case, by_train), pairs, form, constant, mean, precision,
        case.group_multipliers, case.rail_follows,
    )  # fmt: skip


def pointwise_day_loads(case: Case, precision: str = "f64") -> PointwiseLoads:
    """Lay out every axle of every service for the pointwise kernel."""
    parts = load_parts(case.group_multipliers)
    loads = [
        pointwise_load(transfer, case.model, case.window, parts=parts)
        for transfer in case.transfers
    ]
    return PointwiseLoads(
        day_plan(case, by_train=False), joined(loads), case.rail_follows, precision
    )


class March:
    """Realisations on their way through the timetable: iterate to advance them, then take the outcome.

    Parameters
    ----------
    case : Case
    loads : Loads or PointwiseLoads, what the updates of a day apply
    amplitudes : complex [R, K], initial profile amplitudes, m
    sample_days : [H] rising days at which the SD is recorded
    begun : MarchState of the same march, to go on from
    support : Support, where it varies along the track or from section to section
    """

    def __init__(
        self,
        case: Case,
        loads: Loads | PointwiseLoads,
        measure: Roughness,
        amplitudes: np.ndarray,
        sample_days: np.ndarray,
        begun: MarchState | None = None,
        support: Support = ALIKE,
    ) -> None:
        self.case, self.loads, self.measure, self.initial = case, loads, measure, amplitudes
        self.per_day = len(loads.plan.load)
        self.sample_at = np.rint(np.asarray(sample_days) * self.per_day).astype(np.int64)
        self.lanes = loads.begin(amplitudes, 2.0 * case.sd_limit**2, support)
        self.history = np.full((len(amplitudes), len(sample_days)), np.nan)
        self.done = 0
        if begun is not None:
            self.lanes.restore(begun.amplitudes, begun.active, begun.updates, begun.uniform)
            self.history[:], self.done = begun.history, begun.done

    def __iter__(self) -> Iterator[float]:
        """Advance launch by launch to the limit or the horizon; yields the day reached."""
        last = int(np.floor(self.case.horizon * self.per_day))
        stops = np.union1d(self.sample_at[self.sample_at < last], [last])
        for stop in stops[stops >= self.done]:
            while self.done < stop and self.lanes.any_active():
                self._advance(int(min(stop - self.done, self.lanes.burst_size())))
                yield self.done / self.per_day
            self._record(stop)

    def state(self) -> MarchState:
        """The march as it stands."""
        lanes = self.lanes
        return MarchState(
            self.done,
            lanes.amplitudes(),
            lanes.is_active(),
            lanes.updates(),
            lanes.uniform(),
            self.history.copy(),
        )

    def outcome(self) -> Outcome:
        """What became of the realisations, once the march is over."""
        updates, final = self.lanes.updates(), self.lanes.amplitudes()
        sd_final = self.measure.sd(final)
        failed = ~np.isfinite(sd_final)
        reached = ~self.lanes.is_active() & ~failed
        return Outcome(
            reached=reached,
            failed=failed,
            days=np.where(reached, updates / self.per_day, np.nan),
            passages=self.loads.plan.passages(updates),
            sd_initial=self.measure.sd(self.initial),
            sd_final=sd_final,
            mean_settlement=self.lanes.uniform(),
            amplitudes=final,
            history=self.history,
            steps=updates,
        )

    def _advance(self, count: int) -> None:
        updates = update_weights(self.case, self.loads.plan, self.done, count)
        self.lanes.advance(*updates, *self.loads.coefficients)
        self.done += count

    def _record(self, stop: int) -> None:
        """The SD of what is below the limit, where ``stop`` is a day to record."""
        alive, at = self.lanes.is_active(), np.flatnonzero(self.sample_at == stop)
        self.history[np.ix_(alive, at)] = self.measure.sd(self.lanes.amplitudes()[alive])[:, None]


class Stepwise:
    """One case ready to be updated passage by passage, or train by train.

    Parameters
    ----------
    case : Case
    stepping : "every_axle", or "every_train" (spectral only)
    right_hand_side : "spectral", the second-order form, or "pointwise", every x and depth
    precision : of the arithmetic, "f64" or "f32"; the state is in double precision always
    """

    def __init__(
        self,
        case: Case,
        stepping: str = "every_axle",
        right_hand_side: str = "spectral",
        precision: str = "f64",
    ) -> None:
        from mcsettle.kernels import runtime

        runtime.start()
        if case.is_split:
            raise ValueError("services that only count or only settle take stepping 'cycle_jump'")
        self.case, self.measure = case, roughness(case.wavenumbers, case.window)
        if self.measure.basis is not None:
            raise ValueError(
                "updating passage by passage takes a window below 400 m; use stepping 'cycle_jump'"
            )
        self.loads: Loads | PointwiseLoads
        if right_hand_side == "spectral":
            self.loads = day_loads(case, case.mode_pairs, stepping == "every_train", precision)
        elif stepping == "every_axle":
            self.loads = pointwise_day_loads(case, precision)
        else:
            raise ValueError(
                "updating train by train takes the spectral right-hand side; "
                "use stepping 'every_axle' or 'cycle_jump'"
            )

    def march(
        self,
        amplitudes: np.ndarray,
        sample_days: np.ndarray,
        begun: MarchState | None = None,
        support: Support = ALIKE,
    ) -> March:
        """The march of realisations [R, K], to be iterated over."""
        return March(self.case, self.loads, self.measure, amplitudes, sample_days, begun, support)

    def run(
        self, amplitudes: np.ndarray, sample_days: np.ndarray, support: Support = ALIKE
    ) -> Outcome:
        """March realisations [R, K] to the limit or the horizon."""
        march = self.march(amplitudes, sample_days, support=support)
        for _ in march:
            pass
        return march.outcome()


def _forms(case: Case, pairs: ModePairs, by_train: bool) -> list[SettlementForm]:
    if by_train:
        return [train_form(transfer, case.model, pairs) for transfer in case.transfers]
    return [
        axle_form(transfer, axle, case.model, pairs)
        for transfer in case.transfers
        for axle in range(len(transfer.quasi_static))
    ]
