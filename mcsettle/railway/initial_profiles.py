"""Initial profiles of a study's realisations: from a spectrum, or around a measured record."""

from dataclasses import dataclass

import numpy as np

from mcsettle.railway.irregularity import default_section, sample_profiles, standard_deviation
from mcsettle.railway.measured_profiles import ensemble
from mcsettle.railway.record_sections import Sections
from mcsettle.railway.spectra import spectrum


@dataclass(frozen=True, eq=False)
class MeasuredSections:
    """Sections of a measured record, and which ensemble is drawn around them.

    ``noise`` [m] is the standard deviation of the recording car's error, by point.
    """

    sections: Sections
    ensemble: str
    section: int
    noise: float


@dataclass(frozen=True, eq=False)
class InitialProfiles:
    """Where the initial profiles of a variant come from, the same in every scenario.

    ``window`` m; ``wavenumbers`` [K] rad/m; ``sd`` m that profiles are scaled to (None: as drawn).
    Variants that differ in the spectrum alone have the same random numbers under another spectrum.
    """

    window: float
    wavenumbers: np.ndarray
    seed: int
    spectrum: str
    fra_class: int
    sd: float | None = None
    measured: MeasuredSections | None = None

    def sample(self, indices: range) -> np.ndarray:
        """Amplitudes complex [R, K] m of the realisations ``indices``."""
        section = default_section(self.window)
        if self.measured is None:
            return sample_profiles(
                spectrum(self.spectrum, self.fra_class),
                self.wavenumbers,
                self.window,
                self.seed,
                indices,
                sd=self.sd,
                section=section,
            )
        record = self.measured
        profiles = ensemble(
            record.sections, record.ensemble, record.section, record.noise, self.seed, indices
        )
        if self.sd is None:
            return profiles
        before = standard_deviation(profiles, self.wavenumbers, section)
        return np.asarray(profiles * (self.sd / before)[:, None])
