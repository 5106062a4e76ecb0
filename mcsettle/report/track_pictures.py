"""Every picture of a study's track, and its numbers as CSV, written into a folder."""

import math
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from mcsettle.analysis.stress_under_train import (
    DepthCurve,
    depth_curve,
    layer_weights,
    stress_along,
)
from mcsettle.analysis.table4 import DEFINITIONS, Increase
from mcsettle.analysis.track_case import TrackCase, layer_tops, response_under, surface_layer
from mcsettle.analysis.track_summary import Row
from mcsettle.railway.settlement_model import SettlementModel
from mcsettle.railway.spectra import spectrum
from mcsettle.railway.track import TOY_TRACK, SectionTrack, depth_below_subgrade
from mcsettle.railway.traffic import Service, Train
from mcsettle.railway.vehicle import FREIGHT
from mcsettle.report.figures.passage import axle_passage, passage_figure
from mcsettle.report.figures.receptance import receptance_figure, receptance_map
from mcsettle.report.figures.section import (
    cell_values,
    section_figure,
    section_view,
    softening_figure,
)
from mcsettle.report.figures.slice import deflection_slice, slice_figure
from mcsettle.report.figures.stress import along_figure, depth_figure, table4_figure
from mcsettle.report.figures.style import files_of
from mcsettle.report.figures.vehicles import MODELS, vehicle_peaks, vehicles_figure
from mcsettle.report.outgoing import csv_text
from mcsettle.step_a.fem25d import SectionResponse
from mcsettle.step_a.fem25d.centreline_field import CentrelineField
from mcsettle.step_a.fem25d.track_section import track_grid
from mcsettle.step_a.interaction import precompute
from mcsettle.storage.marks import NO_STUDY, write_marked
from mcsettle.types import Progress, silent
from mcsettle.units import KMH, KPA

BELOW_SLEEPER = 0.1  # m, where the paper's Fig. 5 takes the stress
FREIGHT_CARS = 40
FREIGHT_SPEED = 97.0 * KMH
FREIGHT_CLASS = 4  # FRA class of the profile in Figs. 5 and 6
LARGEST_WAVENUMBER = 2.0  # rad/m, of the receptance map
LARGEST_OMEGA = 160.0  # rad/s


def draw_track(
    case: TrackCase,
    rows: list[Row],
    table: list[Increase],
    folder: Path,
    progress: Progress = silent,
    study: str = NO_STUDY,
    force: bool = False,
) -> list[Path]:
    """Write all pictures (PNG, SVG) and tables (CSV) of a track; returns what was written.

    Parameters
    ----------
    case : TrackCase
    rows, table
        The numbers of ``track_report``: written beside the pictures.
    folder : Path
        Made if missing.
    progress : callable, optional
    study, force
        The study's mark; files of the same names are replaced where they bear it, or with ``force``.

    Raises
    ------
    InputError
        The folder cannot be written, or holds others' files of these names.
    """
    pictures = track_figures(case, table)
    files = _tables(case, rows, table, folder)
    for done, (name, draw) in enumerate(pictures.items()):
        progress("Pictures", done, len(pictures))
        files |= files_of(draw(), folder, name)
    progress("Pictures", len(pictures), len(pictures))
    return write_marked(files, study, force)


def track_figures(case: TrackCase, table: list[Increase]) -> dict[str, Callable[[], Figure]]:
    """Every picture of a track by name, each drawn when called."""
    pictures: dict[str, Callable[[TrackCase], Figure]] = {
        "section": _section,
        "softening": _softening,
        "receptance": _receptance,
        "stress_depth": _depth,
        "stress_along": _along,
        "slice": _slice,
        "table4": lambda case: table4_figure(table, case.profile_text),
        "vehicle_models": _vehicles,
        "freight_passage": _freight,
    }
    if not isinstance(case.track, SectionTrack):
        del pictures["section"], pictures["slice"]
    if case.runs[0].softened is None:
        del pictures["softening"]
    if not table:
        del pictures["table4"]
    return {name: partial(draw, case) for name, draw in pictures.items()}


def _section(case: TrackCase) -> Figure:
    assert isinstance(case.track, SectionTrack)
    depth = case.study.settlement_settings(case.variant).integration_depth_m
    return section_figure(section_view(case.track, depth), "Cross-section of track and ground")


def _softening(case: TrackCase) -> Figure:
    """Moduli under the first train over those at small strains."""
    run = case.runs[0]
    response = run.response
    assert isinstance(response, SectionResponse)
    assert response.properties is not None
    mesh, depth = response.settings.mesh, response.integration_depth
    view = section_view(response.track, depth, mesh)
    place = track_grid(response.track, depth, mesh).place
    scale = cell_values(view, place, response.properties.scale)
    scale[view.material == 0] = np.nan  # the sleepers
    return softening_figure(view, scale, f"Ground softened by {run.label}")


def _receptance(case: TrackCase) -> Figure:
    lines = tuple((run.label, run.service.speed) for run in case.runs)
    k = np.linspace(LARGEST_WAVENUMBER / 200.0, LARGEST_WAVENUMBER, 200)
    omegas = np.linspace(0.0, LARGEST_OMEGA, 161)
    view = receptance_map(case.response, k, omegas, lines)
    return receptance_figure(view, f"Rail receptance, unit load per wheelset; {_ground(case)}")


def _ground(case: TrackCase) -> str:
    """Which ground a picture of one response shows."""
    run = case.runs[0]
    return "linear soil" if run.softened is None else f"ground softened by {run.label}"


def _curves(case: TrackCase) -> list[DepthCurve]:
    return [depth_curve(run.transfer, case.power, run.label) for run in case.runs]


def _depth(case: TrackCase) -> Figure:
    kind = "linear" if case.runs[0].softened is None else "equivalent-linear"
    title = f"Deviatoric stress against depth (Figs. 15 and 16), {kind} soil"
    return depth_figure(_curves(case), layer_tops(case.track), case.profile_text, title)


def _along(case: TrackCase) -> Figure:
    """Stress under the first train at the middle of each embankment layer and in the ground."""
    run, grid = case.runs[0], case.runs[0].transfer.grid
    ground = surface_layer(case.track)
    places = [(0, depth_below_subgrade(case.track.layers) - BELOW_SLEEPER, ", below the sleeper")]
    places += [(ground, 0.0, ", subgrade surface"), (ground, -1.0, ""), (ground, -3.0, "")]
    bottom = float(grid.z.min())
    kept = [p for p in places if p[1] >= bottom and np.any(grid.layer == _layer_at(case, *p[:2]))]
    weights = np.array([layer_weights(grid, _layer_at(case, *p[:2]), p[1]) for p in kept])
    heights = np.array([z for _, z, _ in kept])
    names = [f"z = {z:.1f} m".replace("-", "−") + f"{text}" for _, z, text in kept]
    view = stress_along(run.response, run.service.train, run.service.speed, heights, weights)
    return along_figure(view, names, f"Quasi-static stress along the track: {run.label}")


def _layer_at(case: TrackCase, layer: int, z: float) -> int:
    """The layer from ``layer`` downwards that holds the height z [m]."""
    tops = [top for _, top in layer_tops(case.track)] + [-math.inf]
    return next(i for i in range(layer, len(tops) - 1) if z > tops[i + 1])


def _slice(case: TrackCase) -> Figure:
    """Fig. 10: the first train over the study's first profile, its middle in the window's middle."""
    study, run = case.study, case.runs[0]
    assert isinstance(run.response, SectionResponse)
    view = deflection_slice(
        CentrelineField(run.response),
        run.service.train,
        run.service.speed,
        case.wavenumbers,
        study.initial_profiles(case.variant).sample(range(1))[0],
        study.profile.window_m / 2.0,
        study.track_table.hertz_stiffness_n_per_m,
    )
    text = (
        f"Profile: {case.profile_text}, realisation 0 of seed {study.seed}, periodic over "
        f"{study.profile.window_m:g} m. {_ground(case).capitalize()}."
    )
    return slice_figure(view, text)


def _vehicles(case: TrackCase) -> Figure:
    """Fig. 4: the paper's five vehicle models on its simplified track, the study's profile."""
    study = case.study
    amplitudes = case.draw_profiles(case.spectrum, study.profile.sd, 1)[0]
    views = [
        vehicle_peaks(
            vehicle, cars, speed, models, TOY_TRACK, amplitudes, case.wavenumbers,
            study.profile.window_m, study.track_table.hertz_stiffness_n_per_m,
        )
        for vehicle, cars, speed, models in MODELS.values()
    ]  # fmt: skip
    text = f"Profile: {case.profile_text}, realisation 0 of seed {study.seed}."
    return vehicles_figure(views, text, "Dynamic rail deflection by vehicle model (Fig. 4)")


def _freight(case: TrackCase) -> Figure:
    """Figs. 5 and 6: a freight axle on FRA class 4, unscaled, on the study's track, factor 1."""
    study, layers = case.study, case.track.layers
    train = Train("freight", (FREIGHT,) * FREIGHT_CARS)
    response = response_under(study.scenes, case.variant, Service(train, FREIGHT_SPEED, 1))
    contact = study.track_table.hertz_stiffness_n_per_m
    transfer = precompute(train, FREIGHT_SPEED, response, case.wavenumbers, contact)
    settings = study.settlement_settings(case.variant)
    model = SettlementModel(
        tuple(layer.law for layer in layers),
        ballast_cycles_before=settings.ballast_cycles_before,
        subgrade_cycles_before=settings.subgrade_cycles_before,
    )
    view = axle_passage(
        transfer,
        4 * (FREIGHT_CARS // 2),
        case.draw_profiles(spectrum("fra", FREIGHT_CLASS), None, 1)[0],
        layer_weights(transfer.grid, 0, depth_below_subgrade(layers) - BELOW_SLEEPER),
        model,
        study.profile.window_m,
        f"Freight train, {FREIGHT_CARS} cars at {FREIGHT_SPEED / KMH:.0f} km/h, FRA class "
        f"{FREIGHT_CLASS}",
    )
    upper = next(layer.name for layer in layers if layer.law is not None)
    note = (
        f"Realisation 0 of seed {study.seed}, class {FREIGHT_CLASS} unscaled; leading axle of "
        f"the middle car overhead. Settlement factor 1, {settings.ballast_cycles_before:,.0f} cycles "
        "before.\nDynamic settlement: what remains after the settlement without a profile is taken "
        "off. Quasi-static: the same everywhere."
    )
    height = f"deviatoric stress {BELOW_SLEEPER:g} m below the sleeper, axle overhead"
    return passage_figure(view, height, upper, note)


def _tables(
    case: TrackCase, rows: list[Row], table: list[Increase], folder: Path
) -> dict[Path, bytes]:
    """The report, stress by depth and Table 4 as CSV."""
    names = [name for name, _ in layer_tops(case.track)]
    by_depth = [
        (c.label, names[layer], float(z), float(q) / KPA, float(d) / KPA)
        for c in _curves(case)
        for layer, z, q, d in zip(c.layer, c.z, c.quasi_static, c.dynamic, strict=True)
    ]
    header = (
        "train", "layer", "z_m", "quasi_static_overhead_kpa", "dynamic_rms_kpa",
    )  # fmt: skip
    files = {
        folder / "track.csv": csv_text(("quantity", "value", "unit"), rows, "\n").encode(),
        folder / "stress_depth.csv": csv_text(header, by_depth, "\n").encode(),
    }
    if table:
        header4 = (
            "scenario", "speed_kmh", "definition", "stress_kpa", "increase_percent",
            "increase_p5_percent", "increase_p95_percent", "published_percent", "source", "meaning",
        )  # fmt: skip
        entries = [
            (r.scenario, r.speed / KMH, r.definition, r.stress / KPA, r.percent, r.low, r.high,
             "" if r.published is None else r.published, r.source, DEFINITIONS[r.definition])
            for r in table
        ]  # fmt: skip
        files[folder / "table4.csv"] = csv_text(header4, entries, "\n").encode()
    return files
