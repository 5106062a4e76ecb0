"""Why one freight train a day does not cost what the paper says: one lever at a time.

Runs scenarios C and D of studies/traffic.toml against A with one thing changed, on the same tracks,
and prints the reduction of the tamping interval (Table 6: 6.9 % and 13.0 %). The ground is linear, as
in the study's variants "linear...": one ground serves every lever. docs/uncertainty.md has the account.

    python studies/freight_levers.py [--realisations 64] [--without-long-window]
"""

import argparse
import copy
import tomllib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from mcsettle.step_a.transfers import step_a
from mcsettle.step_b.build_case import build_case
from mcsettle.step_b.engine import engine_for
from mcsettle.study.study import Study

Data = dict[str, Any]
PUBLISHED = {"C": 6.9, "D": 13.0}


def settlement(**keys: Any) -> Callable[[Data], None]:
    """Change keys of [settlement]."""
    return lambda data: data["settlement"].update(keys)


def profile(**keys: Any) -> Callable[[Data], None]:
    """Change keys of [profile]."""
    return lambda data: data["profile"].update(keys)


def freight(**keys: Any) -> Callable[[Data], None]:
    """Change keys of the freight train."""
    return lambda data: data["trains"]["freight"].update(keys)


def both(*changes: Callable[[Data], None]) -> Callable[[Data], None]:
    """Several changes at once."""
    return lambda data: [change(data) for change in changes] and None


PER_VEHICLE = settlement(cycles="per_vehicle")
DAMPED = freight(secondary_damping_ns_per_m=30e3)


def levers(total_factor: float, long_window: bool) -> Iterator[tuple[str, Callable[[Data], None]]]:
    """(name, change) of every experiment."""
    yield "as the study, linear ground", lambda data: None
    for damping in (10, 30, 100):
        change = freight(secondary_damping_ns_per_m=damping * 1e3)
        yield f"secondary damping {damping} kNs/m (2.5)", change
    for length in (13.4, 14.4, 15.9):
        yield f"car length {length} m (13.9)", freight(car_length_m=length)
    yield "N counted by vehicle type (shared)", PER_VEHICLE
    yield (
        "total stress, with its own factor (traffic)",
        settlement(stress="total", settlement_factor=total_factor),
    )
    for spectrum in ("fra_one_corner", "german_low"):
        yield f"spectrum {spectrum} (fra)", profile(spectrum=spectrum)
    for window in (195, 205):
        yield f"window {window} m (200)", profile(window_m=window)
    if long_window:
        yield "window 1000 m (200)", profile(window_m=1000)
    yield "freight axle load 28 t (25)", freight(axle_load_t=28)
    yield (
        "N before tamping 1 000 000 (100 000)",
        settlement(ballast_cycles_before=1_000_000, subgrade_cycles_before=1_000_000),
    )
    yield "N by type, damping 30 kNs/m", both(PER_VEHICLE, DAMPED)
    yield (
        "N by type, damping 100 kNs/m",
        both(PER_VEHICLE, freight(secondary_damping_ns_per_m=100e3)),
    )
    if long_window:
        yield "window 1000 m, damping 30 kNs/m", both(DAMPED, profile(window_m=1000))
        yield (
            "N by type, window 1000 m, damping 30 kNs/m",
            both(PER_VEHICLE, DAMPED, profile(window_m=1000)),
        )


def reductions(study: Study, realisations: int) -> dict[str, np.ndarray]:
    """Reduction of the tamping interval [%] of C and D in every realisation that knows both."""
    prepared = step_a(study.scenes)
    profiles = study.initial_profiles().sample(range(realisations))
    days = {}
    for scenario in ("A", "C", "D"):
        case = build_case(study.scene(study.variant_names[0], scenario), prepared)
        days[scenario] = engine_for(case).run(profiles, np.zeros(0)).days
    found = {s: 100.0 * (1.0 - days[s] / days["A"]) for s in ("C", "D")}
    return {s: values[np.isfinite(values)] for s, values in found.items()}


def main() -> None:
    """Print one row of a Markdown table for each lever."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--realisations", type=int, default=64)
    parser.add_argument("--without-long-window", action="store_true")
    options = parser.parse_args()
    path = Path(__file__).with_name("traffic.toml")
    data = tomllib.loads(path.read_text(encoding="utf-8"))
    factors = {entry["name"]: entry["settlement_factor"] for entry in data["variants"][1:]}
    data["variants"] = [{"name": "linear"}]
    data["track"]["soil"] = "linear"
    data["settlement"]["settlement_factor"] = factors["linear"]
    del data["reference"], data["calibration"]
    print(
        "| experiment | C: P5 / P50 / P95 [%] | D: P5 / P50 / P95 [%] "
        "| realisations at or above 6.9 % in C |"
    )
    print("|---|---|---|---|")
    for name, change in levers(factors["linear_total"], not options.without_long_window):
        own = copy.deepcopy(data)
        change(own)
        found = reductions(Study.from_mapping(own), options.realisations)
        cells = [
            " / ".join(f"{q:.1f}" for q in np.quantile(found[s], [0.05, 0.5, 0.95]))
            for s in ("C", "D")
        ]
        share = np.mean(found["C"] >= PUBLISHED["C"])
        print(f"| {name} | {cells[0]} | {cells[1]} | {share:.0%} |", flush=True)


if __name__ == "__main__":
    main()
