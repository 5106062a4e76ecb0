"""The sections of a line as a table: where, how rough now, how fast, when due, and what first."""

from collections.abc import Callable
from dataclasses import dataclass
from datetime import date, timedelta
from functools import partial

import numpy as np
import pandas as pd

from mcsettle.analysis.described_growth import Growth, by_hand
from mcsettle.analysis.growth_by_wave import growth_by_wave
from mcsettle.analysis.growth_courses import SteppedGrowth
from mcsettle.analysis.line_draws import line_draws
from mcsettle.analysis.line_forecast import LineForecast, line_forecast
from mcsettle.analysis.line_hold_out import HoldOut, hold_out
from mcsettle.analysis.worksites import TampingPrices, Worksite, one_by_one, worksites
from mcsettle.errors import InputError
from mcsettle.railway.line_history import LineHistory
from mcsettle.step_a.transfers import step_a
from mcsettle.study.build_line import Line, build_line
from mcsettle.study.study import Study
from mcsettle.types import Progress, silent
from mcsettle.units import DAYS_PER_YEAR, MM

YEARS = (1, 2, 3)
Growths = Callable[[LineHistory], tuple[SteppedGrowth, *tuple[Growth, ...]]]
DRAWS = 400  # of the whole line, for lengths due in a year
LEVELS = (0.05, 0.5, 0.95)


@dataclass(frozen=True, eq=False)
class SectionsReport:
    """What ``mcsettle sections`` tells: ``table`` has one row for each section, worst first.

    ``due`` has a row for each coming year, with the kilometres that fall due; ``sites`` the worksites of
    what is due within the plan's time, ``site_cost`` theirs and ``single_cost`` that of tamping each
    section by itself, in the plan's money. ``increments``: where profiles grew (``growth_by_wave``).
    """

    line: Line
    forecast: LineForecast
    table: pd.DataFrame
    due: pd.DataFrame
    sites: list[Worksite]
    site_cost: float
    single_cost: float
    increments: pd.DataFrame | None

    @property
    def last_run(self) -> date:
        """Date of the last run: day 0 of the forecast."""
        return self.line.history.dates[-1]


def sections_report(
    study: Study, progress: Progress = silent, processes: int = 1
) -> SectionsReport:
    """Forecast every section of the line of ``study``.

    Raises
    ------
    InputError
        There is no ``[line]``, or it cannot be used.
    """
    line, growths = ready(study, progress, processes)
    assert study.line is not None
    history, plan = line.history, study.line.plan
    model, *others = growths(history)
    forecast = line_forecast([model, *others], history, study.limit.horizon_days, progress)
    prices = TampingPrices(plan.cost_per_shift, plan.output_m_per_shift, plan.least_length_m)
    lengths = history.lengths
    due, life_left = _due(history, forecast, plan.join_within_days)
    closed, sites = history.excluded != "", []
    for part in history.stretches:  # no worksite crosses a gap, or changes the track
        of_stretch = worksites(lengths[part], due[part], life_left[part], closed[part], prices)
        sites += [s.moved(part.start) for s in of_stretch]
    cost = sum(site.cost for site in sites)
    single = one_by_one(lengths, due, prices)
    return SectionsReport(
        line, forecast, _table(history, forecast), _due_by_year(history, forecast, study.seed),
        sites, cost, single, growth_by_wave(model, history, forecast, study.wavenumbers),
    )  # fmt: skip


def line_hold_out(
    study: Study, progress: Progress = silent, processes: int = 1
) -> tuple[Line, HoldOut]:
    """Predict the last run of the line of ``study`` from those before it.

    Raises
    ------
    InputError
        There is no ``[line]``, or its runs do not allow it.
    """
    line, growths = ready(study, progress, processes)
    return line, hold_out(growths, line.history, progress)


def ready(study: Study, progress: Progress, processes: int) -> tuple[Line, Growths]:
    """The line of ``study``, and its forms of growth with Step A of what runs on it."""
    line = build_line(study)
    assert study.line is not None
    names = {*zip(line.history.variant, line.history.scenario, strict=True)}
    for variant, scenario in names:  # a name that is none is told before Step A
        study.scene(variant, scenario)
    scenes = [s for s in study.scenes if (s.variant, s.scenario) in names]
    if any(scene.stepping != "cycle_jump" for scene in scenes):
        raise InputError('sections are carried on with stepping "cycle_jump"')
    measured = ~np.isnan(line.history.amplitudes).all()
    for scene in scenes if measured else ():
        if scene.support.settings is not None and scene.support.settings.profile_correlation:
            raise InputError(
                "spatial_variability.profile_correlation: recorded profiles have no random numbers that "
                "the field could share; leave it out"
            )
    by_name = {(scene.variant, scene.scenario): scene for scene in scenes}
    model = partial(SteppedGrowth, by_name, step_a(scenes, progress, processes))
    others = by_hand if study.line.growth != "model" else lambda _: ()
    return line, lambda history: (model(history), *others(history))


def places(history: LineHistory, rows: np.ndarray) -> dict[str, object]:
    """Columns of the sections ``rows``: where they lie, their last SD and their limit."""
    return {
        **({"track": history.track[rows]} if (history.track != "").any() else {}),
        "chainage_from_m": history.chainage_from[rows],
        "chainage_to_m": history.chainage_to[rows],
        "sd_now_mm": history.last_sd[rows] / MM,
        "sd_limit_mm": history.sd_limit[rows] / MM,
    }


def _table(history: LineHistory, forecast: LineForecast) -> pd.DataFrame:
    """One row for each section: first those beyond their limit today, then by median date."""
    rows, last = forecast.rows, history.dates[-1]
    quantiles = forecast.quantiles(LEVELS)
    columns = places(history, rows) | {
        "rate_mm_per_year": forecast.rate() / MM,
        "scenario": history.scenario[rows],
        "variant": history.variant[rows],
        "runs": (~np.isnan(history.sd[rows])).sum(axis=1),
    }
    for level, days in zip(LEVELS, quantiles.T, strict=True):
        columns[f"due_p{level * 100:02.0f}"] = [calendar(last, day) for day in days]
    for years in YEARS:
        columns[f"probability_{years}y"] = forecast.probability_within(years * DAYS_PER_YEAR)
    beyond = history.last_sd[rows] >= history.sd_limit[rows]
    ratio = history.last_sd[rows] / history.sd_limit[rows]
    order = np.lexsort((-ratio, quantiles[:, 1], ~beyond))
    table = pd.DataFrame(columns | {"beyond_limit": beyond}).iloc[order].reset_index(drop=True)
    table.insert(0, "priority", np.arange(1, len(table) + 1))
    return table


def calendar(start: date, days: float) -> date | None:
    """The date ``days`` after ``start``; None beyond the horizon."""
    return start + timedelta(days=float(days)) if np.isfinite(days) else None


def _due(
    history: LineHistory, forecast: LineForecast, within: float
) -> tuple[np.ndarray, np.ndarray]:
    """Which of all sections [S] are due within so many days (median), and the life others have left."""
    n = len(history.chainage_from)
    median = np.full(n, np.inf)
    median[forecast.rows] = forecast.quantiles((0.5,))[:, 0]
    growth = np.full(n, np.nan)
    growth[forecast.rows] = forecast.rate()
    with np.errstate(divide="ignore", invalid="ignore"):
        # Of the time from the SD that a tamping leaves to the limit, the part that is still to come.
        whole = DAYS_PER_YEAR * 0.5 * history.sd_limit / growth
        left = np.where(np.isfinite(median), median / np.maximum(whole, median), 1.0)
    return median <= within, np.nan_to_num(left, nan=1.0)


def _due_by_year(history: LineHistory, forecast: LineForecast, seed: int) -> pd.DataFrame:
    """Kilometres that fall due in each coming year, P5 to P95 of ``DRAWS`` draws of the whole line."""
    n_years = int(np.ceil(forecast.horizon / DAYS_PER_YEAR))
    lengths, rows = np.zeros((DRAWS, n_years)), np.arange(len(forecast.rows))
    kilometres = history.lengths[forecast.rows] / 1000.0
    for draw, drawn in enumerate(line_draws(forecast, DRAWS, seed)):
        days = forecast.days[rows, drawn.start, drawn.rate]
        year = np.minimum(days, n_years * DAYS_PER_YEAR) // DAYS_PER_YEAR
        lengths[draw] = np.bincount(year.astype(int), kilometres, n_years + 1)[:n_years]
    return due_table(lengths, history.dates[-1])


def due_table(lengths: np.ndarray, first: date) -> pd.DataFrame:
    """P5, P50, P95 of kilometres [D, Y] due in each year from the date ``first`` on."""
    low, middle, high = np.quantile(lengths, LEVELS, axis=0)
    return pd.DataFrame(
        {
            "from": [calendar(first, y * DAYS_PER_YEAR) for y in range(lengths.shape[1])],
            "due_km_p05": low,
            "due_km_p50": middle,
            "due_km_p95": high,
        }
    )
