"""What moves the quasi-static column of Table 4: increase of stress at the subgrade surface with speed.

Every row is one ground and one reading of "mean deviatoric stress at subgrade surface", the others
as in studies/linespeed.toml; the columns are increases of σ_d from 201 km/h. The paper prints +1.8,
+3.7 and +5.8 %. A constant moving load needs the line ω = k v alone: 16 direct solutions a ground,
and as many for every iteration of its softening, which starts from the ground of the speed before.

    OPENBLAS_NUM_THREADS=1 nice python studies/table4_levers.py [--keep FOLDER] [GROUND ...]

What has been computed is kept in FOLDER (results/table4), ground by ground and speed by speed; run
again to go on. ``--list`` names the grounds.
"""

import argparse
import hashlib
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from mcsettle.analysis.stress_under_train import layer_weights
from mcsettle.railway.modulus_curves import Curve
from mcsettle.railway.softening_choices import SofteningSettings
from mcsettle.railway.track import CASE_STUDY_TRACK, VALIDATION_TRACK, SectionTrack
from mcsettle.railway.traffic import Train
from mcsettle.step_a.depths import geostatic_stress
from mcsettle.step_a.fem25d import MeshSettings
from mcsettle.step_a.fem25d.depth_grid import depth_grid
from mcsettle.step_a.fem25d.element_scaling import track_frame
from mcsettle.step_a.fem25d.line_spectra import rail_coupling
from mcsettle.step_a.fem25d.passing_train import along_train, line_wavenumbers, places
from mcsettle.step_a.fem25d.softening import soften
from mcsettle.step_a.fem25d.solve import outputs, solve
from mcsettle.step_a.fem25d.track_section import ElementProperties, track_section
from mcsettle.step_b.stress import deviatoric_stress
from mcsettle.study.study import load_study
from mcsettle.units import KMH

SPEEDS = (201.0, 209.0, 217.0, 225.0)  # km/h
DEPTH = 5.5  # m
WAVENUMBERS = 16
SOFT = SofteningSettings(tolerance=0.003, max_iterations=20)
LEVER = replace(SOFT, tolerance=0.01)  # moves an increase by some 0.02 percentage points
ENGINEERING = replace(LEVER, octahedral="engineering")


@dataclass(frozen=True)
class Ground:
    """A track and how its ground softens; ``fixed``: as at the first speed for every speed."""

    track: SectionTrack = CASE_STUDY_TRACK
    softening: SofteningSettings | None = None
    fixed: bool = False


def _clay(settings: SofteningSettings, curve: Curve) -> SofteningSettings:
    return replace(settings, curves=(("subgrade", curve),))


def _clay_modulus(modulus: float) -> SectionTrack:
    clay = CASE_STUDY_TRACK.layers[-1]
    softer = replace(clay, material=replace(clay.material, youngs_modulus=modulus))
    return replace(CASE_STUDY_TRACK, layers=(*CASE_STUDY_TRACK.layers[:-1], softer))


HARDER = replace(CASE_STUDY_TRACK, damping_convention="loss_factor")
SANDY = Curve("ishibashi_zhang", plasticity_index=0.0)
GROUNDS = {
    "linear": Ground(),
    "linear, loss factor": Ground(HARDER),
    "softened": Ground(softening=SOFT),
    "softened, fixed as at 201 km/h": Ground(softening=SOFT, fixed=True),
    "engineering strain": Ground(softening=ENGINEERING),
    "clay of PI 0": Ground(softening=_clay(LEVER, SANDY)),
    "clay by Vucetic and Dobry": Ground(
        softening=_clay(LEVER, Curve("vucetic_dobry", plasticity_index=15.0))
    ),
    "softened, loss factor": Ground(HARDER, LEVER),
    "linear, clay of 35 MPa": Ground(_clay_modulus(35e6)),
    "linear, track of the validation": Ground(VALIDATION_TRACK),
}
# reading: (depth below the subgrade surface [m], geostatic stress included, where along the train)
READINGS = {
    "overhead": (0.0, False, "overhead"),
    "largest": (0.0, False, "largest"),
    "mean over the train": (0.0, False, "mean"),
    "1 m deep, overhead": (1.0, False, "overhead"),
    "3 m deep, overhead": (3.0, False, "overhead"),
    "with geostatic, overhead": (0.0, True, "overhead"),
}


def spectra(ground: Ground, train: Train, folder: Path) -> list[np.ndarray]:
    """Stress spectra [J, 4, Z] Pa/N·m on the line ω = k v for a unit load, one of every speed."""
    found: list[np.ndarray] = []
    last: ElementProperties | None = None
    for number, speed in enumerate(SPEEDS):
        name = hashlib.sha256(f"{ground} {train} {speed} {MeshSettings()} {WAVENUMBERS}".encode())
        path = folder / f"{name.hexdigest()[:16]}.npz"
        if not path.exists():
            if ground.softening is not None and not (ground.fixed and number > 0):
                last = _softened(ground, train, speed, last)
            values = _line(ground.track, last, speed * KMH)
            own = last or ElementProperties(np.ones(1), np.zeros(1))
            folder.mkdir(parents=True, exist_ok=True)
            np.savez(path, values=values, scale=own.scale, damping=own.damping)
        kept = np.load(path)
        if ground.softening is not None:
            last = ElementProperties(kept["scale"], kept["damping"])
        found.append(kept["values"])
    return found


def _softened(
    ground: Ground, train: Train, speed: float, start: ElementProperties | None
) -> ElementProperties:
    frame = track_frame(ground.track, DEPTH, MeshSettings())
    soft = soften(
        ground.track,
        train,
        speed * KMH,
        DEPTH,
        settings=ground.softening,
        progress=lambda stage, done, total: print(f"    {stage}: {done}/{total}", flush=True),
        frame=frame,
        start=start,
    )
    return soft.properties


def _line(track: SectionTrack, properties: ElementProperties | None, speed: float) -> np.ndarray:
    section = track_section(track, DEPTH, MeshSettings(), properties)
    k = line_wavenumbers(WAVENUMBERS)
    found = np.array([outputs(section, q, solve(section, q, q * speed)) for q in k.tolist()])
    force = rail_coupling(track, k, k * speed, found[:, 0])[1]
    return np.asarray((found[:, 1:] * force[:, None]).reshape(k.size, 4, -1))


def reading(
    values: np.ndarray, track: SectionTrack, train: Train, below: float, total: bool, where: str
) -> float:
    """σ_d [Pa] of one reading; "overhead" and "mean" are means over the axles and over the train."""
    grid = depth_grid(track, DEPTH)
    heights = np.cumsum([0.0, *(layer.height for layer in track.ground)])
    layer = len(track.embankment) + int(np.searchsorted(heights, below, side="right")) - 1
    weights = layer_weights(grid, layer, -below)
    axles = train.axle_positions
    x = {"overhead": axles, "mean": np.arange(axles.min(), axles.max(), 0.1)}.get(where)
    x = places(train) if x is None else x
    moving = ((values @ weights).T @ along_train(train, line_wavenumbers(WAVENUMBERS), x)).real
    if total:
        moving += (geostatic_stress(track.layers, grid) @ weights)[:, None]
    sigma = deviatoric_stress(*moving)
    return float(sigma.max() if where == "largest" else sigma.mean())


def main() -> None:
    """Print one line a ground and reading: increases in %, stress at the first speed."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("grounds", nargs="*", metavar="GROUND", help="default: all")
    parser.add_argument("--keep", type=Path, default=Path("results/table4"), metavar="FOLDER")
    parser.add_argument("--list", action="store_true", help="name the grounds and stop")
    chosen = parser.parse_args()
    unknown = sorted(set(chosen.grounds) - set(GROUNDS))
    if unknown or chosen.list:
        parser.exit(
            2 * bool(unknown), "\n".join([*(f"unknown: {u}" for u in unknown), *GROUNDS, ""])
        )
    train = load_study("studies/linespeed.toml").timetable("v201").services[0].train
    print(
        "| ground | reading | +209, % | +217, % | +225, % | at 201 km/h, kPa |\n|---|---|---|---|---|---|"
    )
    for name in chosen.grounds or GROUNDS:
        ground = GROUNDS[name]
        found = spectra(ground, train, chosen.keep)
        for text, choice in READINGS.items():
            sigma = np.array([reading(v, ground.track, train, *choice) for v in found])
            cells = " | ".join(f"{100.0 * (s / sigma[0] - 1.0):.2f}" for s in sigma[1:])
            print(f"| {name} | {text} | {cells} | {sigma[0] / 1e3:.2f} |", flush=True)


if __name__ == "__main__":
    main()
