"""Cycle jump: many days at once, with an error estimate and a step of its own for each realisation.

The growth of the amplitudes per day is dU/d(day) = Σ_e w_e(day) F_e(U), e running over services and
settling layers, F the settlement of a whole train at a frozen profile and w the growth of the cycle
functions. It is integrated in s = log(1 + day/scale), in which it is nearly constant. The cycle
functions enter exactly; only the feedback of the profile is approximated, within the tolerance.
"""

from collections.abc import Callable, Sequence
from itertools import pairwise

import numpy as np

from mcsettle.step_a.transfer import TransferFunctions
from mcsettle.step_b.case import ALIKE, Case, Outcome, Support
from mcsettle.step_b.cycles import Clock, clock_of, daily_weights
from mcsettle.step_b.few_weights import few_weights
from mcsettle.step_b.pointwise import load_parts, pointwise_growth, pointwise_load
from mcsettle.step_b.runge_kutta import Path, integrate
from mcsettle.step_b.sd_map import Roughness, roughness
from mcsettle.step_b.spectral import SettlementForm, stacked, train_form
from mcsettle.step_b.susceptibility import VaryingForm, fast_varying_growth

# Maps amplitudes [A, K], weights [A, E] and fields [A, F, M] to the growth of both parts of the state.
Growth = Callable[[np.ndarray, np.ndarray, np.ndarray | None], tuple[np.ndarray, np.ndarray]]
# Forms of trains by the identity of their transfer functions, which stay alive beside them.
Forms = dict[int, tuple[TransferFunctions, SettlementForm]]
TOLERANCE = 1e-6


class CycleJump:
    """One case ready to be integrated over many days at a time.

    Parameters
    ----------
    case : Case
    right_hand_side : "spectral", the second-order form, or "pointwise", every x and depth
    tolerance : relative to the amplitudes, per step
    forms : second-order forms of trains under this model, to take from and to add to
    """

    def __init__(
        self,
        case: Case,
        right_hand_side: str = "spectral",
        tolerance: float = TOLERANCE,
        forms: Forms | None = None,
    ) -> None:
        from mcsettle.kernels import runtime

        runtime.start()
        self.case, self.tolerance = case, tolerance
        self.measure = roughness(case.wavenumbers, case.window)
        self.growth = (
            exact_growth(case) if right_hand_side == "pointwise" else spectral_growth(case, forms)
        )

    def run(
        self,
        amplitudes: np.ndarray,
        sample_days: np.ndarray,
        factor: np.ndarray | None = None,
        ground_days: np.ndarray | None = None,
        support: Support = ALIKE,
        ballast_days: np.ndarray | None = None,
    ) -> Outcome:
        """Run realisations until they reach the limit or the horizon.

        Parameters
        ----------
        amplitudes : complex [R, K], initial profile amplitudes, m
        sample_days : [H] rising days at which the SD is recorded
        factor : [R] multiplies ``settlement_factor``; default 1
        ground_days : [R] days of this traffic that sub-ballast and ground have had before day 0, while
            the ballast begins anew; default 0
        support : Support, where it varies along the track or from section to section
        ballast_days : [R] days of this traffic that the ballast has had before day 0; default 0

        Returns
        -------
        Outcome
        """
        case, n = self.case, len(amplitudes)
        factors = np.ones(n) if factor is None else np.asarray(factor, dtype=float)
        if support.factor is not None:
            factors = factors * support.factor
        none = np.zeros(n)
        gone = np.stack([none if d is None else d for d in (ground_days, ballast_days)], axis=1)
        samples = np.log1p(np.asarray(sample_days, dtype=float) / day_scale(case))
        path, day = self._integrated([case], amplitudes, samples, factors, gone, support)
        ordered = len(case.timetable.services) > 1 and not case.is_split
        if ordered and path.reached.any():
            at = np.flatnonzero(path.reached)
            day[at] = _in_timetable_order(
                case, self.growth, path.state[at, :-1], day[at], self.measure, gone[at], support[at]
            )
        return self._outcome(case, amplitudes, path, day)

    def run_flagged(
        self, cases: Sequence[Case], amplitudes: np.ndarray, support: Support = ALIKE
    ) -> list[Outcome]:
        """Run every realisation in each of ``cases``, which differ from this one in their flags alone.

        All are advanced together; each has the outcome, to the bit, that it has by itself.
        """
        n, k = len(amplitudes), len(cases)
        rows = np.tile(np.arange(n), k)
        factors = np.ones(n) if support.factor is None else support.factor
        path, day = self._integrated(
            cases, amplitudes[rows], np.zeros(0), factors[rows], np.zeros((n * k, 2)), support[rows]
        )
        parts = [slice(i * n, (i + 1) * n) for i in range(k)]
        return [
            self._outcome(case, amplitudes, path[part], day[part])
            for case, part in zip(cases, parts, strict=True)
        ]

    def _integrated(
        self,
        cases: Sequence[Case],
        amplitudes: np.ndarray,
        samples: np.ndarray,
        factors: np.ndarray,
        days_before: np.ndarray,
        support: Support,
    ) -> tuple[Path, np.ndarray]:
        """Where realisations stop, and on which day [R]; those of one case after those of another.

        ``days_before`` [R, 2] of ground and ballast.
        """
        clocks = [clock_of(case) for case in cases]
        of_case = np.repeat(np.arange(len(cases)), len(amplitudes) // len(cases))
        scales = [day_scale(case) for case in cases]
        scale = np.array(scales)[of_case]

        def rate(time: np.ndarray, state: np.ndarray, rows: np.ndarray) -> np.ndarray:
            day = scale[rows] * np.expm1(time)
            daily = _weights(clocks, of_case[rows], day, days_before[rows])
            weights = daily * (factors[rows] * (day + scale[rows]))[:, None]
            here = support if len(rows) == len(of_case) else support[rows]  # no copy of all fields
            change, uniform = self.growth(state[:, :-1], weights, here.fields)
            return np.concatenate([change, uniform[:, None]], axis=1)

        state = np.concatenate([amplitudes, np.zeros((len(amplitudes), 1))], axis=1)
        end = np.array([np.log1p(self.case.horizon / one) for one in scales])[of_case]
        path = integrate(
            *(rate, state.astype(complex), end, self.case.sd_limit, self.measure, samples),
            tolerance=self.tolerance,
        )
        return path, scale * np.expm1(path.time)

    def _outcome(self, case: Case, amplitudes: np.ndarray, path: Path, day: np.ndarray) -> Outcome:
        return Outcome(
            reached=path.reached,
            failed=path.failed,
            days=np.where(path.reached, day, np.nan),
            passages=np.rint(day * sum(case.daily_passages)).astype(np.int64),
            sd_initial=self.measure.sd(amplitudes),
            sd_final=self.measure.sd(path.state[:, :-1]),
            mean_settlement=path.state[:, -1].real,
            amplitudes=path.state[:, :-1],
            history=path.sd,
            steps=path.steps,
        )


def day_scale(case: Case) -> float:
    """Days in which as many cycles are added as there were before: the integration's unit of time."""
    model = case.model
    before = min(model.cycles_before(law) for law in model.group_laws)
    return before / (model.cycles_per_passage * sum(case.daily_passages))


def _weights(
    clocks: Sequence[Clock], of_case: np.ndarray, day: np.ndarray, days_before: np.ndarray
) -> np.ndarray:
    """Weights [A, E] of realisations, each by the clock of its case."""
    if len(clocks) == 1:
        return clocks[0].daily_weights(day, *days_before.T)
    ends = np.searchsorted(of_case, np.arange(len(clocks) + 1))
    return np.concatenate(
        [
            clock.daily_weights(day[a:b], *days_before[a:b].T)
            for clock, (a, b) in zip(clocks, pairwise(ends), strict=True)
        ]
    )


def _in_timetable_order(
    case: Case,
    growth: Growth,
    amplitudes: np.ndarray,
    day: np.ndarray,
    measure: Roughness,
    days_before: np.ndarray,
    support: Support,
) -> np.ndarray:
    """Day-averaged crossing days [A] as days of the ordered timetable.

    Within its last day a track does not roughen evenly: each service adds its own share of the day's
    growth of the variance, during its own share of the day's passages. The averaged day's fraction is
    read as a fraction of the growth, and mapped to passages service by service.
    """
    services = case.timetable.services
    n_groups = len(case.model.group_laws)
    weights, embedded = daily_weights(case, day, *days_before.T), measure.embed(amplitudes)
    shares = []
    for s in range(len(services)):
        own = np.zeros_like(weights)
        own[:, s * n_groups : (s + 1) * n_groups] = weights[:, s * n_groups : (s + 1) * n_groups]
        change, _ = growth(amplitudes, own, support.fields)
        shares.append(np.sum(embedded * measure.embed(change), axis=1))
    whole = np.sum(shares, axis=0)
    done, passages, left = np.zeros(len(day)), np.zeros(len(day)), np.ones(len(day), bool)
    fraction = day - np.floor(day)
    for s, share in enumerate(shares):
        axles = services[s].per_day * services[s].train.n_axles
        part = share / whole
        begun = done >= fraction  # a track at its limit before the day's first train stays there
        with np.errstate(divide="ignore", invalid="ignore"):
            here = np.where(begun, 0.0, np.clip((fraction - done) / part, 0.0, 1.0))
        ends = left & (begun | ((part > 0.0) & (done + part >= fraction)))
        passages += np.where(ends, here * axles, np.where(left, float(axles), 0.0))
        left &= ~ends
        done = done + part
    return np.floor(day) + passages / case.timetable.passages_per_day


def spectral_growth(case: Case, forms: Forms | None = None) -> Growth:
    """Growth by the second-order form of whole trains, ``forms`` taken from and added to."""
    pairs, known = case.mode_pairs, {} if forms is None else forms
    for transfer in case.transfers:
        if id(transfer) not in known:
            known[id(transfer)] = transfer, train_form(transfer, case.model, pairs)
    form = stacked([known[id(transfer)][1] for transfer in case.transfers])
    multipliers = np.tile(case.group_multipliers, len(case.transfers))
    few = None if case.severity is None else few_weights(case, form, multipliers)
    if few is not None:
        form, multipliers = few.form, few.multipliers
    varying = VaryingForm(form, multipliers, case.following, case.first_mode)
    packed = form.packed()

    def growth(
        amplitudes: np.ndarray, weights: np.ndarray, fields: np.ndarray | None
    ) -> tuple[np.ndarray, np.ndarray]:
        own = weights if few is None else few.of(weights)
        return fast_varying_growth(varying, packed, amplitudes, own, pairs, fields)

    return growth


def exact_growth(case: Case) -> Growth:
    """Growth at every x and depth: any law without expansion, several times slower."""
    parts = load_parts(case.group_multipliers)
    loads = [
        pointwise_load(transfer, case.model, case.window, parts=parts)
        for transfer in case.transfers
    ]
    n_groups = len(case.model.group_laws)

    def growth(
        amplitudes: np.ndarray, weights: np.ndarray, fields: np.ndarray | None
    ) -> tuple[np.ndarray, np.ndarray]:
        change, uniform = np.zeros_like(amplitudes), np.zeros(len(amplitudes))
        for s, load in enumerate(loads):
            of_service = weights[:, s * n_groups : (s + 1) * n_groups]
            factors = None if fields is None else load.strain_factors(fields)
            grown = pointwise_growth(load, np.arange(load.n_axles), amplitudes, of_service, factors)
            change, uniform = change + grown[0], uniform + grown[1]
        return (change if case.following is None else change * case.following), uniform

    return growth
