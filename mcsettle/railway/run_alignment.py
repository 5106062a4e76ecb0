"""Runs of one track laid over one another: where they belong together, and what still differs.

A car's chainage is off by metres and its wheel is worn, so an increment formed point by point is
mostly misplaced track. The lag of a run is found window by window from the correlation of the
band-passed levels, and the chainage corrected by a straight line through the lags. What then differs
between runs with no traffic between them is the error of the measurement, and that of an SD with it.

References
----------
Theil (1950) and Sen (1968): the line of median slopes, which false lags do not move.
"""

from dataclasses import dataclass, replace

import numpy as np

from mcsettle.errors import InputError
from mcsettle.railway.filters import Band, band_passed
from mcsettle.railway.record import Run
from mcsettle.railway.record_sections import resampled

STEP = 0.25  # m, of the common grid
WINDOW = 200.0  # m, over which one lag is found
FURTHEST = 20.0  # m, that a run may be off
ALIKE = 0.7  # correlation from which a window's lag counts
WITHIN = 0.5  # steps: the vertex of a parabola through three correlations


@dataclass(frozen=True)
class Alignment:
    """A run moved onto a reference: x of the reference = x + ``shift`` + ``stretch`` (x − ``middle``).

    ``shift`` m, ``stretch`` [-], ``middle`` m. ``windows`` [W] m middles of the windows, ``lags`` [W] m
    found there and ``correlations`` [W] at them. ``misfit_before``, ``misfit`` m: SD of the difference
    of both band-passed levels as recorded and when aligned; ``residual`` m: what the lags scatter about
    the line by.
    """

    run: Run
    shift: float
    stretch: float
    middle: float
    windows: np.ndarray
    lags: np.ndarray
    correlations: np.ndarray
    misfit_before: float
    misfit: float
    residual: float

    @property
    def text(self) -> str:
        """What was done to the run, and what is left, in words."""
        return (
            f"moved by {self.shift:+.2f} m and stretched by {1e6 * self.stretch:+.0f} mm/km on "
            f"{len(self.lags)} windows (lags within {self.residual:.2f} m of that); the difference from "
            f"the reference has an SD of {1e3 * self.misfit:.2f} mm, {1e3 * self.misfit_before:.2f} mm "
            "as recorded"
        )


@dataclass(frozen=True)
class RepeatError:
    """The error of one SD of one section, from recordings repeated with no traffic between them.

    ``relative`` [-]: standard error over SD; ``low``, ``high``: its 95 % interval; ``sections`` that were
    repeated and the ``degrees`` of freedom they give.
    """

    relative: float
    low: float
    high: float
    sections: int
    degrees: int


def aligned(
    reference: Run, run: Run, band: Band | None = None, furthest: float = FURTHEST
) -> Alignment:
    """``run`` with its chainage moved and stretched onto ``reference``, and the misfit that is left.

    Parameters
    ----------
    reference, run : Run
        Of rising chainage (``record_findings.repaired``), with at least one window in common.
    band : Band, optional
        Waves that are compared (3 to 35 m).
    furthest : float, m
        Lags up to here are looked for.

    Raises
    ------
    InputError
        The runs have no window in common, or are alike in none (another track, or tamped between).
    """
    band = band or Band()
    one, two = _passed(reference, band), _passed(run, band)
    lags = _lags(one, two, furthest)
    good = lags[lags[:, 2] >= ALIKE]
    if not len(good):
        best = float(np.max(lags[:, 2]))
        raise InputError(
            f"runs '{reference.name}' and '{run.name}' are alike nowhere within {furthest:g} m (largest "
            f"correlation {best:.2f} over {WINDOW:g} m): another track, another rail or a tamping between"
        )
    middle = float(np.mean(good[:, 0]))
    shift, stretch = _robust_line(good[:, 0] - middle, good[:, 1])
    moved = run.chainage + shift + stretch * (run.chainage - middle)
    result = replace(run, chainage=moved, posted=run.labels)
    rest = good[:, 1] - shift - stretch * (good[:, 0] - middle)
    return Alignment(
        result, shift, stretch, middle, good[:, 0], good[:, 1], good[:, 2],
        _misfit(one, two), _misfit(one, _passed(result, band)),
        float(np.sqrt(np.mean(rest**2))),
    )  # fmt: skip


def repeat_error(sds: np.ndarray) -> RepeatError:
    """Relative standard error of an SD from repeats: pooled scatter of their logarithms by section.

    Parameters
    ----------
    sds : ndarray, shape [runs, sections], m
        SDs of the same sections, recorded again with no traffic between; NaN where one is missing.

    Raises
    ------
    InputError
        No section has two recordings.

    Examples
    --------
    >>> round(repeat_error(np.array([[1.0, 2.0], [1.1, 2.2]])).relative, 4)
    0.0674
    """
    logs = np.log(np.asarray(sds, dtype=float))
    counts = np.sum(np.isfinite(logs), axis=0)
    repeated = counts >= 2
    degrees = int(np.sum(counts[repeated] - 1))
    if degrees < 1:
        raise InputError("no section was recorded twice: the error of an SD cannot be estimated")
    from scipy import stats

    logs = logs[:, repeated]
    squares = float(np.nansum((logs - np.nanmean(logs, axis=0)) ** 2))
    low, high = (squares / float(stats.chi2.ppf(share, degrees)) for share in (0.975, 0.025))
    return RepeatError(
        float(np.sqrt(squares / degrees)),
        float(np.sqrt(low)),
        float(np.sqrt(high)),
        int(np.sum(repeated)),
        degrees,
    )


def _passed(run: Run, band: Band) -> tuple[np.ndarray, np.ndarray]:
    """Chainage and band-passed level [N] m at the points k × ``STEP`` of the common grid."""
    x, level = resampled(run, STEP)
    level = band_passed(level, STEP, band)
    grid = STEP * np.arange(np.ceil(x[0] / STEP - 1e-9), np.floor(x[-1] / STEP + 1e-9) + 1)
    return grid, np.interp(grid, x, level)


def _common(
    one: tuple[np.ndarray, np.ndarray], two: tuple[np.ndarray, np.ndarray]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Chainage [N] m that two runs on the grid share, and the level of each there."""
    first, last = max(one[0][0], two[0][0]), min(one[0][-1], two[0][-1])
    if last < first:
        raise InputError("the runs have no chainage in common")
    n = round((last - first) / STEP) + 1
    begin = [round((first - run[0][0]) / STEP) for run in (one, two)]
    return first + STEP * np.arange(n), one[1][begin[0] :][:n], two[1][begin[1] :][:n]


def _misfit(one: tuple[np.ndarray, np.ndarray], two: tuple[np.ndarray, np.ndarray]) -> float:
    _, first, second = _common(one, two)
    return float(np.std(second - first))


def _lags(
    one: tuple[np.ndarray, np.ndarray], two: tuple[np.ndarray, np.ndarray], furthest: float
) -> np.ndarray:
    """Middle [m], lag [m] and correlation of each window of the track that both runs cover, [W, 3]."""
    x, first, second = _common(one, two)
    n, reach = round(WINDOW / STEP), round(furthest / STEP)
    rows = []
    for begin in range(reach, len(x) - n - reach + 1, n):
        piece = first[begin : begin + n]
        around = second[begin - reach : begin + n + reach]
        lag, correlation = _lag(piece - piece.mean(), around, reach)
        rows.append((x[begin] + 0.5 * WINDOW, lag, correlation))
    if not rows:
        raise InputError(
            f"the runs have {len(x) * STEP:.4g} m in common; aligning takes {WINDOW + 2 * furthest:g} m"
        )
    return np.array(rows)


def _lag(piece: np.ndarray, around: np.ndarray, reach: int) -> tuple[float, float]:
    """Shift [m] that lays ``around`` onto ``piece``, and the correlation there."""
    n = len(piece)
    products = np.correlate(around, piece, mode="valid")
    sums = np.cumsum(np.concatenate([[0.0], around]))
    squares = np.cumsum(np.concatenate([[0.0], around**2]))
    means = (sums[n:] - sums[:-n]) / n
    spread = np.sqrt(np.maximum((squares[n:] - squares[:-n]) / n - means**2, 1e-30))
    correlations = products / (n * spread * np.std(piece))
    best = int(np.argmax(correlations))
    vertex = 0.0
    if 0 < best < len(correlations) - 1:  # between the steps by a parabola
        a, b, c = correlations[best - 1 : best + 2]
        bend = a - 2.0 * b + c
        vertex = 0.5 * (a - c) / bend if bend < 0.0 else 0.0
    vertex = float(np.clip(vertex, -WITHIN, WITHIN))
    return -(best + vertex - reach) * STEP, float(correlations[best])


def _robust_line(x: np.ndarray, y: np.ndarray) -> tuple[float, float]:
    """Intercept and slope by Theil and Sen: medians, which a few false lags do not move."""
    if len(x) < 3:
        return float(np.mean(y)), 0.0
    i, j = np.triu_indices(len(x), 1)
    slope = float(np.median((y[j] - y[i]) / (x[j] - x[i])))
    return float(np.median(y - slope * x)), slope
