"""A made line whose truth is known: its dated SDs, for the example and for ``mcsettle sections``.

Sections settle as ``form`` says: "model", by Step B of the study with a lognormal factor of their own;
"straight", at a lognormal rate of their own, SD linear in time; "power", SD growing with √time. Some were
tamped between the first two runs. Run: ``python studies/made_line.py`` (writes ``studies/line_sds.csv``).
"""

import argparse
import shutil
import tempfile
from dataclasses import dataclass, replace
from datetime import date, timedelta
from pathlib import Path

import numpy as np

from mcsettle.analysis.sections import line_hold_out
from mcsettle.step_a.transfers import step_a
from mcsettle.step_b.build_case import build_case
from mcsettle.step_b.cycle_jump import CycleJump
from mcsettle.study.study import Study, load_study

FIRST = date(2021, 3, 15)
RUNS = (0, 200, 400, 600)  # days after the first
TAMPED_ON = 90  # day, of the sections that were tamped
MEAN_SD, SPREAD_SD = 0.9e-3, 0.25  # m, and log-SD, of the SD after tamping
RATE = 0.15e-3  # m/year, of the straight and the power form


@dataclass(frozen=True)
class MadeLine:
    """Sections of 200 m: measured ``sd`` [S, D] m, the ``truth`` [S, D] m behind it, who was tamped.

    ``days_to_limit`` [S] from the last run, by the truth; inf beyond the horizon.
    """

    sd: np.ndarray
    truth: np.ndarray
    tamped: np.ndarray
    days_to_limit: np.ndarray
    error: float

    def csv(self) -> str:
        """As a table of dated SDs."""
        lines = ["chainage_from_m,chainage_to_m,date,sd_mm"]
        for section, row in enumerate(self.sd):
            for run, sd in zip(RUNS, row, strict=True):
                day = FIRST + timedelta(days=run)
                lines.append(f"{section * 200},{section * 200 + 200},{day},{sd * 1e3:.3f}")
        return "\n".join(lines) + "\n"


def made_line(
    study: Study,
    n: int,
    seed: int,
    form: str = "model",
    log_sd: float = 0.4,
    error: float = 0.03e-3,
) -> MadeLine:
    """A line of ``n`` sections; ``log_sd`` of factors or rates between them, ``error`` [m] of an SD."""
    rng = np.random.default_rng([seed, n])
    sd_start = MEAN_SD * np.exp(SPREAD_SD * rng.normal(size=n))
    factors = np.exp(log_sd * rng.normal(size=n) - 0.5 * log_sd**2)
    tamped = rng.random(n) < 0.3
    span = np.where(tamped, 1, 0)  # the run at which the present span begins
    truth = np.empty((n, len(RUNS)))
    limit, horizon = study.limit.sd_limit, study.limit.horizon_days
    to_limit = np.full(n, np.inf)
    for start in (0, 1):
        rows = np.flatnonzero(span == start)
        if not len(rows):
            continue
        age = RUNS[1] - TAMPED_ON if start else 0.0
        days = np.array(RUNS[start:], dtype=float) - RUNS[start]
        grid = np.concatenate([days, days[-1] + np.linspace(10.0, horizon, 400)])
        path = _paths(study, rows, sd_start[rows], factors[rows], grid, age, form)
        truth[rows, start:] = path[:, : len(days)]
        for row, course in zip(rows, path, strict=True):
            above = np.flatnonzero(course >= limit)
            if len(above):
                to_limit[row] = max(grid[above[0]] - days[-1], 0.0)
        if start:  # before the tamping they were as rough as makes one tamp
            truth[rows, 0] = rng.uniform(1.3e-3, 1.8e-3, len(rows))
    measured = truth + error * rng.normal(size=truth.shape)
    return MadeLine(np.maximum(measured, 1e-4), truth, tamped, to_limit, error)


def _paths(
    study: Study,
    rows: np.ndarray,
    sd: np.ndarray,
    factors: np.ndarray,
    days: np.ndarray,
    age: float,
    form: str,
) -> np.ndarray:
    """SDs [P, H] m on ``days`` after the start of a span."""
    if form == "straight":
        return sd[:, None] + (RATE * factors)[:, None] * days / 365.0
    if form == "power":
        return sd[:, None] + (RATE * factors)[:, None] * np.sqrt(days / 365.0)
    scene = study.scenes[0]
    case = build_case(scene, step_a([scene]))
    cycles = age * case.timetable.passages_per_day * case.model.cycles_per_passage
    before = case.model.ballast_cycles_before + cycles
    model = replace(case.model, ballast_cycles_before=before)
    engine = CycleJump(replace(case, model=model, sd_limit=20e-3, horizon=2.0 * days[-1]))
    profiles = np.concatenate(
        [scene.profiles.sample(range(10_000 + int(r), 10_001 + int(r))) for r in rows]
    )
    profiles *= (sd / engine.measure.sd(profiles))[:, None]
    return engine.run(profiles, days, factors, np.full(len(rows), age)).history


def score(n_lines: int, n: int) -> None:
    """Coverage and mean absolute errors of held-out runs, lines made by each form."""
    here = Path(__file__).resolve().parent
    study = load_study(here / "line.toml")
    print(
        "| form | inside P5 to P95 | model mm | straight line mm | mean rate mm |\n|--|--|--|--|--|"
    )
    for form in ("model", "power", "straight"):
        shares, errors = [], []
        for seed in range(n_lines):
            line = made_line(study, n, 100 + seed, form)
            with tempfile.TemporaryDirectory() as folder:
                shutil.copy(here / "line.toml", folder)
                (Path(folder) / "line_sds.csv").write_text(line.csv(), encoding="utf-8")
                _, held = line_hold_out(load_study(Path(folder) / "line.toml"))
            shares.append(held.coverage)
            errors.append([1e3 * v for v in held.mean_absolute_error().values()])
        spread = np.std(shares) / np.sqrt(n_lines)
        cells = " | ".join(f"{v:.3f}" for v in np.mean(errors, axis=0))
        print(f"| {form} | {np.mean(shares):.1%} ± {spread:.1%} | {cells} |", flush=True)


def main() -> None:
    """Write the example's table, or score the forecasts."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--sections", type=int, default=100)
    parser.add_argument("--seed", type=int, default=7)
    parser.add_argument(
        "--score", type=int, default=0, metavar="N", help="hold out the last run of N lines a form"
    )
    asked = parser.parse_args()
    if asked.score:
        score(asked.score, asked.sections)
        return
    here = Path(__file__).resolve().parent
    line = made_line(load_study(here / "line.toml"), asked.sections, asked.seed)
    (here / "line_sds.csv").write_text(line.csv(), encoding="utf-8")


if __name__ == "__main__":
    main()
