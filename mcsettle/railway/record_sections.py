"""A measured run cut into sections, each as the wave amplitudes of one periodic window.

The run is resampled to equal steps, band-passed whole and cut. Step B's window repeats, a piece of a
record does not: the head of each section is blended with what follows its end, with weights whose
squares add up to one, so that the variance of the blend is that of the record on average; what is
left of a difference is taken out by scaling to the section's own SD. No window function ever tapers
the level to zero.
"""

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import Akima1DInterpolator, CubicSpline

from mcsettle.errors import InputError
from mcsettle.railway.filters import Band, band_passed
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

    ``starts`` [S] m; ``sd`` [S] m of the band-passed record over each section; ``amplitudes`` complex
    [S, K] m with exactly these SDs; ``scaling`` [S] what the blend was multiplied by to have them.
    ``step`` m; ``chainage``, ``level``, ``passed`` [N] the resampled run, whole and band-passed, m.
    """

    starts: np.ndarray
    sd: np.ndarray
    amplitudes: np.ndarray
    scaling: np.ndarray
    step: float
    chainage: np.ndarray
    level: np.ndarray
    passed: np.ndarray


def resampled(run: Run, step: float) -> tuple[np.ndarray, np.ndarray]:
    """Chainage and level [N] m of a mended ``run`` at equal steps [m].

    By a cubic spline; by Akima's, which does not swing out, where there are gaps to bridge.
    """
    n = int(np.floor(run.length / step * (1.0 + 1e-12))) + 1
    if n > MOST_POINTS:
        raise InputError(f"{n} points at steps of {step:g} m; at most {MOST_POINTS}")
    x = run.chainage[0] + step * np.arange(n)
    if np.max(np.diff(run.chainage)) > GAP * run.step:
        return x, np.asarray(Akima1DInterpolator(run.chainage, run.level, method="makima")(x))
    return x, np.asarray(CubicSpline(run.chainage, run.level)(x))


def cut(run: Run, window: float, wavenumbers: np.ndarray, band: Band) -> Sections:
    """Sections of ``window`` [m] of a mended ``run``, from its first point on.

    Parameters
    ----------
    run : Run
        Of rising chainage (``record.mended``).
    window : float, m
    wavenumbers : ndarray, shape [K], rad/m
        Modes of the window that Step B carries.
    band : Band
        Filter of the record.

    Raises
    ------
    InputError
        The run is shorter than a section, its points lie too far apart, or an SD is none of a track
        (units).
    """
    if run.length < window * (1.0 - 1e-9):
        raise InputError(
            f"the record is {run.length:.4g} m long; a section (profile.window_m) is {window:g} m"
        )
    if run.step > band.shortest / 2.5:
        raise InputError(
            f"points {run.step:.3g} m apart cannot carry waves of {band.shortest:g} m: check "
            f"chainage_unit, or take a longer shortest_m"
        )
    per_section = int(np.ceil(window / min(FINEST_STEP, band.shortest / 10.0)))
    step = window / per_section
    x, level = resampled(run, step)
    passed = band_passed(level, step, band)
    n = max(1, int((len(x) - 1 + 1e-9) // per_section))
    pieces = [passed[i * per_section : (i + 1) * per_section] for i in range(n)]
    sd = np.array([np.std(piece) for piece in pieces])
    _check_plausible(sd)
    blends = np.stack([_periodic(passed, i * per_section, per_section, step) for i in range(n)])
    modes = np.rint(wavenumbers * window / (2.0 * np.pi)).astype(int)
    # Δu = Re Σ U e^{ikx}: twice the coefficient of rfft, over the number of points.
    amplitudes = 2.0 * np.fft.rfft(blends, axis=1)[:, modes] / per_section
    own = standard_deviation(amplitudes)
    scaling = sd / np.maximum(own, LEAST_SD * 1e-3)
    return Sections(
        x[0] + window * np.arange(n),
        sd,
        amplitudes * scaling[:, None],
        scaling,
        step,
        x,
        level,
        passed,
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


def _check_plausible(sd: np.ndarray) -> None:
    low, high = PLAUSIBLE
    if np.max(sd) < low or np.median(sd) > high:
        raise InputError(
            f"the sections have SDs of {1e3 * np.min(sd):.3g} to {1e3 * np.max(sd):.3g} mm in the "
            "band, which is no track's: check level_unit"
        )
