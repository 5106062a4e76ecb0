"""Describe a study's track and trains in numbers: wave speeds, deflection, compliance, stresses.

Depends on: spectral, step_a, stress, study, track, units.
"""

import numpy as np

from mcsettle.step_a import Progress, step_a
from mcsettle.stress import deviatoric_stress
from mcsettle.study import Study
from mcsettle.transfer import TransferFunctions
from mcsettle.units import KMH, KN, KPA, MM

Row = tuple[str, float | str, str]


def track_summary(study: Study, progress: Progress | None = None, processes: int = 1) -> list[Row]:
    """Rows (quantity, value, unit) for the track and for every distinct train and speed."""
    rows: list[Row] = []
    for variant in study.variant_names:
        track = study.track(variant)
        for layer in track.layers:
            m = layer.material
            rows.append((f"{variant}: {layer.name}, height", layer.height, "m"))
            rows.append(
                (f"{variant}: {layer.name}, shear wave speed", m.shear_wave_speed / KMH, "km/h")
            )
    prepared, seen = step_a(study, progress, processes), set()
    for (variant, _), group in prepared.transfers.items():
        for transfer in group:
            if transfer.digest not in seen:
                seen.add(transfer.digest)
                names = [layer.name for layer in study.track(variant).layers]
                rows += _transfer_rows(transfer, names)
    return rows


def _transfer_rows(transfer: TransferFunctions, names: list[str]) -> list[Row]:
    """Rows of one train at one speed, at the middle car's leading axle."""
    head = f"{transfer.train} at {transfer.speed / KMH:.0f} km/h"
    axle = 4 * (len(transfer.rail_deflection) // 8)
    sigma_d = deviatoric_stress(*transfer.quasi_static[axle])
    wavelengths = 2.0 * np.pi / transfer.wavenumbers
    rows: list[Row] = [
        (f"{head}: rail deflection, quasi-static", transfer.rail_deflection[axle] / MM, "mm"),
    ]
    for wavelength in (30.0, 10.0, 5.0, 3.0):
        k = int(np.argmin(np.abs(wavelengths - wavelength)))
        per_mm = abs(transfer.force[axle, k]) * MM / KN
        compliance = abs(transfer.track_compliance[k]) * 1e9
        name = f"{head}, wavelength {wavelengths[k]:.1f} m"
        rows.append((f"{name}: dynamic force per mm of amplitude", per_mm, "kN"))
        rows.append((f"{name}: track compliance", compliance, "m/GN"))
    for index, name in enumerate(names):
        here = transfer.grid.layer == index
        if here.any():
            top = sigma_d[here][0] / KPA
            rows.append((f"{head}: {name}, quasi-static deviatoric stress at its top", top, "kPa"))
    return rows
