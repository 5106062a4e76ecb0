"""What real track does, beside what every model form does: the table of docs/plausibility.md.

Each form is calibrated by a factor of its own to 697 days at 201 km/h on the line of
studies/linespeed.toml; the rates, settlements and correlations that follow are predictions. The ground
is linear but in the form that softens it. A field of susceptibility has a correlation length of 5 m and
no correlation with the first profile. Second-order form throughout.

    python studies/plausibility.py [--realisations 64] [--form NAME ...]
"""

import argparse
import copy
import tomllib
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from mcsettle.analysis.calibration import calibrate
from mcsettle.railway.increments import increment_by_wave
from mcsettle.railway.scene import Scene
from mcsettle.step_a.transfers import step_a
from mcsettle.step_b.build_case import build_case
from mcsettle.step_b.case import Case, Outcome, support_of
from mcsettle.step_b.cycle_jump import CycleJump
from mcsettle.study.study import Study
from mcsettle.units import DAYS_PER_YEAR, MM

Data = dict[str, Any]
TARGET_DAYS = 697.0
SLOW, FAST = 201.0, 225.0  # km/h
HEAVIER = 1.1  # axle load of the train "heavy" over that of "passenger"
ROUGHER = 1.1  # initial SD
TRAFFIC_LINE = 1.7 * MM, 2.4 * MM  # initial SD and limit of the traffic study, m
EDGES = np.array([3.0, 6.0, 12.0, 36.0])  # m
# Where each comes from and how far it was verified: docs/plausibility.md, by number.
MEASURED = {
    "settlement factor": "1",
    "growth of SD in the first year, mm": "0.24, the paper's [1]",
    "spread of rates between sections, log-SD": "0.76, second hand [2]; lognormal, verified [3]",
    "rate, exponent of the axle load": "2.5, verified [4]; 3 and 1.49, not found [5, 6]",
    "rate, exponent of the speed": "0.64, not found [6]",
    "rate, elasticity on the initial SD": "above 0, verified [7]; 0, second hand [2]",
    "the same, the support as it was": "as above",
    "T × MGT, two freight trains over none": "1.00, the paper's [1]",
    "differential over uniform settlement": "0.1 to 0.25, not found [8]; see [9]",
    "increments before and after tamping, correlation": "above 0, verified; no number [10, 11]",
}
NO_LIMIT = 1.0  # m: rates of a year do not end at the tamping limit


def forms() -> Iterator[tuple[str, Data]]:
    """(name, keys of a variant) of every form."""
    varying = {
        "cov": 0.1,
        "correlation_length_m": 5,
        "distribution": "gaussian",
        "profile_correlation": 0,
        "reference_sd_mm": 1.03,
    }
    equivalent = {"cycles": "equivalent", "equivalence_history": "reference"}
    yield "paper", {}
    yield "softened", {"soil": "equivalent_linear"}
    yield "varying_0.1", {"spatial_variability": varying}
    yield (
        "varying_0.3",
        {"spatial_variability": varying | {"cov": 0.3, "distribution": "lognormal"}},
    )
    yield "bending", {"spatial_variability": varying, "rail_bending_share": 0.5}
    yield "equivalent_3", equivalent | {"equivalence_exponent": 3}
    yield "equivalent_5", equivalent | {"equivalence_exponent": 5}
    yield "long_run", {"long_run_cycles": 1_000_000}
    yield (
        "closest",
        {
            "load_per_rail": "whole",
            "cycles": "per_vehicle",
            "trains": {name: {"car_length_m": 22.7} for name in ("passenger", "heavy")},
        },
    )
    total = {"stress": "total", "spatial_variability": varying}
    yield "total_0.1", total
    yield "total_bending", total | {"rail_bending_share": 1.0}


def study_of(form: Data, realisations: int) -> Study:
    """The linespeed study's line with this one form and the scenarios that are compared."""
    path = Path(__file__).with_name("linespeed.toml")
    data = tomllib.loads(path.read_text(encoding="utf-8"))
    for key in ("reference", "calibration", "economics", "sources"):
        data.pop(key, None)
    data["track"]["soil"] = "linear"
    data["settlement"].pop("factor_digest")
    data["settlement"]["settlement_factor"] = 1.0
    data["run"]["realisations"] = realisations
    load = 17.0 * HEAVIER
    body = 32_900 + 4_000 * (load - 17.0)  # kg: what is added lies in the body
    data["trains"]["heavy"] = {
        "vehicle": "passenger",
        "cars": 11,
        "axle_load_t": load,
        "body_mass_kg": body,
        "body_inertia_kg_m2": 2_080_000 * body / 32_900,
    }
    data["trains"]["freight"] = {"vehicle": "freight", "cars": 40}
    timetables = {
        "base": [("passenger", SLOW, 72)],
        "fast": [("passenger", FAST, 72)],
        "heavy": [("heavy", SLOW, 72)],
        "freight": [("passenger", SLOW, 72), ("freight", 97.0, 2)],
    }
    data["scenarios"] = [
        {
            "name": name,
            "timetable": [
                {"train": train, "speed_kmh": speed, "per_day": count}
                for train, speed, count in rows
            ],
        }
        for name, rows in timetables.items()
    ]
    data["variants"] = [{"name": "form"} | copy.deepcopy(form)]
    return Study.from_mapping(data)


@dataclass(frozen=True)
class Line:
    """One form, calibrated, and its cases and initial profiles [R, K] m."""

    study: Study
    cases: dict[str, Case]
    profiles: np.ndarray

    def scene(self, scenario: str) -> Scene:
        """The scenario's scene."""
        return self.study.scene("form", scenario)

    def run(
        self,
        scenario: str,
        profiles: np.ndarray,
        sd_limit: float | None = None,
        days: tuple[float, ...] = (),
        support_sd: np.ndarray | None = None,
        ground_days: np.ndarray | None = None,
    ) -> Outcome:
        """Realisations from ``profiles``; their support is that of ``support_sd`` [R, K] if given."""
        case = self.cases[scenario]
        if sd_limit is not None:
            case = replace(case, sd_limit=sd_limit)
        base = profiles if support_sd is None else support_sd
        support = support_of(self.scene(scenario), range(len(profiles)), base)
        return CycleJump(case).run(
            profiles, np.array(days), ground_days=ground_days, support=support
        )

    def rates(self, scenario: str, scale: float = 1.0, same_support: bool = False) -> np.ndarray:
        """Growth of the SD [R] in the first year, mm."""
        profiles = self.profiles * scale
        base = self.profiles if same_support else None
        days = (0.0, DAYS_PER_YEAR)
        history = self.run(scenario, profiles, NO_LIMIT, days, base).history
        return np.asarray((history[:, 1] - history[:, 0]) / MM)


def line_of(form: Data, realisations: int) -> tuple[Line, float]:
    """A form calibrated to ``TARGET_DAYS``, and its factor."""
    study = study_of(form, realisations)
    factor = calibrate(study, "base", TARGET_DAYS).factor
    prepared, cases = step_a(study.scenes), {}
    for scenario in study.scenario_names:
        case = build_case(study.scene("form", scenario), prepared)
        cases[scenario] = replace(case, model=replace(case.model, settlement_factor=factor))
    profiles = study.initial_profiles().sample(range(realisations))
    return Line(study, cases, profiles), factor


def exponent(changed: np.ndarray, base: np.ndarray, ratio: float) -> str:
    """Exponent of the line's mean rate, and its standard error by the jackknife over tracks."""
    valid = np.isfinite(changed) & np.isfinite(base)
    a, b, n = changed[valid], base[valid], int(valid.sum())
    value = np.log(a.mean() / b.mean()) / np.log(ratio)
    left_out = np.log((a.sum() - a) / (b.sum() - b)) / np.log(ratio)
    error = np.sqrt((n - 1) * np.var(left_out))
    return f"{value:.2f} ± {error:.2f}"


def quantiles(values: np.ndarray, digits: int = 2) -> str:
    """Median and P5 to P95."""
    low, middle, high = np.nanquantile(values, [0.05, 0.5, 0.95])
    return f"{middle:.{digits}f} ({low:.{digits}f} to {high:.{digits}f})"


def regularities(line: Line, factor: float) -> dict[str, str]:
    """Every row of the table for one form."""
    start = line.profiles
    first = line.run("base", start)
    year = line.rates("base")
    grown = first.amplitudes - start
    return {
        "settlement factor": f"{factor:.3g}",
        "growth of SD in the first year, mm": quantiles(year),
        "spread of rates between sections, log-SD": spread(first),
        "rate, exponent of the axle load": exponent(line.rates("heavy"), year, HEAVIER),
        "rate, exponent of the speed": exponent(line.rates("fast"), year, FAST / SLOW),
        "rate, elasticity on the initial SD": exponent(line.rates("base", ROUGHER), year, ROUGHER),
        "the same, the support as it was": exponent(
            line.rates("base", ROUGHER, same_support=True), year, ROUGHER
        ),
        "T × MGT, two freight trains over none": tonnage_ratio(line),
        "uniform settlement, mm per MGT": quantiles(
            first.mean_settlement / MM / (first.days * line.study.mgt_per_day("base"))
        ),
        "differential over uniform settlement": quantiles(
            root_sum(grown) / first.mean_settlement, 3
        ),
        "increments before and after tamping, correlation": repetition(line, first),
    } | by_wave(line, first.amplitudes)


def root_sum(amplitudes: np.ndarray) -> np.ndarray:
    """SD [R] of waves of complex amplitudes [R, K]."""
    return np.asarray(np.sqrt(0.5 * np.sum(np.abs(amplitudes) ** 2, axis=1)))


def spread(outcome: Outcome) -> str:
    """Log-SD of rise over interval: of the days, as every section rises by the same SD."""
    logs = np.log(outcome.days[outcome.reached])
    return f"{np.std(logs, ddof=1):.2f} ± {np.std(logs, ddof=1) / np.sqrt(2 * len(logs)):.2f}"


def tonnage_ratio(line: Line) -> str:
    """(days × MGT a day) with two freight trains a day over that without, on the traffic study's line."""
    initial, limit = TRAFFIC_LINE
    profiles = line.profiles * (initial / (1.03 * MM))
    days = {name: line.run(name, profiles, limit).days for name in ("base", "freight")}
    heavier = line.study.mgt_per_day("freight") / line.study.mgt_per_day("base")
    return quantiles(days["freight"] / days["base"] * heavier)


def repetition(line: Line, first: Outcome) -> str:
    """Correlation of the increments of two intervals, between which tamping leaves a new profile.

    The new profile has nothing in common with the first but its spectrum and SD; the field of
    susceptibility stays, the ballast's count begins anew and that of the ground goes on.
    """
    start, n = line.profiles, len(line.profiles)
    tamped = line.study.initial_profiles().sample(range(n, 2 * n))
    days = np.where(first.reached, first.days, line.cases["base"].horizon)
    second = line.run("base", tamped, ground_days=days)
    before, after = first.amplitudes - start, second.amplitudes - tamped
    product = 0.5 * np.sum((before * np.conj(after)).real, axis=1)
    correlation = product / (root_sum(before) * root_sum(after))
    both = first.reached & second.reached
    return quantiles(correlation[both])


def by_wave(line: Line, end: np.ndarray) -> dict[str, str]:
    """SD of an interval's increment over that of the first profile, by wavelength."""
    rows = increment_by_wave(line.profiles, end, line.study.wavenumbers, EDGES)
    return {
        f"growth of waves of {low:g} to {high:g} m over their first SD": f"{growth:.2f}"
        for low, high, growth, _ in rows
    }


def main() -> None:
    """Print the Markdown table, forms across."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--realisations", type=int, default=64)
    parser.add_argument("--form", nargs="+", choices=[name for name, _ in forms()])
    options = parser.parse_args()
    columns = {}
    for name, form in forms():
        if options.form is None or name in options.form:
            columns[name] = regularities(*line_of(form, options.realisations))
    print("| regularity | real track | " + " | ".join(columns) + " |")
    print("|--|--|" + "--|" * len(columns))
    for row in next(iter(columns.values())):
        cells = [row, MEASURED.get(row, "not found")]
        cells += [column[row] for column in columns.values()]
        print("| " + " | ".join(cells) + " |")


if __name__ == "__main__":
    main()
