"""A study's track made ready to be looked at: responses, transfer functions, one profile.

Variants that differ in Step B alone have one and the same track.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mcsettle.analysis.stress_under_train import (
    change_squares,
    dynamic_squares,
    layer_weights,
    profile_power,
    quasi_static_overhead,
    stress_along,
)
from mcsettle.analysis.table4 import (
    CHANGE,
    DYNAMIC,
    LARGEST,
    METRIC_OF,
    OVERHEAD,
    REALISATIONS,
    Increase,
    SurfaceStress,
    increases,
)
from mcsettle.railway.irregularity import default_section, sample_profiles
from mcsettle.railway.record_sections import sections_spectrum
from mcsettle.railway.scene import Scene
from mcsettle.railway.softening_choices import Softened
from mcsettle.railway.spectra import Spectrum, spectrum
from mcsettle.railway.track import Track, depth_below_subgrade
from mcsettle.railway.traffic import Service
from mcsettle.step_a.track_response import track_response
from mcsettle.step_a.transfer import TrackResponse, TransferFunctions
from mcsettle.step_a.transfers import StepA, section_settings, step_a
from mcsettle.study.study import Study
from mcsettle.types import Progress, silent
from mcsettle.units import KMH


@dataclass(frozen=True)
class Run:
    """One train at one speed: where it runs first (``scenario``), Step A for it, its ground."""

    scenario: str
    service: Service
    transfer: TransferFunctions
    response: TrackResponse
    softened: Softened | None = None

    @property
    def label(self) -> str:
        """Train and speed in words."""
        return f"{self.service.train.name}, {self.service.speed / KMH:.0f} km/h"


@dataclass(frozen=True)
class TrackCase:
    """Step A of one variant: every distinct train and speed, in the order of the study."""

    study: Study
    variant: str
    track: Track
    wavenumbers: np.ndarray
    runs: tuple[Run, ...]

    @property
    def response(self) -> TrackResponse:
        """The response the first train meets."""
        return self.runs[0].response

    @property
    def spectrum(self) -> Spectrum:
        """Spectrum of the study's profile."""
        record = self.study.record()
        if record is not None:
            return sections_spectrum(
                record.sections.amplitudes, self.wavenumbers, self.study.profile.window_m
            )
        return spectrum(self.study.profile.spectrum, self.study.profile.fra_class)

    @property
    def power(self) -> np.ndarray:
        """Variance of the initial profile by mode [K] m²."""
        profile = self.study.profile
        return profile_power(self.spectrum, self.wavenumbers, profile.window_m, profile.sd)

    @property
    def profile_text(self) -> str:
        """The study's initial profile in words."""
        profile = self.study.profile
        name = profile.spectrum.replace("_", " ").replace("fra", "FRA").replace("german", "German")
        number = f" class {profile.fra_class}" if profile.spectrum.startswith("fra") else ""
        if profile.file is not None:
            name, number = f"{profile.file},", ""
        scaled = "unscaled" if profile.sd_mm is None else f"scaled to SD {profile.sd_mm:g} mm"
        return f"{name}{number} spectrum, {scaled}"

    def draw_profiles(self, shape: Spectrum, sd: float | None, count: int) -> np.ndarray:
        """Amplitudes [R, K] m of the study's first realisations, of any spectrum and SD [m]."""
        window, seed = self.study.profile.window_m, self.study.seed
        section = default_section(window)
        return sample_profiles(shape, self.wavenumbers, window, seed, range(count), sd, section)


def track_cases(study: Study, progress: Progress = silent, processes: int = 1) -> list[TrackCase]:
    """Step A of every variant that differs in it, from the cache or computed; the first one first.

    ``processes`` > 1 spawns processes, so the calling program needs a main guard.
    """
    scenes = study.scenes
    prepared = step_a(scenes, progress, processes)
    distinct: dict[tuple[str, ...], TrackCase] = {}
    for variant in study.variant_names:
        groups = [prepared.transfers[variant, scenario] for scenario in study.scenario_names]
        digests = tuple(transfer.digest for group in groups for transfer in group)
        if digests not in distinct:
            runs = _runs(scenes, variant, prepared, progress, processes)
            track = study.track(variant)
            distinct[digests] = TrackCase(study, variant, track, study.wavenumbers, runs)
    return list(distinct.values())


def _runs(
    scenes: Sequence[Scene], variant: str, prepared: StepA, progress: Progress, processes: int
) -> tuple[Run, ...]:
    """Every distinct train and speed of a variant."""
    responses: dict[Softened | None, TrackResponse] = {}
    runs: dict[str, Run] = {}
    for scene in (scene for scene in scenes if scene.variant == variant):
        transfers = prepared.transfers[variant, scene.scenario]
        for service, transfer in zip(scene.timetable.services, transfers, strict=True):
            ground = scene.softened(service)
            if ground not in responses:
                responses[ground] = response_under(scenes, variant, service, progress, processes)
            run = Run(scene.scenario, service, transfer, responses[ground], ground)
            runs.setdefault(transfer.digest, run)
    return tuple(runs.values())


def response_under(
    scenes: Sequence[Scene],
    variant: str,
    service: Service,
    progress: Progress = silent,
    processes: int = 1,
) -> TrackResponse:
    """Response of a variant's track with the ground that ``service`` makes for itself.

    ``scenes`` of the study: the fastest train decides the range of Step A on linear ground.
    """
    scene = next(scene for scene in scenes if scene.variant == variant)
    softened = scene.softened(service)
    settings = section_settings(scenes, softened)
    return track_response(
        scene.track, scene.integration_depth, progress, processes, softened, settings
    )


def table4(case: TrackCase, progress: Progress = silent) -> list[Increase]:
    """Stress at the subgrade surface of every speed against the baseline's; empty if none differs.

    Ours and the published ones among the study's references, from scenarios with a single service of
    the baseline's train.
    """
    runs = _speeds(case)
    if len(runs) < 2:
        return []
    stresses = []
    for done, run in enumerate(runs):
        stresses.append(surface_stress(case, run))
        progress("Stress at the subgrade surface", done + 1, len(runs))
    published: dict[tuple[str, str], tuple[float, str]] = {
        (row.metric, row.scenario): (row.value, row.source)
        for row in case.study.reference
        if row.metric in METRIC_OF.values()
    }
    return increases(stresses, published)


def surface_stress(case: TrackCase, run: Run) -> SurfaceStress:
    """σ_d [Pa] at the top of the first ground layer, by each definition of Table 4."""
    transfer = run.transfer
    weights = layer_weights(transfer.grid, surface_layer(case.track), 0.0)[None]
    service = run.service
    along = stress_along(run.response, service.train, service.speed, np.zeros(1), weights)
    values = {
        OVERHEAD: float(quasi_static_overhead(transfer, weights)[0]),
        LARGEST: float(along.sigma.max()),
    }
    profiles = case.draw_profiles(case.spectrum, case.study.profile.sd, REALISATIONS)
    powers, samples = 0.5 * np.abs(profiles) ** 2, {}
    for definition, squares in ((DYNAMIC, dynamic_squares), (CHANGE, change_squares)):
        by_mode = squares(transfer, weights)[:, 0]
        values[definition] = float(np.sqrt(case.power @ by_mode))
        samples[definition] = np.sqrt(powers @ by_mode)
    return SurfaceStress(run.scenario, service.speed, values, samples)


def surface_layer(track: Track) -> int:
    """Index of the layer whose top is the subgrade surface."""
    return next(i for i, layer in enumerate(track.layers) if layer.width is None)


def layer_tops(track: Track) -> list[tuple[str, float]]:
    """Name and top [m] of each layer."""
    tops, z = [], depth_below_subgrade(track.layers)
    for layer in track.layers:
        tops.append((layer.name, z))
        z -= layer.height
    return tops


def _speeds(case: TrackCase) -> list[Run]:
    """Runs of the baseline's train at distinct speeds, the baseline first."""
    study = case.study
    base = study.reference_scenario
    single = [run for run in case.runs if len(study.timetable(run.scenario).services) == 1]
    first = next((run for run in single if run.scenario == base), None)
    if first is None:
        return []
    train = first.service.train
    return [first, *(run for run in single if run is not first and run.service.train == train)]
