"""What moves the quasi-static column of Table 4: increase of stress at the subgrade surface with speed.

Every row takes one reading of the model that the paper leaves open, the others as in
studies/linespeed.toml, and gives the increase of the deviatoric stress from 201 km/h, with the axle
overhead and as the largest along the train. The published column is +1.8, +3.7 and +5.8 %.

    python studies/table4_levers.py [NAME ...]
"""

import sys
from dataclasses import replace

import numpy as np

from mcsettle.curves import Curve
from mcsettle.fem25d import MeshSettings
from mcsettle.fem25d.depth import depth_grid, geostatic_stress
from mcsettle.fem25d.moving import rail_coupling
from mcsettle.fem25d.passing import along_train, line_wavenumbers, places
from mcsettle.fem25d.section import track_section
from mcsettle.fem25d.softening import soften
from mcsettle.fem25d.solve import outputs, solve
from mcsettle.soil import SofteningSettings
from mcsettle.stress import deviatoric_stress
from mcsettle.study import load_study
from mcsettle.track import CASE_STUDY_TRACK, SectionTrack
from mcsettle.traffic import Train
from mcsettle.units import KMH
from mcsettle.views.stress import layer_weights

SPEEDS = (201.0, 209.0, 217.0, 225.0)
DEPTH = 5.5  # m
WAVENUMBERS = 24
SOFT = SofteningSettings(tolerance=0.003, max_iterations=20)
HARDER = replace(CASE_STUDY_TRACK, damping_convention="loss_factor")
TOP = 2  # index of the first ground layer

# name: (track, softening or None, depth below the subgrade surface [m], geostatic stress included)
LEVERS: dict[str, tuple[SectionTrack, SofteningSettings | None, float, bool]] = {
    "linear": (CASE_STUDY_TRACK, None, 0.0, False),
    "softened": (CASE_STUDY_TRACK, SOFT, 0.0, False),
    "octahedral": (CASE_STUDY_TRACK, replace(SOFT, octahedral="engineering"), 0.0, False),
    "clay_pi_0": (
        CASE_STUDY_TRACK,
        replace(SOFT, curves=(("subgrade", Curve("ishibashi_zhang", plasticity_index=0.0)),)),
        0.0,
        False,
    ),
    "clay_vucetic_dobry": (
        CASE_STUDY_TRACK,
        replace(SOFT, curves=(("subgrade", Curve("vucetic_dobry", plasticity_index=15.0)),)),
        0.0,
        False,
    ),
    "loss_factor": (HARDER, SOFT, 0.0, False),
    "one_metre_deep": (CASE_STUDY_TRACK, SOFT, 1.0, False),
    "total_stress": (CASE_STUDY_TRACK, SOFT, 0.0, True),
}


def stresses(
    track: SectionTrack,
    softening: SofteningSettings | None,
    below: float,
    total: bool,
    train: Train,
    speed: float,
) -> tuple[float, float]:
    """σ_d [Pa] with the middle car's leading axle overhead, and the largest along the train."""
    mesh, properties = MeshSettings(), None
    if softening is not None:
        properties = soften(track, train, speed, DEPTH, mesh, softening).properties
    section = track_section(track, DEPTH, mesh, properties)
    k = line_wavenumbers(WAVENUMBERS)
    found = np.array(
        [outputs(section, float(q), solve(section, float(q), float(q) * speed)) for q in k]
    )
    force = rail_coupling(track, k, k * speed, found[:, 0])[1]
    grid = depth_grid(track, DEPTH)
    weights = layer_weights(grid, TOP, -below)
    at_depth = (found[:, 1:] * force[:, None]).reshape(k.size, 4, -1) @ weights  # [J, 4]
    axles = train.axle_positions
    x = np.concatenate([[axles[4 * (axles.size // 8)]], places(train)])
    moving = (at_depth.T @ along_train(train, k, x)).real
    if total:
        moving += (geostatic_stress(track, grid) @ weights)[:, None]
    sigma = deviatoric_stress(*moving)
    return float(sigma[0]), float(sigma.max())


def main() -> None:
    """Print one line a lever: increases in % overhead, and of the largest."""
    train = load_study("studies/linespeed.toml").timetable("v201").services[0].train
    names = sys.argv[1:] or list(LEVERS)
    heads = "".join(f"{speed:>8.0f}" for speed in SPEEDS[1:])
    print(f"{'increase over 201 km/h [%]':<28}{'overhead':>24}{'largest':>24}{'at 201 [kPa]':>14}")
    print(f"{'':<28}{heads}{heads}")
    for name in names:
        both = np.array([stresses(*LEVERS[name], train, speed * KMH) for speed in SPEEDS])
        change = 100.0 * (both[1:] / both[0] - 1.0)
        cells = "".join(f"{value:8.2f}" for value in change.T.ravel())
        print(f"{name:<28}{cells}{both[0, 0] / 1e3:14.2f}", flush=True)


if __name__ == "__main__":
    main()
