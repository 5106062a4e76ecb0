"""When each section of a line reaches its limit: its own rate, pooled over the line, carried on.

A section starts at the first run of a span between tampings and grows in one of several forms
(``growth_courses``: Step B; ``described_growth``: powers of time). Later runs of the span give the
likelihood of its rate; all spans of a section share it; ``estimate.pooling`` pools the sections. The
days to the limit of the last span, weighted by what the runs left of rates and starts, are the forecast
of a form.

The forms are equally likely at first. What all runs of the line say under each (its evidence: rates,
line and spread integrated out) weighs them, and the forecast is the average (Hoeting et al., Bayesian
model averaging, Statistical Science 14, 1999). No later run enters.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from mcsettle.analysis.described_growth import Courses, Growth
from mcsettle.analysis.growth_courses import NODE_WEIGHTS
from mcsettle.estimate.pooling import Pooled, pooled
from mcsettle.railway.line_history import LineHistory
from mcsettle.types import Progress, silent
from mcsettle.units import DAYS_PER_YEAR

LEAST_PROBABILITY = 1e-4  # of a form that is carried on to the forecast


@dataclass(frozen=True, eq=False)
class FormOfGrowth:
    """A form by name, its ``probability`` given the runs of the line, and its ``pooled`` rates."""

    name: str
    probability: float
    pooled: Pooled


@dataclass(frozen=True, eq=False)
class LineForecast:
    """What is known of each section that is not left out, from the day of the last run on.

    ``rows`` [S] numbers of the sections in the history. ``forms`` of growth; those that are carried on
    have their rates side by side in ``weights`` [S, N, F], adding up to 1, of start SDs and rates;
    ``form_of_rate`` [F] numbers of their forms. ``days`` [S, N, F] from the last run to the limit, 0
    where it is reached by then, inf beyond the horizon. ``predicted`` [S, N, F]: SD m on the day asked
    for, from which ``sd_error`` m separates a measurement. ``last_run_day``: days from the first run to
    the last; ``horizon`` days.
    """

    rows: np.ndarray
    forms: tuple[FormOfGrowth, ...]
    form_of_rate: np.ndarray
    weights: np.ndarray
    days: np.ndarray
    predicted: np.ndarray
    sd_error: float
    last_run_day: float
    horizon: float

    @property
    def factors(self) -> Pooled:
        """The pooled factors of the first form, Step B."""
        return self.forms[0].pooled

    def quantiles(self, levels: tuple[float, ...] = (0.05, 0.5, 0.95)) -> np.ndarray:
        """Days [S, L] from the last run to the limit."""
        flat, weights = (part.reshape(len(self.rows), -1) for part in (self.days, self.weights))
        order = np.argsort(flat, axis=1)
        sorted_days = np.take_along_axis(flat, order, axis=1)
        below = np.cumsum(np.take_along_axis(weights, order, axis=1), axis=1)
        at = [np.argmax(below >= level - 1e-12, axis=1) for level in levels]
        return np.stack([sorted_days[np.arange(len(flat)), a] for a in at], axis=1)

    def probability_within(self, days: float | np.ndarray) -> np.ndarray:
        """Probability [S] that the limit is reached within ``days`` (one, or [S]) of the last run."""
        within = self.days <= np.reshape(days, (-1, 1, 1))
        return np.asarray(np.sum(self.weights * within, axis=(1, 2)))

    def rate(self) -> np.ndarray:
        """Mean growth [S] of the SD in the year after the last run, m/year; NaN where not followed."""
        known = np.isfinite(self.predicted)
        weights = self.weights * known
        growth = np.sum(weights * np.where(known, self.predicted, 0.0), axis=(1, 2))
        total = np.sum(weights, axis=(1, 2))
        return np.asarray(np.where(total > 0.5, growth / np.maximum(total, 1e-300), np.nan))


@dataclass(frozen=True, eq=False)
class _Form:
    """The forecast of one form alone: as LineForecast, ``joint`` log weights before pooling."""

    name: str
    pooled: Pooled
    joint: np.ndarray
    days: np.ndarray
    predicted: np.ndarray

    def weights(self) -> np.ndarray:
        """Weights [S, N, F] of start SDs and rates."""
        inside = np.exp(self.joint - np.logaddexp.reduce(self.joint, axis=1)[:, None, :])
        return np.asarray(inside * self.pooled.sections[:, None, :])


def line_forecast(
    growths: Sequence[Growth],
    history: LineHistory,
    horizon: float,
    progress: Progress = silent,
    predict_on: float | None = None,
) -> LineForecast:
    """Forecast the sections of ``history`` over ``horizon`` [days] from its last run.

    ``growths``: forms of growth, the first of them Step B. ``predict_on``: day since the first run for
    ``predicted`` (None: a year after the last run, as growth from there).
    """
    rows = np.flatnonzero((history.excluded == "") & ~np.isnan(history.sd).all(axis=1))
    forms = [  # Step B alone, the first, takes time
        _by(growth, history, rows, horizon, silent if place else progress, predict_on)
        for place, growth in enumerate(growths)
    ]
    evidence = np.array([form.pooled.log_evidence for form in forms])
    probability = np.exp(evidence - evidence.max())
    probability /= probability.sum()
    carried = np.flatnonzero(probability >= LEAST_PROBABILITY)
    shares = probability / probability[carried].sum()
    due = history.last_sd[rows] >= history.sd_limit[rows]
    days = np.concatenate([forms[f].days for f in carried], axis=-1)
    days = np.where(due[:, None, None], 0.0, np.where(days > horizon, np.inf, days))
    return LineForecast(
        rows,
        tuple(
            FormOfGrowth(form.name, float(p), form.pooled)
            for form, p in zip(forms, probability, strict=True)
        ),
        np.repeat(carried, [len(forms[f].pooled.logs) for f in carried]),
        np.concatenate([shares[f] * forms[f].weights() for f in carried], axis=-1),
        days,
        np.concatenate([forms[f].predicted for f in carried], axis=-1),
        history.sd_error,
        float(history.days[-1]),
        horizon,
    )


def _by(
    growth: Growth,
    history: LineHistory,
    rows: np.ndarray,
    horizon: float,
    progress: Progress,
    predict_on: float | None,
) -> _Form:
    """The forecast of the sections ``rows`` by one form of growth."""
    days, spans = history.days, history.spans[rows]
    last_day, text = float(days[-1]), "Sections from each of their starts"
    shape = (len(rows), len(NODE_WEIGHTS), len(growth.logs))
    likelihood = np.zeros((len(rows), len(growth.logs)))
    joint, reached = np.zeros(shape), np.full(shape, np.inf)
    predicted = np.full(shape, np.inf)
    parts = list(starts(history, rows, spans))
    for done, (start, which, is_last) in enumerate(parts):
        progress(text, done, len(parts))
        courses = growth.courses(rows[which], start, horizon + last_day)
        logs = np.log(NODE_WEIGHTS)[None, :, None] + _log_likelihood(
            courses, history, rows[which], spans[which], start, len(growth.logs)
        )
        likelihood[which] += np.logaddexp.reduce(logs, axis=1)
        at, since = which[is_last], days[start] - last_day
        joint[at] = logs[is_last]
        limits = history.sd_limit[rows[which]]
        reached[at] = np.maximum(courses.reaching(limits)[is_last] + since, 0.0)
        if predict_on is None:
            every = np.ones(len(which))
            year = courses.on((DAYS_PER_YEAR - since) * every)
            with np.errstate(invalid="ignore"):
                predicted[at] = (year - courses.on(-since * every))[is_last]
        else:
            predicted[at] = courses.on(np.full(len(which), predict_on - days[start]))[is_last]
    progress(text, len(parts), len(parts))
    return _Form(growth.name, pooled(growth.logs, likelihood), joint, reached, predicted)


def starts(
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


def _log_likelihood(
    courses: Courses,
    history: LineHistory,
    rows: np.ndarray,
    spans: np.ndarray,
    start: int,
    n_rates: int,
) -> np.ndarray:
    """Log likelihood [P, N, F] of the runs after ``start`` in its span, Gaussian errors."""
    days = history.days
    total = np.zeros((len(rows), len(NODE_WEIGHTS), n_rates))
    for run in range(start + 1, len(history.dates)):
        measured = history.sd[rows, run]
        used = (spans[:, run] == spans[:, start]) & ~np.isnan(measured)
        if used.any():
            model = courses.on(np.full(len(rows), days[run] - days[start]))
            off = (model - measured[:, None, None]) / history.sd_error
            logs = np.where(np.isfinite(off), np.maximum(-0.5 * off**2, -1e4), -1e4)
            total += np.where(used[:, None, None], logs, 0.0)
    return total
