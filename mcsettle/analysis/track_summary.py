"""Describe a study's track and trains in numbers: wave speeds, deflection, compliance, stresses."""

import math
from dataclasses import replace

import numpy as np

from mcsettle.analysis.stress_under_train import layer_weights
from mcsettle.analysis.track_case import Run, TrackCase, layer_tops, track_cases
from mcsettle.railway.track import SectionTrack, Track, rayleigh_speed
from mcsettle.step_a.critical_speed import critical_speed_of, speed_remark
from mcsettle.step_a.fem25d import SectionResponse
from mcsettle.step_a.track_response import softening_history
from mcsettle.step_a.transfer import TrackResponse
from mcsettle.step_b.stress import deviatoric_stress
from mcsettle.study.study import Study
from mcsettle.types import Progress, silent
from mcsettle.units import KMH, KN, KPA, MM, MPA

Row = tuple[str, float | str, str]
WAVELENGTHS = (30.0, 10.0, 5.0, 3.0)  # m
GIGA = 1e9


def track_summary(study: Study, progress: Progress = silent, processes: int = 1) -> list[Row]:
    """Rows (quantity, value, unit) for the first variant's track, every distinct train and speed."""
    return describe(track_cases(study, progress, processes)[0])


def describe(case: TrackCase) -> list[Row]:
    """Rows (quantity, value, unit) of a track made ready (``track_cases``)."""
    rows = _layer_rows(case.track) + _response_rows(case.response)
    if case.runs[0].softened is None and isinstance(case.response, SectionResponse):
        name = "critical speed of track and ground"
        rows.append((name, critical_speed_of(case.response) / KMH, "km/h"))
    for run in case.runs:
        rows += _softening_rows(run, case) + _run_rows(run, case.track)
    return rows


def _layer_rows(track: Track) -> list[Row]:
    rows: list[Row] = []
    for layer in track.layers:
        m, unbounded = layer.material, math.isinf(layer.height)
        rows += [
            (f"{layer.name}: height", *(("unbounded", "") if unbounded else (layer.height, "m"))),
            (f"{layer.name}: Young's modulus", m.youngs_modulus / MPA, "MPa"),
            (f"{layer.name}: shear wave speed", m.shear_wave_speed / KMH, "km/h"),
        ]
        if isinstance(track, SectionTrack) and layer.width is None:
            rows.append((f"{layer.name}: Rayleigh wave speed", rayleigh_speed(m) / KMH, "km/h"))
    return rows


def _response_rows(response: TrackResponse) -> list[Row]:
    if not isinstance(response, SectionResponse):
        return [("critical speed of the track", response.rayleigh_speed / KMH, "km/h")]
    return [
        ("lowest Rayleigh wave speed, small strains", response.lowest_rayleigh_speed / KMH, "km/h"),
        ("Step A: error estimate of the reduced bases", response.error_estimate, "1"),
        ("Step A: direct solutions", str(response.solves), ""),
    ]


def speed_warnings(case: TrackCase) -> list[str]:
    """Trains faster than 0.8 of the critical speed of the ground they run on, softened or not."""
    remarks = (speed_remark(r.service, r.response, r.softened is not None) for r in case.runs)
    return [remark for remark in remarks if remark is not None]


def _softened_speeds(run: Run, track: SectionTrack, mean: np.ndarray) -> list[Row]:
    """Rayleigh speeds of the softened layers (mean moduli of the mesh) and the critical speed."""
    rows: list[Row] = []
    for layer, modulus in zip(track.layers, mean, strict=True):
        if layer.width is None:
            soft = replace(layer.material, youngs_modulus=float(modulus))
            name = f"{run.label}: {layer.name}, Rayleigh wave speed at the mean modulus"
            rows.append((name, rayleigh_speed(soft) / KMH, "km/h"))
    name = f"{run.label}: critical speed of track and softened ground"
    return [*rows, (name, critical_speed_of(run.response) / KMH, "km/h")]


def _softening_rows(run: Run, case: TrackCase) -> list[Row]:
    """How the ground has softened under one train; nothing where the soil is linear."""
    if run.softened is None or not isinstance(case.track, SectionTrack):
        return []
    depth = case.study.settlement_settings(case.variant).integration_depth_m
    history = softening_history(case.track, depth, run.softened)
    rows: list[Row] = [
        (f"{run.label}: softening, iterations", str(history.iterations), ""),
        (f"{run.label}: softening, last change of a modulus", float(history.change[-1]), "1"),
    ]
    for i, name in enumerate(history.layers):
        head = f"{run.label}: {name}, Young's modulus under the train"
        rows.append((f"{head}, lowest", float(history.lowest[-1, i]) / MPA, "MPa"))
        rows.append((f"{head}, mean", float(history.mean[-1, i]) / MPA, "MPa"))
    return rows + _softened_speeds(run, case.track, history.mean[-1])


def _run_rows(run: Run, track: Track) -> list[Row]:
    """Rows of one train at one speed, at the middle car's leading axle."""
    transfer, head = run.transfer, run.label
    axle = 4 * (len(transfer.rail_deflection) // 8)
    rows: list[Row] = [
        (
            f"{head}: speed over the critical speed",
            transfer.speed / critical_speed_of(run.response),
            "1",
        ),
        (f"{head}: rail deflection, quasi-static", transfer.rail_deflection[axle] / MM, "mm"),
    ]
    wavelengths = 2.0 * np.pi / transfer.wavenumbers
    for wavelength in WAVELENGTHS:
        k = int(np.argmin(np.abs(wavelengths - wavelength)))
        name = f"{head}, wavelength {wavelengths[k]:.1f} m"
        per_mm = abs(transfer.force[axle, k]) * MM / KN
        rows.append((f"{name}: dynamic force per mm of amplitude", per_mm, "kN"))
        compliance = abs(transfer.track_compliance[k]) * GIGA
        rows.append((f"{name}: track compliance", compliance, "m/GN"))
    for index, (layer, z) in enumerate(layer_tops(track)):
        if np.any(transfer.grid.layer == index):
            weights = layer_weights(transfer.grid, index, z)
            sigma = deviatoric_stress(*(transfer.quasi_static[axle] @ weights))
            name = f"{head}: {layer}, quasi-static deviatoric stress at its top"
            rows.append((name, float(sigma) / KPA, "kPa"))
    return [(name, value if isinstance(value, str) else float(value), u) for name, value, u in rows]
