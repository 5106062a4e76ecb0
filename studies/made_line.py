"""A made line whose truth is known: its dated SDs, for the example and for ``mcsettle sections``.

Sections settle as ``form`` says: "model", by Step B of the study with a lognormal factor of their own;
"straight", at a lognormal rate of their own, SD linear in time; "power", SD growing with √time;
"wandering", at a rate that changes from year to year. Some were tamped between the first two runs.

``python studies/made_line.py`` writes ``studies/line_sds.csv``; ``--sections 10000 --grounds 10 --out
DIR`` a line of 2000 km on ten grounds, with its study; ``--score`` and ``--dates`` score the forecasts.
"""

import argparse
import itertools
import shutil
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass, replace
from datetime import date, timedelta
from pathlib import Path

import numpy as np

from mcsettle.analysis.line_forecast import LineForecast
from mcsettle.analysis.sections import line_hold_out, sections_report
from mcsettle.railway.scene import Scene
from mcsettle.step_a.transfers import step_a
from mcsettle.step_b.build_case import build_case
from mcsettle.step_b.cycle_jump import CycleJump
from mcsettle.study.study import Study, load_study, resolved_toml

FIRST = date(2021, 3, 15)
RUNS = (0, 200, 400, 600)  # days after the first
TAMPED_ON = 90  # day, of the sections that were tamped
SOFTEST, STIFFEST = 60e6, 180e6  # Pa, Young's modulus of the subgrade of a line on several grounds
MEAN_SD, SPREAD_SD = 0.9e-3, 0.25  # m, and log-SD, of the SD after tamping
RATE = 0.15e-3  # m/year, of the forms that are not Step B's
WANDER = 0.5  # log-SD of a year's rate about the section's own
FORMS = ("model", "power", "straight", "wandering")
BINS = 10


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
    """A line of ``n`` sections; ``log_sd`` of factors or rates between them, ``error`` [m] of an SD.

    Each variant of ``study`` is the ground of an equal part of the line.
    """
    rng = np.random.default_rng([seed, n])
    sd_start = MEAN_SD * np.exp(SPREAD_SD * rng.normal(size=n))
    factors = np.exp(log_sd * rng.normal(size=n) - 0.5 * log_sd**2)
    tamped = rng.random(n) < 0.3
    span = np.where(tamped, 1, 0)  # the run at which the present span begins
    truth = np.empty((n, len(RUNS)))
    limit, horizon = study.limit.sd_limit, study.limit.horizon_days
    to_limit = np.full(n, np.inf)
    scenes = study.scenes
    ground = np.arange(n) * len(scenes) // n
    for start, scene in itertools.product((0, 1), range(len(scenes))):
        rows = np.flatnonzero((span == start) & (ground == scene))
        if not len(rows):
            continue
        age = RUNS[1] - TAMPED_ON if start else 0.0
        days = np.array(RUNS[start:], dtype=float) - RUNS[start]
        grid = np.concatenate([days, days[-1] + np.linspace(10.0, horizon, 400)])
        path = _paths(scenes[scene], rows, sd_start[rows], factors[rows], grid, age, form, seed)
        truth[rows, start:] = path[:, : len(days)]
        for row, course in zip(rows, path, strict=True):
            above = np.flatnonzero(course >= limit)
            if len(above):
                first = max(int(above[0]), 1)
                share = (limit - course[first - 1]) / (course[first] - course[first - 1])
                day = grid[first - 1] + np.clip(share, 0.0, 1.0) * np.diff(grid)[first - 1]
                to_limit[row] = max(day - days[-1], 0.0)
        if start:  # before the tamping they were as rough as makes one tamp
            truth[rows, 0] = rng.uniform(1.3e-3, 1.8e-3, len(rows))
    measured = truth + error * rng.normal(size=truth.shape)
    return MadeLine(np.maximum(measured, 1e-4), truth, tamped, to_limit, error)


def _paths(
    scene: Scene,
    rows: np.ndarray,
    sd: np.ndarray,
    factors: np.ndarray,
    days: np.ndarray,
    age: float,
    form: str,
    seed: int,
) -> np.ndarray:
    """SDs [P, H] m on ``days`` after the start of a span."""
    if form == "straight":
        return sd[:, None] + (RATE * factors)[:, None] * days / 365.0
    if form == "power":
        return sd[:, None] + (RATE * factors)[:, None] * np.sqrt(days / 365.0)
    if form == "wandering":
        rng = np.random.default_rng([seed, len(rows)])
        years = np.arange(2 + int(days[-1] / 365.0))
        shares = np.exp(WANDER * rng.normal(size=(len(rows), len(years) - 1)) - 0.5 * WANDER**2)
        grown = np.cumsum(np.pad(shares, ((0, 0), (1, 0))), axis=1)
        grown = np.stack([np.interp(days / 365.0, years, row) for row in grown])
        return sd[:, None] + (RATE * factors)[:, None] * grown
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


def on_grounds(study: Study, n_grounds: int, n: int) -> Study:
    """``study`` with so many grounds, each under an equal part of a line of ``n`` sections."""
    data = study.model_dump(mode="json", by_alias=True, exclude_none=True)
    moduli = np.geomspace(SOFTEST, STIFFEST, n_grounds)
    edges = [200.0 * (n * ground // n_grounds) for ground in range(n_grounds + 1)]
    data["variants"] = [
        {"name": f"ground_{g}", "layers": {"subgrade": {"youngs_modulus_pa": float(modulus)}}}
        for g, modulus in enumerate(moduli)
    ]
    data["line"]["stretches"] = [
        {"chainage_from_m": low, "chainage_to_m": high, "variant": f"ground_{g}"}
        for g, (low, high) in enumerate(itertools.pairwise(edges))
    ]
    return Study.from_mapping(data)


def score(n_lines: int, n: int, forms: tuple[str, ...]) -> None:
    """Coverage and mean absolute errors of held-out runs, lines made by each form."""
    print("| form | inside P5 to P95 | forecast mm | straight line mm | mean rate mm |")
    print("|--|--|--|--|--|")
    for form in forms:
        shares, errors = [], []
        for _, study in _lines(n_lines, n, form):
            _, held = line_hold_out(study)
            shares.append(held.coverage)
            errors.append([1e3 * v for v in held.mean_absolute_error().values()])
        spread = np.std(shares, ddof=1) / np.sqrt(n_lines)
        cells = " | ".join(f"{v:.3f}" for v in np.mean(errors, axis=0))
        print(f"| {form} | {np.mean(shares):.1%} ± {spread:.1%} | {cells} |", flush=True)


def score_dates(n_lines: int, n: int, forms: tuple[str, ...]) -> None:
    """Coverage of the dates of tamping, and their ranks in tenths, lines made by each form."""
    print(
        "| form | inside P5 to P95 | of it with P95 beyond the horizon | share in each tenth, % |"
    )
    print("|--|--|--|--|")
    for form in forms:
        shares, late, ranks = [], [], []
        for number, (line, study) in enumerate(_lines(n_lines, n, form)):
            report = sections_report(study)
            rank, open_ended = date_ranks(report.forecast, line, study, number)
            inside = (rank > 0.05) & (rank < 0.95)
            shares.append(np.mean(inside))
            late.append(np.mean(inside[open_ended]) if open_ended.any() else np.nan)
            ranks.append(rank)
        spread = np.std(shares, ddof=1) / np.sqrt(n_lines)
        tenths = np.histogram(np.concatenate(ranks), BINS, (0.0, 1.0))[0]
        cells = " ".join(f"{100 * v / tenths.sum():.0f}" for v in tenths)
        print(
            f"| {form} | {np.mean(shares):.1%} ± {spread:.1%} | {np.nanmean(late):.1%} | {cells} |",
            flush=True,
        )


def date_ranks(
    forecast: LineForecast, line: MadeLine, study: Study, seed: int
) -> tuple[np.ndarray, np.ndarray]:
    """Rank [P] of each true date in its forecast, uniform where the bands are right.

    Of the sections below their limit on the last run. What is only known to lie after the horizon (or
    before the last run) has a rank drawn evenly from those left: whether such a section is inside P5 to
    P95 is a matter of how much probability lies beyond, not of the date. Also whether [P] P95 is open.
    """
    limit = study.limit.sd_limit
    below = np.flatnonzero(line.sd[forecast.rows, -1] < limit)
    true = line.days_to_limit[forecast.rows]
    seen = np.isfinite(true) & (true <= forecast.horizon)
    upper = np.where(seen, forecast.probability_within(np.where(seen, true, 0.0)), 1.0)
    beyond = forecast.probability_within(forecast.horizon)
    lower = np.where(seen, np.where(true > 0.0, upper, 0.0), beyond)
    drawn = np.random.default_rng(seed).random(len(true))
    open_ended = ~np.isfinite(forecast.quantiles((0.95,))[:, 0])
    return (lower + drawn * (upper - lower))[below], open_ended[below]


def _lines(n_lines: int, n: int, form: str) -> Iterator[tuple[MadeLine, Study]]:
    """Made lines, and a study of each."""
    here = Path(__file__).resolve().parent
    study = load_study(here / "line.toml")
    for seed in range(n_lines):
        line = made_line(study, n, 100 + seed, form)
        with tempfile.TemporaryDirectory() as folder:
            shutil.copy(here / "line.toml", folder)
            (Path(folder) / "line_sds.csv").write_text(line.csv(), encoding="utf-8")
            yield line, load_study(Path(folder) / "line.toml")


def main() -> None:
    """Write the example's table, or score the forecasts."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--sections", type=int, default=100)
    parser.add_argument("--seed", type=int, default=7)
    parser.add_argument("--grounds", type=int, default=1)
    parser.add_argument("--out", type=Path, help="folder for study and table (default: studies/)")
    parser.add_argument(
        "--score",
        type=int,
        default=0,
        metavar="N",
        help="hold out the last run of N lines per form",
    )
    parser.add_argument(
        "--dates", type=int, default=0, metavar="N", help="rank the true dates of N lines per form"
    )
    parser.add_argument(
        "--form", choices=FORMS, default="model", help="of the line that is written"
    )
    parser.add_argument("--forms", nargs="+", choices=FORMS, default=FORMS)
    asked = parser.parse_args()
    if asked.score:
        score(asked.score, asked.sections, tuple(asked.forms))
    if asked.dates:
        score_dates(asked.dates, asked.sections, tuple(asked.forms))
    if asked.score or asked.dates:
        return
    here = Path(__file__).resolve().parent
    study, folder = load_study(here / "line.toml"), asked.out or here
    if asked.out:
        folder.mkdir(parents=True, exist_ok=True)
        study = on_grounds(study, asked.grounds, asked.sections)
        (folder / "line.toml").write_text(resolved_toml(study), encoding="utf-8")
    line = made_line(study, asked.sections, asked.seed, asked.form)
    (folder / "line_sds.csv").write_text(line.csv(), encoding="utf-8")


if __name__ == "__main__":
    main()
