"""When each section of a line reaches its limit: its own rate, pooled over the line, carried on.

A section starts, at the first run of a span between tampings, from its measured profile (where only an SD
is known: from a random one of the study's spectrum with that SD). Step B carries it on for every
factor of a grid and for a start SD at its measured value and √3 standard errors to either side
(Gauss–Hermite nodes: the start is measured no better than the rest). Later runs of the span give the
likelihood of the factor; all spans of a section share it; ``estimate.pooling`` pools the sections. The
days to the limit of the last span, weighted by what the runs left of factors and starts, are the
forecast.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np

from mcsettle.estimate.pooling import Pooled, pooled
from mcsettle.railway.line_history import LineHistory
from mcsettle.railway.scene import Scene
from mcsettle.step_a.transfers import StepA
from mcsettle.step_b.build_case import build_case
from mcsettle.step_b.cycle_jump import CycleJump
from mcsettle.types import Progress
from mcsettle.units import DAYS_PER_YEAR

COARSE = np.linspace(np.log(0.15), np.log(6.0), 15)  # log factors about the study's own, advanced
FACTORS = np.linspace(
    COARSE[0], COARSE[-1], 85
)  # and between them: SDs and 1/days are linear there
NODES = np.array([-np.sqrt(3.0), 0.0, np.sqrt(3.0)])  # standard errors of the start SD
NODE_WEIGHTS = np.array([1.0, 4.0, 1.0]) / 6.0
SAMPLES = 50  # days on which an SD is recorded, evenly in log(1 + day / 30)
ROWS = 40_000  # realisations advanced at a time
ABOVE = 8.0  # standard errors above limit and measurements a track is followed


@dataclass(frozen=True, eq=False)
class Courses:
    """SDs of S sections from the start of a span on: ``days`` [H], ``sd`` [S, N, F, H] m.

    N start SDs, F factors; infinite where a track has left the range that matters.
    """

    days: np.ndarray
    sd: np.ndarray

    def on(self, day: np.ndarray) -> np.ndarray:
        """SD [S, N, F] m on ``day`` [S], linear between the days recorded."""
        at = np.clip(np.searchsorted(self.days, day), 1, len(self.days) - 1)
        share = (day - self.days[at - 1]) / (self.days[at] - self.days[at - 1])
        rows = np.arange(len(day))
        low, high = self.sd[rows, :, :, at - 1], self.sd[rows, :, :, at]
        weight = np.clip(share, 0.0, 1.0)[:, None, None]
        with np.errstate(invalid="ignore"):
            between = low + weight * (high - low)
        return np.where(np.isfinite(high), between, np.where(weight == 0.0, low, np.inf))

    def reaching(self, limit: np.ndarray) -> np.ndarray:
        """Days [S, N, F] from the start to the limit [S] m; inf where it is not reached."""
        above = self.sd >= limit[:, None, None, None]
        first = np.argmax(above, axis=-1)
        index = np.maximum(first, 1)[..., None]
        low = np.take_along_axis(self.sd, index - 1, axis=-1)[..., 0]
        high = np.take_along_axis(self.sd, index, axis=-1)[..., 0]
        days_low, days_high = self.days[index[..., 0] - 1], self.days[index[..., 0]]
        with np.errstate(invalid="ignore"):
            share = np.where(np.isfinite(high), (limit[:, None, None] - low) / (high - low), 1.0)
        reached = days_low + np.clip(share, 0.0, 1.0) * (days_high - days_low)
        return np.where(above.any(axis=-1), np.where(first == 0, 0.0, reached), np.inf)


@dataclass(frozen=True, eq=False)
class LineForecast:
    """What is known of each section that is not left out, from the day of the last run on.

    ``rows`` [S] numbers of the sections in the history. ``factors``: the pooled factors.
    ``weights`` [S, N, F], adding up to 1, of start SDs and factors; ``days`` [S, N, F] from the last run
    to the limit, 0 where it is reached by then, inf beyond the horizon. ``predicted`` [S, N, F]: SD m on
    the day asked for, from which ``sd_error`` m separates a measurement. ``last_run_day``: days from the
    first run to the last; ``horizon`` days.
    """

    rows: np.ndarray
    factors: Pooled
    weights: np.ndarray
    days: np.ndarray
    predicted: np.ndarray
    sd_error: float
    last_run_day: float
    horizon: float

    def quantiles(self, levels: tuple[float, ...] = (0.05, 0.5, 0.95)) -> np.ndarray:
        """Days [S, L] from the last run to the limit."""
        flat, weights = (part.reshape(len(self.rows), -1) for part in (self.days, self.weights))
        order = np.argsort(flat, axis=1)
        sorted_days = np.take_along_axis(flat, order, axis=1)
        below = np.cumsum(np.take_along_axis(weights, order, axis=1), axis=1)
        at = [np.argmax(below >= level - 1e-12, axis=1) for level in levels]
        return np.stack([sorted_days[np.arange(len(flat)), a] for a in at], axis=1)

    def probability_within(self, days: float) -> np.ndarray:
        """Probability [S] that the limit is reached within ``days`` of the last run."""
        return np.asarray(np.sum(self.weights * (self.days <= days), axis=(1, 2)))

    def rate(self) -> np.ndarray:
        """Mean growth [S] of the SD in the year after the last run, m/year; NaN where not followed."""
        known = np.isfinite(self.predicted)
        weights = self.weights * known
        growth = np.sum(weights * np.where(known, self.predicted, 0.0), axis=(1, 2))
        total = np.sum(weights, axis=(1, 2))
        return np.asarray(np.where(total > 0.5, growth / np.maximum(total, 1e-300), np.nan))


def line_forecast(
    scenes: Mapping[tuple[str, str], Scene],
    prepared: StepA,
    history: LineHistory,
    horizon: float,
    progress: Progress | None = None,
    predict_on: float | None = None,
) -> LineForecast:
    """Forecast the sections of ``history`` over ``horizon`` [days] from its last run.

    ``scenes`` by (variant, scenario); ``predict_on``: day since the first run for ``predicted``
    (None: a year after the last run, as growth from there).
    """
    rows = np.flatnonzero((history.excluded == "") & ~np.isnan(history.sd).all(axis=1))
    days, spans = history.days, history.spans[rows]
    last_day = float(days[-1])
    shape = (len(rows), len(NODES), len(FACTORS))
    likelihood = np.zeros((len(rows), len(FACTORS)))
    joint, reached = np.zeros(shape), np.full(shape, np.inf)
    predicted = np.full(shape, np.inf)
    parts = list(_starts(history, rows, spans))
    for done, (start, which, is_last) in enumerate(parts):
        if progress is not None:
            progress("Sections from each of their starts", done, len(parts))
        courses = _courses(scenes, prepared, history, rows[which], start, horizon + last_day)
        logs = np.log(NODE_WEIGHTS)[None, :, None] + _log_likelihood(
            courses, history, rows[which], spans[which], start
        )
        likelihood[which] += np.logaddexp.reduce(logs, axis=1)
        at = which[is_last]
        joint[at] = logs[is_last]
        since = days[start] - last_day
        limits = history.sd_limit[rows[at]]
        last = Courses(courses.days, courses.sd[is_last])
        with np.errstate(divide="ignore"):
            to_limit = 1.0 / between(1.0 / np.maximum(last.reaching(limits), 1e-3))
        reached[at] = np.maximum(to_limit + since, 0.0)
        if predict_on is None:
            year = last.on(np.full(len(at), DAYS_PER_YEAR - since))
            with np.errstate(invalid="ignore"):
                predicted[at] = between(year - last.on(np.full(len(at), -since)))
        else:
            predicted[at] = between(last.on(np.full(len(at), predict_on - days[start])))
    if progress is not None:
        progress("Sections from each of their starts", len(parts), len(parts))
    due = history.last_sd[rows] >= history.sd_limit[rows]
    reached[due] = 0.0
    factors = pooled(FACTORS, likelihood)
    inside = np.exp(joint - np.logaddexp.reduce(joint, axis=1)[:, None, :])
    weights = inside * factors.sections[:, None, :]
    reached = np.where(reached > horizon, np.inf, reached)
    return LineForecast(
        rows, factors, weights, reached, predicted, history.sd_error, last_day, horizon
    )


def between(values: np.ndarray) -> np.ndarray:
    """Values [..., FACTORS] from those [..., COARSE], linear in the log factor; inf beside inf."""
    step = COARSE[1] - COARSE[0]
    low = np.minimum(((FACTORS - COARSE[0]) / step + 1e-9).astype(int), len(COARSE) - 2)
    share = (FACTORS - COARSE[low]) / step
    left, right = values[..., low], values[..., low + 1]
    with np.errstate(invalid="ignore"):
        mixed = left + share * (right - left)
    finite = np.isfinite(left) & np.isfinite(right)
    return np.where(share < 1e-6, left, np.where(finite, mixed, np.inf))


def _starts(
    history: LineHistory, rows: np.ndarray, spans: np.ndarray
) -> Iterator[tuple[int, np.ndarray, np.ndarray]]:
    """Runs at which spans begin: the run, the sections [P] that start there, whether it is their last."""
    known = ~np.isnan(history.sd[rows])
    for run in range(len(history.dates)):
        same = spans == spans[:, [run]]
        first = known[:, run] & ~np.any(known[:, :run] & same[:, :run], axis=1)
        which = np.flatnonzero(first)
        if len(which):
            later = known[which, run + 1 :] & ~same[which, run + 1 :]
            yield run, which, ~later.any(axis=1)


def _courses(
    scenes: Mapping[tuple[str, str], Scene],
    prepared: StepA,
    history: LineHistory,
    rows: np.ndarray,
    start: int,
    horizon: float,
) -> Courses:
    """SDs of the sections ``rows`` from run ``start`` on."""
    days = 30.0 * np.expm1(np.linspace(0.0, np.log1p(horizon / 30.0), SAMPLES))
    sd = np.empty((len(rows), len(NODES), len(COARSE), SAMPLES), dtype=np.float32)
    top = np.nanmax(np.concatenate([history.sd[rows].ravel(), history.sd_limit[rows]]))
    top = 1.5 * top + ABOVE * history.sd_error
    since = _days_since_tamping(history, rows, start)
    kinds = np.array(
        [f"{v}\0{s}\0{a}" for v, s, a in zip(
            history.variant[rows], history.scenario[rows], since, strict=True)]
    )  # fmt: skip
    for kind in np.unique(kinds):
        at = np.flatnonzero(kinds == kind)
        variant, scenario, age = str(kind).split("\0")
        engine = _engine(scenes[variant, scenario], prepared, float(age), top, horizon)
        profiles = _profiles(scenes[variant, scenario], history, rows[at], start)
        per_batch = max(1, ROWS // (len(NODES) * len(COARSE)))
        for first in range(0, len(at), per_batch):
            part = at[first : first + per_batch]
            own = profiles[first : first + per_batch]
            sd[part] = _advanced(engine, history, rows[part], start, own, days, float(age))
    return Courses(days, sd)


def _engine(scene: Scene, prepared: StepA, age: float, top: float, horizon: float) -> CycleJump:
    """The engine of a kind of sections that were tamped ``age`` days before their start."""
    case = build_case(scene, prepared)
    model = case.model
    cycles = age * case.timetable.passages_per_day * model.cycles_per_passage
    model = replace(model, ballast_cycles_before=model.ballast_cycles_before + cycles)
    return CycleJump(replace(case, model=model, sd_limit=top, horizon=1.001 * horizon))


def _profiles(scene: Scene, history: LineHistory, rows: np.ndarray, start: int) -> np.ndarray:
    """Amplitudes complex [P, K] m at run ``start``: as measured, else random of the same SD."""
    measured = history.amplitudes[rows, start]
    unknown = np.isnan(measured).any(axis=1)
    if not unknown.any():
        return measured
    drawn = np.concatenate(
        [scene.profiles.sample(range(int(row), int(row) + 1)) for row in rows[unknown]]
    )
    profiles = np.where(unknown[:, None], 0.0, measured)
    profiles[unknown] = drawn
    return profiles


def _advanced(
    engine: CycleJump,
    history: LineHistory,
    rows: np.ndarray,
    start: int,
    profiles: np.ndarray,
    days: np.ndarray,
    age: float,
) -> np.ndarray:
    """SDs [P, N, F, H] m of sections from ``profiles`` [P, K] scaled to each start SD."""
    sd = history.sd[rows, start]
    least = 0.2 * sd
    starts = np.maximum(sd[:, None] + NODES * history.sd_error, least[:, None])
    scaled = profiles * (1.0 / engine.measure.sd(profiles))[:, None]
    shape = (len(rows), len(NODES), len(COARSE))
    amplitudes = np.broadcast_to(
        (starts[:, :, None] * scaled[:, None, :])[:, :, None, :], (*shape, profiles.shape[1])
    ).reshape(-1, profiles.shape[1])
    factors = np.broadcast_to(np.exp(COARSE), shape).ravel()
    ground = np.full(len(factors), age)
    history_of = engine.run(np.ascontiguousarray(amplitudes), days, factors, ground).history
    return np.where(np.isnan(history_of), np.inf, history_of).reshape(*shape, len(days))


def _days_since_tamping(history: LineHistory, rows: np.ndarray, start: int) -> np.ndarray:
    """Days [P] from the tamping before run ``start`` to it; 0 where none is known."""
    tamped, day = history.tamped_on[rows, : start + 1], history.dates[start].toordinal()
    last = np.nanmax(np.where(np.isnan(tamped), -np.inf, tamped), axis=1)
    return np.where(np.isfinite(last), day - last, 0.0)


def _log_likelihood(
    courses: Courses, history: LineHistory, rows: np.ndarray, spans: np.ndarray, start: int
) -> np.ndarray:
    """Log likelihood [P, N, F] of the runs after ``start`` in its span, Gaussian errors."""
    days = history.days
    total = np.zeros((len(rows), len(NODES), len(FACTORS)))
    for run in range(start + 1, len(history.dates)):
        measured = history.sd[rows, run]
        used = (spans[:, run] == spans[:, start]) & ~np.isnan(measured)
        if used.any():
            model = between(courses.on(np.full(len(rows), days[run] - days[start])))
            off = (model - measured[:, None, None]) / history.sd_error
            logs = np.where(np.isfinite(off), np.maximum(-0.5 * off**2, -1e4), -1e4)
            total += np.where(used[:, None, None], logs, 0.0)
    return total
