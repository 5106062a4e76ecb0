"""One variant and scenario of a study as Step B takes it: case, initial tracks, days recorded."""

import hashlib

import numpy as np

from mcsettle.railway.irregularity import default_section, sample_profiles, standard_deviation
from mcsettle.railway.measured_profiles import ensemble
from mcsettle.railway.record_sections import Sections
from mcsettle.railway.spectra import spectrum
from mcsettle.run.transfers import StepA
from mcsettle.step_b.case import Case
from mcsettle.study.study import Study, study_wavenumbers
from mcsettle.units import DAYS_PER_YEAR, MM


def build_case(study: Study, prepared: StepA, variant: str, scenario: str) -> Case:
    """The engine's description of one variant and scenario."""
    settings = study.settlement_settings(variant)
    return Case(
        timetable=study.timetable(scenario),
        transfers=prepared.transfers[variant, scenario],
        model=settings.model(study.track(variant)),
        window=study.profile.window_m,
        sd_limit=study.limit.sd_limit,
        horizon=study.limit.horizon_days,
    )


def initial_profiles(study: Study, indices: range, variant: str | None = None) -> np.ndarray:
    """Initial amplitudes complex [R, K] m of the realisations ``indices``, the same in every scenario.

    A ``variant`` with a spectrum of its own has the same random numbers under another spectrum.
    """
    profile = study.profile
    own = None if variant is None else study.variant(variant)
    name, number = profile.spectrum, profile.fra_class
    if own is not None:
        name, number = own.spectrum or name, own.fra_class or number
    record = study.record()
    if record is not None:
        return _measured_profiles(study, record.sections, indices)
    return sample_profiles(
        spectrum(name, number),
        study_wavenumbers(study),
        profile.window_m,
        study.seed,
        indices,
        sd=profile.sd,
        section=default_section(profile.window_m),
    )


def _measured_profiles(study: Study, sections: Sections, indices: range) -> np.ndarray:
    """Initial amplitudes around a measured record, scaled to the study's SD where it gives one."""
    table, sd = study.profile.record, study.profile.sd
    assert table is not None
    noise = (table.noise_mm or 0.0) * MM
    profiles = ensemble(sections, table.ensemble, table.section, noise, study.seed, indices)
    if sd is None:
        return profiles
    own = standard_deviation(
        profiles, study_wavenumbers(study), default_section(study.profile.window_m)
    )
    return np.asarray(profiles * (sd / own)[:, None])


def sample_days(study: Study) -> np.ndarray:
    """Days at which histories are recorded: the study's, the start and the first year."""
    days = {0.0, DAYS_PER_YEAR, *study.run.history_days}
    return np.array(sorted(day for day in days if day <= study.limit.horizon_days))


def step_b_key(study: Study, variant: str, scenario: str) -> str:
    """Digest of all that decides Step B's rows of one variant and scenario: no economics.

    Studies of equal key (parameter sets that differ in money alone) have equal rows.
    """
    run = study.run
    parts = (
        study.track_table,  # what the track is made of, and how it is modelled
        study.variant(variant),
        study.settlement_settings(variant),
        study.timetable(scenario),
        study.profile,
        study.limit,
        study.seed,
        (run.stepping, run.right_hand_side, run.precision, run.history_days),
    )
    return hashlib.sha256("\n".join(map(repr, parts)).encode()).hexdigest()
