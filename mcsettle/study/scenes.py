"""What the model needs of a study: one ``Scene`` for each variant and scenario."""

import hashlib
from typing import TYPE_CHECKING

import numpy as np

from mcsettle.railway.initial_profiles import InitialProfiles, MeasuredSections
from mcsettle.railway.irregularity import profile_modes, wavenumbers
from mcsettle.railway.scene import Scene
from mcsettle.study.build import build_settlement
from mcsettle.study.build_forms import build_rail_loads, build_support
from mcsettle.study.schema.study import StudyTables
from mcsettle.units import MM

if TYPE_CHECKING:
    from mcsettle.study.study import Study


def build_scene(study: "Study", variant: str, scenario: str) -> Scene:
    """The scene of one variant and scenario."""
    settings, track, run = study.settlement_settings(variant), study.track(variant), study.run
    profile, table = study.profile, study.variant(variant)
    modes = profile_modes(profile.window_m, profile.shortest_m, profile.longest_m)
    return Scene(
        variant=variant,
        scenario=scenario,
        track=track,
        timetable=study.timetable(scenario, variant),
        settlement=build_settlement(settings, track),
        integration_depth=settings.integration_depth_m,
        softening=study.softening(variant),
        contact=study.track_table.hertz_stiffness_n_per_m,
        profiles=build_initial_profiles(study, variant),
        sd_limit=study.limit.sd_limit,
        horizon=study.limit.horizon_days,
        sample_days=study.sample_days,
        stepping=run.stepping,
        right_hand_side=run.right_hand_side,
        precision=run.precision,
        rail_loads=build_rail_loads(study.track_table, table),
        support=build_support(
            study.spatial_variability, track, profile, modes, table, settings.section_log_sd or 0.0
        ),
        reference_scenario=study.reference_scenario,
    )


def build_initial_profiles(study: "Study", variant: str | None = None) -> InitialProfiles:
    """Where the initial profiles of ``variant`` come from (None: as the study says)."""
    profile, record, measured = study.profile, study.record(), None
    name, number = profile.spectrum, profile.fra_class
    if variant is not None:
        table = study.variant(variant)
        name, number = table.spectrum or name, table.fra_class or number
    if record is not None and profile.record is not None:
        choice = profile.record
        noise = (choice.noise_mm or 0.0) * MM
        measured = MeasuredSections(record.sections, choice.ensemble, choice.section, noise)
    return InitialProfiles(
        profile.window_m, profile_wavenumbers(study), study.seed, name, number, profile.sd, measured
    )


def profile_wavenumbers(study: StudyTables) -> np.ndarray:
    """Wavenumbers [K] rad/m of the profile's modes."""
    profile = study.profile
    return wavenumbers(profile.window_m, profile.shortest_m, profile.longest_m)


def step_b_key(study: "Study", variant: str, scenario: str) -> str:
    """Digest of all that decides the rows of Step B: parameter sets of equal key have equal rows."""
    run = study.run
    parts = (
        study.track_table,  # what the track is made of, and how it is modelled
        study.variant(variant),
        study.settlement_settings(variant),
        study.timetable(scenario, variant),
        study.timetable(study.reference_scenario, variant),
        study.spatial_variability,
        study.profile,
        study.limit,
        study.seed,
        (run.stepping, run.right_hand_side, run.precision, run.history_days),
    )
    return hashlib.sha256("\n".join(map(repr, parts)).encode()).hexdigest()
