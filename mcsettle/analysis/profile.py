"""What a measured record says: SD by section, spectrum against published ones, filter's effect.

The constant of a spectrum of known shape is fitted by averaging periodogram over shape: each ordinate
of a Gaussian process is exponentially distributed about S(k), so the mean ratio is unbiased and is
the maximum-likelihood estimate; its standard error is the constant over the root of their number.

The quality classes are those commonly quoted for EN 13848-6 (SD of longitudinal level D1 by speed);
check them against your copy of the standard.
"""

from dataclasses import dataclass

import numpy as np

from mcsettle.railway.filters import D1, Band, band_passed, sd_ratio
from mcsettle.railway.measured_profiles import Record
from mcsettle.railway.record_findings import Finding
from mcsettle.railway.record_sections import Sections, sections_spectrum
from mcsettle.railway.spectra import (
    FRA_ROUGHNESS,
    GERMAN_ROUGHNESS,
    ONE_CORNER_ROUGHNESS,
    Spectrum,
    fra,
    fra_one_corner,
    german,
)

# Upper bounds of classes A to D [m] by the highest speed [km/h] they are for; above D is E.
EN_CLASSES = {
    80: (1.25e-3, 1.75e-3, 2.75e-3, 3.75e-3),
    120: (0.75e-3, 1.10e-3, 1.80e-3, 2.50e-3),
    160: (0.65e-3, 0.85e-3, 1.40e-3, 1.85e-3),
    230: (0.60e-3, 0.75e-3, 1.15e-3, 1.60e-3),
    300: (0.40e-3, 0.55e-3, 0.85e-3, 1.15e-3),
}
SHAPES = {
    "fra": (fra, "m²·cycle/m"),
    "fra_one_corner": (fra_one_corner, "m²·rad/m"),
    "german": (german, "m²·rad/m"),
}
PUBLISHED = {
    "fra": {f"class {i}": a for i, a in enumerate(FRA_ROUGHNESS, 1)},
    "fra_one_corner": {f"class {i}": a for i, a in enumerate(ONE_CORNER_ROUGHNESS, 1)},
    "german": {name.removeprefix("german_"): a for name, a in GERMAN_ROUGHNESS.items()},
}


D1_FILTER = Band(*D1, "butterworth", 4)


@dataclass(frozen=True)
class Fit:
    """A spectrum of known shape fitted to a record.

    ``roughness`` with ``standard_error`` in ``unit``; ``nearest`` published class by ratio;
    ``misfit``: standard deviation over wavelength of log10(measured mean / fitted), chance included.
    """

    shape: str
    roughness: float
    standard_error: float
    unit: str
    nearest: str
    misfit: float


@dataclass(frozen=True)
class ProfileReport:
    """A record looked at; lengths in metres.

    ``sd`` [S] in the record's band; ``sd_d1`` [S] in D1 by a Butterworth of order 4; ``classes`` [S]
    of EN 13848-6 where a speed is given; ``filter_effect``: SD through the record's filter over SD
    through the ideal band, for the record's own spectrum (inside the band, continued outside it).
    """

    run: str
    length: float
    median_step: float
    points: int
    findings: tuple[Finding, ...]
    remarks: tuple[str, ...]
    band: Band
    window: float
    sections: Sections
    sd: np.ndarray
    sd_d1: np.ndarray
    classes: tuple[str, ...]
    speed_kmh: float | None
    filter_effect: float
    fits: tuple[Fit, ...]
    wavenumbers: np.ndarray
    power: np.ndarray


def profile_report(
    record: Record,
    window: float,
    wavenumbers: np.ndarray,
    band: Band,
    speed_kmh: float | None = None,
) -> ProfileReport:
    """Everything ``mcsettle profile`` shows of a prepared ``record``.

    Parameters
    ----------
    record : Record
    window : float, m
    wavenumbers : ndarray, shape [K], rad/m
    band : Band
        The record's filter.
    speed_kmh : float, optional
        Speed of the line, for the quality classes.
    """
    parts = record.sections
    in_d1 = band.passed and (band.shortest, band.longest) == D1
    d1 = parts.passed if in_d1 else band_passed(parts.level, parts.step, D1_FILTER)
    sd_d1 = np.array([np.std(d1[i:j]) for i, j in zip(parts.starts, parts.ends, strict=True)])
    power = 0.5 * np.abs(parts.amplitudes) ** 2 * window / (2.0 * np.pi)
    own = sections_spectrum(parts.amplitudes, wavenumbers, window)
    return ProfileReport(
        run=record.run.name,
        length=record.run.length,
        median_step=record.run.step,
        points=len(record.run.chainage),
        findings=record.findings,
        remarks=record.remarks,
        band=band,
        window=window,
        sections=parts,
        sd=parts.sd,
        sd_d1=sd_d1,
        classes=tuple(quality_class(sd, speed_kmh) for sd in sd_d1) if speed_kmh else (),
        speed_kmh=speed_kmh,
        filter_effect=sd_ratio(
            band, _continued(own, wavenumbers), Band(band.shortest, band.longest)
        ),
        fits=tuple(fitted(name, power, wavenumbers, band) for name in SHAPES),
        wavenumbers=wavenumbers,
        power=power.mean(axis=0),
    )


def fitted(shape: str, power: np.ndarray, wavenumbers: np.ndarray, band: Band) -> Fit:
    """Fit the constant of the spectrum ``shape`` to periodograms [S, K] m²/(rad/m).

    The gain of the record's filter is taken out.
    """
    form, unit = SHAPES[shape]
    ratio = power / (form(wavenumbers, 1.0) * band.gain(wavenumbers) ** 2)
    roughness = float(ratio.mean())
    error = roughness / np.sqrt(ratio.size)
    if len(ratio) >= 5:  # sections of a line differ by more than chance
        error = max(error, float(ratio.mean(axis=1).std(ddof=1) / np.sqrt(len(ratio))))
    known = PUBLISHED[shape]
    nearest = min(known, key=lambda name: abs(np.log(known[name] / roughness)))
    misfit = float(np.std(np.log10(np.maximum(ratio.mean(axis=0), 1e-30) / roughness)))
    return Fit(shape, roughness, error, unit, nearest, misfit)


def quality_class(sd: float, speed_kmh: float) -> str:
    """Class A to E of EN 13848-6 for an SD [m] of D1 at a line's speed.

    >>> quality_class(1.0e-3, 200.0)
    'C'
    """
    limits = next((EN_CLASSES[v] for v in EN_CLASSES if speed_kmh <= v), EN_CLASSES[300])
    return "ABCDE"[int(np.searchsorted(limits, sd))]


def _continued(own: Spectrum, wavenumbers: np.ndarray) -> Spectrum:
    """A record's spectrum carried on outside its band as the FRA shape has it."""
    low, high = float(wavenumbers[0]), float(wavenumbers[-1])

    def spectrum(k: np.ndarray) -> np.ndarray:
        inside = np.clip(k, low, high)
        return np.asarray(own(inside) * fra(k, 1.0) / fra(inside, 1.0))

    return spectrum
