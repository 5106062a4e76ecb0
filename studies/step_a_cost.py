"""What Step A costs and how exact it is: reduced bases against direct solutions of the same table.

The bases of the linespeed study's ground are computed afresh. Then ``--points`` random (k, ω) of the
table, the same number in every band of wavenumber, are solved directly: the time of one direct
solution times the points of the table is what the bases save, and the differences are their errors.
They are given twice: against the section with its absorbing border cut as the bases have it, which are
the errors of the bases alone, and against the section with the whole border, so that the cut counts
too.

    python studies/step_a_cost.py --points 220
"""

import argparse
import time

import numpy as np

from mcsettle.step_a.fem25d import Settings, section_response
from mcsettle.step_a.fem25d.reduced_basis import output_error
from mcsettle.step_a.fem25d.solve import outputs, solve
from mcsettle.step_a.fem25d.track_section import track_section
from mcsettle.step_a.interaction import precompute
from mcsettle.study.study import load_study

SEED = 7_310_229
SHARES = (0.5, 0.9, 0.99, 1.0)


def main() -> None:
    """Print CPU seconds, the ratio, and the distribution of the errors."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--study", default="studies/linespeed.toml")
    parser.add_argument("--points", type=int, default=220, help="direct solutions")
    arguments = parser.parse_args()
    study, settings = load_study(arguments.study), Settings()
    track, modes = study.track(study.variant_names[0]), study.wavenumbers
    depth = study.settlement_settings(study.variant_names[0]).integration_depth_m
    service = study.timetable(study.scenario_names[0]).services[0]
    start = time.process_time()
    response = section_response(track, depth, settings, use_cache=False)
    bases = time.process_time() - start
    start = time.process_time()
    precompute(service.train, service.speed, response, modes)
    table = time.process_time() - start
    section = track_section(track, depth, settings.mesh)
    rng = np.random.Generator(np.random.Philox(key=SEED))
    lowers = (0.0, *settings.bands[:-1])
    parts = [section.for_wavenumbers(lower, settings.mesh.border) for lower in lowers]
    errors: dict[str, list[float]] = {"cut border": [], "whole border": []}
    spent = 0.0
    for i in range(arguments.points):
        band = response.bands[i % len(response.bands)]
        at, share = rng.random(2)
        k = lowers[i % len(lowers)] + at * (band.upper - lowers[i % len(lowers)])
        omega = share * (settings.max_omega + k * settings.max_speed)
        found = band.outputs(k, np.array([omega]))[0]
        start = time.process_time()
        own = parts[i % len(parts)]
        exact = outputs(own, k, solve(own, k, omega))
        spent += time.process_time() - start
        errors["cut border"].append(output_error(found, exact))
        whole = outputs(section, k, solve(section, k, omega))
        errors["whole border"].append(output_error(found, whole))
    entries = 2 * (modes.size + 1) * response.quadrature.nodes.size
    one = spent / arguments.points
    print(
        f"reduced bases: {bases:.1f} CPU s, {response.solves} direct solutions, "
        f"{response.errors.size} checks"
    )
    print(f"table of one train at one speed, {entries} entries (k, omega): {table:.1f} CPU s")
    sizes = ", ".join(str(part.unknowns) for part in parts)
    print(f"unknowns, band by band: {sizes}; of the bases: {[b.size for b in response.bands]}")
    print(f"one direct solution: {one:.3f} CPU s; the same table: {one * entries:.3g} CPU s")
    print(f"ratio: {one * entries / (bases + table):.0f}")
    for border, of_border in errors.items():
        for part, found in (("all", of_border), *_by_band(of_border, len(response.bands))):
            values = ", ".join(f"{q:.0%} {np.quantile(found, q):.1e}" for q in SHARES)
            print(f"relative error of displacement and stresses, {border}, {part}: {values}")


def _by_band(errors: list[float], count: int) -> list[tuple[str, list[float]]]:
    return [(f"band {i + 1}", errors[i::count]) for i in range(count)]


if __name__ == "__main__":
    main()
