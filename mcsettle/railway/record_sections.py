"""A measured run cut into sections, each as the wave amplitudes of one periodic window.

The run is resampled to equal steps, band-passed whole and cut. Step B's window repeats, a piece of a
record does not: the head of each section is blended with what follows its end, with weights whose
squares add up to one, so that the variance of the blend is that of the record on average; what is
left of a difference is taken out by scaling to the section's own SD. No window function ever tapers
the level to zero.
"""

from dataclasses import dataclass, replace

import numpy as np

from mcsettle.errors import InputError
from mcsettle.railway.filters import Band, band_passed, level_from_versines
from mcsettle.railway.irregularity import standard_deviation
from mcsettle.railway.record import GAP, Run
from mcsettle.railway.spectra import Spectrum

BLEND = 35.0  # m of a section's head, at most a quarter of the section
FINEST_STEP = 0.25  # m, of the resampled record unless the band asks for a finer one
LEAST_SD = 1e-6  # m: a flat record has no shape to scale
MOST_POINTS = 20_000_000
PLAUSIBLE = (1e-5, 5e-2)  # m, SD of a section in its band


@dataclass(frozen=True)
class Sections:
    """Sections of one run: S of them, K modes of the window.

    ``chainage_from``, ``chainage_to`` [S] m as the record's owner reads them; ``starts``, ``ends``
    [S] their first points and the points behind their last ones. The last section may be shorter than
    the window; ``left_over`` m behind it are too short to be one. ``sd`` [S] m of the band-passed
    record over each section; ``amplitudes`` complex [S, K] m with exactly these SDs; ``scaling`` [S]
    what the blend was multiplied by to have them. ``step`` m; ``chainage``, ``level``, ``passed`` [N]
    the resampled run, whole and band-passed, m.
    """

    chainage_from: np.ndarray
    chainage_to: np.ndarray
    starts: np.ndarray
    ends: np.ndarray
    left_over: float
    sd: np.ndarray
    amplitudes: np.ndarray
    scaling: np.ndarray
    step: float
    chainage: np.ndarray
    level: np.ndarray
    passed: np.ndarray

    @property
    def begins(self) -> np.ndarray:
        """Where the sections [S] begin by the distance travelled, m."""
        return np.asarray(self.chainage[self.starts])


def resampled(run: Run, step: float) -> tuple[np.ndarray, np.ndarray]:
    """Chainage and level [N] m of a repaired ``run`` at equal steps [m].

    By a cubic spline; by Akima's, which does not swing out, where there are gaps to bridge.
    """
    from scipy.interpolate import Akima1DInterpolator, CubicSpline  # take long to import

    # The last point stands for a step of the record as every other one does.
    n = int(np.floor((run.length + run.step) / step * (1.0 + 1e-12) + 1e-6))
    if n > MOST_POINTS:
        raise InputError(f"{n} points at steps of {step:g} m; at most {MOST_POINTS}")
    x = run.chainage[0] + step * np.arange(n)
    within = np.minimum(x, run.chainage[-1])
    if np.max(np.diff(run.chainage)) > GAP * run.step:
        return x, np.asarray(Akima1DInterpolator(run.chainage, run.level, method="makima")(within))
    return x, np.asarray(CubicSpline(run.chainage, run.level)(within))


def cut(
    run: Run, window: float, wavenumbers: np.ndarray, band: Band, chord: float | None = None
) -> Sections:
    """Sections of ``window`` [m] of a repaired ``run``, from its first point on.

    A point stands for the step behind it. What is left at the end is a shorter section of its own
    from twice the longest wave on; its shape is that of the last whole window of the record.

    Parameters
    ----------
    run : Run
        Of rising chainage (``record_findings.repaired``).
    window : float, m
    wavenumbers : ndarray, shape [K], rad/m
        Modes of the window that Step B carries.
    band : Band
        Filter of the record.
    chord : float, optional, m
        The levels are offsets from the middle of a chord of this length, and are converted.

    Raises
    ------
    InputError
        The run is shorter than a section, its points lie too far apart, or an SD is none of a track
        (units).
    """
    _check_long_and_dense(run, window, band)
    per_section = int(np.ceil(window / min(FINEST_STEP, band.shortest / 10.0)))
    step = window / per_section
    x, level = resampled(run, step)
    if chord is not None:
        level = level_from_versines(level, step, chord, band.longest)
    passed = band_passed(level, step, band)
    starts, ends = _ends(len(x), per_section, int(np.ceil(2.0 * band.longest / step)))
    sd = np.array([np.std(passed[i:j]) for i, j in zip(starts, ends, strict=True)])
    labels = np.interp(x, run.chainage, run.labels)
    _check_plausible(sd, labels[starts])
    blends = np.stack(
        [_periodic(passed, min(i, len(x) - per_section), per_section, step) for i in starts]
    )
    modes = np.rint(wavenumbers * window / (2.0 * np.pi)).astype(int)
    # Δu = Re Σ U e^{ikx}: twice the coefficient of rfft, over the number of points.
    amplitudes = 2.0 * np.fft.rfft(blends, axis=1)[:, modes] / per_section
    own = standard_deviation(amplitudes)
    scaling = sd / np.maximum(own, LEAST_SD * 1e-3)
    return Sections(
        labels[starts],
        labels[ends - 1] + step,
        starts,
        ends,
        float((len(x) - ends[-1]) * step),
        sd,
        amplitudes * scaling[:, None],
        scaling,
        step,
        x,
        level,
        passed,
    )


def worse_rail(one: Sections, two: Sections) -> Sections:
    """Of each section the rail with the larger SD; both rails are cut at the same points."""
    second = two.sd > one.sd
    rows = second[:, None]
    return replace(
        one,
        sd=np.where(second, two.sd, one.sd),
        amplitudes=np.where(rows, two.amplitudes, one.amplitudes),
        scaling=np.where(second, two.scaling, one.scaling),
        level=_chosen(one, two.level, one.level, second),
        passed=_chosen(one, two.passed, one.passed, second),
    )


def sections_spectrum(amplitudes: np.ndarray, wavenumbers: np.ndarray, window: float) -> Spectrum:
    """Mean spectrum of sections [S, K] m, between the modes by power laws: k -> S(k) [m²/(rad/m)]."""
    density = np.mean(0.5 * np.abs(amplitudes) ** 2, axis=0) * window / (2.0 * np.pi)
    logs = np.log(np.maximum(density, 1e-30))

    def spectrum(k: np.ndarray) -> np.ndarray:
        return np.asarray(np.exp(np.interp(np.log(k), np.log(wavenumbers), logs)))

    return spectrum


def _periodic(level: np.ndarray, start: int, n: int, step: float) -> np.ndarray:
    """``n`` points that go on into themselves: the head blended with what follows the end."""
    piece = level[start : start + n].copy()
    width = int(min(BLEND, 0.25 * n * step) / step)
    beyond = level[start + n : start + n + width]
    if len(beyond) < width:  # the record ends here: its mirror image goes on
        mirror = 2.0 * level[-1] - level[-2 : -2 - (width - len(beyond)) : -1]
        beyond = np.concatenate([beyond, mirror])
    angle = 0.5 * np.pi * (np.arange(width) + 0.5) / width
    piece[:width] = np.sin(angle) * piece[:width] + np.cos(angle) * beyond
    return piece


def _chosen(sections: Sections, two: np.ndarray, one: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Level [N] of the second rail over the sections where it is chosen, of the first elsewhere."""
    chosen = one.copy()
    for start, end in zip(sections.starts[second], sections.ends[second], strict=True):
        chosen[start:end] = two[start:end]
    return chosen


def _ends(n: int, per_section: int, least: int) -> tuple[np.ndarray, np.ndarray]:
    """First points of the sections of ``n`` points, and the points behind their last ones."""
    starts = np.arange(0, n - per_section + 1, per_section)
    ends = starts + per_section
    if n - ends[-1] >= least:
        return np.append(starts, ends[-1]), np.append(ends, n)
    return starts, ends


def _check_long_and_dense(run: Run, window: float, band: Band) -> None:
    if run.length + run.step < window * (1.0 - 1e-9):
        raise InputError(
            f"the record is {run.length:.4g} m long; a section (profile.window_m) is {window:g} m"
        )
    if run.step > band.shortest / 2.5:
        raise InputError(
            f"points {run.step:.3g} m apart cannot carry waves of {band.shortest:g} m: check "
            f"chainage_unit, or take a longer shortest_m"
        )


def _check_plausible(sd: np.ndarray, chainage: np.ndarray) -> None:
    low, high = PLAUSIBLE
    worst = int(np.argmax(sd))
    if np.max(sd) < low or np.max(sd) > high:
        raise InputError(
            f"the sections have SDs of {1e3 * np.min(sd):.3g} to {1e3 * np.max(sd):.3g} mm in the "
            f"band (the largest from {chainage[worst]:.6g} m on), which is no track's: check "
            "level_unit, and what the record holds there"
        )
