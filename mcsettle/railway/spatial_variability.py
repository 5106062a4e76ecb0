"""Support that varies along the track: a stationary random field of settlement susceptibility.

Strain increments at x are multiplied by 1 + h(x). On the window of the profile

    h(x) = Re Σ h_n e^{+ik_n x},   h_n = √(S_h Δk) [ρ g_n + √(1 − ρ²) g′_n],   n = 1 … 2 n_max,

with g the profile's own normal numbers, g′ numbers of an address of their own, and the bracket g′_n
alone outside the profile's band: ρ is the coherence, wave by wave, with the profile before traffic.
Waves beyond twice the profile's highest cannot bring a wave of the profile back into its band.
The tracks stay the same tracks whatever the field: no number of theirs is drawn anew.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import ndtr

from mcsettle.errors import InputError
from mcsettle.railway.irregularity import random_amplitudes
from mcsettle.railway.spectra import Spectrum

LARGEST_GAUSSIAN = 0.3  # point coefficient of variation: 1 + h < 0 in 0.04 % of the track
SECTION_STREAM, FIELD_STREAM, LAYER_STREAM = 1, 2, 3  # the layers' own fields follow the last
LARGEST_LOG_SD = 1.5  # of a lognormal field at a point


@dataclass(frozen=True)
class SpatialVariability:
    """How settlement susceptibility varies along the track.

    ``cov`` is its coefficient of variation in the profile's band, at the initial SD ``reference_sd``
    [m] if there is one (then it is proportional to the initial SD). ``correlation_length`` [m] of an
    exponential correlation, or None: the profile's own spectrum, in its band alone. ``multipliers``
    [L] of h in the layers of the track; ``independent``: each layer has a field of its own.
    ``persistence``: correlation of the field before and after a tamping.
    """

    cov: float
    correlation_length: float | None
    profile_correlation: float = 0.0
    distribution: str = "gaussian"
    multipliers: tuple[float, ...] = (1.0,)
    independent: bool = False
    reference_sd: float | None = None
    persistence: float = 1.0

    def coupling(self, settling: Iterable[int]) -> np.ndarray:
        """What each field is multiplied by in each layer, [F, L]; no field where nothing settles."""
        m = np.array(self.multipliers)
        keep = np.isin(np.arange(m.size), list(settling)) & (m != 0.0)
        if self.independent:
            return np.diag(m)[keep]
        return m[None, :] * keep if keep.any() else np.zeros((0, m.size))

    def streams(self, settling: Iterable[int]) -> list[int]:
        """Stream of the normal numbers of each field."""
        rows = self.coupling(settling)
        if not self.independent:
            return [FIELD_STREAM] * len(rows)
        return [LAYER_STREAM + int(np.flatnonzero(row)[0]) for row in rows]


@dataclass(frozen=True, eq=False)
class FieldWaves:
    """Waves 1 … M = 2 n_max of a field, of which ``first`` to ``last`` are the profile's.

    ``scale`` [M]: root mean square √(S_h Δk) of each for a coefficient of variation of 1 in the band.
    """

    scale: np.ndarray
    first: int
    last: int

    @property
    def band(self) -> slice:
        """The profile's waves among [M]."""
        return slice(self.first - 1, self.last)

    @property
    def point_share(self) -> float:
        """Coefficient of variation at a point over that in the band."""
        return float(np.sqrt(np.sum(self.scale**2)))

    @property
    def n_points(self) -> int:
        """Points of the grid on which a lognormal field is made: eight on its shortest wave."""
        return int(2 ** np.ceil(np.log2(8 * self.scale.size)))


def field_waves(
    settings: SpatialVariability, modes: np.ndarray, window: float, profile: Spectrum
) -> FieldWaves:
    """The waves of a field on a window [m] whose profile has the mode numbers ``modes`` [K].

    ``profile``: its spectrum, which the field has (in the band) without a correlation length.
    """
    number = np.arange(1, 2 * int(modes[-1]) + 1)
    k = 2.0 * np.pi * number / window
    band = (number >= modes[0]) & (number <= modes[-1])
    if settings.correlation_length is None:
        density = np.where(band, profile(k), 0.0)
    else:
        length = settings.correlation_length
        density = length / (1.0 + (k * length) ** 2)
    scale = np.sqrt(density / density[band].sum())
    return FieldWaves(scale, int(modes[0]), int(modes[-1]))


def negative_share(coefficient: float) -> float:
    """Share of the track where a Gaussian 1 + h of this point coefficient is negative."""
    return float(ndtr(-1.0 / coefficient)) if coefficient > 0.0 else 0.0


def susceptibility(
    settings: SpatialVariability,
    waves: FieldWaves,
    seed: int,
    indices: Iterable[int],
    settling: Iterable[int],
    initial_sd: np.ndarray | None = None,
    tamping: int = 0,
    to_come: tuple[int, Sequence[int]] | None = None,
) -> np.ndarray:
    """Fields of h, complex [R, F, M] at modes 1 … M.

    Parameters
    ----------
    settings : SpatialVariability
    waves : FieldWaves
    seed, indices : address of each realisation, as of its profile
    settling : layers that have a settlement law
    initial_sd : [R] m, where there is a ``reference_sd``
    tamping : how many tampings the field has lived through
    to_come : the tampings after so many have what they draw anew from these addresses [R]
    """
    streams, rows = settings.streams(settling), list(indices)
    fields = np.empty((len(rows), len(streams), waves.scale.size), dtype=complex)
    for r, index in enumerate(rows):
        cov = settings.cov
        if settings.reference_sd is not None and initial_sd is not None:
            cov *= float(initial_sd[r]) / settings.reference_sd
        for f, stream in enumerate(streams):
            later = None if to_come is None else (to_come[0], to_come[1][r])
            normals = _normals(settings, waves, seed, index, stream, tamping, later)
            fields[r, f] = _field(settings.distribution, waves, cov, normals)
    return fields


@dataclass(frozen=True, eq=False)
class SupportVariation:
    """How the support differs along and between the sections of a study.

    ``settings`` and ``waves`` of the fields (None: alike along the track); ``settling``: layers with a
    settlement law; ``section_log_sd`` of a lognormal factor of each section, 0: none.
    """

    settings: SpatialVariability | None = None
    waves: FieldWaves | None = None
    settling: tuple[int, ...] = ()
    section_log_sd: float = 0.0

    @property
    def multipliers(self) -> np.ndarray | None:
        """Multipliers [F, L] of each field in each layer; None where no field is."""
        return None if self.settings is None else self.settings.coupling(self.settling)

    def sample(
        self,
        seed: int,
        indices: Iterable[int],
        initial_sd: np.ndarray,
        tamping: int = 0,
        to_come: tuple[int, Sequence[int]] | None = None,
    ) -> tuple[np.ndarray | None, np.ndarray | None]:
        """Fields complex [R, F, M] and factors [R] of realisations of SD ``initial_sd`` [R] m.

        None for what there is none of. ``tamping``, ``to_come``: as for ``susceptibility``.
        """
        rows, fields, factors = list(indices), None, None
        if self.settings is not None and self.waves is not None:
            fields = susceptibility(
                self.settings, self.waves, seed, rows, self.settling, initial_sd, tamping, to_come
            )
        if self.section_log_sd > 0.0:
            factors = section_factors(seed, rows, self.section_log_sd)
        return fields, factors


UNIFORM = SupportVariation()


def section_factors(seed: int, indices: Iterable[int], log_sd: float) -> np.ndarray:
    """Lognormal factor [R] of median 1 on each realisation's settlement, the same in every scenario."""
    drawn = [random_amplitudes(seed, i, 1, (SECTION_STREAM, 0))[0].real for i in indices]
    return np.exp(log_sd * np.array(drawn))


def to_points(fields: np.ndarray, n_points: int) -> np.ndarray:
    """Fields h [..., X] at x = window · (0 … X − 1)/X from modes 1 … M [..., M]; X exceeds 2 M."""
    spectrum = np.zeros((*fields.shape[:-1], n_points // 2 + 1), dtype=complex)
    spectrum[..., 1 : fields.shape[-1] + 1] = fields
    flat = spectrum.reshape(-1, spectrum.shape[-1])
    # Row by row: a transform of many rows at once may round differently in other batches.
    rows = [np.fft.irfft(row, n_points) * (n_points / 2.0) for row in flat]
    return np.array(rows).reshape(*fields.shape[:-1], n_points)


def _normals(
    settings: SpatialVariability,
    waves: FieldWaves,
    seed: int,
    index: int,
    stream: int,
    tamping: int,
    to_come: tuple[int, int] | None = None,
) -> np.ndarray:
    """Complex normal numbers [M] of one field, in the band coherent with those of the profile."""
    rho, p = settings.profile_correlation, settings.persistence
    profile = random_amplitudes(seed, index, waves.last - waves.first + 1)
    normals = random_amplitudes(seed, index, waves.scale.size, (stream, 0))
    normals[waves.band] = rho * profile + np.sqrt(1.0 - rho**2) * normals[waves.band]
    for after in range(1, tamping + 1 if p < 1.0 else 1):
        own = index if to_come is None or after <= to_come[0] else to_come[1]
        fresh = random_amplitudes(seed, own, waves.scale.size, (stream, after))
        normals = p * normals + np.sqrt(1.0 - p**2) * fresh
    return normals


def _field(distribution: str, waves: FieldWaves, cov: float, normals: np.ndarray) -> np.ndarray:
    """Amplitudes [M] of one field."""
    if distribution == "gaussian":
        return np.asarray(cov * waves.scale * normals)
    scale, n_points = _log_scale(waves, cov), waves.n_points
    factor = np.exp(to_points(scale * waves.scale * normals, n_points))
    # Over its own mean: a section that settles more as a whole is another matter (section_factors).
    return np.asarray(np.fft.rfft(factor / factor.mean())[1 : normals.size + 1] * (2.0 / n_points))


_log_scales: dict[tuple[bytes, int, float], float] = {}


def refuse_unreachable(waves: FieldWaves, cov: float) -> None:
    """Refuse a lognormal field of a coefficient in the band that these waves cannot have.

    Raises
    ------
    InputError
        With the largest that they can have.
    """
    largest = _band_coefficient(waves, LARGEST_LOG_SD / waves.point_share)
    if cov > largest:
        raise InputError(
            f"received a cov of {cov:g}; a lognormal field of these waves has at most {largest:.3g} in "
            "the profile's band"
        )


def _log_scale(waves: FieldWaves, cov: float) -> float:
    """Factor of the waves in the exponent of a lognormal field of coefficient ``cov`` in the band."""
    key = waves.scale.tobytes(), waves.first, cov
    if key not in _log_scales:
        from scipy.optimize import brentq  # takes long to import, and few need it

        refuse_unreachable(waves, cov)
        high = LARGEST_LOG_SD / waves.point_share
        _log_scales[key] = float(
            brentq(lambda a: _band_coefficient(waves, a) - cov, 0.0, high, xtol=1e-14)
        )
    return _log_scales[key]


def _band_coefficient(waves: FieldWaves, scale: float) -> float:
    """Coefficient of variation, in the band, of exp of the field of ``scale`` times the waves.

    The exponential of a Gaussian field of covariance C has the covariance e^C − 1, over its squared mean.
    """
    covariance = to_points((waves.scale**2).astype(complex), waves.n_points)
    power = np.fft.rfft(np.expm1(scale**2 * covariance)).real * (2.0 / waves.n_points)
    return float(np.sqrt(power[1:][waves.band].sum()))
