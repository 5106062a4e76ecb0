"""Adaptive Runge–Kutta integration of many realisations, each with its own step.

Dormand–Prince 5(4) with the tableau and the interpolant of SciPy's ``RK45``; the error, the step and
the stop are decided row by row, so that a realisation does not know which others run beside it.
"""

from collections.abc import Callable
from dataclasses import dataclass, fields

import numpy as np
from scipy.integrate import RK45

from mcsettle.step_b.sd_map import Roughness

Rate = Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]


@dataclass(frozen=True)
class Path:
    """Where each of R realisations stopped.

    ``reached`` [R]; ``time`` [R] of the independent variable; ``state`` complex [R, C] there; ``sd``
    [R, H] m at the sample times (NaN after the stop); ``failed`` [R] steps collapsed or overflowed;
    ``steps`` [R] accepted steps.
    """

    reached: np.ndarray
    time: np.ndarray
    state: np.ndarray
    sd: np.ndarray
    failed: np.ndarray
    steps: np.ndarray

    def __getitem__(self, rows: slice) -> "Path":
        """Some of them."""
        return Path(*(getattr(self, field.name)[rows] for field in fields(self)))


@np.errstate(over="ignore", invalid="ignore", divide="ignore")  # the error estimate sees to it
def integrate(
    rate: Rate,
    state: np.ndarray,
    end: float | np.ndarray,
    sd_limit: float,
    roughness: Roughness,
    samples: np.ndarray,
    tolerance: float = 1e-8,
    max_steps: int = 2000,
) -> Path:
    """Integrate d(state)/ds = rate(s, state, rows) from s = 0 until the SD limit or ``end``.

    Parameters
    ----------
    rate : function of s [A], state complex [A, C] and the row numbers [A], giving complex [A, C]
    state : complex [R, C]; the last column is uniform settlement and carries no roughness, m
    end : last value of s, of all or of each [R]
    sd_limit : standard deviation at which a realisation stops, m
    roughness : Roughness
    samples : [H] increasing values of s at which the SD is recorded
    tolerance : local error of the amplitudes relative to their size

    Returns
    -------
    Path
    """
    n, u, last = len(state), state.copy(), np.broadcast_to(end, len(state))
    time, step = np.zeros(n), np.minimum(0.05, last)
    sd = np.full((n, len(samples)), np.nan)
    sd[:, samples <= 0.0] = roughness.sd(u[:, :-1])[:, None]
    reached = roughness.sd(u[:, :-1]) >= sd_limit
    failed, steps = np.zeros(n, bool), np.zeros(n, int)
    slope = rate(time, u, np.arange(n))
    rows = np.flatnonzero(~reached)
    for _ in range(max_steps):
        if not rows.size:
            break
        h = np.minimum(step[rows], last[rows] - time[rows])
        stages, new = _stages(rate, time[rows], u[rows], slope[rows], h, rows)
        error = _error(stages, h, u[rows], tolerance)
        take = error <= 1.0
        step[rows] = h * np.clip(0.9 * np.maximum(error, 1e-10) ** -0.2, 0.2, 5.0)
        failed[rows[~take & (h < 1e-12)]] = True
        accepted = rows[take]
        if accepted.size:
            steps[accepted] += 1
            after = new if take.all() else new[take]
            made = stages if take.all() else stages[:, take]
            theta, hit = _record(
                u[accepted], made, after, time[accepted], h[take],
                sd_limit, roughness, samples, sd, accepted,
            )  # fmt: skip
            u[accepted] = after
            time[accepted] += theta * h[take]
            slope[accepted] = stages[-1, take]
            reached[accepted[hit]] = True
        done = reached[rows] | failed[rows] | (time[rows] >= last[rows] * (1.0 - 1e-14))
        rows = rows[~done]
    failed[rows] = True
    return Path(reached, time, u, sd, failed, steps)


def _stages(
    rate: Rate, time: np.ndarray, u: np.ndarray, slope: np.ndarray, h: np.ndarray, rows: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Slopes of the seven stages [7, A, C] and the fifth-order result [A, C]."""
    stages = np.empty((7, *u.shape), dtype=complex)
    stages[0] = slope
    for i in range(1, 6):
        y = u + _combine(RK45.A[i, :i], stages[:i], h)
        stages[i] = rate(time + RK45.C[i] * h, y, rows)
    new = u + _combine(RK45.B, stages[:6], h)
    stages[6] = rate(time + h, new, rows)
    return stages, new


def _combine(coefficients: np.ndarray, stages: np.ndarray, h: np.ndarray) -> np.ndarray:
    """Σ c_i stage_i times h, complex [A, C]; by real products, which cost half as much."""
    parts = stages.view(float)
    total = coefficients[0] * parts[0]
    for c, part in zip(coefficients[1:], parts[1:], strict=True):
        if c != 0.0:
            total += c * part
    total *= h[:, None]
    return total.view(complex)


def _error(stages: np.ndarray, h: np.ndarray, u: np.ndarray, tolerance: float) -> np.ndarray:
    """Local error estimate over tolerance [A], amplitudes only; inf where the step overflowed."""
    difference = _combine(RK45.E, stages, h)[:, :-1]
    size = np.sqrt(np.sum(np.abs(u[:, :-1]) ** 2, axis=1))
    error = np.sqrt(np.sum(np.abs(difference) ** 2, axis=1)) / (tolerance * size)
    return np.where(np.isnan(error), np.inf, error)


def _coefficients(u: np.ndarray, stages: np.ndarray, h: np.ndarray) -> np.ndarray:
    """Interpolant u(θ) = Σ_p c_p θ^p over a step, c as [5, A, C]."""
    c = np.empty((5, *u.shape), dtype=complex)
    c[0] = u
    for p in range(4):
        c[p + 1] = _combine(RK45.P[:, p], stages, h)
    return c


def _dense(c: np.ndarray, theta: np.ndarray) -> np.ndarray:
    """Interpolant with coefficients c [5, A, C] at θ [A]."""
    total = c[4]
    for p in (3, 2, 1, 0):
        total = c[p] + theta[:, None] * total
    return total


def _record(
    u: np.ndarray,
    stages: np.ndarray,
    new: np.ndarray,
    time: np.ndarray,
    h: np.ndarray,
    sd_limit: float,
    roughness: Roughness,
    samples: np.ndarray,
    sd: np.ndarray,
    rows: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Write the SD at the samples inside a step; return where each row stops, θ [A], and if it did.

    ``new`` [A, C] becomes the state at the crossing where there is one.
    """
    hit = roughness.sd(new[:, :-1]) >= sd_limit
    inside = (samples > time[:, None]) & (samples <= (time + h)[:, None])
    theta = np.ones(len(u))
    needed = np.flatnonzero(hit | inside.any(axis=1))
    if not needed.size:
        return theta, hit
    every = needed.size == len(u)
    part = stages if every else stages[:, needed]
    c = _coefficients(u if every else u[needed], part, h[needed])
    variance = _variance_polynomial(roughness.embed(c[:, :, :-1]))
    crossing = _bisect(variance, sd_limit**2)
    theta[needed] = np.where(hit[needed], crossing, 1.0)
    stopped = hit[needed]
    new[hit] = _dense(c[:, stopped], theta[hit])
    for column in np.flatnonzero(inside.any(axis=0)):
        at = (samples[column] - time[needed]) / h[needed]
        use = inside[needed, column] & (at <= theta[needed])
        sd[rows[needed[use]], column] = np.sqrt(_evaluate(variance[:, use], at[use]))
    return theta, hit


def _variance_polynomial(embedded: np.ndarray) -> np.ndarray:
    """Coefficients [9, A] of |Σ_p e_p θ^p|² for embedded interpolants e [5, A, P]."""
    total = np.zeros((9, embedded.shape[1]))
    for a in range(5):
        total[2 * a] += np.sum(embedded[a] * embedded[a], axis=-1)
        for b in range(a):
            total[a + b] += 2.0 * np.sum(embedded[a] * embedded[b], axis=-1)
    return total


def _evaluate(polynomial: np.ndarray, theta: np.ndarray) -> np.ndarray:
    value = polynomial[-1]
    for coefficient in polynomial[-2::-1]:
        value = coefficient + theta * value
    return value


def _bisect(polynomial: np.ndarray, level: float) -> np.ndarray:
    """Where the polynomial first passes ``level`` on [0, 1], to 2⁻⁵⁰ of the step."""
    low, high = np.zeros(polynomial.shape[1]), np.ones(polynomial.shape[1])
    for _ in range(50):
        middle = 0.5 * (low + high)
        above = _evaluate(polynomial, middle) >= level
        high = np.where(above, middle, high)
        low = np.where(above, low, middle)
    return high
