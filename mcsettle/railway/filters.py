"""Band-pass filters of track records and what each does to a standard deviation.

Zero-phase filters only: a Butterworth of stated order run forwards and backwards (its gain is
squared: −6 dB at both edges), or the ideal band, which keeps what lies inside and nothing else.
``D1`` of EN 13848 is 3–25 m; the filter by which a record was made belongs to its own description.

References
----------
EN 13848-1, longitudinal level: ranges D1 (3 to 25 m), D2 (25 to 70 m), D3 (70 to 150 m); its annex
on chord measurements and their transfer function.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from mcsettle.errors import InputError

KINDS = ("ideal", "butterworth")
D1 = (3.0, 25.0)  # m
FINEST = 4096  # points of the quadrature over wavelength
LEAST_GAIN = 0.1  # of a chord: waves that it shows more weakly are lost
REACH = 4.0  # longest waves on each side that a filter still feels


@dataclass(frozen=True)
class Band:
    """Wavelengths ``shortest`` to ``longest`` [m] kept by a filter of ``kind`` and ``order``.

    ``passed``: the record went through that filter before it was written, and goes through no other.
    """

    shortest: float = 3.0
    longest: float = 35.0
    kind: str = "ideal"
    order: int = 4
    passed: bool = False

    def __post_init__(self) -> None:
        if not 0.0 < self.shortest < self.longest < np.inf:
            raise InputError(
                f"band {self.shortest:g}–{self.longest:g} m; lengths must be positive and rise"
            )
        if self.kind not in KINDS:
            raise InputError(f"filter '{self.kind}' is unknown; choose one of {', '.join(KINDS)}")
        if not 1 <= self.order <= 12:
            raise InputError(f"order {self.order} of the filter; it must lie between 1 and 12")

    def gain(self, wavenumbers: np.ndarray) -> np.ndarray:
        """Gain [-] at ``wavenumbers`` [rad/m]: zero phase, forwards and backwards together.

        The Butterworth's is that of the continuous filter, to which the digital one comes near at
        steps far below the shortest wave.
        """
        k = np.asarray(wavenumbers, dtype=float)
        low, high = 2.0 * np.pi / self.longest, 2.0 * np.pi / self.shortest
        if self.kind == "ideal":
            return np.asarray((k >= low * (1.0 - 1e-12)) & (k <= high * (1.0 + 1e-12)), dtype=float)
        with np.errstate(divide="ignore", over="ignore"):
            detuning = (k**2 - low * high) / (k * (high - low))
            return np.asarray(1.0 / (1.0 + detuning ** (2 * self.order)))


def band_passed(level: np.ndarray, step: float, band: Band) -> np.ndarray:
    """``level`` [N] m at equal steps [m] with the waves of ``band`` only.

    Both ends are continued by odd reflections that fade out, so that they ring as little as can be;
    within about the longest wave of an end the result is still a guess.

    Raises
    ------
    InputError
        The step is too coarse for the shortest wave, or the record shorter than twice the longest.
    """
    if step > band.shortest / 2.5:
        raise InputError(
            f"points {step:.3g} m apart cannot carry waves of {band.shortest:g} m; they must lie at "
            f"most {band.shortest / 2.5:.3g} m apart"
        )
    if band.passed:
        return np.asarray(level - np.mean(level))
    if len(level) * step < 2.0 * band.longest:
        raise InputError(
            f"the record is {len(level) * step:.4g} m long; waves of {band.longest:g} m need at "
            f"least {2.0 * band.longest:g} m"
        )
    padded, pad = _continued(level, int(np.ceil(REACH * band.longest / step)))
    if band.kind == "ideal":
        wavenumbers = 2.0 * np.pi * np.fft.rfftfreq(len(padded), step)
        passed = np.fft.irfft(np.fft.rfft(padded) * band.gain(wavenumbers), len(padded))
    else:
        from scipy import signal  # takes half a second to import

        edges = 1.0 / band.longest, 1.0 / band.shortest
        sections = signal.butter(band.order, edges, "bandpass", output="sos", fs=1.0 / step)
        passed = signal.sosfiltfilt(sections, padded, padlen=0)
    return np.asarray(passed[pad : pad + len(level)])


def level_from_versines(
    versine: np.ndarray, step: float, chord: float, longest: float
) -> np.ndarray:
    """Level [N] m of offsets ``versine`` [N] m from the middle of a chord [m], at equal steps [m].

    The offset from the middle of a symmetrical chord has the gain ``versine_gain``; waves that it
    shows with less than ``LEAST_GAIN`` are lost and left out, the others divided by it. Waves longer
    than twice ``longest`` [m] are left out as well: their errors would be enlarged without bound.
    """
    padded, pad = _continued(versine, int(np.ceil(REACH * longest / step)))
    wavenumbers = 2.0 * np.pi * np.fft.rfftfreq(len(padded), step)
    gain = versine_gain(wavenumbers, chord)
    shown = (gain >= LEAST_GAIN) & (wavenumbers >= np.pi / longest)
    waves = np.where(shown, np.fft.rfft(padded) / np.where(shown, gain, 1.0), 0.0)
    return np.asarray(np.fft.irfft(waves, len(padded))[pad : pad + len(versine)])


def versine_gain(wavenumbers: np.ndarray, chord: float) -> np.ndarray:
    """Gain 1 − cos(k L/2) [-] at ``wavenumbers`` [rad/m] of the offset from the middle of a chord [m].

    >>> versine_gain(2.0 * np.pi / np.array([5.0, 10.0, 20.0]), 10.0).round(12).tolist()
    [0.0, 2.0, 1.0]
    """
    return np.asarray(1.0 - np.cos(0.5 * np.asarray(wavenumbers) * chord))


def versine_loss(
    chord: float, band: Band, spectrum: Callable[[np.ndarray], np.ndarray]
) -> tuple[float, tuple[float, ...]]:
    """Share of a profile's variance within ``band`` that a chord [m] does not show, and its blind waves.

    Returns
    -------
    The share [-] for a profile of ``spectrum`` (k -> S [m²/(rad/m)]), and the wavelengths [m] within
    the band at which the chord shows nothing, L/2, L/4, …, longest first.
    """
    k = np.linspace(2.0 * np.pi / band.longest, 2.0 * np.pi / band.shortest, FINEST)
    power = spectrum(k)
    lost = versine_gain(k, chord) < LEAST_GAIN
    blind = tuple(chord / (2.0 * n) for n in range(1, int(chord / (2.0 * band.shortest)) + 1))
    share = float(np.sum(power[lost]) / np.sum(power))
    return share, tuple(wave for wave in blind if wave <= band.longest)


def _continued(level: np.ndarray, reach: int) -> tuple[np.ndarray, int]:
    """``level`` without its trend, continued on both sides by odd reflections that fade out."""
    pad = min(len(level) - 1, reach)
    x = np.arange(len(level))
    trend = np.polynomial.Polynomial.fit(x, level, 1)
    padded = np.pad(level - trend(x), pad, mode="reflect", reflect_type="odd")
    fade = np.sin(0.5 * np.pi * np.arange(pad) / max(pad, 1)) ** 2  # of the continuations alone
    padded[:pad] *= fade
    padded[len(padded) - pad :] *= fade[::-1]
    return padded, pad


def sd_ratio(band: Band, spectrum: Callable[[np.ndarray], np.ndarray], reference: Band) -> float:
    """SD through ``band`` over SD through ``reference``, for a profile of ``spectrum``.

    Parameters
    ----------
    band, reference : Band
    spectrum : callable, k [rad/m] -> S(k) [m²/(rad/m)], one-sided

    Examples
    --------
    >>> from mcsettle.railway.spectra import spectrum
    >>> ideal = Band(3.0, 35.0)
    >>> round(sd_ratio(Band(3.0, 25.0), spectrum("fra"), ideal), 3)
    0.745
    """
    ends = (min(band.shortest, reference.shortest), max(band.longest, reference.longest))
    k = np.geomspace(2.0 * np.pi / (20.0 * ends[1]), 2.0 * np.pi * 20.0 / ends[0], FINEST * 16)
    power = spectrum(k) * k
    own, other = (float(np.trapezoid(power * b.gain(k) ** 2, np.log(k))) for b in (band, reference))
    return float(np.sqrt(own / other))
