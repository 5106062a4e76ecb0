"""The sections of a line tamped again and again over the horizon: how often, and at what cost.

A draw is one way the line may go (``line_draws``): a form of growth, the line's rate and the spread about
it, and for each section the rate and the start SD that its runs left. From there a section is followed
from tamping to tamping as ``life`` follows a track: SD after a tamping by the recovery of
``[maintenance]``, the same rate again and again. By Step B the shape after a tamping and the support are
as persistent as the study says; the ballast's count of cycles begins anew and the ground's goes on. In a
form described by hand an interval is ((limit − SD after) / r)^(1/q) years.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from datetime import date

import numpy as np
import pandas as pd

from mcsettle.analysis.described_growth import DescribedGrowth, Growth
from mcsettle.analysis.growth_courses import (
    ROWS,
    TOLERANCE,
    SteppedGrowth,
    days_since_tamping,
    start_profiles,
    start_sds,
    start_support,
)
from mcsettle.analysis.line_draws import line_draws
from mcsettle.analysis.line_forecast import LineForecast, line_forecast, starts
from mcsettle.analysis.sections import LEVELS, calendar, due_table, places, ready
from mcsettle.analysis.tamped_tracks import (
    Tracks,
    Upkeep,
    followed,
    recovery_of,
    with_renewed_ballast,
)
from mcsettle.analysis.tamping import Recovery
from mcsettle.errors import InputError
from mcsettle.railway.line_history import LineHistory
from mcsettle.railway.scene import Scene
from mcsettle.step_b.build_case import build_case
from mcsettle.step_b.case import Support
from mcsettle.step_b.cycle_jump import CycleJump
from mcsettle.study.build_line import Line
from mcsettle.study.sample_cap import capped
from mcsettle.study.schema.economics import MaintenanceTable
from mcsettle.study.study import Study
from mcsettle.types import Progress, silent
from mcsettle.units import DAYS_PER_YEAR, MM

DRAWS = 100  # of the whole line


@dataclass(frozen=True, eq=False)
class LineLife:
    """What the sections of a ``line`` that are not left out need over ``forecast.horizon`` days.

    ``days`` [D, S, C] from the last run to each tamping of D draws of S sections, NaN after the last one
    within the horizon. ``is_open`` [D, S]: followed no further, so that later tampings are missing.
    ``kilometres`` [S]; ``cost`` [D, S] of the tampings in ``currency``, discounted to the last run.
    """

    line: Line
    forecast: LineForecast
    days: np.ndarray
    is_open: np.ndarray
    kilometres: np.ndarray
    cost: np.ndarray
    currency: str
    discount_rate: float

    @property
    def count(self) -> np.ndarray:
        """Tampings [D, S]."""
        return np.asarray(np.sum(~np.isnan(self.days), axis=2))

    @property
    def totals(self) -> pd.DataFrame:
        """A row for each draw of the line: kilometres tamped, and their cost."""
        tamped = (self.count * self.kilometres).sum(axis=1)
        return pd.DataFrame({"tamped_km": tamped, "cost": self.cost.sum(axis=1)})

    def by_year(self) -> pd.DataFrame:
        """P5, P50, P95 of the kilometres tamped in each year from the last run on."""
        n_years = int(np.ceil(self.forecast.horizon / DAYS_PER_YEAR))
        lengths = np.zeros((len(self.days), n_years))
        for draw, days in enumerate(self.days):
            year = (days[~np.isnan(days)] // DAYS_PER_YEAR).astype(int)
            kilometres = np.broadcast_to(self.kilometres[:, None], days.shape)[~np.isnan(days)]
            lengths[draw] = np.bincount(year, kilometres, n_years)[:n_years]
        return due_table(lengths, self.line.history.dates[-1])

    def table(self) -> pd.DataFrame:
        """A row for each section, dearest first; dates of its first and second tamping."""
        history, rows = self.line.history, self.forecast.rows
        columns = places(history, rows)
        for name, values in (("tampings", self.count), ("cost", self.cost)):
            columns[f"{name}_mean"] = values.mean(axis=0)
            for level, quantiles in zip(LEVELS, np.quantile(values, LEVELS, axis=0), strict=True):
                columns[f"{name}_p{level * 100:02.0f}"] = quantiles
        for place, name in enumerate(("first", "second")):
            for level, days in zip(LEVELS, self._dates(place), strict=True):
                columns[f"{name}_p{level * 100:02.0f}"] = days
        columns["followed_no_further"] = self.is_open.mean(axis=0)
        order = np.argsort(-self.cost.mean(axis=0), kind="stable")
        return pd.DataFrame(columns).iloc[order].reset_index(drop=True)

    def _dates(self, place: int) -> Iterator[list[date | None]]:
        """Dates [S] of a tamping at each level; None beyond the horizon."""
        days = np.full(self.days.shape[:2], np.inf)
        if place < self.days.shape[2]:
            days = np.nan_to_num(self.days[:, :, place], nan=np.inf)
        last = self.line.history.dates[-1]
        for quantiles in np.quantile(days, LEVELS, axis=0, method="higher"):
            yield [calendar(last, day) for day in quantiles]


def line_life(
    study: Study, draws: int | None = None, progress: Progress = silent, processes: int = 1
) -> LineLife:
    """Tamp every section of the line of ``study`` again and again over ``[limit] horizon_years``.

    ``draws`` of the whole line; default ``DRAWS``.

    Raises
    ------
    InputError
        There is no ``[line]``, ``[maintenance]`` or ``[economics]``, or they cannot be used together.
    """
    if study.maintenance is None or study.economics is None:
        raise InputError("tamping again and again needs the tables [maintenance] and [economics]")
    recovery = _recovery(study.maintenance)
    line, growths = ready(study, progress, processes)
    history, horizon = line.history, study.limit.horizon_days
    _check_limits(history, recovery)
    forms = growths(history)
    forecast = line_forecast(forms, history, horizon, progress)
    count = draws or capped(DRAWS)
    drawn = list(line_draws(forecast, count, study.seed))
    n, cycles = len(forecast.rows), study.maintenance.cycles
    days, is_open = np.full((count, n, cycles), np.nan), np.zeros((count, n), bool)
    for number, growth in enumerate(forms):
        of_form = np.array([d for d, draw in enumerate(drawn) if draw.form == number], dtype=int)
        if not len(of_form):
            continue
        place = np.tile(np.arange(n), len(of_form))
        start = np.concatenate([drawn[d].start for d in of_form])
        rate = np.concatenate([drawn[d].rate for d in of_form])
        address = np.repeat(of_form * n, n) + place
        part = _Drawn(study, history, forecast, recovery, cycles, place, start, rate, address)
        tampings, further = part.followed(growth, progress)
        days[of_form], is_open[of_form] = tampings.reshape(-1, n, cycles), further.reshape(-1, n)
    kilometres = history.lengths[forecast.rows] / 1000.0
    factors = np.exp(-study.economics.discount_rate * days / DAYS_PER_YEAR)
    cost = study.economics.tamping_cost_per_track_km * kilometres * np.nansum(factors, axis=2)
    money = study.economics.currency, study.economics.discount_rate
    return LineLife(line, forecast, days, is_open, kilometres, cost, *money)


def _recovery(table: MaintenanceTable) -> Recovery:
    """What a tamping of the line leaves."""
    recovery = recovery_of(table)
    if recovery is None:
        raise InputError(
            "maintenance.recovery is 'perfect', which brings a track back to its start; sections of a "
            'line are in service and have none: give recovery = "linear" with intercept_mm and slope'
        )
    if table.renewal_years is not None:
        raise InputError(
            "maintenance.renewal_years: the sections of a line are followed over [limit] "
            "horizon_years, and when each was laid is not known; leave renewal_years out"
        )
    return recovery


def _check_limits(history: LineHistory, recovery: Recovery) -> None:
    """Refuse limits along the line that a tamping would not bring a section below."""
    lowest = float(history.sd_limit[history.excluded == ""].min(initial=np.inf))
    after = recovery.intercept + recovery.slope * lowest
    if after >= lowest:
        raise InputError(
            f"maintenance: a tamping at the lowest limit along the line, {lowest / MM:g} mm, leaves "
            f"{after / MM:.3g} mm; it must leave less than the limit"
        )


@dataclass(frozen=True, eq=False)
class _Drawn:
    """Sections [R] of a line in the draws of one form of growth, one draw after the other.

    ``place`` among those of the forecast; numbers of the ``start`` SD and of the ``rate``; ``address`` of
    what is random at a tamping.
    """

    study: Study
    history: LineHistory
    forecast: LineForecast
    recovery: Recovery
    cycles: int
    place: np.ndarray
    start: np.ndarray
    rate: np.ndarray
    address: np.ndarray

    @property
    def rows(self) -> np.ndarray:
        """Numbers [R] of the sections in the history."""
        return self.forecast.rows[self.place]

    def rates(self, growth: Growth) -> np.ndarray:
        """Rates [R] of the form, or factors."""
        form = self.forecast.form_of_rate[self.rate[0]]
        first = int(np.argmax(self.forecast.form_of_rate == form))
        return np.exp(growth.logs[self.rate - first])

    def followed(self, growth: Growth, progress: Progress) -> tuple[np.ndarray, np.ndarray]:
        """Days [R, C] of tampings from the last run on, and whether [R] there are more."""
        if isinstance(growth, DescribedGrowth):
            return self._by_hand(growth)
        return self._by_step_b(growth, progress)

    def _by_hand(self, growth: DescribedGrowth) -> tuple[np.ndarray, np.ndarray]:
        """Tampings where the SD rises with a power of time."""
        limit, horizon = self.history.sd_limit[self.rows], self.forecast.horizon
        day, rates = self.forecast.days[self.place, self.start, self.rate], self.rates(growth)
        before = np.maximum(self.history.last_sd[self.rows], limit)
        tampings, alive = np.full((len(day), self.cycles), np.nan), day < horizon
        for tamping in range(1, self.cycles + 1):
            at = np.flatnonzero(alive)
            tampings[at, tamping - 1] = day[at]
            address = self.address[at].tolist()
            after = self.recovery.sd_after(before[at], self.study.seed, address, tamping)
            rates[at] *= 1.0 + self.recovery.damage
            left = np.maximum(limit[at] - after, 0.0) / rates[at]
            day[at] += DAYS_PER_YEAR * left ** (1.0 / growth.power)
            alive[at] = (day[at] < horizon) & (left > 0.0)
            before = limit
        return tampings, day < horizon

    def _by_step_b(
        self, growth: SteppedGrowth, progress: Progress
    ) -> tuple[np.ndarray, np.ndarray]:
        """Tampings by Step B, sections of one scene, limit and first run at a time."""
        history, rows, factor = self.history, self.forecast.rows, self.rates(growth)
        told = (of[rows] for of in (history.variant, history.scenario, history.sd_limit))
        kinds = list(zip(*told, _start_runs(history, rows), strict=True))
        days = np.full((len(factor), self.cycles), np.nan)
        is_open, typical = np.zeros(len(factor), bool), min(64, self.study.run.realisations)
        for kind in dict.fromkeys(kinds):
            variant, scenario, limit, run = kind
            machines = self._machines(growth, variant, scenario, limit)
            scene = growth.scenes[variant, scenario]
            upkeep = Upkeep(
                self.recovery, self.cycles, self.forecast.horizon, scene.profiles, typical,
                self.study.seed,
            )  # fmt: skip
            of_kind = np.array([other == kind for other in kinds])
            at = np.flatnonzero(of_kind[self.place])
            for first in range(0, len(at), ROWS):
                part = at[first : first + ROWS]
                tracks = self._tracks(machines[0], scene, part, int(run), factor[part])
                sequence, _ = followed(
                    machines, tracks, upkeep, f"the line, {variant} {scenario}", progress
                )
                days[part, : sequence.years.shape[1]] = sequence.years * DAYS_PER_YEAR
                is_open[part] = sequence.open
        return days, is_open

    def _machines(
        self, growth: SteppedGrowth, variant: str, scenario: str, limit: float
    ) -> tuple[CycleJump, CycleJump]:
        """Engines to the first tamping and from one to the next, for as long as is needed."""
        assert self.study.maintenance is not None
        horizon = self.forecast.horizon + self.forecast.last_run_day
        case = build_case(growth.scenes[variant, scenario], growth.prepared)
        case = replace(case, sd_limit=limit, horizon=1.001 * horizon)
        forms = growth.forms.setdefault((variant, scenario), {})
        later = with_renewed_ballast(case, self.study.maintenance)
        return CycleJump(case, tolerance=TOLERANCE, forms=forms), CycleJump(
            later, tolerance=TOLERANCE, forms=forms
        )

    def _tracks(
        self, machine: CycleJump, scene: Scene, part: np.ndarray, run: int, factor: np.ndarray
    ) -> Tracks:
        """The sections ``part`` [P] of [R] from their run ``run`` on, as drawn."""
        history, rows, limit = self.history, self.rows[part], machine.case.sd_limit
        address = self.address[part].tolist()
        alone, again = np.unique(rows, return_inverse=True)
        sd = start_sds(history, rows, run)[np.arange(len(rows)), self.start[part]]
        profiles = start_profiles(scene, history, alone, run)[again]
        profiles = profiles * (sd / machine.measure.sd(profiles))[:, None]
        rough = np.maximum(history.last_sd[rows], np.where(sd >= limit, sd, 0.0))
        field = scene.support.settings
        fades = field is not None and field.persistence < 1.0

        def support(gone: int) -> Support:
            if fades and gone:
                return start_support(scene, history, rows, run, gone, address)
            now = start_support(scene, history, alone, run)
            return now if field is None else now[again]

        return Tracks(
            profiles,
            address,
            factor,
            days_since_tamping(history, rows, run),
            np.full(len(rows), self.forecast.last_run_day - history.days[run]),
            np.where(rough >= limit, rough, np.nan),
            support,
            fades,
        )


def _start_runs(history: LineHistory, rows: np.ndarray) -> np.ndarray:
    """Run [S] at which the last span of each section begins."""
    first_runs = np.zeros(len(rows), dtype=int)
    for run, which, is_last in starts(history, rows, history.spans[rows]):
        first_runs[which[is_last]] = run
    return first_runs
